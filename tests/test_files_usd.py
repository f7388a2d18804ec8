"""USD: the layer comes back with nothing but points, and what follows from them, changed."""

import io
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fixtures.usd_files import CUBE, POINTS, crate, offsets, package, tetra, without_arrays
from o3dmark.errors import MeshError
from o3dmark.files import convert, open_asset
from o3dmark.files.references import Source
from o3dmark.files.usd import Usd
from o3dmark.files.usd import text as usd_text

try:
    import pxr  # noqa: F401

    MISSING = ""
except ImportError:
    MISSING = "usd-core is not installed"
needs_library = pytest.mark.skipif(bool(MISSING), reason=MISSING)
SHIFT = np.array([0.125, -1 / 3, 1e-3])


def opened(files, name=None):
    name = name or next(iter(files))
    return Usd(Source(Path(name), files))


def values(content, name="a.usda"):
    """All attributes of a layer: path -> value, as the library reads them."""
    from pxr import Sdf

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(content)
        layer, found = Sdf.Layer.FindOrOpen(str(path)), {}
        layer.Traverse(
            "/", lambda at: found.update({str(at): layer.GetAttributeAtPath(at)}) if at.IsPropertyPath() else None
        )
        return {at: str(spec.default) for at, spec in found.items() if spec}


def sheared(vertices):
    return vertices + vertices[:, [1, 2, 0]] * [0.01, 0.002, 0.003]


@needs_library
def test_text_keeps_every_other_character():
    before = CUBE.encode()
    asset = opened({"a.usda": before})
    assert [part.name for part in asset.parts] == ["/World/Box"]
    part = asset.parts[0]
    assert asset.with_positions({}) == {"a.usda": before}
    assert asset.with_positions({0: part.vertices}) == {"a.usda": before}
    new = part.vertices.copy()
    new[6] += SHIFT
    after = asset.with_positions({0: new})["a.usda"]
    assert without_arrays(before) == without_arrays(after)
    assert (
        b"[(0, 0, 0.0), (2.00, 0, 0), (2, 1, 0), (0, 1, 0),\n            (0, 0, 3), (2, 0, 3), (2.125, 0.6666667,"
        in after
    )
    again = opened({"a.usda": after}).parts[0]
    np.testing.assert_array_equal(again.vertices, new.astype(np.float32))
    np.testing.assert_array_equal(again.steps, np.spacing(np.abs(again.vertices).astype(np.float32)))


