"""Conversions: the same triangles in every format, and nothing that is dropped goes unsaid."""

import importlib
import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from fixtures.convert_files import (
    CORNERS,
    TRIANGLES,
    coloured_ply,
    face_coloured_ply,
    floats_of,
    glb,
    off,
    picture,
    stl,
    textured_obj,
    tree_of,
    triangles_of,
    view_of,
)
from fixtures.threemf_files import archive, mesh, model
from o3dmark.errors import BackendError, MeshError
from o3dmark.files import ASSETS, open_asset
from o3dmark.files.asset import KINDS, Asset, Part
from o3dmark.files.conversion import TARGETS, convert, dropped
from o3dmark.files.conversion.repack import packed
from o3dmark.files.conversion.same_shape import same_shape
from o3dmark.files.obj import Obj
from o3dmark.files.references import Source

PNG, JPEG = picture("PNG"), picture("JPEG", (10, 90, 200))
UV = np.array([[0.25, 0.5], [1, 0], [1, 1], [0, 1]] * 2, np.float32)
TURNED = [{"children": [1], "rotation": [0, 0, 0.6, 0.8]}, {"mesh": 0, "scale": [-1, 2, 1], "translation": [5, 6, 7]}]
MATERIALS = [
    {"name": "A\nb", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "baseColorFactor": [1, 0.2, 0.4, 1]}},
    {"name": "B", "pbrMetallicRoughness": {"baseColorTexture": {"index": 1}}, "normalTexture": {"index": 1}},
]
SOURCES = {
    "textured OBJ": {**textured_obj(), "a.png": PNG, "b.jpg": JPEG},
    "coloured PLY": coloured_ply(),
    "PLY with colours of faces": face_coloured_ply(),
    "STL": stl(),
    "OFF": off(),
    "3MF": {
        "a.3mf": archive(model(mesh(attributes=' name="n"') + mesh(2), '<item objectid="1"/><item objectid="2"/>'))
    },
    "GLB": glb(),
    "GLB of nodes": glb(nodes=TURNED),
    "GLB of textures": glb(
        {"TEXCOORD_0": (UV, False)}, images=[(PNG, "image/png"), (JPEG, "image/jpeg")], materials=MATERIALS
    ),
    "quantised GLB": glb(positions=(CORNERS * 100).astype("<u2"), nodes=[{"mesh": 0, "scale": [0.01] * 3}]),
}


def asset_of(files):
    return open_asset(Source(Path(next(iter(files))), files))


def converted(files, suffix):
    return convert(asset_of(files), Path(f"out{suffix}"), open_asset)


def all_corners(asset):
    """The corners (m, 9) of an asset, sorted and each from its least one."""
    corners = [
        (part.vertices @ place[:3, :3].T + place[:3, 3])[part.triangles[:, :: -1 if np.linalg.det(place) < 0 else 1]]
        for part in asset.parts
        for place in part.placements
    ]
    turned = [min(tuple(np.roll(each, turn, axis=0).ravel()) for turn in range(3)) for each in np.concatenate(corners)]
    return np.array(sorted(turned))


@pytest.mark.parametrize("suffix", TARGETS)
@pytest.mark.parametrize("files", SOURCES.values(), ids=SOURCES.keys())
def test_shapes_arrive_and_losses_are_said(files, suffix):
    before = asset_of(files)
    if before.path.suffix == suffix:
        return
    done = convert(before, Path(f"out{suffix}"), open_asset)
    assert f"out{suffix}" in done.files
    wanted = all_corners(before)
    np.testing.assert_allclose(all_corners(done.asset), wanted, rtol=0, atol=1e-5)
    if suffix not in (".glb", ".gltf"):
        np.testing.assert_allclose(triangles_of(f"out{suffix}", done.files[f"out{suffix}"]), wanted, rtol=0, atol=1e-5)
    assert before.contents <= done.asset.contents | set(done.dropped)
    order = [KINDS.index(word) for word in done.dropped if word in KINDS]
    assert order == sorted(order)


def test_what_formats_hold_is_not_dropped():
    assert dropped(asset_of(SOURCES["coloured PLY"]), converted(SOURCES["coloured PLY"], ".glb").asset) == (
        "polygons",
        "property quality",
    )
    assert converted(SOURCES["coloured PLY"], ".obj").dropped == ("polygons", "property quality")
    assert converted(SOURCES["GLB of textures"], ".obj").dropped == ()
    assert converted(SOURCES["GLB"], ".ply").dropped == ("names",)
    assert "texture coordinates" in converted(SOURCES["GLB of textures"], ".ply").dropped


