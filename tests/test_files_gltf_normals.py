"""Normals and tangents of a glTF turn with their surface, each in its own type."""

import numpy as np
import pytest

from fixtures.gltf_files import BUMPY, CASES, Builder, Case, waved
from fixtures.gltf_parser import assert_only_positions_differ, parse
from o3dmark.files.gltf import Gltf
from o3dmark.mesh import geometry

COS, SIN = np.cos(0.4), np.sin(0.4)
TURN = np.array([[COS, -SIN, 0], [SIN, COS, 0], [0, 0, 1]])


def ball(normals=None, tangents=None, **more: object) -> Case:
    b = Builder()
    attributes = {"POSITION": b.positions()}
    if normals is not None:
        attributes["NORMAL"] = b.add(normals, **more)
    if tangents is not None:
        attributes["TANGENT"] = b.add(tangents, **more)
    b.mesh({"attributes": attributes, "indices": b.indices()})
    return b.glb()


def after(case: Case, move) -> Case:
    """The case with all parts moved."""
    asset = Gltf(case.source)
    written = asset.with_positions({n: move(part.vertices) for n, part in enumerate(asset.parts)})
    assert_only_positions_differ(case, case.with_files(written))
    return case.with_files(written)


def rows(case: Case, name: str, place: int = 0) -> np.ndarray:
    parsed = parse(case)
    return parsed.rows(parsed.attributes(name)[place])


def turned(vertices: np.ndarray) -> np.ndarray:
    return vertices @ TURN.T


def surface_normals() -> np.ndarray:
    """Of the welded shape, by area: what the surface's own motion takes along exactly."""
    vertices = BUMPY.vertices.astype(float)
    kept, place = geometry.weld(vertices)
    return geometry.unit(geometry.vertex_area_vectors(vertices[kept], place[BUMPY.triangles]))[place]


def test_normals_turn_as_the_whole_turns():
    normals = surface_normals()
    new = rows(after(ball(normals.astype("<f4")), turned), "NORMAL")
    np.testing.assert_allclose(new, normals @ TURN.T, atol=3e-7)


def test_equal_normals_at_a_seam_stay_equal():
    case = after(CASES["tangents"](), waved)
    normals, positions = rows(case, "NORMAL").reshape(10, 17, 3), rows(case, "POSITION").reshape(10, 17, 3)
    np.testing.assert_array_equal(positions[:, 0], positions[:, -1])
    np.testing.assert_array_equal(normals[:, 0], normals[:, -1])


def test_tangents_stay_square_to_normals():
    case = after(CASES["tangents"](), lambda v: waved(v, 0.03))
    normals, tangents = rows(case, "NORMAL"), rows(case, "TANGENT")
    np.testing.assert_array_equal(tangents[:, 3], -1.0)
    assert np.abs((normals * tangents[:, :3]).sum(axis=1)).max() < 1e-6
    assert np.abs(np.linalg.norm(normals, axis=1) - 1.0).max() < 1e-6


def test_hard_edges_stay_hard():
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], "<f4")
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    vertices = corners[np.array(faces).ravel()]
    triangles = np.array([[4 * k + a, 4 * k + b, 4 * k + c] for k in range(6) for a, b, c in ((0, 1, 2), (0, 2, 3))])
    flat = np.repeat(geometry.unit(geometry.area_vectors(vertices.astype(float), triangles[::2])), 4, axis=0)
    b = Builder()
    attributes = {"POSITION": b.positions(vertices), "NORMAL": b.add(flat.astype("<f4"))}
    b.mesh({"attributes": attributes, "indices": b.indices(triangles)})
    new = rows(after(b.glb(), lambda v: v @ np.array([[1, 0.1, 0], [0, 1, 0], [0.05, 0, 1.0]])), "NORMAL")
    moved = rows(after(b.glb(), lambda v: v @ np.array([[1, 0.1, 0], [0, 1, 0], [0.05, 0, 1.0]])), "POSITION")
    expected = np.repeat(geometry.unit(geometry.area_vectors(moved.astype(float), triangles[::2])), 4, axis=0)
    np.testing.assert_allclose(new, expected, atol=1e-6)


def test_where_the_surface_stays_they_keep_their_bytes():
    """Some lengths are off, some are zero or no numbers."""
    normals = BUMPY.normals * np.linspace(0.3, 4, 170, dtype="<f4")[:, None]
    normals[40], normals[41, 1], normals[42, 2] = 0.0, np.nan, -np.inf
    normals[43] = [-0.0, 0.0, -0.0]

    def move(vertices):
        moved = vertices.copy()
        moved[:34] = turned(moved[:34])
        return moved

    case = ball(normals)
    old, new = rows(case, "NORMAL"), rows(after(case, move), "NORMAL")
    assert old[51:].tobytes() == new[51:].tobytes()
    assert old[40:44].tobytes() == new[40:44].tobytes()
    np.testing.assert_allclose(np.linalg.norm(new[:34], axis=1), np.linalg.norm(old[:34], axis=1), rtol=1e-6)
    assert (old[:17] != new[:17]).any(axis=1).all()


