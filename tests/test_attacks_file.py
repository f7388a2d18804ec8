"""Attacks that leave the shape alone: reordering, formats, half precision, welding."""

import numpy as np
import open3d as o3d
import pytest
from scipy.spatial import KDTree

from o3dmark.attacks import ATTACKS
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays, triangle_mesh


def triangle_rows(mesh: TriangleMesh) -> np.ndarray:
    """The corners of every triangle (m, 9), from its smallest on, sorted: blind to order, not to winding."""
    vertices, triangles = mesh_arrays(mesh)
    corners = vertices[triangles]
    turn = [min(range(3), key=lambda k: tuple(three[k])) for three in corners]
    turned = np.stack([np.roll(three, -k, axis=0).ravel() for three, k in zip(corners, turn, strict=True)])
    return turned[np.lexsort(turned.T)]


def square() -> TriangleMesh:
    """Two triangles with six vertices of their own, two positions of which coincide twice."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    return triangle_mesh(corners, np.arange(6).reshape(2, 3))


def test_reordering_changes_every_order_and_no_triangle(spot: TriangleMesh) -> None:
    after = ATTACKS.make("reorder")(spot, 1)
    (v, t), (w, u) = mesh_arrays(spot), mesh_arrays(after)
    assert np.array_equal(triangle_rows(spot), triangle_rows(after))
    assert np.array_equal(v[np.lexsort(v.T)], w[np.lexsort(w.T)])
    assert (np.abs(v - w).max(axis=1) > 0).mean() > 0.99
    assert (v[t] != w[u]).any(axis=(1, 2)).mean() > 0.99


@pytest.mark.parametrize("part", ["vertices", "triangles", "corners"])
def test_one_part_of_a_reordering_at_a_time(spot: TriangleMesh, part: str) -> None:
    others = ",".join(f"{name}=false" for name in ("vertices", "triangles", "corners") if name != part)
    after = ATTACKS.make(f"reorder:{others}")(spot, 1)
    (v, t), (w, u) = mesh_arrays(spot), mesh_arrays(after)
    assert np.array_equal(v, w) == (part != "vertices")
    if part == "corners":
        assert np.array_equal(np.sort(t, axis=1), np.sort(u, axis=1))
        assert np.bincount(np.argmax(u == t[:, :1], axis=1)) == pytest.approx(np.full(3, len(t) / 3), rel=0.1)
    if part == "vertices":
        assert np.array_equal(v[t], w[u])


@pytest.mark.parametrize(
    ("kind", "bound"), [("ply", 0.0), ("ply-ascii", 1e-5), ("obj", 1e-5), ("off", 1e-5), ("stl", 1e-6), ("glb", 1e-6)]
)
def test_formats_keep_what_they_promise(spot: TriangleMesh, kind: str, bound: float) -> None:
    rough = ATTACKS.make("noise")(spot, 0)  # positions that float32 does not have
    after = ATTACKS.make(f"reformat:format={kind}")(rough)
    v, w = mesh_arrays(rough)[0], mesh_arrays(after)[0]
    assert len(after.triangles) == len(spot.triangles)
    assert len(geometry.weld(w)[0]) == len(v)
    assert KDTree(w).query(v)[0].max() <= bound
    assert geometry.volume(*mesh_arrays(after)) == pytest.approx(geometry.volume(*mesh_arrays(rough)), rel=1e-4)
    if kind == "ply":
        assert np.array_equal(v, w)
    elif kind != "ply-ascii":
        assert not np.array_equal(v, w)


@pytest.mark.parametrize("kind", ["ply", "ply-ascii", "obj", "off", "glb"])
def test_formats_keep_colours(kind: str) -> None:
    mesh = TriangleMesh.create_torus(1.0, 0.4, 12, 8)
    mesh.vertex_colors = o3d.utility.Vector3dVector(np.random.default_rng(0).uniform(size=(96, 3)))
    after = ATTACKS.make(f"reformat:format={kind}")(mesh)
    nearest = KDTree(mesh_arrays(after)[0]).query(mesh_arrays(mesh)[0])[1]
    assert np.asarray(after.vertex_colors)[nearest] == pytest.approx(np.asarray(mesh.vertex_colors), abs=1 / 255)


@pytest.mark.parametrize("kind", ["ply", "ply-ascii", "obj", "off", "stl", "glb"])
def test_nothing_is_printed(spot: TriangleMesh, kind: str, capfd: pytest.CaptureFixture[str]) -> None:
    mesh = TriangleMesh(spot)  # with what most formats cannot keep
    mesh.triangle_uvs = o3d.utility.Vector2dVector(np.zeros((3 * len(spot.triangles), 2)))
    mesh.vertex_colors = o3d.utility.Vector3dVector(np.full((2930, 3), 0.5))
    ATTACKS.make(f"reformat:format={kind}")(mesh)
    assert "".join(capfd.readouterr()) == ""


def test_half_precision_keeps_eleven_bits_wherever_the_mesh_stands(spot: TriangleMesh) -> None:
    far = TriangleMesh(spot).translate((1e5, 0.0, 0.0))
    v, w = mesh_arrays(far)[0], mesh_arrays(ATTACKS.make("float16")(far))[0]
    low, high = v.min(axis=0), v.max(axis=0)
    half_side = (high - low).max() / 2.0
    error = np.abs(w - v).max()
    assert 2.0**-13 * half_side < error <= 2.0**-12 * half_side * 1.001
    from_centre = np.abs(v - (low + high) / 2.0)
    assert (np.abs(w - v) <= 2.0**-11 * from_centre + 1e-7 * half_side).all()


def test_welding_by_hand() -> None:
    after = ATTACKS.make("weld")(square())
    assert np.array_equal(mesh_arrays(after)[0], np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]]))
    assert mesh_arrays(after)[1].tolist() == [[0, 1, 2], [0, 2, 3]]


def test_unwelding_and_welding_is_the_identity_but_for_order(spot: TriangleMesh) -> None:
    soup = ATTACKS.make("unweld")(spot)
    assert len(soup.vertices) == 3 * len(spot.triangles)
    back = ATTACKS.make("weld")(soup)
    assert len(back.vertices) == len(spot.vertices)
    assert np.array_equal(triangle_rows(back), triangle_rows(spot))
    assert np.array_equal(triangle_rows(soup), triangle_rows(spot))
