"""Views that meshoptimizer compressed: read, and written back compressed alike, with nothing left of what was there."""

import importlib
import json
import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fixtures.gltf_files import BUMPY, Case, waved
from fixtures.gltf_packed import EXTENT, MeshoptBuilder, meshopt, octahedral
from o3dmark.errors import MeshError
from o3dmark.files.asset import float_steps
from o3dmark.files.gltf import Gltf
from o3dmark.files.gltf import meshopt_codec as codec

pytest.importorskip("meshoptimizer")

KINDS = {
    "whole numbers": {},
    "exponential filter": {"positions": "<f4"},
    "Khronos' name": {"extension": "KHR_meshopt_compression", "version": 1},
    "plain beside": {"fallback": True},
    "plain beside, exponential": {"fallback": True, "positions": "<f4"},
}


@pytest.fixture(params=KINDS)
def case(request) -> Case:
    return meshopt(**KINDS[request.param])


def parts_of(case: Case) -> tuple[dict[str, Any], bytes]:
    content = case.files[case.name]
    n = struct.unpack_from("<I", content, 12)[0]
    return json.loads(content[20 : 20 + n]), content[28 + n :]


def extension(view: dict[str, Any]) -> dict[str, Any]:
    return next(iter(view["extensions"].values()))


def packed(case: Case, number: int) -> bytes:
    value, binary = parts_of(case)
    fields = extension(value["bufferViews"][number])
    return binary[fields["byteOffset"] : fields["byteOffset"] + fields["byteLength"]]


def rows(case: Case, number: int) -> np.ndarray:
    """What view ``number`` holds (n, stride), by the library itself."""
    import meshoptimizer

    fields = extension(parts_of(case)[0]["bufferViews"][number])
    count, stride, content = fields["count"], fields["byteStride"], packed(case, number)
    if fields["mode"] == "TRIANGLES":
        return meshoptimizer.decode_index_buffer(count, 4, content)
    if fields["mode"] == "INDICES":
        return meshoptimizer.decode_index_sequence(count, 4, content)
    decoded = meshoptimizer.decode_vertex_buffer(count, stride, content, dtype=np.dtype((np.uint8, stride)))
    if "filter" in fields:
        decode = {"OCTAHEDRAL": meshoptimizer.decode_filter_oct, "EXPONENTIAL": meshoptimizer.decode_filter_exp}
        decoded = decode[fields["filter"]](decoded, count, stride)
    return decoded


def without_places(case: Case) -> dict[str, Any]:
    """The JSON but for bounds, and for where compressed bytes are."""
    value, _ = parts_of(case)
    value["buffers"][0]["byteLength"] = None
    for view in value["bufferViews"]:
        extension(view).update(byteOffset=None, byteLength=None)
    value["accessors"][0].update(min=None, max=None)
    return value


def after(case: Case, amount: float = 0.01) -> Case:
    asset = Gltf(case.source)
    return case.with_files(asset.with_positions({0: waved(asset.parts[0].vertices, amount)}))


def test_what_is_compressed_is_read(case):
    [part] = Gltf(case.source).parts
    first = part.triangles.argmin(axis=1)[:, None]  # the codec turns triangles
    turned = np.take_along_axis(part.triangles, (first + np.arange(3)) % 3, axis=1)
    assert (part.fixed, np.array_equal(turned, BUMPY.triangles)) == ("", True)
    if part.vertices.max() > 100:
        np.testing.assert_array_equal(part.vertices, rows(case, 0).view("<u2")[:, :3])
        assert part.steps.tolist() == [1.0] * 3
    else:
        np.testing.assert_array_equal(part.vertices, rows(case, 0).view("<f4"))
        np.testing.assert_allclose(part.vertices, BUMPY.vertices, atol=2.0**-14)
        assert np.array_equal(part.vertices / part.steps, np.rint(part.vertices / part.steps))


def test_where_nothing_moves_every_byte_stays(case):
    asset = Gltf(case.source)
    assert asset.with_positions({0: asset.parts[0].vertices}) == case.files


