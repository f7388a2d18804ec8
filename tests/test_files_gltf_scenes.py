"""Parts, places and shared bytes of a glTF; and a glTF as one mesh."""

import json

import numpy as np
import pytest

from fixtures.gltf_files import BUMPY, CASES, PICTURE, Builder, Case, glb, waved
from fixtures.gltf_parser import assert_only_positions_differ
from o3dmark.errors import MeshError
from o3dmark.files import _open3d
from o3dmark.files.gltf import Gltf
from o3dmark.files.references import Source


def read(case: Case) -> Gltf:
    return Gltf(case.source)


def on_disk(case: Case, folder) -> Gltf:
    for name, content in case.files.items():
        (folder / name).write_bytes(content)
    return Gltf(Source(folder / case.name))


def quad(b: Builder, **more: object) -> dict:
    """A square of four vertices of its own."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "<f4")
    primitive = {"attributes": {"POSITION": b.positions(vertices)}, "indices": b.indices(np.array([0, 1, 2, 0, 2, 3]))}
    return primitive | more


def test_a_mesh_is_one_part_with_all_its_primitives():
    [part] = read(CASES["two primitives"]()).parts
    assert np.array_equal(part.vertices, np.concatenate([BUMPY.vertices, BUMPY.vertices[:40]]))
    own = np.array([[0, 1, 17], [1, 18, 17]]) + len(BUMPY.vertices)
    assert np.array_equal(part.triangles, np.concatenate([BUMPY.triangles, own]))


def test_strips_fans_and_lists():
    [part] = read(CASES["strips"]()).parts
    n = len(BUMPY.vertices)
    strip, fan, rest = part.triangles[:32], part.triangles[32:35], part.triangles[35:]
    expected = [[a, 17 + a, a + 1] if odd == 0 else [17 + a, 18 + a, a + 1] for a in range(16) for odd in (0, 1)]
    assert {tuple(np.roll(t, -t.argmin())) for t in strip} == {tuple(np.roll(t, -np.argmin(t))) for t in expected}
    assert [set(t) for t in fan.tolist()] == [{60, 61, 78}, {60, 78, 77}, {60, 77, 76}]
    assert np.array_equal(rest, n + np.arange(60).reshape(-1, 3))
    assert len(part.vertices) == n + 60 + 4


def test_meshes_that_draw_the_same_positions_are_one_part():
    both, own = read(CASES["shared accessor"]()).parts
    assert (both.name, own.name) == ("mesh 0 'Red', Blue", "mesh 2 'Red'")
    assert np.array_equal(both.triangles, BUMPY.triangles)
    assert both.placements[:, 0, 3].tolist() == [1.0, 2.0]
    assert own.placements[:, 0, 3].tolist() == [0.0]


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["A", "B"], ["A", "B"]),
        (["A", "A", None], ["mesh 0 'A'", "mesh 1 'A'", "mesh 2"]),
        (["two\nlines", "\ud800"], ["two\\nlines", "?"]),
    ],
)
def test_names(names, said):
    b = Builder()
    for name in names:
        b.mesh(quad(b), **({} if name is None else {"name": name}))
    assert [part.name for part in read(b.glb()).parts] == said


def test_places():
    [part] = read(CASES["instances"]()).parts
    corner = np.array([1.0, 2.0, 3.0, 1.0])
    turned = np.array([0.28 * 1 + 0.96 * 3, 2.0 + 1.0, -0.96 * 1 + 0.28 * 3]) * 2 + [5, 0, 0]
    expected = [[1, 2, 3], turned, [-1, 2, 12], [448263.36, 5411934.68, 134.3]]
    np.testing.assert_allclose((part.placements @ corner)[:, :3], expected, rtol=1e-15)


def test_places_of_instances_on_the_card():
    [part] = read(CASES["gpu instances"]()).parts
    assert part.placements[:, :3, 3].tolist() == (3.0 * np.arange(9.0).reshape(3, 3)).tolist()
    np.testing.assert_array_equal(part.placements[:, :3, :3], np.tile(3.0 * np.eye(3), (3, 1, 1)))


def test_a_mesh_that_no_node_of_the_scene_uses_stands_where_it_is():
    b = Builder()
    b.mesh(quad(b), node={"translation": [9, 0, 0]})
    b.put("meshes", {"primitives": [quad(b)]})
    b.json["scenes"].append({"nodes": [0]})
    assert [part.placements[:, 0, 3].tolist() for part in read(b.glb()).parts] == [[9.0], [0.0]]
    del b.json["scene"]  # then all scenes count, and a node is placed once
    assert [part.placements[:, 0, 3].tolist() for part in read(b.glb()).parts] == [[9.0], [0.0]]
    del b.json["scenes"]  # then what is nobody's child
    assert [part.placements[:, 0, 3].tolist() for part in read(b.glb()).parts] == [[9.0], [0.0]]


def test_a_hierarchy_as_deep_as_it_is_long():
    b = Builder()
    b.mesh(quad(b))
    n = 20_000
    b.json["nodes"] = [{"children": [k + 1], "translation": [1, 0, 0]} for k in range(n)] + [{"mesh": 0}]
    assert read(b.glb()).parts[0].placements[0, 0, 3] == n


@pytest.mark.parametrize(
    ("nodes", "words"),
    [
        ([{"children": [1]}, {"children": [0]}], "its own ancestor"),
        ([{"children": [0]}], "its own ancestor"),
        ([{"children": [1, 2]}, {"children": [2]}, {}], "two parents"),
        ([{"mesh": 7}], "node 0: 'mesh' should be below 1"),
        ([{"children": [5]}], "'children' should be whole numbers below 1"),
        ([{"matrix": [1, 2, 3]}], "'matrix' should be 16 finite numbers"),
        ([{"scale": [1e308, 1, 1], "children": [1]}, {"scale": [1e308, 1, 1], "mesh": 0}], "where no number reaches"),
    ],
)
def test_nodes_that_cannot_be(nodes, words):
    b = Builder()
    b.mesh(quad(b))
    b.json["nodes"] = nodes
    with pytest.raises(MeshError, match=words):
        read(b.glb())


def test_too_many_nodes():
    b = Builder()
    b.json["nodes"] = [{}] * 100_001
    with pytest.raises(MeshError, match="100001 nodes; up to 100000"):
        read(b.glb())


def test_bytes_that_serve_something_else_too():
    b = Builder()
    vertices = b.positions()
    shape = {"attributes": {"POSITION": vertices}, "indices": b.indices(), "targets": [{"POSITION": vertices}]}
    b.mesh(shape, name="target")
    picture = b.view(PICTURE + bytes(36))
    b.put("images", {"bufferView": picture, "mimeType": "image/png"})
    where = len(PICTURE) + -len(PICTURE) % 4
    inside = b.accessor(
        np.zeros((3, 3), "<f4"), b.put("bufferViews", {**b.json["bufferViews"][picture], "byteLength": where + 36})
    )
    b.json["accessors"][inside]["byteOffset"] = where
    b.mesh({"attributes": {"POSITION": inside}}, name="picture")
    other = b.positions()
    b.accessor(np.zeros(4, "<u1"), b.json["accessors"][other]["bufferView"], byteOffset=6)
    b.mesh({"attributes": {"POSITION": other}, "indices": b.indices()}, name="unused accessor")
    b.mesh(quad(b), name="free")
    fixed = {part.name: part.fixed for part in read(b.glb()).parts}
    assert [name for name, why in fixed.items() if not why] == ["free"]
    assert all("also used for other data" in why for name, why in fixed.items() if name != "free")


def test_interleaved_rows_share_no_byte():
    asset = read(CASES["interleaved"]())
    assert not asset.parts[0].fixed
    case = CASES["interleaved"]()
    value, binary = json.loads(case.files["a.glb"][20:].partition(b"\0")[0].rpartition(b"}")[0] + b"}"), b""
    normal = value["accessors"][1]
    assert normal["byteOffset"] == 12
    del binary


def test_windows_on_one_row_of_positions_move_together():
    """Two meshes see the first and the last rows of one view, some of them both."""
    b = Builder()
    view = b.view(BUMPY.vertices.tobytes())
    n = len(BUMPY.vertices)
    low = b.accessor(BUMPY.vertices[:100], view, bounds=True)
    high = b.accessor(BUMPY.vertices[60:], view, bounds=True, byteOffset=60 * 12)
    for accessor, count in ((low, 100), (high, n - 60)):
        strip = np.arange(count - count % 3)
        b.mesh({"attributes": {"POSITION": accessor}, "indices": b.indices(strip)})
    case = b.glb()
    [part] = read(case).parts
    assert (len(part.vertices), part.fixed) == (100 + n - 60, "")
    written = read(case).with_positions({0: waved(part.vertices)})
    assert_only_positions_differ(case, case.with_files(written))
    again = read(case.with_files(written)).parts[0]
    np.testing.assert_allclose(again.vertices, waved(part.vertices), atol=1e-6)


def test_windows_that_see_the_same_bytes_otherwise_stay():
    b = Builder()
    view = b.view(BUMPY.vertices.tobytes())
    for offset in (0, 4):
        b.mesh({"attributes": {"POSITION": b.accessor(BUMPY.vertices[:99], view, byteOffset=offset)}})
    [part] = read(b.glb()).parts
    assert part.fixed == "its positions share bytes with positions of another form"


def test_zeros_that_the_file_does_not_store():
    def sparse(listed: int) -> Case:
        b = Builder()
        vertices = quad(b)["attributes"]["POSITION"]
        b.json["accessors"][vertices].pop("bufferView")
        rows = {
            "count": listed,
            "indices": {"bufferView": b.view(np.arange(listed, dtype="<u1").tobytes()), "componentType": 5121},
            "values": {"bufferView": b.view(np.ones((listed, 3), "<f4").tobytes())},
        }
        b.json["accessors"][vertices]["sparse"] = rows
        b.mesh({"attributes": {"POSITION": vertices}, "mode": 6})
        return b.glb()

    [part] = read(sparse(3)).parts
    assert part.fixed.startswith("some of its positions are zeros that the file does not store")
    assert part.vertices.tolist() == [[1, 1, 1]] * 3 + [[0, 0, 0]]
    case = sparse(4)
    [part] = read(case).parts
    assert part.fixed == ""
    written = read(case).with_positions({0: part.vertices + 0.25})
    assert read(case.with_files(written)).parts[0].vertices.tolist() == [[1.25] * 3] * 4


def test_positions_that_are_no_numbers():
    vertices = BUMPY.vertices.copy()
    vertices[7, 1] = np.nan
    b = Builder()
    b.mesh({"attributes": {"POSITION": b.add(vertices)}, "indices": b.indices()})
    assert read(b.glb()).parts[0].fixed == "1 of its 170 positions are not finite numbers"


def test_a_scene_as_one_mesh():
    asset = read(CASES["instances"]())
    mesh = asset.mesh()
    n, m = len(BUMPY.vertices), len(BUMPY.triangles)
    assert (len(mesh.vertices), len(mesh.triangles)) == (4 * n, 4 * m)
    places = asset.parts[0].placements
    for number, place in enumerate(places):
        here = BUMPY.vertices.astype(np.float64) @ place[:3, :3].T + place[:3, 3]
        np.testing.assert_array_equal(np.asarray(mesh.vertices)[number * n : (number + 1) * n], here)
    mirrored = np.asarray(mesh.triangles)[2 * m : 3 * m] - 2 * n
    np.testing.assert_array_equal(mirrored, BUMPY.triangles[:, ::-1])


@pytest.mark.parametrize("name", ["interleaved", "tangents", "two primitives", "shared accessor"])
def test_open3d_has_words_for_textures_and_colours(name, tmp_path):
    asset = on_disk(CASES[name](), tmp_path)
    mesh, read_by_open3d = asset.mesh(), _open3d.read(asset.path)
    for has in ("has_triangle_uvs", "has_textures", "has_vertex_colors", "has_vertex_normals"):
        assert getattr(mesh, has)() == getattr(read_by_open3d, has)()
    exact = np.concatenate([part.vertices + place[:3, 3] for part in asset.parts for place in part.placements])
    assert {tuple(row) for row in np.asarray(mesh.vertices)} <= {tuple(row) for row in exact}


def test_nothing_is_read_from_another_folder(tmp_path):
    (tmp_path / "secret.png").write_bytes(PICTURE)
    (tmp_path / "inner").mkdir()
    b = Builder()
    texture = {"index": b.put("textures", {"source": b.put("images", {"uri": "../secret.png"})})}
    b.put("materials", {"pbrMetallicRoughness": {"baseColorTexture": texture}})
    attributes = {"POSITION": b.positions(), "TEXCOORD_0": b.add(BUMPY.uv)}
    b.mesh({"attributes": attributes, "indices": b.indices(), "material": 0})
    asset = on_disk(b.glb(), tmp_path / "inner")
    assert asset.references == ("../secret.png",)
    assert not asset.mesh().has_textures()


def test_a_forest_is_not_poured_into_memory():
    b = Builder()
    mesh = b.mesh({"attributes": {"POSITION": b.positions()}, "indices": b.indices()})
    for _ in range(40_000):
        b.node({"mesh": mesh})
    asset = read(b.glb())
    assert len(asset.parts[0].placements) == 40_001
    with pytest.raises(MeshError, match="stand at 40001 places, which is too much for one mesh"):
        asset.mesh()


def test_a_file_without_meshes():
    case = Case("a.glb", {"a.glb": glb(b'{"asset": {"version": "2.0"}}', None)})
    assert read(case).parts == ()
    assert not read(case).mesh().has_triangles()
    assert read(case).with_positions({}) == case.files