def test_digits_are_kept():
    """In double precision where the format has it, and in text."""
    shift = (1 / 3, np.pi * 1e6, -1e-9)
    files = {**textured_obj(shift), "a.png": PNG, "b.jpg": JPEG}
    wanted = all_corners(asset_of(files))
    for suffix in (".ply", ".off", ".3mf"):
        np.testing.assert_array_equal(all_corners(converted(files, suffix).asset), wanted)


def test_far_meshes_keep_their_digits_through_a_node():
    """Metres of UTM in float32 are half a metre apart; a node of glTF has double precision."""
    files = {**textured_obj((448262.404431, 5411934.18525, 134.0)), "a.png": PNG, "b.jpg": JPEG}
    done = converted(files, ".glb")
    np.testing.assert_allclose(all_corners(done.asset), all_corners(asset_of(files)), rtol=0, atol=1e-6)
    assert np.abs(done.asset.parts[0].vertices).max() < 10


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_textures_of_an_obj_arrive_byte_by_byte(suffix):
    """In one mesh, whose materials have the names, colours and roughness of the library, and are no metal."""
    tree, content = tree_of(converted(SOURCES["textured OBJ"], suffix).files)
    assert len(tree["meshes"]) == 1
    found = {}
    for material in tree["materials"]:
        look = material["pbrMetallicRoughness"]
        image = tree["images"][tree["textures"][look["baseColorTexture"]["index"]]["source"]]
        found[material["name"]] = view_of(tree, content, image["bufferView"]), image["mimeType"]
        assert look["metallicFactor"] == 0
    assert {name: kind for name, (_, kind) in found.items()} == {"one": "image/png", "two": "image/jpeg"}
    assert found["one"][0].rstrip(b"\0") == PNG.rstrip(b"\0")
    assert found["two"][0].rstrip(b"\0") == JPEG.rstrip(b"\0")
    looks = {each["name"]: each["pbrMetallicRoughness"]["baseColorFactor"] for each in tree["materials"]}
    np.testing.assert_allclose(looks["one"], [0.5, 0.25, 1, 1], atol=0.01)
    np.testing.assert_allclose(looks["two"], [1, 1, 1, 1])


def test_texture_coordinates_stay_at_their_corners():
    tree, content = tree_of(converted(SOURCES["textured OBJ"], ".glb").files)
    for primitive in tree["meshes"][0]["primitives"]:
        uv = floats_of(tree, content, primitive["attributes"]["TEXCOORD_0"])
        assert {tuple(row) for row in uv.tolist()} == {(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)}
    text = converted(SOURCES["GLB of textures"], ".obj").files["out.obj"].decode()
    assert "vt 0.25 0.5" in text


def test_pictures_of_other_formats_become_png():
    bitmap = picture("BMP")
    files = {**textured_obj(maps=("a.bmp", "b.jpg")), "a.bmp": bitmap, "b.jpg": JPEG}
    tree, content = tree_of(converted(files, ".glb").files)
    pictures = {image["mimeType"]: view_of(tree, content, image["bufferView"]) for image in tree["images"]}
    image = Image.open(io.BytesIO(pictures["image/png"]))
    np.testing.assert_array_equal(np.asarray(image), np.asarray(Image.open(io.BytesIO(bitmap))))


def test_pictures_of_a_glb_lie_beside_an_obj():
    files = converted(SOURCES["GLB of textures"], ".obj").files
    assert {name: content for name, content in files.items() if name[-4:] in (".png", ".jpg")} == {
        "out.png": PNG,
        "out1.jpg": JPEG,
    }
    library = files["out.mtl"].decode()
    assert "newmtl A b\n" in library  # on one line
    assert "norm out1.jpg" in library
    assert files["out.obj"].decode().count("usemtl") == 2


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_a_conversion_that_would_lose_textures_is_refused(suffix):
    files = {**textured_obj(), "a.png": PNG}
    with pytest.raises(MeshError, match=r"b\.jpg"):
        converted(files, suffix)
    with pytest.raises(MeshError, match="textures"):
        converted({**files, "b.jpg": b"no picture"}, suffix)
    assert "textures" in converted(files, ".stl").dropped


