"""The command line and people's files: the file that comes back is theirs, and nothing of theirs is lost."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import open3d as o3d
import pytest

from fixtures.command_line import run
from fixtures.gltf_files import Builder
from o3dmark.coding.keys import Key
from o3dmark.files import open_asset, read_mesh, read_shape, write_mesh
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays
from o3dmark.watermark import Watermark

BITS = ("--n-bits", 43)  # which hold two bytes
PNG = bytes.fromhex("89504e470d0a1a0a") + b"not really a picture"
Embed = Callable[..., tuple[int, Any, str]]


@pytest.fixture
def home(tmp_path: Path, key: Key, spot: TriangleMesh) -> Path:
    """A folder with a key, a textured OBJ with its MTL and picture, and a glTF with its buffer."""
    key.save(tmp_path / "owner.key")
    vertices, triangles = mesh_arrays(spot)
    lines = ["# a scan", "mtllib spot.mtl", "o Spot", *("v " + " ".join(f"{x:.6f}" for x in v) for v in vertices)]
    lines += ["vt 0.5 0.5", "g skin", "usemtl skin", *(f"f {a}/1 {b}/1 {c}/1" for a, b, c in triangles + 1), ""]
    (tmp_path / "spot.obj").write_text("\r\n".join(lines))
    (tmp_path / "spot.mtl").write_text("newmtl skin\nmap_Kd pictures/skin.png\n")
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures" / "skin.png").write_bytes(PNG)
    builder = Builder()
    positions, indices = builder.positions(vertices.astype("<f4")), builder.indices(triangles, "<u4")
    builder.mesh({"attributes": {"POSITION": positions}, "indices": indices}, name="Spot", node={"scale": [9, 9, 9]})
    for name, content in builder.gltf(uris=["spot.bin"], files=["spot.bin"]).files.items():
        (tmp_path / name.replace("a.gltf", "spot.gltf")).write_bytes(content)
    return tmp_path


@pytest.fixture
def embed(home: Path, capsys: Any) -> Embed:
    def embed(source: str, out: str, *more: object) -> tuple[int, Any, str]:
        words = ("--key", home / "owner.key", "--message", "me", *BITS, "--json", *more)
        return run(capsys, "embed", home / source, home / out, *words)

    return embed


def contents(folder: Path) -> dict[str, bytes]:
    return {file.relative_to(folder).as_posix(): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def message_in(capsys: Any, home: Path, name: str) -> str | None:
    return str(run(capsys, "extract", home / name, "--key", home / "owner.key", *BITS, "--json")[1]["message"])


def test_an_obj_comes_back_with_other_vertices_only(home: Path, embed: Embed, capsys: Any) -> None:
    before = contents(home)
    code, result, err = embed("spot.obj", "marked.obj")
    assert (code, result["verified"], result["files"], err) == (0, True, ["marked.obj"], "")
    after = contents(home)
    assert {name: after[name] for name in before} == before
    old, new = before["spot.obj"].split(b"\r\n"), after["marked.obj"].split(b"\r\n")
    assert {one[:2] for one, other in zip(old, new, strict=True) if one != other} == {b"v "}
    assert message_in(capsys, home, "marked.obj") == "me"


def test_elsewhere_its_materials_and_pictures_come_along(home: Path, embed: Embed) -> None:
    (home / "out").mkdir()
    assert embed("spot.obj", "out/marked.obj")[1]["files"] == ["marked.obj", "pictures/skin.png", "spot.mtl"]
    assert contents(home / "out")["pictures/skin.png"] == PNG


def test_a_gltf_in_its_own_folder_leaves_the_buffer_of_the_original(home: Path, embed: Embed, capsys: Any) -> None:
    before = contents(home)
    code, result, _ = embed("spot.gltf", "marked.gltf")
    assert (code, result["files"]) == (0, ["marked.bin", "marked.gltf"])
    assert {name: contents(home)[name] for name in before} == before
    assert message_in(capsys, home, "marked.gltf") == "me"
    cover, marked = (open_asset(home / f"{name}.gltf").parts[0] for name in ("spot", "marked"))
    assert 0 < np.abs(marked.vertices - cover.vertices).max() < 0.01
    np.testing.assert_array_equal(marked.placements, cover.placements)


@pytest.mark.parametrize("out", ["spot.obj", "spot.mtl", "pictures/skin.png", "spot.gltf"])
def test_what_is_there_is_not_overwritten_and_nothing_is_computed(
    home: Path, embed: Embed, out: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Watermark, "embed", lambda *_: pytest.fail("it was computed"))
    before = contents(home)
    code, result, _ = embed("spot.obj", out)
    assert code == 2
    assert "is free" in result["message"] or "the ending of" in result["message"]
    assert contents(home) == before


def test_out_gives_way_when_told_to_but_in_never(home: Path, embed: Embed) -> None:
    (home / "old.obj").write_text("old")
    assert embed("spot.obj", "old.obj")[0] == 2
    assert embed("spot.obj", "old.obj", "--overwrite")[0] == 0
    assert (home / "old.obj").read_text().startswith("# a scan")
    assert embed("spot.obj", "spot.obj", "--overwrite")[0] == 2


def test_references_that_leave_the_folder_are_refused(home: Path, embed: Embed) -> None:
    (home / "inner").mkdir()
    (home / "inner" / "spot.obj").write_bytes((home / "spot.obj").read_bytes().replace(b"spot.mtl", b"../spot.mtl"))
    code, result, _ = embed("inner/spot.obj", "inner/marked.obj")
    assert (code, result["error"]) == (3, "MeshError")
    assert "leaves its folder" in result["message"]


def test_what_is_missing_is_named(home: Path, embed: Embed) -> None:
    (home / "spot.mtl").unlink()
    code, result, err = embed("spot.obj", "marked.obj")
    assert (code, result["missing"]) == (0, ["spot.mtl"])
    assert "spot.mtl" in err
    (home / "spot.bin").unlink()
    code, result, _ = embed("spot.gltf", "marked.gltf")
    assert code == 3
    assert "spot.bin" in result["message"]


def test_another_ending_is_a_conversion_that_says_what_it_drops(home: Path, embed: Embed, capsys: Any) -> None:
    code, result, err = embed("spot.gltf", "marked.stl")
    assert (code, result["dropped"], result["files"]) == (0, ["names", "nodes"], ["marked.stl"])
    assert "was dropped: names, nodes" in err
    assert message_in(capsys, home, "marked.stl") == "me"
    code, result, _ = embed("spot.gltf", "marked.glb")
    assert (code, result["dropped"]) == (0, [])


def test_a_texture_arrives_or_the_command_refuses(home: Path, embed: Embed) -> None:
    code, result, _ = embed("spot.obj", "marked.glb")
    assert code == 3  # the picture is none
    assert "texture" in result["message"]
    assert not (home / "marked.glb").exists()


def test_clouds_are_read(home: Path, capsys: Any, spot: TriangleMesh, key: Key) -> None:
    marked = Watermark(n_bits=43).embed(spot, "me", key).compute_vertex_normals()
    o3d.utility.random.seed(0)
    cloud = marked.sample_points_uniformly(40_000)
    for name in ("cloud.ply", "cloud.pcd", "cloud.xyzn"):
        o3d.io.write_point_cloud(str(home / name), cloud)
        assert np.allclose(read_shape(home / name).points, cloud.points, atol=1e-5)
    assert message_in(capsys, home, "cloud.pcd") == "me"
    words = ("--key", home / "owner.key", "--message", "me", *BITS, "--json")
    code, result, _ = run(capsys, "detect", home / "cloud.ply", *words)
    assert (code, result["present"], result["part"]) == (0, True, "all of it")


def test_other_commands_cover_nothing_either(home: Path, capsys: Any) -> None:
    before = contents(home)
    for words in (
        ("attack", home / "spot.obj", home / "spot.obj", "noise"),
        ("synth", "vase", home / "spot.obj"),
        ("saliency", home / "spot.obj", "--out", home / "spot.mtl"),
        ("view", home / "spot.obj", "--png", home / "pictures" / "skin.png"),
    ):
        code, result, _ = run(capsys, *words, "--json")
        assert (code, result["error"]) == (2, "SpecError")
        assert "is free" in result["message"]
    assert contents(home) == before
    assert run(capsys, "synth", "vase", home / "spot.obj", "--overwrite")[0] == 0
    assert len(read_mesh(home / "spot.obj").vertices) != 2930


def test_a_conversion_that_fails_advises_no_profile(spot, tmp_path, key, capsys):
    """The mesh can be marked; it is its missing material that stands in the way."""
    write_mesh(tmp_path / "a.obj", spot)
    (tmp_path / "b.obj").write_text("mtllib x.mtl\n" + (tmp_path / "a.obj").read_text())
    key.save(tmp_path / "owner.key")
    words = ["embed", tmp_path / "b.obj", tmp_path / "b.glb", "--key", tmp_path / "owner.key", "--message", "hi"]
    code, error, _ = run(capsys, *words, "--json")
    assert (code, error["error"]) == (3, "ConversionError")
    assert "x.mtl" in error["message"]
    assert "as .obj it can be marked" in error["message"]
    assert "profile" not in error["message"]
    assert not (tmp_path / "b.glb").exists()