def test_a_mirrored_motion_turns_nothing():
    """A surface turned over says nothing about how its normals turned."""
    case = ball(BUMPY.normals)
    assert rows(after(case, lambda v: v * [1, 1, -1]), "POSITION").shape == (170, 3)


@pytest.mark.parametrize("dtype", ["<i1", "<i2"])
def test_quantised_ones_move_on_their_grid(dtype):
    largest = np.iinfo(dtype).max
    normals, tangents = (np.rint(x * largest).astype(dtype) for x in (BUMPY.normals, BUMPY.tangents))
    normals[9] = np.iinfo(dtype).min  # stands for -1, as its neighbour does
    stride = 4 * np.dtype(dtype).itemsize
    case = ball(normals, tangents, stride=stride, normalized=True)
    floating = after(ball(*(np.maximum(x / largest, -1.0).astype("<f4") for x in (normals, tangents))), turned)
    for name, old in (("NORMAL", normals), ("TANGENT", tangents)):
        new, exact = rows(after(case, turned), name), rows(floating, name)
        assert (new.dtype, (new != old).any()) == (np.dtype(dtype), True)
        unit = geometry.unit(exact[:, :3].astype(float))
        assert np.abs(np.delete(unit - new[:, :3] / largest, 9, axis=0)).max() < 0.5001 / largest + 1e-6
        lengths = np.delete(np.linalg.norm(new[:, :3] / largest, axis=1), 9)
        assert np.abs(lengths - 1.0).max() < 0.87 / largest
        np.testing.assert_array_equal(new[:, 3:], old[:, 3:])


def test_tangents_without_normals_turn_on_their_own():
    normals = surface_normals()
    new = rows(after(ball(tangents=BUMPY.tangents), turned), "TANGENT")[:, :3]
    along, now = (BUMPY.tangents[:, :3] * normals).sum(axis=1), (new * (normals @ TURN.T)).sum(axis=1)
    np.testing.assert_allclose(now, along, atol=1e-6)
    assert (new != BUMPY.tangents[:, :3]).any(axis=1).sum() > 100


def test_two_rows_of_tangents_on_the_same_normals():
    b = Builder()
    shared = {"POSITION": b.positions(), "NORMAL": b.add(BUMPY.normals)}
    half = len(BUMPY.triangles) // 2
    other = np.concatenate([np.cross(BUMPY.normals, BUMPY.tangents[:, :3]), np.ones((170, 1))], axis=1).astype("<f4")
    for tangents, triangles in ((BUMPY.tangents, BUMPY.triangles[:half]), (other, BUMPY.triangles[half:])):
        attributes = {**shared, "TANGENT": b.add(tangents)}
        b.json.setdefault("meshes", [{"primitives": []}])[0]["primitives"].append(
            {"attributes": attributes, "indices": b.indices(triangles)}
        )
    new = after(b.glb(), turned)
    normals = rows(new, "NORMAL")
    for place in (0, 1):
        tangents = rows(new, "TANGENT", place)
        assert np.abs((normals * tangents[:, :3]).sum(axis=1)).max() < 1e-6


def test_sparse_normals():
    b = Builder()
    rows_of = {
        "count": 2,
        "indices": {"bufferView": b.view(np.array([3, 30], "<u4").tobytes()), "componentType": 5125},
        "values": {"bufferView": b.view(BUMPY.normals[[3, 30]].tobytes())},
    }
    base = BUMPY.normals.copy()
    base[[3, 30]] = 9
    normals = b.accessor(BUMPY.normals, b.view(base.tobytes()), sparse=rows_of)
    b.mesh({"attributes": {"POSITION": b.positions(), "NORMAL": normals}, "indices": b.indices()})
    new = rows(after(b.glb(), turned), "NORMAL")
    np.testing.assert_array_equal(new, rows(after(ball(BUMPY.normals), turned), "NORMAL"))


def test_normals_of_two_parts_stay():
    """They cannot turn with each."""
    b = Builder()
    normals = b.add(BUMPY.normals)
    for scale in (1, 2):
        attributes = {"POSITION": b.positions(BUMPY.vertices * np.float32(scale)), "NORMAL": normals}
        b.mesh({"attributes": attributes, "indices": b.indices()})
    assert np.array_equal(rows(after(b.glb(), turned), "NORMAL"), BUMPY.normals)


def test_normals_whose_bytes_serve_something_else_stay():
    b = Builder()
    normals = b.add(BUMPY.normals)
    b.mesh({"attributes": {"POSITION": b.positions(), "NORMAL": normals, "_COPY": normals}, "indices": b.indices()})
    assert not Gltf(b.glb().source).parts[0].fixed
    assert np.array_equal(rows(after(b.glb(), turned), "NORMAL"), BUMPY.normals)
