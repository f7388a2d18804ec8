"""Damaged glTFs, and those made to do harm, are refused with a sentence, soon, and without taking much memory."""

import copy
import json
import struct
import tracemalloc
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fixtures.gltf_files import BUMPY, CASES, Builder, Case, glb, waved
from fixtures.gltf_packed import quantised
from o3dmark.errors import MeshError
from o3dmark.files.gltf import Gltf

SOME = {name: CASES[name]() for name in ("interleaved", "sparse", "two buffers", "strips", "gpu instances", "data URI")}
SOME["quantised"] = quantised("<i2", normalized=True)


def plain() -> tuple[dict[str, Any], bytes]:
    """The JSON and the binary chunk of a small file."""
    b = Builder()
    attributes = {"POSITION": b.positions(), "NORMAL": b.add(BUMPY.normals)}
    b.mesh({"attributes": attributes, "indices": b.indices()})
    b.json["buffers"] = [{"byteLength": len(b.buffers[0])}]
    return b.json, bytes(b.buffers[0])


def read(value: Any, binary: bytes | None = None) -> Gltf:
    content = value if isinstance(value, bytes) else glb(json.dumps(value).encode(), binary)
    return Gltf(Case("a.glb", {"a.glb": content}).source)


def refused(value: Any, binary: bytes | None = None) -> str:
    with pytest.raises(MeshError, match=r"^a\.glb") as caught:
        read(value, binary)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def survives(case: Case) -> None:
    """Reading gives an asset that can be used, or a sentence."""
    try:
        asset = Gltf(case.source)
        assert all(isinstance(word, str) for word in asset.contents)
        free = {n: waved(part.vertices) for n, part in enumerate(asset.parts) if not part.fixed and len(part.vertices)}
        free = {number: vertices for number, vertices in free.items() if np.isfinite(vertices).all()}
        again = Gltf(case.with_files(asset.with_positions(free)).source)
        assert [part.vertices.shape for part in again.parts] == [part.vertices.shape for part in asset.parts]
        asset.mesh()
    except MeshError as error:
        assert "\n" not in str(error)  # noqa: PT017 - it may be raised anywhere, or not at all


def test_every_cut_of_a_file():
    content = CASES["plain"]().files["a.glb"]
    for length in [*range(1, 120), *range(120, len(content), 97), len(content) - 1]:
        refused(content[:length])


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"Lorem ipsum dolor sit amet", "JSON is damaged"),
        (b"[1, 2]", "is no JSON object"),
        (b"{}", "no glTF 2.0: it has no 'asset'"),
        (b'{"asset": {"version": "1.1"}}', "glTF '1.1'; 2.0 is read"),
        (b'{"asset": {"version": "2.0"}} {}', "something follows it"),
        (b"[" * 100_000, "too deep"),
        (struct.pack("<4sII", b"glTF", 1, 12), "GLB version 1"),
        (struct.pack("<4sII", b"glTF", 2, 99), "truncated: 12 bytes, its header announces 99"),
        (struct.pack("<4sII", b"glTF", 2, 12), "first chunk is not JSON"),
        (struct.pack("<4sIII4s", b"glTF", 2, 20, 2**32 - 1, b"JSON"), "announces 4294967295 bytes, but 0 are left"),
        (struct.pack("<4sII", b"glTF", 2, 12 + 8 * 2000) + struct.pack("<I4s", 0, b"JSON") * 2000, "1000 chunks"),
    ],
)
def test_containers(content, words):
    assert words in refused(content)


CHANGES = {
    "no 'POSITION' of that number": lambda v: v["meshes"][0]["primitives"][0]["attributes"].update(POSITION=9),
    "'indices' should be below 3": lambda v: v["meshes"][0]["primitives"][0].update(indices=3),
    "'bufferView' should be below 3": lambda v: v["accessors"][0].update(bufferView=3),
    "'buffer' should be below 1": lambda v: v["bufferViews"][0].update(buffer=1),
    "reaches to byte": lambda v: v["bufferViews"][0].update(byteLength=10**12),
    "reach beyond its buffer view": lambda v: v["accessors"][0].update(count=10**15),
    "1000000 rows of 12 bytes": lambda v: v["accessors"][0].update(count=10**6),
    "'componentType' should be one of": lambda v: v["accessors"][0].update(componentType=5124),
    "'type' should be SCALAR": lambda v: v["accessors"][0].update(type="VEC5"),
    "POSITION has rows of 2 numbers, not 3": lambda v: v["accessors"][0].update(type="VEC2"),
    "100 rows of NORMAL for 170 positions": lambda v: v["accessors"][1].update(count=100),
    "rows of 12 bytes cannot be 4 apart": lambda v: v["bufferViews"][0].update(byteStride=4),
    "its indices are not whole numbers": lambda v: v["meshes"][0]["primitives"][0].update(indices=1),
    "'mode' should be below 7": lambda v: v["meshes"][0]["primitives"][0].update(mode=7),
    "names vertex 169, but has vertices 0 to 119": lambda v: [v["accessors"][k].update(count=120) for k in (0, 1)],
    "'meshes' should be a list": lambda v: v.update(meshes=3),
    "primitive 0 is no JSON object": lambda v: v["meshes"][0].update(primitives=[[]]),
    "'count' should be a whole number": lambda v: v["accessors"][0].update(count="many"),
    "'byteOffset' should be a whole number": lambda v: v["bufferViews"][1].update(byteOffset=-4),
    "'X_folded'": lambda v: v.update(extensionsRequired=["KHR_mesh_quantization", "X_folded"]),
    "no BIN chunk stands for it": lambda v: (
        v["buffers"].append(v["buffers"][0]) or v["bufferViews"][0].update(buffer=1)
    ),
    "'gone.bin', which is not there": lambda v: v["buffers"][0].update(uri="gone.bin"),
    "which leaves its folder": lambda v: v["buffers"][0].update(uri="../../etc/passwd"),
    "is a damaged data URI": lambda v: v["buffers"][0].update(uri="data:;base64,AAA"),
    "'scene' should be below 1": lambda v: v.update(scene=1),
}


