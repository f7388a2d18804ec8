"""The contract of every attack, tested for whatever is registered."""

import numpy as np
import open3d as o3d
import pytest

from fixtures.attacked import QUICK, SPECS
from o3dmark.attacks import ATTACKS, Attack, attack_all
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface, TriangleMesh, mesh_arrays, triangle_mesh
from o3dmark.metrics.distance import surface_distance
from o3dmark.registry import describe, spec_of

RANDOM = [
    *("similarity", "stretch", "noise", "reorder", "twist", "bend", "crop", "holes", "paste"),
    *("poisson", "rescan", "print-scan"),
    *("soup", "crack", "twice", "inside", "speck", "dust", "scene", "plate"),
    *("strain", "flatten", "bump", "half", "warp", "remark"),
]
NOTHING = [
    "identity",
    "reorder:vertices=false,triangles=false,corners=false",
    "similarity:translation=0,rotation=0,smallest=1,largest=1",
    "stretch:amount=0",
    "axes:order=xyz",
    "units:factor=1",
    "noise:amplitude=0",
    "noise:amplitude=0,kind=normal",
    "smooth:iterations=0",
    "smooth:strength=0",
    "taubin:iterations=0",
    "hc:iterations=0",
    "twist:angle=0",
    "bend:angle=0",
    "simplify:ratio=0",
    "subdivide:iterations=0",
    "remesh:iterations=0",
    "crop:share=0",
    "crop:share=0,largest=true",
    "holes:share=0",
    "crack:gap=0",
    "crack:pieces=1",
    "inside:size=0",
    "dust:count=0",
    "scene:objects=0",
    "plate:copies=1",
    "strain:amount=0",
    "flatten:share=0",
    "bump:height=0",
    "half:iterations=0",
    "half:edit=simplify,ratio=0",
    "pedestal:depth=0",
    "sharpen:strength=0",
    "bilateral:iterations=0",
    "warp:amplitude=0",
    "meshopt-simplify:ratio=0",
]
SAME_ELEMENTS = [  # geometry only: vertex i is still vertex i
    *("identity", "similarity", "stretch", "mirror", "axes", "units", "noise", "quantise", "float16"),
    *("smooth", "taubin", "hc", "twist", "bend"),
    *("strain", "flatten", "bump", "half", "sharpen", "bilateral", "warp", QUICK["remark"]),
]


def torus(**attributes: np.ndarray) -> TriangleMesh:
    """600 vertices, 1 200 triangles, closed; turned so that nothing is aligned with the axes."""
    mesh = TriangleMesh.create_torus(1.0, 0.4, 30, 20)
    mesh.rotate(o3d.geometry.get_rotation_matrix_from_xyz((0.3, 0.5, 0.7)), (0.0, 0.0, 0.0))
    for name, value in attributes.items():
        vector = o3d.utility.Vector2dVector if value.shape[1] == 2 else o3d.utility.Vector3dVector
        setattr(mesh, name, vector(value))
    return mesh


def coloured() -> TriangleMesh:
    """The torus, each vertex coloured by its place in the bounding box."""
    vertices = np.asarray(torus().vertices)
    return torus(vertex_colors=(vertices - vertices.min(axis=0)) / np.ptp(vertices, axis=0))


def textured() -> TriangleMesh:
    """The torus; the texture coordinates of a corner are x and y of its vertex."""
    vertices, triangles = mesh_arrays(torus())
    return torus(triangle_uvs=vertices[triangles.ravel()][:, :2])


def same(a: TriangleMesh, b: TriangleMesh) -> bool:
    """Equal positions, triangles and colours, bit for bit."""
    parts = [(np.asarray(m.vertices), np.asarray(m.triangles), np.asarray(m.vertex_colors)) for m in (a, b)]
    return all(np.array_equal(x, y) for x, y in zip(*parts, strict=True))


@pytest.fixture(scope="module")
def results() -> dict[tuple[str, int], TriangleMesh]:
    """Attacked tori by spec and seed, made when first asked for."""

    class Results(dict):
        def __missing__(self, key: tuple[str, int]) -> TriangleMesh:
            self[key] = ATTACKS.make(key[0])(coloured(), key[1])
            return self[key]

    return Results()


@pytest.mark.parametrize("spec", SPECS)
def test_the_result_is_a_sound_mesh(spec: str, results: dict) -> None:
    mesh = results[spec, 1]
    vertices, triangles = mesh_arrays(mesh)
    assert isinstance(mesh, TriangleMesh)
    assert len(triangles) >= 4
    assert np.isfinite(vertices).all()
    assert triangles.min() >= 0
    assert triangles.max() < len(vertices)
    assert Surface.of(mesh).area > 0


