"""Method and code together: what an owner embeds, a reader with the same key and profile reads, and nobody else."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import open3d as o3d
import pytest

from o3dmark.attacks import attack_all
from o3dmark.coding.keys import Key
from o3dmark.coding.payload import CODES
from o3dmark.errors import CapacityError, MeshError, SpecError
from o3dmark.files import read_mesh, write_mesh
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays, triangle_mesh
from o3dmark.methods import METHODS, Extraction
from o3dmark.profiles import DEFAULT_PROFILE, PROFILES
from o3dmark.registry import to_dict
from o3dmark.watermark import Watermark, bit_text, parse_bits

MESSAGE = "o3d!"


@pytest.fixture(scope="module")
def marked(carrier: Any, key: Key) -> Any:
    return Watermark().embed(carrier, MESSAGE, key)


def test_the_message_comes_back_blindly(marked: Any, key: Key) -> None:
    attacked = attack_all(marked, ["similarity", "reorder", "noise:amplitude=0.001"], 1)
    reading = Watermark().extract(attacked, key)
    assert reading.found
    assert reading.message == MESSAGE
    assert reading.p_value < 1e-6
    assert json.loads(json.dumps(reading.to_dict()))["message"] == MESSAGE


def test_a_wrong_key_finds_nothing(marked: Any) -> None:
    wrong_key = Key(bytes(31) + b"\1")
    extraction = Watermark().extract_bits(marked, wrong_key)
    reading = Watermark().decode(extraction, wrong_key)
    assert not reading.found
    assert reading.message is None
    assert not Watermark().test(extraction, wrong_key, MESSAGE).present


def test_an_unmarked_mesh_holds_nothing(carrier: Any, key: Key) -> None:
    extraction = Watermark().extract_bits(carrier, key)
    assert not Watermark().decode(extraction, key).found
    assert not Watermark().test(extraction, key, MESSAGE).present


def test_knowing_the_message_sharpens_the_test(marked: Any, key: Key) -> None:
    blind, known = Watermark().detect(marked, key), Watermark().detect(marked, key, MESSAGE)
    assert blind.present
    assert known.present
    assert known.log10_p < blind.log10_p - 8
    assert known.matches == known.n_bits == 64


def test_a_known_message_is_found_where_none_can_be_read(marked: Any, key: Key) -> None:
    """A twentieth of the triangles: among 64 unknown bits no hypothesis stands out, beside known ones one does."""
    attacked = attack_all(marked, ["simplify:ratio=0.95"], 1)
    assert not Watermark().extract(attacked, key).found
    found = Watermark().detect(attacked, key, MESSAGE)
    assert found.present
    assert found.hypotheses > 1000
    assert Watermark().detect(attacked, Key(bytes(31) + b"\1"), MESSAGE).p_value > 1e-3
    assert Watermark().detect(attacked, key, "else").p_value > 1e-3


def test_all_readings_are_charged_where_the_bits_choose() -> None:
    bits = np.array([1, 0, 1])
    readings = np.array([[1, 1, 1], [0.1, -0.1, 0.1], [-1, 1, -1]], np.float32)
    read = Extraction(readings[0].astype(float), 2, readings=readings)
    np.testing.assert_array_equal(read.nearest(bits).bits, bits)
    assert read.nearest(bits).hypotheses == 3
    alone = Extraction(np.ones(3), 2)
    assert alone.nearest(bits) is alone


def test_another_message_is_not_there_and_the_one_that_is_is_named(marked: Any, key: Key) -> None:
    found = Watermark().detect(marked, key, "else")
    assert (found.present, found.other) == (False, MESSAGE)
    assert Watermark().detect(marked, key, MESSAGE).other is None
    assert Watermark().detect(marked, key, "hex:" + MESSAGE.encode().hex()).other == MESSAGE  # bytes are not a text


def test_a_message_that_reads_better_turns_any_answer_into_no(key: Key) -> None:
    """All bits of the one, three quarters of the other: by itself that would be enough at this rate."""
    mark = Watermark()
    one, other = (2.0 * mark.code.encode(message, 64, key) - 1 for message in ("one", "two"))
    soft = np.where(np.arange(64) % 4 == 0, -other, other) * 1e-3 + one
    assert mark.test(Extraction(one), key, "two", false_positive_rate=1.0).other == "one"
    assert not mark.test(Extraction(one), key, "two", false_positive_rate=1.0).present
    assert mark.test(Extraction(soft), key, "one", false_positive_rate=1e-6).present


def test_other_messages_of_the_same_key_are_chance(key: Key) -> None:
    """Serial numbers asked of one copy: p-values at or below 0.1, 0.01 and 0.001 come as often as they say, or less."""
    mark = Watermark()
    soft = 2.0 * mark.code.encode("0000", 64, key) - 1 + np.random.default_rng(1).normal(0, 0.7, 64)
    extraction = Extraction(soft)
    log10_p = np.array([mark.test(extraction, key, f"{number:04}").log10_p for number in range(1, 1001)])
    assert mark.test(extraction, key, "0000").log10_p < -10
    counts = [int(np.count_nonzero(log10_p <= level)) for level in (-1, -2, -3)]
    assert np.all(np.array(counts) <= [140, 23, 6])  # four standard deviations above 100, 10 and 1
    assert counts[0] > 60


def test_raw_bits_pass_by_the_code(carrier: Any, key: Key) -> None:
    mark, bits = Watermark(n_bits=24), np.resize([1, 0, 0, 1, 1], 24)
    extraction = mark.extract_bits(mark.embed_bits(carrier, bits, key), key)
    np.testing.assert_array_equal(extraction.bits, bits)


def test_a_mesh_too_small_says_how_many_bits_fit(key: Key) -> None:
    small = TriangleMesh.create_sphere(resolution=12)
    with pytest.raises(CapacityError) as caught:
        Watermark().embed(small, MESSAGE, key)
    assert 0 < caught.value.fits < 64


def test_a_message_too_long_says_what_it_takes(carrier: Any, key: Key) -> None:
    with pytest.raises(SpecError, match="4 fit"):
        Watermark().embed(carrier, "longer than four", key)


def test_profiles_never_change() -> None:
    """A published profile is a promise to old marks. Add new ones; never edit these lines."""
    scs = {
        "name": "saliency-scs",
        "sync": "sphere",
        "mrms": 6e-4,
        "step": None,
        "lam": None,
        "gamma": 0.7,
        "share": 0.7,
        "salient": "count",
        "sigma": 2.0,
        "epsilon": 0.003,
        "passes": 8,
        "format": "2026",
        "search": True,
    }
    spectrum = {"name": "shape-spectrum", "mrms": 5.8e-4, "lowest": 4.0, "highest": 12.0, "box": 6.0, "slack": 0.04}
    spectrum |= {"rungs": 45, "format": "2026", "mask": "none", "motion": "unseen", "search": True}
    spectrum |= {"jnd": 1.0}  # of the writer alone: old marks are read all the same
    frozen = {
        "robust-2026": (spectrum, {"name": "random", "message_bytes": None}, 64),
        "slender-2026": (
            spectrum | {"lowest": 8.0, "highest": 24.0, "rungs": 60},
            {"name": "random", "message_bytes": None},
            64,
        ),
        "contested-2026": (
            spectrum | {"mrms": 4e-4, "lowest": 8.0, "highest": 24.0, "rungs": 60},
            {"name": "random", "message_bytes": None},
            64,
        ),
        "invisible-2026": (spectrum | {"mrms": 3.7e-4}, {"name": "random", "message_bytes": None}, 64),
        "paper-2026": (scs, {"name": "random", "message_bytes": None}, 64),
        "tiny-2026": (scs, {"name": "random", "message_bytes": 1}, 32),
    }
    for name, (method, code, n_bits) in frozen.items():
        profile = PROFILES[name]
        assert (to_dict(profile.method), to_dict(profile.code), profile.n_bits) == (method, code, n_bits)
    assert DEFAULT_PROFILE in PROFILES


def test_what_is_too_slender_for_the_default_has_a_profile(spot: TriangleMesh, key: Key) -> None:
    vertices, triangles = mesh_arrays(spot)
    slender = triangle_mesh(vertices * [1.0, 12.0, 1.0], triangles)
    with pytest.raises(MeshError, match="too slender"):
        PROFILES[DEFAULT_PROFILE].embed(slender, "mine", key)
    marked = PROFILES["slender-2026"].embed(slender, "mine", key)
    attacked = attack_all(marked, ["similarity", "noise:amplitude=0.001"], 1)
    assert PROFILES["slender-2026"].extract(attacked, key).message == "mine"


@pytest.mark.parametrize("code", list(CODES))
@pytest.mark.parametrize("method", [name for name in METHODS if not METHODS.make(name).layers])
def test_every_method_takes_every_code(
    spot: TriangleMesh, semi_regular: TriangleMesh, key: Key, method: str, code: str
) -> None:
    mark = Watermark(METHODS.make(method), CODES.make(code), 32)
    cover = semi_regular if mark.method.needs_semi_regular else spot
    assert mark.extract(mark.embed(cover, "o", key), key).message == "o"


def test_bits_as_text() -> None:
    assert bit_text(parse_bits("0110")) == "0110"
    for wrong in ("", "012", "ab"):
        with pytest.raises(SpecError):
            parse_bits(wrong)
    with pytest.raises(SpecError):
        Watermark(n_bits=0)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_tensors_come_back_in_their_precision(spot: TriangleMesh, key: Key, tmp_path: Path, dtype: type) -> None:
    """A tensor mesh is marked, written and read; so is a tensor cloud of its surface."""
    vertices, triangles = mesh_arrays(spot)
    tensor = o3d.t.geometry.TriangleMesh(o3d.core.Tensor(vertices.astype(dtype)), o3d.core.Tensor(triangles))
    mark = Watermark(n_bits=43)
    marked = mark.embed(tensor, "me", key)
    assert isinstance(marked, o3d.t.geometry.TriangleMesh)
    assert marked.vertex.positions.numpy().dtype == dtype
    assert mark.extract(marked, key).message == "me"
    assert mark.detect(marked, key, "me").present
    write_mesh(tmp_path / "marked.ply", marked)
    np.testing.assert_array_equal(read_mesh(tmp_path / "marked.ply").vertices, marked.vertex.positions.numpy())
    o3d.utility.random.seed(0)
    cloud = marked.to_legacy().compute_vertex_normals().sample_points_uniformly(40_000)
    points = o3d.t.geometry.PointCloud.from_legacy(cloud, o3d.core.Dtype.Float32)
    assert mark.extract(points, key).message == "me"
