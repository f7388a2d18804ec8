"""Primitives that Draco compressed: read, and written back compressed, on the grids that they were on."""

import importlib
import json
import struct
from contextlib import nullcontext
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fixtures.gltf_files import BUMPY, Case, bumpy, glb, waved
from fixtures.gltf_packed import draco, of_stream
from o3dmark.errors import MeshError
from o3dmark.files.gltf import Gltf
from o3dmark.files.gltf import draco_codec as codec
from o3dmark.files.gltf.draco_grid import bits_for, step_of

DracoPy = pytest.importorskip("DracoPy")

KINDS = {
    "usual": {},
    "kept order": {"order": True},
    "positions alone": {"more": False},
    "coarse": {"bits": 11},
    "fine": {"bits": 24, "more": False},
}


@pytest.fixture(params=KINDS)
def case(request) -> Case:
    return draco(**KINDS[request.param])


def parts_of(case: Case) -> tuple[dict[str, Any], bytes]:
    content = case.files[case.name]
    n = struct.unpack_from("<I", content, 12)[0]
    return json.loads(content[20 : 20 + n]), content[28 + n :]


def extension(case: Case) -> dict[str, Any]:
    return parts_of(case)[0]["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]


def packed(case: Case) -> bytes:
    value, binary = parts_of(case)
    view = value["bufferViews"][extension(case)["bufferView"]]
    return binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]


def attributes(case: Case) -> dict[str, np.ndarray]:
    """The numbers of each attribute, by the name that the glTF gives it; and the triangles."""
    mesh = DracoPy.decode(packed(case))
    by_id = {each["unique_id"]: each["data"] for each in mesh.attributes}
    return {"triangles": mesh.faces} | {name: by_id[number] for name, number in extension(case)["attributes"].items()}


def with_json(case: Case, change) -> Case:
    value, binary = parts_of(case)
    change(value)
    return Case(case.name, {case.name: glb(json.dumps(value).encode(), binary)})


def after(case: Case, amount: float = 0.01) -> Case:
    asset = Gltf(case.source)
    return case.with_files(asset.with_positions({0: waved(asset.parts[0].vertices, amount)}))


def test_what_is_compressed_is_read(case):
    [part] = Gltf(case.source).parts
    found = attributes(case)
    assert (part.name, part.fixed) == ("Bust", "")
    np.testing.assert_array_equal(part.vertices, found["POSITION"])
    np.testing.assert_array_equal(part.triangles, found["triangles"])


def test_where_nothing_moves_every_byte_stays(case):
    asset = Gltf(case.source)
    assert asset.with_positions({0: asset.parts[0].vertices}) == case.files


def test_only_positions_and_normals_change(case):
    old, new = attributes(case), attributes(after(case))
    assert set(old) == set(new)
    for name in set(old) - {"POSITION", "NORMAL"}:
        assert np.array_equal(old[name], new[name])
        assert old[name].dtype == new[name].dtype
    assert all((old[name] != new[name]).any() for name in {"POSITION", "NORMAL"} & set(old))


def test_the_json_changes_in_bounds_places_and_ids_only(case):
    def neutral(value):
        value["accessors"][[*extension(case)["attributes"]].index("POSITION")].update(min=None, max=None)
        for primitive in value["meshes"][0]["primitives"]:
            ids = primitive["extensions"]["KHR_draco_mesh_compression"]["attributes"]
            ids.update(dict.fromkeys(ids))
        value["bufferViews"][extension(case)["bufferView"]].update(byteOffset=None, byteLength=None)
        value["buffers"][0]["byteLength"] = None
        return value

    assert neutral(parts_of(after(case))[0]) == neutral(parts_of(case)[0])


def test_positions_stay_on_their_grid(case):
    asset = Gltf(case.source)
    wanted = waved(asset.parts[0].vertices)
    again = Gltf(after(case).source).parts[0]
    error = np.abs(again.vertices - wanted)
    assert (error <= asset.parts[0].steps).all()
    assert (error <= 0.51 * asset.parts[0].steps).mean() > 0.95
    assert np.array_equal(again.triangles, asset.parts[0].triangles)