@pytest.mark.parametrize("spec", SPECS)
def test_the_same_seed_gives_the_same_mesh(spec: str, results: dict) -> None:
    again = ATTACKS.make(spec)(coloured(), np.random.default_rng(1))
    assert same(results[spec, 1], again)


@pytest.mark.parametrize("name", list(ATTACKS))
def test_another_seed_gives_another_mesh_where_there_is_chance(name: str, results: dict) -> None:
    spec = QUICK.get(name, name)
    assert same(results[spec, 1], results[spec, 2]) == (name not in RANDOM)


def test_attacks_in_a_row_do_not_repeat_each_others_chance() -> None:
    """Twice the same noise would be one of twice the size; two draws add up as squares do."""
    cover = mesh_arrays(torus())[0]
    once, twice = (mesh_arrays(attack_all(torus(), ["noise"] * n, 1))[0] - cover for n in (1, 2))
    assert np.linalg.norm(twice) / np.linalg.norm(once) == pytest.approx(np.sqrt(2.0), rel=0.1)


@pytest.mark.parametrize("spec", SPECS)
def test_the_input_is_not_touched(spec: str) -> None:
    mesh = coloured()
    attacked = ATTACKS.make(spec)(mesh, 1)
    np.asarray(attacked.vertices)[:] = 0.0
    np.asarray(attacked.triangles)[:] = 0
    assert same(mesh, coloured())


@pytest.mark.parametrize("spec", NOTHING)
def test_no_strength_is_the_identity(spec: str) -> None:
    mesh = coloured()
    attacked = ATTACKS.make(spec)(mesh, 1)
    assert attacked is not mesh
    assert same(attacked, mesh)


@pytest.mark.parametrize(
    ("spec", "strengths"),
    [
        ("noise:amplitude={}", (1e-4, 5e-4, 1e-3, 3e-3)),
        ("noise:kind=gaussian,amplitude={}", (1e-4, 5e-4, 1e-3, 3e-3)),
        ("noise:kind=normal,amplitude={}", (1e-4, 5e-4, 1e-3, 3e-3)),
        ("quantise:bits={}", (12, 11, 9, 7)),
        ("smooth:iterations={}", (1, 5, 10, 30)),
        ("smooth:strength={}", (0.05, 0.1, 0.3)),
        ("stretch:amount={}", (0.01, 0.1, 0.3)),
        ("strain:amount={}", (0.005, 0.02, 0.1)),
        ("strain:kind=shear,amount={}", (0.005, 0.02, 0.1)),
        ("flatten:share={}", (0.005, 0.02, 0.2)),
        ("bump:height={}", (0.003, 0.01, 0.05)),
        ("half:iterations={}", (1, 10, 30)),
        ("half:edit=simplify,ratio={}", (0.3, 0.6, 0.9)),
        ("sharpen:strength={}", (0.1, 0.5, 2.0)),
        ("bilateral:iterations={}", (1, 5, 20)),
        ("warp:amplitude={}", (1e-4, 5e-4, 2e-3)),
        ("twist:angle={}", (1, 5, 15, 40)),
        ("bend:angle={}", (1, 5, 15, 40)),
        ("simplify:ratio={}", (0.1, 0.5, 0.9, 0.975)),
        ("draco:bits={}", (14, 11, 8)),
    ],
)
def test_a_stronger_attack_changes_the_shape_more(spec: str, strengths: tuple[float, ...], spot: TriangleMesh) -> None:
    if spec.startswith("draco"):
        pytest.importorskip("DracoPy")
    cost = [surface_distance(spot, ATTACKS.make(spec.format(s))(spot, 1), samples=4_000).mrms for s in strengths]
    assert cost[0] > 0
    assert cost == sorted(cost)
    assert len(set(cost)) == len(cost)


@pytest.mark.parametrize(("size", "place"), [(1e-6, 0.0), (1e7, 0.0), (1.0, 1e5)])
@pytest.mark.parametrize(
    "spec",  # the second mark of a torus: rounding says which of its vertices are salient
    [spec for spec in SPECS if not spec.startswith(("units", "reformat", "draco", "remark"))],
)
def test_neither_the_unit_of_length_nor_the_origin_matters(spec: str, size: float, place: float, results: dict) -> None:
    mesh = coloured().scale(size, np.zeros(3)).translate(np.full(3, place))
    vertices, triangles = mesh_arrays(ATTACKS.make(spec)(mesh, 1))
    vertices = (vertices - place) / size
    expected, corners = mesh_arrays(results[spec, 1])
    if np.array_equal(triangles, corners):
        assert np.abs(vertices - expected).max() < 1e-6
    else:  # edges that are equal but for rounding may go in another order
        assert len(triangles) == pytest.approx(len(corners), rel=0.01)
        assert surface_distance(results[spec, 1], triangle_mesh(vertices, triangles)).mrms < 5e-3