@pytest.mark.parametrize("words", CHANGES)
def test_damaged_descriptions(words):
    value, binary = plain()
    CHANGES[words](value)
    said = refused(value, binary)
    assert words in said or "no 'POSITION'" in words


def test_extensions_that_are_known_are_no_obstacle():
    value, binary = plain()
    value["extensionsRequired"] = [
        "KHR_materials_anything",
        "KHR_texture_basisu",
        "EXT_texture_webp",
        "KHR_lights_punctual",
    ]
    assert len(read(value, binary).parts) == 1


def test_a_truncated_side_file():
    case = CASES["two buffers"]()
    cut = case.with_files({"the positions.bin": case.files["the positions.bin"][:-5]})
    with pytest.raises(MeshError, match=r"a\.gltf, accessor 0 reaches to byte 2040, but there are 2035"):
        Gltf(cut.source)


def test_sparse_rows_out_of_order():
    for listed in ([3, 2, 50, 51, 120], [2, 2, 50, 51, 120], [2, 3, 50, 51, 170]):
        case = CASES["sparse"]()
        content = case.files["a.glb"].replace(
            np.array([2, 3, 50, 51, 120], "<u2").tobytes(), np.array(listed, "<u2").tobytes()
        )
        assert "not ascending and below 170" in refused(content)


BOMBS = {
    "zeros without bytes": lambda v: (
        v["accessors"].append({"componentType": 5126, "count": 2**40, "type": "VEC3"})
        or v["meshes"].append({"primitives": [{"attributes": {"POSITION": 3}}]})
    ),
    "the same triangles in a thousand meshes": lambda v: v.update(
        meshes=[
            {"primitives": [{**v["meshes"][0]["primitives"][0], "mode": mode} for mode in (4, 5, 6)]} for _ in range(3)
        ]
        + [
            {"primitives": [{"attributes": {"POSITION": len(v["accessors"]) - 1}, "indices": 2}]}
            for k in range(800)
            if v["accessors"].append({**v["accessors"][0], "byteOffset": 0, "count": 170, "normalized": bool(k % 2)})
            is None
        ]
    ),
    "the same instances in many nodes": lambda v: v.update(
        nodes=[
            {"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}}}}
            for _ in range(8_000)
        ],
        scenes=[{"nodes": list(range(8_000))}],
    ),
    "windows on the same bytes": lambda v: v.update(
        meshes=[
            {"primitives": [{"attributes": {"POSITION": len(v["accessors"]) - 1}, "mode": 0}]}
            for k in range(800)
            if v["accessors"].append({**v["accessors"][0], "byteOffset": k % 270, "count": 80 - k // 270}) is None
        ]
    ),
}


@pytest.mark.parametrize("name", BOMBS)
def test_bombs(name):
    """Whatever is made of a file of a few hundred kilobytes, it is not much."""
    value, binary = plain()
    BOMBS[name](value)
    case = Case("a.glb", {"a.glb": glb(json.dumps(value).encode(), binary)})
    tracemalloc.start()
    try:
        survives(case)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert most < 10 * len(case.files["a.glb"]) + (256 << 20)


@given(
    st.sampled_from(sorted(SOME)),
    st.lists(st.tuples(st.integers(0, 2**20), st.integers(0, 255)), min_size=1, max_size=6),
    st.integers(0, 400),
)
@settings(deadline=None, max_examples=150, suppress_health_check=[HealthCheck.too_slow])
def test_random_bytes(name, changes, cut):
    case = SOME[name]
    damaged = {}
    for file, content in case.files.items():
        changed = bytearray(content)
        for place, byte in changes:
            changed[place % len(changed)] = byte
        damaged[file] = bytes(changed[: len(changed) - (cut if cut < 40 else 0)])
    survives(Case(case.name, damaged))


WRONG = [
    -1,
    0,
    1,
    3,
    255,
    2**31,
    2**63,
    1e308,
    0.5,
    "",
    "VEC3",
    "MAT4",
    [],
    {},
    [0],
    None,
    True,
    5120,
    5121,
    5126,
    "a.bin",
]


@given(st.sampled_from(sorted(SOME)), st.integers(0, 10**6), st.sampled_from(range(len(WRONG))), st.integers(-8, 8))
@settings(deadline=None, max_examples=300, suppress_health_check=[HealthCheck.too_slow])
def test_random_values(name, which, wrong, by):
    """One value of the JSON is another: of a wrong kind, or a little more or less."""
    case = SOME[name]
    content = case.files[case.name]
    n = struct.unpack_from("<I", content, 12)[0] if content[:4] == b"glTF" else 0
    value = copy.deepcopy(json.loads(content[20 : 20 + n] if n else content))
    places = [place for place in _places(value) if place[0] is not None]
    holder, key = places[which % len(places)]
    old = holder[key]
    holder[key] = old + by if isinstance(old, int) and by and not isinstance(old, bool) else WRONG[wrong]
    text = json.dumps(value).encode()
    survives(Case(case.name, {**case.files, case.name: glb(text, content[28 + n :]) if n else text}))


def _places(value: Any, holder: Any = None, key: Any = None) -> list[tuple[Any, Any]]:
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [(holder, key), *(place for k, v in list(inner) for place in _places(v, value, k))]
