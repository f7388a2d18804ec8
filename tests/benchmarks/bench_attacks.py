"""Speed of the attacks that are ours against MeshLab's in the same run: `pytest tests/benchmarks --benchmark-only`."""

import numpy as np
import pymeshlab
import pytest

from o3dmark.attacks import ATTACKS, _meshlab
from o3dmark.mesh import mesh_arrays

CELLS = 128


def meshlab_resampled(mesh):
    extent = mesh.get_max_bound() - mesh.get_min_bound()
    cell = float(extent.max() / CELLS / np.linalg.norm(extent))
    march = {"cellsize": _meshlab.length(cell), "offset": pymeshlab.PercentageValue(50.0)}  # 50: none
    return _meshlab.apply(*mesh_arrays(mesh), ("generate_resampled_uniform_mesh", march))


@pytest.fixture(scope="module")
def large(spot):
    """46 850 vertices."""
    return spot.subdivide_loop(2)


@pytest.mark.benchmark(group="resample, 46 850 vertices, 128 cells")
def test_bench_resample(benchmark, large):
    attack = ATTACKS.make(f"resample:cells={CELLS}")
    attack(large)
    benchmark.pedantic(attack, (large,), rounds=3)


@pytest.mark.benchmark(group="resample, 46 850 vertices, 128 cells")
def test_bench_meshlab_resample(benchmark, large):
    benchmark.pedantic(meshlab_resampled, (large,), rounds=3)