def test_bounds_are_those_of_the_numbers(case):
    new = after(case, 0.05)
    accessor = parts_of(new)[0]["accessors"][[*extension(new)["attributes"]].index("POSITION")]
    positions = attributes(new)["POSITION"]
    assert np.array_equal(np.array(accessor["min"], np.float32), positions.min(axis=0))
    assert np.array_equal(np.array(accessor["max"], np.float32), positions.max(axis=0))


def test_equal_positions_stay_equal(case):
    old, new = attributes(case)["POSITION"], attributes(after(case))["POSITION"]
    _, place = np.unique(old, axis=0, return_inverse=True)
    for group in np.unique(place):
        rows = new[place.ravel() == group]
        assert (rows == rows[0]).all()


def test_nothing_stays_of_what_was_there(case):
    assert packed(case)[-40:] not in after(case).files["a.glb"]


def test_a_second_marking_finds_the_same_grid():
    case = draco()
    steps = [Gltf(each.source).parts[0].steps.max() for each in (case, after(case), after(after(case)))]
    assert max(steps) / min(steps) < 4


def test_what_the_library_cannot_write_is_left(monkeypatch):
    monkeypatch.setattr(codec, "_WRITTEN", ("float32", "uint8"))
    [part] = Gltf(draco().source).parts
    assert len(part.vertices)
    assert part.fixed.endswith("decompress the file first, with `gltf-transform copy IN OUT`")
    with pytest.raises(MeshError, match="of a type that DracoPy does not write"):
        Gltf(draco().source).with_positions({0: part.vertices})


@pytest.mark.parametrize(("scale", "fits"), [(1.0, True), (1e30, True), (1e-30, True), (1e-36, False)])
def test_positions_too_small_for_the_arithmetic_of_the_library_are_refused(scale, fits):
    packed = DracoPy.encode(BUMPY.vertices.astype(float), BUMPY.triangles.astype(np.uint32), preserve_order=True)
    mesh = codec.decoded("a.glb", packed)
    wanted = {mesh.first: (scale * mesh.positions.astype(np.float64)).astype(np.float32)}
    with nullcontext() if fits else pytest.raises(MeshError, match="does not write back"):
        codec.encoded("a.glb", mesh, wanted, 14)


