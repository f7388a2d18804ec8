"""Attacks that change the triangles: subdivision, simplification, remeshing, cropping, holes, pasting."""

from collections.abc import Callable

import numpy as np
import pytest

from o3dmark.attacks import ATTACKS, _meshlab
from o3dmark.errors import BackendError, MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface, TriangleMesh, mesh_arrays, triangle_mesh
from o3dmark.metrics.distance import surface_distance

SCHEMES = ["midpoint", "loop", "butterfly", "sqrt3"]


def rows(vertices: np.ndarray) -> set[tuple[float, ...]]:
    """Positions as a set, to nine decimals."""
    return set(map(tuple, np.round(vertices, 9) + 0.0))


def flat(x: np.ndarray, _: np.ndarray) -> np.ndarray:
    return 0.0 * x


def grid(n: int = 12, height: Callable[[np.ndarray, np.ndarray], np.ndarray] = flat) -> TriangleMesh:
    """(n + 1)^2 vertices over the square 0 .. n, regular: every inner vertex has six neighbours."""
    x, y = (side.ravel().astype(np.float64) for side in np.meshgrid(np.arange(n + 1), np.arange(n + 1)))
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    lower = np.stack([corner, corner + 1, corner + n + 2], axis=1)
    upper = np.stack([corner, corner + n + 2, corner + n + 1], axis=1)
    return triangle_mesh(np.stack([x, y, height(x, y)], axis=1), np.concatenate([lower, upper]))


def torus() -> TriangleMesh:
    return TriangleMesh.create_torus(1.0, 0.4, 30, 20)


def is_closed(mesh: TriangleMesh) -> bool:
    """Every directed edge once, and its opposite too."""
    triangles, n = mesh_arrays(mesh)[1], len(mesh.vertices)
    start, stop = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    forth, back = np.sort(start * n + stop), np.sort(stop * n + start)
    return len(np.unique(forth)) == len(forth) and np.array_equal(forth, back)


