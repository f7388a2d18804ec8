"""Speed of the attacks that are ours against MeshLab's in the same run: `pytest tests/benchmarks --benchmark-only`."""

import pytest

from fixtures.references import meshlab_resampled
from o3dmark.attacks import ATTACKS

CELLS = 128


@pytest.mark.benchmark(group="resample, 46 850 vertices, 128 cells")
def test_bench_resample(benchmark, large):
    attack = ATTACKS.make(f"resample:cells={CELLS}")
    attack(large)
    benchmark.pedantic(attack, (large,), rounds=3)


@pytest.mark.benchmark(group="resample, 46 850 vertices, 128 cells")
def test_bench_meshlab_resample(benchmark, large):
    benchmark.pedantic(meshlab_resampled, (large, CELLS), rounds=3)