def test_pictures_without_coordinates_are_dropped_and_said():
    """Nothing says how they lie on the mesh, so that no program draws them."""
    obj = re.sub(rb"/\d", b"", re.sub(rb"vt .*\n", b"", textured_obj()["box.obj"]))
    done = converted({**textured_obj(), "box.obj": obj, "a.png": PNG, "b.jpg": JPEG}, ".glb")
    assert "textures" in done.dropped
    assert "images" not in tree_of(done.files)[0]


def test_an_obj_textured_in_part_keeps_its_textures():
    """Whatever form corners without texture coordinates have."""
    files = {**textured_obj(), "a.png": PNG, "b.jpg": JPEG}
    lines = files["box.obj"].split(b"\n")
    faces = [number for number, line in enumerate(lines) if line.startswith(b"f ")]
    lines[faces[0]] = re.sub(rb"/\d", b"", lines[faces[0]])
    lines[faces[4]] = re.sub(rb"/\d", b"//1", lines[faces[4]])
    files["box.obj"] = b"vn 0 0 1\n" + b"\n".join(lines)
    tree, content = tree_of(converted(files, ".glb").files)
    assert len(tree["images"]) == 2
    for primitive in tree["meshes"][0]["primitives"]:
        uv = floats_of(tree, content, primitive["attributes"]["TEXCOORD_0"])
        assert {tuple(row) for row in uv.tolist()} == {(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)}


def test_maps_that_have_no_counterpart_are_named():
    files = {**textured_obj(extra="map_Bump b.jpg\n"), "a.png": PNG, "b.jpg": JPEG}
    assert "texture map_Bump" in converted(files, ".glb").dropped


def test_pictures_outside_of_the_folder_are_refused(tmp_path):
    (tmp_path / "secret.png").write_bytes(PNG)
    (tmp_path / "in").mkdir()
    for name, content in {**textured_obj(maps=("../secret.png", "b.jpg")), "b.jpg": JPEG}.items():
        (tmp_path / "in" / name).write_bytes(content)
    with pytest.raises(MeshError, match="leaves its folder"):
        convert(Obj(Source(tmp_path / "in" / "box.obj")), Path("out.glb"), open_asset)


def test_there_and_back_glb_and_gltf_lose_nothing():
    files = SOURCES["GLB of textures"]
    there = converted(files, ".gltf")
    assert there.dropped == ()
    back = convert(asset_of({"out.gltf": there.files["out.gltf"], **there.files}), Path("a.glb"), open_asset)
    (tree, content), (again, content_again) = tree_of(files), tree_of(back.files)
    assert tree == again
    assert content.rstrip(b"\0") == content_again.rstrip(b"\0")


def test_files_of_a_gltf_go_into_the_glb():
    """Buffers and images; data that stand in the text stay there."""
    tree, content = tree_of(SOURCES["GLB of textures"])
    half = tree["bufferViews"][2]["byteOffset"]
    for view in tree["bufferViews"][2:]:
        view |= {"buffer": 1, "byteOffset": view["byteOffset"] - half}
    tree["buffers"] = [{"uri": "a%20b.bin", "byteLength": half}, {"uri": "c.bin", "byteLength": len(content) - half}]
    tree["images"] = [{"uri": "a.png"}, {"uri": "data:image/jpeg;base64,AAAA"}]
    files = {"a.gltf": json.dumps(tree).encode(), "a b.bin": content[:half], "c.bin": content[half:], "a.png": PNG}
    whole = packed(Source(Path("a.gltf"), files))
    (after, data) = tree_of({"a.glb": whole.glb()})
    assert len(after["buffers"]) == 1
    assert after["images"][0]["mimeType"] == "image/png"
    assert view_of(after, data, after["images"][0]["bufferView"]) == PNG
    assert after["images"][1] == {"uri": "data:image/jpeg;base64,AAAA"}
    for number in range(len(tree["bufferViews"])):
        assert view_of(after, data, number) == view_of(*tree_of(SOURCES["GLB of textures"]), number)


def test_quantised_attributes_arrive_as_what_they_stand_for():
    colours = np.array([[65535, 0, 32768, 65535]] * 8, "<u2")
    attributes = {"TEXCOORD_0": ((UV * 65535).round().astype("<u2"), True), "COLOR_0": (colours, True)}
    transform = {"extensions": {"KHR_texture_transform": {"scale": [0.5, 0.5], "offset": [0.25, 0]}}, "index": 0}
    materials = [{"pbrMetallicRoughness": {"baseColorTexture": transform}}] * 2
    files = glb(attributes, images=[(PNG, "image/png")], materials=materials)
    text = converted(files, ".obj").files["out.obj"].decode()
    rows = np.array([line.split()[1:] for line in text.splitlines() if line.startswith("vt ")], float)
    np.testing.assert_allclose(rows[:2], [[0.375, 0.75], [0.75, 1.0]], atol=1e-4)  # v counts from the other side
    content = converted(glb({"COLOR_0": (colours, True)}), ".ply").files["out.ply"]
    row = np.dtype([("xyz", "<f8", 3), ("rgba", "u1", 4)])
    table = np.frombuffer(content.partition(b"end_header\n")[2], row, 8)
    np.testing.assert_array_equal(table["rgba"][0], [255, 0, 128, 255])


