"""glTF and GLB: the file comes back with its positions moved, and what follows from them, and nothing else."""

import numpy as np
import pytest

from fixtures.gltf_files import BUMPY, CASES, Builder, Case, Shape, bumpy, waved
from fixtures.gltf_parser import assert_only_positions_differ, parse
from fixtures.paths import SHARED
from o3dmark.errors import MeshError
from o3dmark.files.gltf import Gltf
from o3dmark.files.references import Source
from o3dmark.mesh import geometry


def read(case: Case) -> Gltf:
    return Gltf(case.source)


def moved(asset: Gltf) -> dict[int, np.ndarray]:
    return {number: waved(part.vertices) for number, part in enumerate(asset.parts) if not part.fixed}


@pytest.fixture(params=CASES)
def case(request) -> Case:
    return CASES[request.param]()


def test_where_nothing_moves_every_byte_stays(case):
    asset = read(case)
    same = {name: case.files[name] for name in (case.name, *asset.changing)}
    assert asset.with_positions({}) == same
    assert asset.with_positions({n: part.vertices for n, part in enumerate(asset.parts)}) == same


def test_only_positions_change(case):
    asset = read(case)
    written = asset.with_positions(moved(asset))
    assert set(written) == {case.name, *asset.changing}
    assert_only_positions_differ(case, case.with_files(written))


def test_the_nearest_numbers_are_written_and_read_again(case):
    asset = read(case)
    wanted = moved(asset)
    again = read(case.with_files(asset.with_positions(wanted)))
    for number, (old, new) in enumerate(zip(asset.parts, again.parts, strict=True)):
        assert (np.abs(new.vertices - wanted[number]) <= 0.5 * np.maximum(old.steps, new.steps)).all()
        assert (np.array_equal(new.triangles, old.triangles), new.name) == (True, old.name)
        assert np.array_equal(new.placements, old.placements)
        place = geometry.weld(old.vertices)[1]
        assert np.array_equal(new.vertices[place == place[0]][0], new.vertices[0])
        assert len(geometry.weld(new.vertices)[0]) == len(geometry.weld(old.vertices)[0])


def test_a_vertex_that_does_not_move_keeps_its_bytes(case):
    asset = read(case)
    wanted = moved(asset)
    wanted[0][5:] = asset.parts[0].vertices[5:]
    again = read(case.with_files(asset.with_positions({0: wanted[0]})))
    assert np.array_equal(again.parts[0].vertices[5:], asset.parts[0].vertices[5:])
    assert not np.array_equal(again.parts[0].vertices[:5], asset.parts[0].vertices[:5])
    for new, old in zip(again.parts[1:], asset.parts[1:], strict=True):
        assert np.array_equal(new.vertices, old.vertices)


def test_positions_are_the_numbers_of_the_file(case):
    asset, parsed = read(case), parse(case)
    for part in asset.parts:
        assert (part.vertices.dtype, part.triangles.dtype) == (np.float64, np.int64)
        assert not part.vertices.flags.writeable
    numbers = parsed.attributes("POSITION")
    assert sum(len(part.vertices) for part in asset.parts) == sum(len(parsed.rows(number)) for number in numbers)
    assert np.array_equal(
        np.concatenate([p.vertices for p in asset.parts]), np.concatenate(list(map(parsed.rows, numbers)))
    )


SHARED_FILES = sorted((SHARED / "cases").glob("**/*.gl*[bf]")) if SHARED.is_dir() else []


@pytest.mark.parametrize("path", SHARED_FILES or [None], ids=lambda path: path.name if path else "none")
def test_files_of_other_people(path):
    if path is None:
        pytest.skip("no shared files here (set O3DMARK_SHARED to the folder that holds them)")
    files = {file.name: file.read_bytes() for file in path.parent.iterdir() if file.suffix in (".bin", path.suffix)}
    case = Case(path.name, files)
    asset = Gltf(Source(path))
    assert asset.with_positions({})[path.name] == files[path.name]
    written = asset.with_positions(moved(asset))
    assert_only_positions_differ(case, case.with_files(written))
    assert asset.mesh().has_triangles()


def test_contents():
    said = {name: read(make()).contents for name, make in CASES.items()}
    assert said["plain"] == {"names"}
    assert said["two primitives"] == {"names", "normals", "materials"}
    assert said["interleaved"] == {"normals", "texture coordinates", "attribute _FEATURE_ID_0", "textures", "materials"}
    assert said["morph targets"] == {"morph targets", "metadata"}
    assert said["skinned"] == {"normals", "skins", "animations", "cameras", "lights", "nodes", "names"}
    assert said["instances"] == said["gpu instances"] == {"nodes"}
    assert said["shared accessor"] == {"several meshes", "materials", "names", "nodes"}
    assert said["strips"] == {"lines", "points"}
    assert said["tangents"] == {
        "normals",
        "tangents",
        "texture coordinates",
        "second texture coordinates",
        "vertex colours",
    }
    assert said["extras"] == {"metadata", "extension X_unknown", "names"}
    assert said["two buffers"] == {"normals", "textures"}