@pytest.mark.parametrize("spec", SPECS)
def test_an_attack_is_its_text(spec: str) -> None:
    attack = ATTACKS.make(spec)
    assert isinstance(attack, Attack)
    assert ATTACKS.make(spec_of(attack)) == attack


@pytest.mark.parametrize("name", list(ATTACKS))
def test_every_attack_and_option_explains_itself(name: str) -> None:
    doc = ATTACKS[name].__doc__ or ""
    assert len(doc) > 40
    assert "Source:" in doc
    for option, _, _, doc in describe(ATTACKS[name]):
        assert doc, f"{name}: {option} says nothing"


@pytest.mark.parametrize("spec", [spec for spec in SPECS if spec != "reformat:format=stl"])
def test_colours_follow_the_surface(spec: str, results: dict) -> None:
    mesh, before = results[spec, 1], coloured()
    colours = np.asarray(mesh.vertex_colors)
    assert colours.shape == np.asarray(mesh.vertices).shape
    assert colours.min() >= 0.0
    assert colours.max() <= 1.0
    if spec in SAME_ELEMENTS:
        assert np.array_equal(colours, np.asarray(before.vertex_colors))


@pytest.mark.parametrize("spec", SAME_ELEMENTS)
def test_geometry_attacks_keep_texture_coordinates(spec: str) -> None:
    before, after = textured(), ATTACKS.make(spec)(textured(), 1)
    corners = np.asarray(after.triangles)
    uvs = np.asarray(after.triangle_uvs).reshape(-1, 3, 2)
    assert np.array_equal(uvs, np.asarray(before.vertices)[corners][..., :2])


@pytest.mark.parametrize("spec", ["reorder", "weld", "unweld", "crop", "crop:largest=true", "holes"])
def test_picked_elements_keep_their_texture_coordinates(spec: str) -> None:
    after = ATTACKS.make(spec)(textured(), 1)
    vertices, triangles = mesh_arrays(after)
    assert np.array_equal(np.asarray(after.triangle_uvs), vertices[triangles.ravel()][:, :2])


@pytest.mark.parametrize("spec", ["noise", "similarity", "smooth", "quantise", "reorder", "crop", "subdivide"])
def test_tensor_meshes_are_taken(spec: str) -> None:
    legacy = coloured()
    tensor = o3d.t.geometry.TriangleMesh.from_legacy(legacy)
    tensor.vertex.positions = o3d.core.Tensor(np.asarray(legacy.vertices))
    after = ATTACKS.make(spec)(tensor, 1)
    expected = ATTACKS.make(spec)(legacy, 1)
    for got, wanted in zip(mesh_arrays(after), mesh_arrays(expected), strict=True):
        assert np.array_equal(got, wanted)


@pytest.mark.parametrize("spec", ["smooth", "taubin", "hc", "quantise", "subdivide", "subdivide:scheme=sqrt3", "noise"])
def test_seams_do_not_open(spec: str) -> None:
    soup = ATTACKS.make("unweld")(torus())
    positions = mesh_arrays(ATTACKS.make(spec)(soup, 1))[0]
    smooth = mesh_arrays(ATTACKS.make(spec)(torus(), 1))[0]
    assert len(geometry.weld(positions)[0]) == len(smooth) if "sqrt3" not in spec else len(smooth) <= len(positions)
    if spec != "noise":
        distance = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(positions)).compute_point_cloud_distance(
            o3d.geometry.PointCloud(o3d.utility.Vector3dVector(smooth))
        )
        assert np.max(distance) < 1e-12


def test_attacks_compose_from_left_to_right() -> None:
    mesh, rng = torus(), np.random.default_rng(5)
    specs = ["similarity", "simplify:ratio=0.5", "noise:amplitude=0.001"]
    by_hand = mesh
    for spec in specs:
        by_hand = ATTACKS.make(spec)(by_hand, rng)
    assert same(attack_all(mesh, specs, 5), by_hand)
    assert not same(attack_all(mesh, specs[::-1], 5), by_hand)