def test_normals_turn_with_mirrored_nodes():
    normals = (CORNERS - CORNERS.mean(axis=0)).astype("<f4")
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    text = converted(glb({"NORMAL": (normals, False)}, nodes=TURNED), ".obj").files["out.obj"].decode()
    lines = [line.split() for line in text.splitlines()]
    v, vn = (np.array([line[1:4] for line in lines if line[0] == word], float) for word in ("v", "vn"))
    faces = [[[int(index) - 1 for index in word.split("//")] for word in line[1:]] for line in lines if line[0] == "f"]
    for (a, na), (b, _), (c, _) in faces:
        assert np.cross(v[b] - v[a], v[c] - v[a]) @ vn[na] > 0  # outward, as the triangles wind


def test_unknown_endings_and_clouds_are_refused():
    with pytest.raises(MeshError, match=r"\.xyz"):
        converted(stl(), ".xyz")
    properties = "".join(f"property float {axis}\n" for axis in "xyz")
    cloud = f"ply\nformat ascii 1.0\nelement vertex 1\n{properties}end_header\n1 2 3\n".encode()
    with pytest.raises(MeshError, match="no triangle"):
        converted({"a.ply": cloud}, ".obj")


def test_what_trimesh_reads_wrongly_goes_as_shape_alone(monkeypatch):
    """And where that is wrong too, the conversion is refused."""
    from o3dmark.files.conversion import scene

    def broken(*_, **__):
        raise KeyError("of trimesh")

    monkeypatch.setattr(scene, "loaded", broken)
    assert "vertex colours" in converted(coloured_ply(), ".obj").dropped
    module = importlib.import_module("o3dmark.files.conversion")  # the package has a function of that name
    monkeypatch.setitem(module._PLAIN, ".stl", lambda _: stl()["a.stl"])
    with pytest.raises(BackendError, match="triangles"):
        converted(SOURCES["GLB of nodes"], ".stl")


class Shape(Asset):
    """Vertices and triangles, for comparison."""

    contents = frozenset()

    def __init__(self, vertices, triangles):
        self.parts = (Part("shape", np.array(vertices, float), np.array(triangles, np.int64).reshape(-1, 3)),)

    def with_positions(self, moved, names=None):
        raise NotImplementedError


@settings(max_examples=20, deadline=None)
@given(st.permutations(range(len(TRIANGLES))), st.lists(st.integers(0, 2), min_size=12, max_size=12))
def test_order_is_no_matter_to_a_shape(order, turns):
    turned = [np.roll(TRIANGLES[number], turn) for number, turn in zip(order, turns, strict=True)]
    shape = Shape(CORNERS, TRIANGLES)
    assert same_shape(shape, Shape(CORNERS, turned))
    assert same_shape(shape, Shape(CORNERS + 1e-8, turned))
    assert same_shape(Shape(CORNERS + 0.1, TRIANGLES), Shape((CORNERS + 0.1).astype(np.float32), turned))
    assert not same_shape(shape, Shape(CORNERS * [1, 1, 1.0001], turned))
    assert not same_shape(shape, Shape(CORNERS, [turned[0][::-1], *turned[1:]]))
    assert not same_shape(shape, Shape(CORNERS, turned[1:]))


def test_every_case_converts(shared):
    """Into every format, but where the reason is clear; nothing that is dropped goes unsaid."""
    for path in sorted(shared("cases").rglob("*")):
        if path.suffix not in ASSETS:
            continue
        before = open_asset(Source(path))
        for suffix in TARGETS:
            if suffix == path.suffix:
                continue
            try:
                done = convert(before, Path(f"out{suffix}"), open_asset)
            except MeshError as error:
                assert "x.mtl" in str(error) or "no triangle" in str(error)  # noqa: PT017
                continue
            assert before.contents <= done.asset.contents | set(done.dropped)