def test_names_of_files_beside():
    asset = read(CASES["two buffers"]())
    assert asset.references == ("rest.bin", "the positions.bin", "pictures/gone.png")
    assert set(asset.changing) == {"the positions.bin", "rest.bin"}
    names = {"the positions.bin": "new one.bin", "rest.bin": "rest-1.bin"}
    written = asset.with_positions(moved(asset), names)
    assert set(written) == {"a.gltf", "new one.bin", "rest-1.bin"}
    assert b'"new%20one.bin"' in written["a.gltf"]
    case = CASES["two buffers"]()
    assert_only_positions_differ(case, Case("a.gltf", written))
    assert asset.with_positions({}, names)["new one.bin"] == case.files["the positions.bin"]


def test_a_buffer_without_positions_is_not_asked_for():
    case = CASES["two buffers"]()
    b = Builder(buffers=[bytearray(), bytearray()])
    b.mesh({"attributes": {"POSITION": b.positions()}, "indices": b.indices()})
    b.put("animations", {"samplers": [{"input": b.add(np.zeros(1, "<f4"), buffer=1), "output": 2}], "channels": []})
    case = b.gltf(uris=["a.bin", "gone.bin"], files=["a.bin", "gone.bin"])
    asset = read(Case(case.name, {name: case.files[name] for name in ("a.gltf", "a.bin")}))
    assert (asset.changing, asset.references) == (("a.bin",), ("a.bin", "gone.bin"))


def test_one_file_that_two_buffers_name():
    b = Builder(buffers=[bytearray(), bytearray()])
    b.mesh({"attributes": {"POSITION": b.positions()}, "indices": b.indices()})
    case = b.gltf(uris=["a.bin", "a.bin"], files=["a.bin", "ignored"])
    asset = read(Case(case.name, {**case.files, "a.bin": bytes(b.buffers[0])}))
    assert asset.changing == ("a.bin",)
    assert read(case.with_files(asset.with_positions(moved(asset)))).parts[0].vertices[0] != pytest.approx(
        BUMPY.vertices[0]
    )


def test_a_text_that_has_a_byte_order_mark():
    case = CASES["data URI"]()
    marked = Case("a.gltf", {"a.gltf": b"\xef\xbb\xbf" + case.files["a.gltf"]})
    written = read(marked).with_positions(moved(read(case)))["a.gltf"]
    assert written == b"\xef\xbb\xbf" + read(case).with_positions(moved(read(case)))["a.gltf"]


def test_the_ending_does_not_say_what_a_file_is():
    content = CASES["plain"]().files["a.glb"]
    assert len(read(Case("a.gltf", {"a.gltf": content})).parts) == 1


def test_a_fixed_part_says_why():
    b = Builder()
    positions = b.positions()
    b.mesh({"attributes": {"POSITION": positions, "NORMAL": positions}, "indices": b.indices()}, name="Ball")
    asset = read(b.glb())
    with pytest.raises(MeshError, match=r"a\.glb, Ball: the bytes of its positions are also used for NORMAL"):
        asset.with_positions(moved(asset) or {0: waved(asset.parts[0].vertices)})


def test_new_positions_are_checked():
    asset = read(CASES["plain"]())
    with pytest.raises(MeshError, match=r"has positions \(170, 3\), not \(3, 3\)"):
        asset.with_positions({0: np.zeros((3, 3))})
    lost = asset.parts[0].vertices.copy()
    lost[3, 1] = np.nan
    with pytest.raises(MeshError, match="not all finite"):
        asset.with_positions({0: lost})


def test_a_million_vertices_take_one_pass(monkeypatch):
    """No loop over vertices: parsing a mesh a hundred times larger calls no more functions."""
    import sys

    def calls(shape: Shape) -> int:
        b = Builder()
        b.mesh({"attributes": {"POSITION": b.positions(shape.vertices)}, "indices": b.indices(shape.triangles, "<u4")})
        case, count = b.glb(), 0

        def profile(*_: object) -> None:
            nonlocal count
            count += 1

        sys.setprofile(profile)
        try:
            read(case)
        finally:
            sys.setprofile(None)
        return count

    calls(bumpy())
    assert calls(bumpy(100, 200)) < 1.2 * calls(bumpy())
