"""Positions in whole numbers (KHR_mesh_quantization) move on their grid, to its rim at most."""

import numpy as np
import pytest

from fixtures.gltf_files import BUMPY, Builder, Case, waved
from fixtures.gltf_packed import EXTENT, quantised
from fixtures.gltf_parser import assert_only_positions_differ, parse
from o3dmark.errors import MeshError
from o3dmark.files.gltf import Gltf

KINDS = {
    "u16 of 14 bits, stride 8": {"dtype": "<u2", "bits": 14, "stride": 8},
    "u16, stride 12": {"dtype": "<u2", "stride": 12},
    "i16 normalized": {"dtype": "<i2", "normalized": True},
    "u16 normalized": {"dtype": "<u2", "normalized": True},
    "i8 normalized": {"dtype": "<i1", "normalized": True},
    "u8": {"dtype": "<u1"},
}


@pytest.fixture(params=KINDS)
def case(request) -> Case:
    return quantised(**KINDS[request.param])


def numbers(case: Case) -> np.ndarray:
    return parse(case).rows(0)


def grid(case: Case) -> tuple[float, float, float]:
    """The step, the least and the greatest number that the file can hold."""
    limits = np.iinfo(numbers(case).dtype)
    if parse(case).value["accessors"][0]["normalized"]:
        return 1 / limits.max, -1.0 if limits.min else 0.0, 1.0
    return 1.0, limits.min, limits.max


def test_positions_are_what_the_numbers_stand_for(case):
    [part] = Gltf(case.source).parts
    step, low, high = grid(case)
    assert (part.steps.tolist(), part.fixed) == ([step] * 3, "")
    np.testing.assert_allclose(part.vertices, numbers(case) * step, rtol=1e-15)
    assert (part.vertices.min() >= low, part.vertices.max() <= high) == (True, True)
    [place] = part.placements
    world = part.vertices @ place[:3, :3].T + place[:3, 3]
    np.testing.assert_allclose(world, BUMPY.vertices, atol=0.51 * step * place[0, 0])


def test_where_nothing_moves_every_byte_stays(case):
    asset = Gltf(case.source)
    assert asset.with_positions({0: asset.parts[0].vertices}) == case.files


def test_the_nearest_numbers_are_written(case):
    asset = Gltf(case.source)
    wanted = waved(asset.parts[0].vertices, 0.02)
    written = case.with_files(asset.with_positions({0: wanted}))
    assert_only_positions_differ(case, written)
    step, low, high = grid(case)
    found = Gltf(written.source).parts[0].vertices
    assert np.abs(found - np.clip(wanted, low, high)).max() <= 0.5000001 * step
    assert (numbers(written) != numbers(case)).mean() > 0.5


def test_far_beyond_what_the_numbers_can_hold_is_refused(case):
    asset = Gltf(case.source)
    step, low, high = grid(case)
    moved = asset.parts[0].vertices.copy()
    moved[0] = high + 0.01 * (high - low)
    written = Gltf(case.with_files(asset.with_positions({0: moved})).source)
    np.testing.assert_allclose(written.parts[0].vertices[0], high, atol=step)
    moved[0] = high + 0.1 * (high - low)
    with pytest.raises(MeshError, match="beyond what"):
        asset.with_positions({0: moved})


def test_bounds_are_the_whole_numbers(case):
    asset = Gltf(case.source)
    written = parse(case.with_files(asset.with_positions({0: waved(asset.parts[0].vertices, 0.05)})))
    accessor = written.value["accessors"][0]
    assert accessor["min"] == written.rows(0).min(axis=0).tolist()
    assert accessor["max"] == written.rows(0).max(axis=0).tolist()
    assert all(isinstance(number, int) for number in accessor["min"] + accessor["max"])


@pytest.mark.parametrize(("dtype", "lowest"), [("<i1", -128), ("<i2", -32768)])
def test_the_lowest_number_stands_for_minus_one_and_stays(dtype, lowest):
    b = Builder()
    rows = np.rint(BUMPY.vertices / EXTENT * np.iinfo(dtype).max).astype(dtype)
    rows[3] = lowest
    attributes = {"POSITION": b.positions(rows, stride=4 * rows.itemsize, normalized=True)}
    b.mesh({"attributes": attributes, "indices": b.indices()})
    case = b.glb()
    [part] = Gltf(case.source).parts
    assert part.vertices[3].tolist() == [-1.0] * 3
    moved = waved(part.vertices)
    moved[3] = [-1.0, -1.0, -0.9]
    written = numbers(case.with_files(Gltf(case.source).with_positions({0: moved})))
    assert written[3].tolist() == [lowest, lowest, round(-0.9 * np.iinfo(dtype).max)]


def test_primitives_of_two_types_are_one_part():
    b = Builder()
    b.mesh(
        {"attributes": {"POSITION": b.positions()}, "indices": b.indices()},
        {"attributes": {"POSITION": b.positions(np.array([[0, 0, 0], [1, 2, 3], [5, 5, 0]], "<u2"), stride=8)}},
    )
    case = b.glb()
    [part] = Gltf(case.source).parts
    assert part.steps[-3:].tolist() == [[1.0] * 3] * 3
    assert part.steps[:-3].max() < 1e-6
    written = case.with_files(Gltf(case.source).with_positions({0: part.vertices + 0.75}))
    assert Gltf(written.source).parts[0].vertices[-3:].tolist() == [[1, 1, 1], [2, 3, 4], [6, 6, 1]]
    assert_only_positions_differ(case, written)