# subdivision


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("iterations", [1, 2])
def test_subdivision_counts_and_stays_closed(spot: TriangleMesh, scheme: str, iterations: int) -> None:
    before, after = spot, ATTACKS.make(f"subdivide:scheme={scheme},iterations={iterations}")(spot)
    v, f = len(before.vertices), len(before.triangles)
    for _ in range(iterations):
        v, f = (v + f, 3 * f) if scheme == "sqrt3" else (v + 3 * f // 2, 4 * f)
    assert (len(after.vertices), len(after.triangles)) == (v, f)
    assert is_closed(after)
    assert geometry.volume(*mesh_arrays(after)) == pytest.approx(geometry.volume(*mesh_arrays(spot)), rel=0.02)


@pytest.mark.parametrize("iterations", [1, 2])
def test_subdivision_agrees_with_open3d(iterations: int) -> None:
    midpoint = ATTACKS.make(f"subdivide:scheme=midpoint,iterations={iterations}")
    loop = ATTACKS.make(f"subdivide:scheme=loop,iterations={iterations}")
    for mesh in (torus(), TriangleMesh.create_icosahedron(), TriangleMesh.create_box()):
        assert rows(mesh_arrays(midpoint(mesh))[0]) == rows(np.asarray(mesh.subdivide_midpoint(iterations).vertices))
    # Open3D has Warren's weights, which are Loop's at six neighbours only
    assert rows(mesh_arrays(loop(torus()))[0]) == rows(np.asarray(torus().subdivide_loop(iterations).vertices))


def test_loop_and_butterfly_agree_with_meshlab() -> None:
    once = {"iterations": 1, "threshold": _meshlab.length(0.0)}
    for mesh in (TriangleMesh.create_icosahedron(), torus(), grid(4, lambda x, y: x * y - x**2)):
        ours = ATTACKS.make("subdivide:scheme=loop")(mesh)
        theirs = _meshlab.apply(*mesh_arrays(mesh), ("meshing_surface_subdivision_loop", once))
        assert rows(mesh_arrays(ours)[0]) == rows(theirs[0])
    ours = ATTACKS.make("subdivide:scheme=butterfly")(torus())
    theirs = _meshlab.apply(*mesh_arrays(torus()), ("meshing_surface_subdivision_butterfly", once))
    assert rows(mesh_arrays(ours)[0]) == rows(theirs[0])


def test_midpoint_keeps_the_shape() -> None:
    after = ATTACKS.make("subdivide:scheme=midpoint")(torus())
    assert np.array_equal(mesh_arrays(after)[0][:600], mesh_arrays(torus())[0])
    assert Surface.of(after).area == pytest.approx(Surface.of(torus()).area)
    assert geometry.volume(*mesh_arrays(after)) == pytest.approx(geometry.volume(*mesh_arrays(torus())))


@pytest.mark.parametrize("scheme", SCHEMES)
def test_subdivision_reproduces_planes(scheme: str) -> None:
    plane = grid(6, lambda x, y: 2.0 * x - 3.0 * y + 1.0)
    x, y, z = mesh_arrays(ATTACKS.make(f"subdivide:scheme={scheme},iterations=2")(plane))[0].T
    assert z == pytest.approx(2.0 * x - 3.0 * y + 1.0)


def test_butterfly_reproduces_cubics_and_keeps_old_vertices() -> None:
    def cubic(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x**3 - 2.0 * x * y * y + 5.0 * x * y - y**2

    after = mesh_arrays(ATTACKS.make("subdivide:scheme=butterfly")(grid(12, cubic)))[0]
    assert np.array_equal(after[: 13 * 13], mesh_arrays(grid(12, cubic))[0])
    x, y, z = after[13 * 13 :].T
    inner = (np.minimum(x, y) > 2) & (np.maximum(x, y) < 10)
    assert inner.sum() > 100
    assert z[inner] == pytest.approx(cubic(x, y)[inner])


def test_loop_and_sqrt3_by_hand() -> None:
    bump = grid(4)
    np.asarray(bump.vertices)[12, 2] = 1.0  # the middle one of 25
    heights = {}
    for scheme in ("loop", "sqrt3"):
        after = mesh_arrays(ATTACKS.make(f"subdivide:scheme={scheme}")(bump))[0]
        heights[scheme] = after[12, 2], sorted(np.unique(np.round(after[25:, 2], 9)))
    assert heights["loop"][0] == pytest.approx(10 / 16)
    assert heights["loop"][1] == pytest.approx([0, 1 / 8, 3 / 8])
    assert heights["sqrt3"][0] == pytest.approx(2 / 3)  # alpha_6 = 1/3
    assert heights["sqrt3"][1] == pytest.approx([0, 1 / 3])


def test_sqrt3_flips_every_inner_edge_and_no_border() -> None:
    two = triangle_mesh(np.array([[0, 0, 0], [3, 0, 0], [3, 3, 0], [0, 3, 0.0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    after = ATTACKS.make("subdivide:scheme=sqrt3")(two)
    edges = set(map(tuple, geometry.edges(mesh_arrays(after)[1])))
    assert (0, 2) not in edges
    assert (4, 5) in edges
    assert {(0, 1), (1, 2), (2, 3), (0, 3)} <= edges
    assert Surface.of(after).area == pytest.approx(9.0)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_non_manifold_edges_are_creases_not_errors(scheme: str) -> None:
    vertices = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [-1, -1, 0.0]])
    book = triangle_mesh(vertices, np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]]))
    after = mesh_arrays(ATTACKS.make(f"subdivide:scheme={scheme}")(book))
    assert len(after[1]) == (9 if scheme == "sqrt3" else 12)
    if scheme != "sqrt3":
        assert (0.0, 0.0, 0.5) in rows(after[0])


# simplification and remeshing


@pytest.mark.parametrize("ratio", [0.1, 0.5, 0.9, 0.975])
def test_simplification_removes_its_share_of_triangles_and_edges(spot: TriangleMesh, ratio: float) -> None:
    after = ATTACKS.make(f"simplify:ratio={ratio}")(spot)
    assert 1.0 - len(after.triangles) / 5856 == pytest.approx(ratio, abs=1e-3)
    assert 1.0 - len(geometry.edges(mesh_arrays(after)[1])) / 8784 == pytest.approx(ratio, abs=1e-3)
    assert is_closed(after)
    assert geometry.volume(*mesh_arrays(after)) == pytest.approx(geometry.volume(*mesh_arrays(spot)), rel=0.1)


def test_a_soup_is_simplified_as_the_surface_that_it_is(spot: TriangleMesh) -> None:
    soup = ATTACKS.make("unweld")(spot)
    assert len(ATTACKS.make("simplify:ratio=0.5")(soup).vertices) == len(
        ATTACKS.make("simplify:ratio=0.5")(spot).vertices
    )


def test_remeshing_evens_the_edges(spot: TriangleMesh) -> None:
    def edge_lengths(mesh: TriangleMesh) -> np.ndarray:
        vertices, triangles = mesh_arrays(mesh)
        return np.linalg.norm(np.diff(vertices[geometry.edges(triangles)], axis=1)[:, 0], axis=1)

    after = edge_lengths(ATTACKS.make("remesh:edge=0.03")(spot))
    assert after.mean() == pytest.approx(0.03 * Surface.of(spot).diagonal, rel=0.1)
    assert after.std() / after.mean() < 0.6 * edge_lengths(spot).std() / edge_lengths(spot).mean()
    assert edge_lengths(ATTACKS.make("remesh")(spot)).mean() == pytest.approx(edge_lengths(spot).mean(), rel=0.1)


# MeshLab's door


def test_meshlab_keeps_double_precision(spot: TriangleMesh) -> None:
    vertices = mesh_arrays(spot)[0] + 1e-13
    after, triangles = _meshlab.apply(vertices, mesh_arrays(spot)[1])
    np.testing.assert_allclose(after, vertices, rtol=0, atol=1e-15)
    assert np.array_equal(triangles, mesh_arrays(spot)[1])


def test_what_others_ask_of_meshlab_is_not_remembered(spot: TriangleMesh) -> None:
    before = mesh_arrays(ATTACKS.make("simplify")(spot))
    other = {"targetfacenum": 1000, "optimalplacement": False, "qualitythr": 1.0, "preservenormal": True}
    _meshlab.apply(*mesh_arrays(spot), ("meshing_decimation_quadric_edge_collapse", other))
    for old, new in zip(before, mesh_arrays(ATTACKS.make("simplify")(spot)), strict=True):
        np.testing.assert_array_equal(old, new)


def test_simplification_keeps_planes() -> None:
    """A box of many triangles is the same box with a fifth of them: not a vertex leaves its side."""
    box = TriangleMesh.create_box(1.0, 0.8, 0.6).subdivide_midpoint(4)
    box.rotate(TriangleMesh.get_rotation_matrix_from_xyz((0.5, 0.6, 0.7)))
    assert surface_distance(box, ATTACKS.make("simplify:ratio=0.8")(box)).hausdorff < 1e-3


def test_meshlab_s_refusals_are_named(spot: TriangleMesh) -> None:
    with pytest.raises(BackendError, match="meshing_surface_subdivision_nix failed: Filter does not exist"):
        _meshlab.apply(*mesh_arrays(spot), ("meshing_surface_subdivision_nix", {}))
    with pytest.raises(BackendError, match="leaves no triangle of the 5856"):
        _meshlab.apply(*mesh_arrays(spot), ("set_selection_all", {}), ("meshing_remove_selected_faces", {}))


# cropping, holes, pasting


@pytest.mark.parametrize("kind", ["plane", "ball"])
@pytest.mark.parametrize("share", [0.1, 0.3, 0.5, 0.9])
def test_a_crop_removes_its_share_of_vertices(spot: TriangleMesh, share: float, kind: str) -> None:
    after = ATTACKS.make(f"crop:share={share},kind={kind}")(spot, 3)
    gone = 2930 - len(after.vertices)
    assert round(share * 2930) <= gone <= round(share * 2930) + 6  # and those left without a triangle
    assert rows(mesh_arrays(after)[0]) <= rows(mesh_arrays(spot)[0])


@pytest.mark.parametrize("seed", range(5))
def test_a_cropped_plane(seed: int) -> None:
    before, after = grid(20), mesh_arrays(ATTACKS.make("crop:share=0.4")(grid(20), seed))[0]
    gone = np.array(sorted(rows(mesh_arrays(before)[0]) - rows(after)))
    assert 176 <= len(gone) <= 176 + 6  # 0.4 of 441
    difference = gone.mean(axis=0) - after.mean(axis=0)
    assert np.linalg.norm(difference) > 8.0  # a cut, not a sieve
    hull = [np.isclose(after[:, 0], edge).any() + np.isclose(after[:, 1], edge).any() for edge in (0, 20)]
    assert sum(hull) >= 2


@pytest.mark.parametrize("seed", range(4))
def test_a_cropped_ribbon_by_hand(seed: int) -> None:
    """A plane so narrow that every cut is across it: 0.3 of 200 vertices are 30 pairs, at one end."""
    side = np.repeat([0.0, 1e-3], 100)
    along = np.tile(np.arange(100.0), 2)
    first = np.arange(99)
    corners = np.r_[np.c_[first, first + 1, first + 100], np.c_[first + 1, first + 101, first + 100]]
    ribbon = triangle_mesh(np.c_[along, side, 0 * side], corners)
    kept, triangles = mesh_arrays(ATTACKS.make("crop:share=0.3")(ribbon, seed))
    x = np.unique(kept[:, 0])
    assert x.tolist() in (list(range(70)), list(range(30, 100)))
    assert (len(kept), len(triangles)) == (140, 138)
    assert geometry.areas(kept, triangles).sum() == pytest.approx(69e-3)


def test_a_plane_crop_is_a_half_space(spot: TriangleMesh) -> None:
    from scipy.optimize import linprog

    kept = mesh_arrays(ATTACKS.make("crop:share=0.3")(spot, 7))[0]
    gone = np.array(sorted(rows(mesh_arrays(spot)[0]) - rows(kept)))
    sides = np.concatenate([np.c_[-kept, np.ones(len(kept))], np.c_[gone, -np.ones(len(gone))]])
    lonely = 3  # strays that lost all their triangles lie on the kept side
    result = linprog(
        np.r_[np.zeros(4), np.ones(len(sides))],
        np.c_[sides, -np.eye(len(sides))],
        -np.ones(len(sides)),
        bounds=[(None, None)] * 4 + [(0, None)] * len(sides),
        options={"time_limit": 20},
    )
    assert (result.x[4:] > 1.0).sum() <= lonely


def test_a_ball_crop_keeps_a_ball(spot: TriangleMesh) -> None:
    kept = mesh_arrays(ATTACKS.make("crop:share=0.8,kind=ball")(spot, 2))[0]
    all_vertices = mesh_arrays(spot)[0]
    radii = [np.linalg.norm(kept - centre, axis=1).max() for centre in all_vertices]
    centre = all_vertices[np.argmin(radii)]
    inside = np.linalg.norm(all_vertices - centre, axis=1) < min(radii)
    assert inside.sum() < 0.35 * 2930


def test_the_largest_piece_is_connected_and_largest() -> None:
    small = TriangleMesh.create_icosahedron().translate((5.0, 0.0, 0.0))
    both = torus() + small
    assert len(ATTACKS.make("crop:share=0,largest=true")(both).vertices) == 600
    soup = ATTACKS.make("unweld")(both)
    assert len(ATTACKS.make("crop:share=0,largest=true")(soup).triangles) == 1200


def test_cutting_everything_off_is_refused_with_a_reason() -> None:
    with pytest.raises(MeshError, match="leaves no triangle"):
        ATTACKS.make("crop:share=0.99")(TriangleMesh.create_icosahedron(), 0)


def test_holes_open_the_mesh_where_they_say(spot: TriangleMesh) -> None:
    after = ATTACKS.make("holes:share=0.1,count=4")(spot, 1)
    gone = 2930 - len(after.vertices)
    assert 0.03 * 2930 < gone <= 0.1 * 2930 + 10
    border = geometry.boundary_vertices(mesh_arrays(after)[1], len(after.vertices))
    assert border.any()
    assert not is_closed(after)


def test_holes_in_a_mesh_of_a_few_vertices_keep_to_their_share() -> None:
    box = TriangleMesh.create_box()  # 8 vertices: a twentieth is less than one
    assert len(ATTACKS.make("holes")(box, 0).vertices) == 7
    assert len(ATTACKS.make("holes:share=0.25,count=4")(box, 1).vertices) >= 5


@pytest.mark.parametrize("foreign", ["torus", "sphere", "box", "cone"])
def test_a_pasted_fragment_is_there_in_one_piece_beside_the_foreign_object(spot: TriangleMesh, foreign: str) -> None:
    after = ATTACKS.make(f"paste:share=0.5,foreign={foreign},size=2")(spot, 1)
    fragment = ATTACKS.make("crop:share=0.5")(spot, 1)
    n, m = len(fragment.vertices), len(fragment.triangles)
    vertices, triangles = mesh_arrays(after)
    assert np.array_equal(triangles[:m], mesh_arrays(fragment)[1])
    assert triangles[m:].min() >= n
    ratio = geometry.diagonal(vertices[n:]) / geometry.diagonal(vertices[:n])
    assert ratio == pytest.approx(2.0)
    lengths = [np.linalg.norm(np.diff(v[:n:50], axis=0), axis=1) for v in (vertices, mesh_arrays(fragment)[0])]
    assert np.ptp(lengths[0] / lengths[1]) < 1e-9 * lengths[0].max()
    distances = np.linalg.norm(vertices[:n, None] - vertices[None, n:], axis=2)
    assert distances.min() < 1e-9