def test_only_positions_and_normals_change(case):
    new = after(case)
    assert without_places(new) == without_places(case)
    for number in (2, 3, 4):
        assert packed(new, number) == packed(case, number)
    assert not np.array_equal(rows(new, 0), rows(case, 0))
    assert not np.array_equal(rows(new, 1), rows(case, 1))
    assert set(new.files) == set(case.files)


def test_the_nearest_numbers_are_written(case):
    asset = Gltf(case.source)
    wanted = waved(asset.parts[0].vertices)
    again = Gltf(after(case).source).parts[0]
    steps = 0.5 * np.maximum(asset.parts[0].steps, again.steps) + float_steps(wanted)  # by way of float32
    assert (np.abs(again.vertices - wanted) <= steps).all()


def test_nothing_stays_of_what_was_there(case):
    new = after(case)
    for number in (0, 1):
        assert packed(case, number)[:40] not in new.files[new.name]


def test_bounds_are_those_of_the_numbers(case):
    new = after(case, 0.05)
    accessor = parts_of(new)[0]["accessors"][0]
    numbers = rows(new, 0).view("<u2")[:, :3] if accessor["componentType"] == 5123 else rows(new, 0).view("<f4")
    assert np.array_equal(np.array(accessor["min"], numbers.dtype), numbers.min(axis=0))
    assert np.array_equal(np.array(accessor["max"], numbers.dtype), numbers.max(axis=0))


def test_the_version_of_the_codec_stays():
    for name in KINDS:
        old = meshopt(**KINDS[name])
        assert packed(after(old), 0)[0] == packed(old, 0)[0]


def test_normals_turn_and_the_others_keep_their_bytes():
    case = meshopt()
    asset = Gltf(case.source)
    wanted = asset.parts[0].vertices.copy()
    wanted[:17] = waved(wanted)[:17] + np.array([0, 60, 0])
    new = case.with_files(asset.with_positions({0: wanted}))
    before, now = rows(case, 1).view("<i1"), rows(new, 1).view("<i1")
    assert np.array_equal(before[34:], now[34:])
    assert (before[:17] != now[:17]).any()
    lengths = np.linalg.norm(now[:, :3].astype(float), axis=1)
    assert np.abs(lengths - 127.0).max() < 1.0
    turned = (before[:, :3].astype(float) * now[:, :3]).sum(axis=1) / 127.0**2
    assert turned.min() > 0.9