@needs_library
def test_triangles_places_and_contents():
    asset = opened({"a.usda": CUBE.encode()})
    part = asset.parts[0]
    assert len(part.triangles) == 12
    assert not part.fixed
    places = sorted(part.placements.tolist())
    np.testing.assert_array_equal(places[0], np.diag([-1.0, 2, 1, 1]))  # the reference brings no translation of its own
    np.testing.assert_array_equal(places[1], [[1, 0, 0, 448262.25], [0, 1, 0, 5411934.5], [0, 0, 1, 134], [0, 0, 0, 1]])
    words = {"polygons", "normals", "texture coordinates", "materials", "textures", "names", "nodes", "metadata"}
    assert asset.contents == words | {"comments"}
    assert asset.references == ("a.png",)
    corners = part.vertices[part.triangles]
    volume = np.einsum("md,md->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    assert volume == pytest.approx(6)
    mirrored = opened({"b.usda": tetra().encode()}).parts[0]
    corners = mirrored.vertices[mirrored.triangles]
    assert np.einsum("md,md->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6 == pytest.approx(-1 / 6)


@needs_library
@pytest.mark.parametrize("kind", ["usda", "usdc", "usdz", "usd"])
def test_normals_and_extents_follow(kind):
    text = CUBE.encode()
    content = {"usda": text, "usdc": None, "usdz": None, "usd": text}[kind] or crate(CUBE)
    files = {"usdz": {"a.usdz": package({"scene.usdc": content, "a.png": b"picture"})}}.get(
        kind, {f"a.{kind}": content}
    )
    asset = opened(files)
    new = sheared(asset.parts[0].vertices)
    after = asset.with_positions({0: new})
    again = opened(after)
    np.testing.assert_array_equal(again.parts[0].vertices, new.astype(np.float32))
    before, found = asset._meshes[0], again._meshes[0]
    np.testing.assert_array_equal(found.extent[1], [found.points.min(axis=0), found.points.max(axis=0)])
    corners = new[asset.parts[0].triangles]
    wanted = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    wanted /= np.linalg.norm(wanted, axis=1)[:, None]
    turned = found.normals[1][found.normals[2]][:, 0]
    np.testing.assert_allclose(turned, wanted, atol=0.01)
    assert (before.normals[1] != found.normals[1]).any()


@needs_library
def test_binary_keeps_every_other_byte():
    before = crate(CUBE)
    asset = opened({"a.usdc": before})
    new = asset.parts[0].vertices + np.array([0, 0, 0.25])  # nothing turns, and the extent moves
    after = asset.with_positions({0: new})["a.usdc"]
    assert len(after) == len(before)
    different = np.flatnonzero(np.frombuffer(before, "u1") != np.frombuffer(after, "u1"))
    assert len(different) <= (8 + 2) * 4
    one, other = values(before, "a.usdc"), values(after, "a.usdc")
    assert {path for path in one if one[path] != other[path]} == {"/World/Box.points", "/World/Box.extent"}
    assert one.keys() == other.keys()


@needs_library
def test_meshes_that_share_bytes_move_alone():
    """The binary form keeps equal arrays once."""
    text = tetra() + tetra("U").replace("#usda 1.0\n", "")
    asset = opened({"a.usdc": crate(text)})
    after = asset.with_positions({1: asset.parts[1].vertices + SHIFT})["a.usdc"]
    first, second = opened({"a.usdc": after}).parts
    np.testing.assert_array_equal(first.vertices, asset.parts[0].vertices)
    np.testing.assert_array_equal(second.vertices, (asset.parts[1].vertices + SHIFT).astype(np.float32))


@needs_library
@pytest.mark.parametrize("binary", [False, True])
def test_packages_keep_their_other_files_and_stay_aligned(binary):
    root = crate(CUBE) if binary else CUBE.encode()
    before = package({"scene.usd": root, "a.png": b"\x89PNG" * 99, "b/c.png": b"x"})
    assert all(at % 64 == 0 for at in offsets(before))
    asset = opened({"a.usdz": before})
    assert asset.with_positions({}) == {"a.usdz": before}
    assert asset.references == ()
    after = asset.with_positions({0: asset.parts[0].vertices + SHIFT})["a.usdz"]
    assert all(at % 64 == 0 for at in offsets(after))
    with zipfile.ZipFile(io.BytesIO(after)) as archive:
        assert archive.namelist() == ["scene.usd", "a.png", "b/c.png"]
        assert archive.read("a.png") == b"\x89PNG" * 99
        assert {info.date_time for info in archive.infolist()} == {(2022, 1, 2, 3, 4, 6)}
    np.testing.assert_allclose(opened({"a.usdz": after}).parts[0].vertices, asset.parts[0].vertices + SHIFT, atol=1e-6)


@needs_library
def test_what_cannot_change_in_place_says_why():
    files = {
        "a.usda": b"#usda 1.0\n(\n    subLayers = [@sub/b.usda@]\n)\n",
        "sub/b.usda": (
            tetra()
            + tetra("U", "point3f[] points.timeSamples = {\n1: [(0,0,0), (1,0,0), (0,1,0), (0,0,1)],\n}\n").replace(
                "#usda 1.0\n", ""
            )
        ).encode(),
    }
    asset = opened(files)
    assert asset.references == ("sub/b.usda",)
    reasons = {part.name: part.fixed for part in asset.parts}
    assert "b.usda" in reasons["/T"]
    assert "over time" in reasons["/U"]
    assert all(reasons.values())
    with pytest.raises(MeshError, match=r"b\.usda"):
        asset.with_positions({0: asset.parts[0].vertices + 1})
    double = opened({"a.usda": tetra(points=POINTS.replace("point3f", "point3d")).encode()})
    assert all(part.fixed for part in double.parts)


@needs_library
def test_points_in_a_variant():
    text = (
        '#usda 1.0\ndef Xform "V" (\n    variants = {\n        string shape = "a"\n    }\n'
        '    prepend variantSets = "shape"\n)\n{\n'
        '    variantSet "shape" = {\n        "a" {\n' + tetra("M").replace("#usda 1.0\n", "") + "        }\n"
        '        "b" {\n' + tetra("M", POINTS.replace("0", "7")).replace("#usda 1.0\n", "") + "        }\n    }\n}\n"
    ).encode()
    asset = opened({"a.usda": text})
    assert len(asset.parts) == 1
    assert "variants" in asset.contents
    after = asset.with_positions({0: asset.parts[0].vertices + np.array([0, 0, 0.5])})["a.usda"]
    assert after.replace(b"(0, 0, 0.5), (1, 0, 0.5), (0, 1, 0.5), (0, 0, 1.5)", POINTS[20:-1].encode()) == text


@needs_library
def test_instancers_place_their_prototypes():
    text = tetra("P").replace("#usda 1.0\n", "")
    scene = (
        '#usda 1.0\ndef PointInstancer "I"\n{\n    double3 xformOp:translate = (10, 0, 0)\n'
        '    uniform token[] xformOpOrder = ["xformOp:translate"]\n    rel prototypes = </I/P>\n'
        f"    int[] protoIndices = [0, 0]\n    point3f[] positions = [(1, 0, 0), (0, 2, 0)]\n{text}}}\n"
    )
    part = opened({"a.usda": scene.encode()}).parts[0]
    assert {tuple(place[:3, 3]) for place in part.placements} == {(11, 0, 0), (10, 2, 0)}


@needs_library
@pytest.mark.parametrize("suffix", [".glb", ".obj", ".ply", ".3mf"])
def test_scenes_convert_with_their_shape(suffix):
    asset = opened({"a.usda": CUBE.encode()})
    done = convert(asset, Path(f"out{suffix}"), open_asset)
    assert {"materials", "textures"} <= set(done.dropped)
    places = sum(len(part.triangles) * len(part.placements) for part in done.asset.parts)
    assert places == 24


BAD_FACES = tetra().replace("[3, 3, 3, 3]", "[3, 3, 3, 4]")
REFUSED = {
    "no USD": ({"a.usda": b"solid"}, "damaged"),
    "cut": ({"a.usda": CUBE[:900].encode()}, "damaged"),
    "binary cut": ({"a.usdc": b"PXR-USDC" + bytes(200)}, "damaged"),
    "missing layer": ({"a.usda": b"#usda 1.0\n(\n    subLayers = [@b.usda@]\n)\n"}, "b.usda"),
    "layer outside": (
        {"a.usda": b'#usda 1.0\ndef "A" (\n    references = @../b.usda@\n)\n{\n}\n'},
        "leaves its folder",
    ),
    "absolute layer": (
        {"a.usda": b'#usda 1.0\ndef "A" (\n    payload = @/etc/b.usda@\n)\n{\n}\n'},
        "leaves its folder",
    ),
    "faces": ({"a.usda": BAD_FACES.encode()}, "corners"),
    "a point beyond": ({"a.usda": tetra().replace("[0, 2, 1,", "[0, 2, 9,").encode()}, "beyond"),
    "empty package": ({"a.usdz": package({"a.png": b"x"})}, "no USD layer"),
    "package outside": ({"a.usdz": package({"../a.usda": tetra().encode()})}, "leaves its folder"),
    "damaged package": ({"a.usdz": package({"a.usda": tetra().encode()})[:-30]}, "zip"),
}


@needs_library
@pytest.mark.parametrize(("files", "word"), REFUSED.values(), ids=REFUSED.keys())
def test_refusals(files, word, capfd):
    with pytest.raises(MeshError) as caught:
        opened(files)
    assert word in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")  # the library keeps quiet


def test_without_the_library_the_package_is_named(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(MeshError, match=r"pip install o3dmark\[usd\]"):
        opened({"a.usda": tetra().encode()})


def test_arrays_are_found_by_the_paths_of_attributes():
    """Not in strings, comments, metadata or dictionaries; None where a path is there twice."""
    text = CUBE.encode()
    found = usd_text.arrays("a.usda", text)
    span = found["/World/Box.points"]
    np.testing.assert_array_equal(usd_text.numbers(text, span)[:6], [0, 0, 0, 2, 0, 0])
    assert not [path for path in found if path.startswith(("/No", "/World/Look"))]
    twice = tetra(points=f"{POINTS}\n{POINTS}").encode()
    assert usd_text.arrays("a.usda", twice)["/T.points"] is None
    with pytest.raises(MeshError, match="deep"):
        usd_text.arrays("a.usda", b'def "a" {' * 300)
    with pytest.raises(MeshError, match="never closed"):
        usd_text.arrays("a.usda", b"((" * 9)


@settings(max_examples=50, deadline=None)
@given(
    st.lists(st.floats(-(2.0**90), 2.0**90, width=32), min_size=6, max_size=6),
    st.lists(st.floats(-(2.0**90), 2.0**90, width=32), min_size=6, max_size=6),
)
def test_numbers_in_text_read_back_as_float32(before, after):
    text = ("points = [" + ", ".join(map(repr, before)) + "]").encode()
    span = 10, len(text) - 1
    before, after = np.array(before, np.float32), np.array(after, np.float32)
    np.testing.assert_array_equal(usd_text.numbers(text, span).astype(np.float32), before)
    new = usd_text.with_numbers(text, {span: (before, after)})
    np.testing.assert_array_equal(usd_text.numbers(new, (10, len(new) - 1)).astype(np.float32), after)


@needs_library
@settings(max_examples=60, deadline=None)
@given(st.data())
def test_damaged_text_gives_a_sound_asset_or_a_clear_error(data):
    text = bytearray(CUBE.encode())
    for _ in range(data.draw(st.integers(1, 3))):
        text[data.draw(st.integers(0, len(text) - 1))] = data.draw(st.integers(0, 255))
    try:
        asset = opened({"a.usda": bytes(text)})
        moved = {number: part.vertices + SHIFT for number, part in enumerate(asset.parts) if not part.fixed}
        after = asset.with_positions(moved)
    except MeshError as error:
        assert "\n" not in str(error)  # noqa: PT017
        return
    for number, part in enumerate(opened({"a.usda": after["a.usda"]}).parts):
        if number in moved:
            np.testing.assert_array_equal(part.vertices, moved[number].astype(np.float32))


@needs_library
def test_what_the_library_cannot_write_again_is_refused():
    """A zero character in a name, which the library reads as the name's end, and a field that it does not know."""
    text = CUBE.replace('def Xform "World"', 'def Xform "W\0orld"').replace("references", "refereupAxisnces")
    asset = opened({"a.usda": text.encode()})
    with pytest.raises(MeshError, match="cannot write again"):
        asset.with_positions({0: asset.parts[0].vertices + 0.01})