def test_what_is_there_twice_is_left():
    def twice(value):
        place = value["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
        value["bufferViews"].append({"buffer": 0, "byteLength": 12 * value["accessors"][place]["count"]})
        value["accessors"][place]["bufferView"] = len(value["bufferViews"]) - 1

    assert "in the file uncompressed as well" in Gltf(with_json(draco(order=True), twice).source).parts[0].fixed


def test_two_primitives_of_one_stream():
    def second(value):
        value["meshes"][0]["primitives"].append(value["meshes"][0]["primitives"][0] | {"material": 0})
        value["materials"] = [{}]

    case = with_json(draco(), second)
    new = after(case)
    ids = [
        each["extensions"]["KHR_draco_mesh_compression"]["attributes"]
        for each in parts_of(new)[0]["meshes"][0]["primitives"]
    ]
    assert ids[0] == ids[1]
    assert len(attributes(new)["POSITION"]) == len(Gltf(case.source).parts[0].vertices)


def test_two_views_of_one_stream():
    def second(value):
        other = json.loads(json.dumps(value["meshes"][0]["primitives"][0]))
        value["bufferViews"].append(value["bufferViews"][0])
        other["extensions"]["KHR_draco_mesh_compression"]["bufferView"] = 1
        value["meshes"].append({"primitives": [other]})

    assert all("also used for other data" in part.fixed for part in Gltf(with_json(draco(), second).source).parts)


def test_without_the_library(monkeypatch):
    def missing(name):
        raise ImportError(name)

    case = draco()
    monkeypatch.setattr(importlib, "import_module", missing)
    with pytest.raises(MeshError, match=r'DracoPy is not installed: pip install "o3dmark\[pipeline\]"'):
        Gltf(case.source)


@pytest.mark.parametrize(
    "change",
    [
        lambda value: value["accessors"][-1].update(count=3),
        lambda value: value["accessors"][0].update(count=3),
        lambda value: value["accessors"][0].update(componentType=5123),
        lambda value: value["bufferViews"][0].update(byteLength=30),
        lambda value: value["bufferViews"][0].update(byteOffset=4),
        lambda value: value["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"].update(
            bufferView=9
        ),
        lambda value: value["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"].update(
            attributes={"POSITION": 99}
        ),
    ],
)
def test_damaged_descriptions(change):
    with pytest.raises(MeshError, match=r"^a\.glb"):
        Gltf(with_json(draco(more=False), change).source)


@given(st.integers(0, 10**6), st.integers(0, 255))
@settings(deadline=None, max_examples=60)
def test_damaged_streams(place, byte):
    case = draco(more=False)
    content = bytearray(case.files["a.glb"])
    start = content.index(b"DRACO")
    content[start + place % (len(content) - start)] = byte
    try:
        asset = Gltf(Case("a.glb", {"a.glb": bytes(content)}).source)
    except MeshError:
        return
    assert [part.vertices.shape[1] for part in asset.parts] == [3]


def test_counts_are_seen_before_anything_is_decoded():
    plain = DracoPy.encode(BUMPY.vertices.astype(float), BUMPY.triangles.astype(np.uint32), preserve_order=True)
    noted = DracoPy.encode(
        BUMPY.vertices.astype(float),
        BUMPY.triangles.astype(np.uint32),
        quantization_range=3.0,
        quantization_origin=[-2, -2, -2],
        create_metadata=True,
        generic_attributes={"name": np.zeros((170, 1), np.float32)},
    )
    assert codec.counts("x", plain) == (len(BUMPY.triangles), len(BUMPY.vertices))
    assert codec.counts("x", noted)[0] == len(BUMPY.triangles)
    assert codec.counts("x", noted)[1] <= len(BUMPY.vertices)
    for damaged in (b"", b"DRACO", plain[:11], b"DRACO\x01\x00\x01" + plain[8:], plain[:7] + b"\x00" + plain[8:]):
        with pytest.raises(MeshError, match="no mesh that Draco"):
            codec.counts("x", damaged)


@given(
    st.integers(8, 18),
    st.sampled_from([1e-3, 1.0, 37.3, 5e4]),
    st.sampled_from([0.0, 3.0]),
    st.sampled_from([1.0, 0.37]),
    st.integers(0, 2**32 - 1),
)
@settings(deadline=None, max_examples=50)
def test_a_grid_is_found_again(bits, size, away, part, seed):
    """Whether it is that of the box of the positions, or of a larger one: every position lies on the one found."""
    rng = np.random.default_rng(seed)
    count = (1 << bits) - 1
    delta, origin = np.float32(np.float32(size) / np.float32(count)), (rng.random(3) * away * size).astype(np.float32)
    places = rng.integers(0, max(int(count * part), 1) + 1, (3000, 3))
    places[:2] = [[0] * 3, [max(int(count * part), 1)] * 3]
    positions = (places.astype(np.float32) * delta + origin).astype(float)
    step = step_of(positions)
    assert step <= 1.01 * delta
    offsets = (positions - positions.min(axis=0)) / step
    if step > 16 * np.spacing(np.float32(np.abs(positions).max())):
        assert np.abs(offsets - np.rint(offsets)).max() < 0.3
    extent = np.ptp(positions, axis=0).max()
    assert extent / ((1 << bits_for(positions, step)) - 1) <= 1.001 * step
    assert extent / ((1 << (bits_for(positions, step) - 1)) - 1) > step


def test_a_large_primitive_takes_less_than_plain_numbers():
    shape = bumpy(60, 100)
    plain = 12 * len(shape.vertices) + 6 * len(shape.triangles)
    stream = DracoPy.encode(shape.vertices.astype(float), shape.triangles.astype(np.uint32), quantization_bits=14)
    assert len(packed(after(of_stream(stream)))) < 0.75 * plain