def test_the_plain_copy_changes_alike():
    case = meshopt(fallback=True)
    asset = Gltf(case.source)
    assert (asset.references, asset.changing) == (("plain.bin",), ("plain.bin",))
    new = after(case)
    view = parts_of(new)[0]["bufferViews"][0]
    plain = new.files["plain.bin"][view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
    assert plain == rows(new, 0).tobytes()
    changed = np.frombuffer(new.files["plain.bin"], np.uint8) != np.frombuffer(case.files["plain.bin"], np.uint8)
    uv = parts_of(new)[0]["bufferViews"][2]
    assert not changed[uv["byteOffset"] :].any()


def test_the_plain_copy_need_not_be_there():
    case = meshopt(fallback=True)
    asset = Gltf(Case(case.name, {case.name: case.files[case.name]}).source)
    assert (asset.references, asset.changing) == (("plain.bin",), ())
    assert set(asset.with_positions({0: waved(asset.parts[0].vertices)})) == {case.name}


def test_longer_bytes_go_behind_all_others():
    """Noise takes more bytes than a smooth shape."""
    case = meshopt()
    asset = Gltf(case.source)
    noise = np.random.default_rng(0).normal(size=(170, 3)) * 300
    new = case.with_files(asset.with_positions({0: np.abs(asset.parts[0].vertices + noise)}))
    (old_value, old), (value, binary) = parts_of(case), parts_of(new)
    place, was = extension(value["bufferViews"][0]), extension(old_value["bufferViews"][0])
    assert place["byteOffset"] >= len(old) - 3 > was["byteOffset"]
    assert place["byteOffset"] + place["byteLength"] <= value["buffers"][0]["byteLength"] <= len(binary)
    assert binary[was["byteOffset"] : was["byteOffset"] + was["byteLength"]] == bytes(was["byteLength"])
    np.testing.assert_allclose(Gltf(new.source).parts[0].vertices, np.abs(asset.parts[0].vertices + noise), atol=0.5)


def test_bytes_that_two_views_share_stay():
    case = meshopt()
    value, binary = parts_of(case)
    value["bufferViews"].append(value["bufferViews"][0])
    value["accessors"].append({**value["accessors"][0], "bufferView": len(value["bufferViews"]) - 1})
    text = json.dumps(value).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    shared = Case("a.glb", {"a.glb": struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks})
    assert "also used for other data" in Gltf(shared.source).parts[0].fixed


def test_without_the_library(monkeypatch):
    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(importlib, "import_module", missing)
    with pytest.raises(MeshError, match=r'meshoptimizer is not installed: pip install "o3dmark\[pipeline\]"'):
        Gltf(meshopt().source)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("mode", "POINTS"),
        ("filter", "COLOUR"),
        ("filter", "QUATERNION"),
        ("byteStride", 6),
        ("count", 200),
        ("byteLength", 3),
        ("byteLength", 10**9),
        ("byteOffset", 1),
        ("buffer", 2),
        ("count", 2**40),
    ],
)
def test_damaged_descriptions(field, value):
    case = meshopt(positions="<f4")
    content = case.files[case.name]
    json_value, binary = parts_of(case)
    for view in json_value["bufferViews"][:1]:
        extension(view)[field] = value
        view["byteLength"] = extension(view)["count"] * extension(view)["byteStride"]
    json_value["buffers"][1]["byteLength"] = 2**60
    text = json.dumps(json_value).encode()
    text += b" " * (-len(text) % 4)
    size = 20 + len(text) + 8 + len(binary)
    damaged = struct.pack("<4sIII4s", b"glTF", 2, size, len(text), b"JSON") + text
    damaged += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    assert len(content) > 0
    with pytest.raises(MeshError, match=r"a\.glb"):
        Gltf(Case("a.glb", {"a.glb": damaged}).source)


floats = st.floats(width=32, allow_nan=False, allow_infinity=False)


@given(st.lists(floats, min_size=1, max_size=20), st.integers(-100, 100))
@settings(deadline=None)
def test_the_exponential_filter_keeps_what_it_can(values, exponent):
    values = np.array(values)
    mantissas, exponents = codec.mantissas_of(values, np.full(len(values), exponent))
    assert (exponents >= exponent).all()
    assert np.abs(mantissas).max() < 2**23
    assert (np.abs(np.ldexp(mantissas.astype(float), exponents) - values) <= np.ldexp(0.5, exponents)).all()
    coarser = exponents > exponent  # only what would not fit
    assert (np.abs(values[coarser]) >= np.ldexp(2.0**23 - 0.5, exponents[coarser] - 1)).all()


@given(st.integers(0, 2**32 - 1), st.sampled_from([4, 8]))
@settings(deadline=None, max_examples=30)
def test_the_octahedral_filter_comes_back(seed, stride):
    import meshoptimizer

    dtype, largest = ("<i1", 127) if stride == 4 else ("<i2", 32767)
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(32, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    rows = np.rint(np.column_stack([directions, rng.uniform(-1, 1, 32)]) * largest).astype(dtype)
    old = np.zeros((32, 4), dtype)
    old[:, 2], old[:, 3] = largest, rows[:, 3]
    filtered = codec.filtered(
        rows.view(np.uint8).reshape(32, stride), "OCTAHEDRAL", old.view(np.uint8).reshape(32, stride)
    )
    back = meshoptimizer.decode_filter_oct(filtered, 32, stride).view(dtype)
    assert np.abs(back.astype(int) - rows).max() <= max(2, largest / 10000)
    assert np.array_equal(back[:, 3], rows[:, 3])


def test_the_fixture_is_what_the_library_says():
    rows, plain = octahedral(BUMPY.normals)
    assert (rows.shape, plain.shape) == ((170, 4), (170, 4))
    assert np.abs(plain[:, :3] / 127 - BUMPY.normals).max() < 0.03
    assert MeshoptBuilder().version == 0
    assert EXTENT > 2
