"""Speed of the methods that the paper compares with: `pytest tests/benchmarks/bench_rivals.py --benchmark-only`."""

import numpy as np
import pytest

from o3dmark.mesh.semi_regular import analysis, subdivisions, synthesis
from o3dmark.mesh.surface import Surface
from o3dmark.methods import METHODS
from o3dmark.synthetic import make

BINS = ["cho2007-mean", "cho2007-variance"]
WAVELETS = ["wang2008", "hamidi2017", "hamidi2019"]


@pytest.fixture(scope="module")
def million():
    """A torus of a million vertices. Do not change it."""
    return make("torus:vertices=1000000")


@pytest.fixture(scope="module")
def larger(spot):
    """Spot, subdivided to 187 394 vertices. Do not change it."""
    return spot.subdivide_loop(3)


@pytest.mark.benchmark(group="bins on norms, 1 000 000 vertices: embed")
@pytest.mark.parametrize("name", BINS)
def test_bench_bins_embed(benchmark, million, message, key, name):
    benchmark.pedantic(METHODS.make(name).embed, (million, message, key), rounds=3)


@pytest.mark.benchmark(group="bins on norms, 1 000 000 vertices: extract")
@pytest.mark.parametrize("name", BINS)
def test_bench_bins_extract(benchmark, million, key, name):
    benchmark.pedantic(METHODS.make(name).extract, (million, 64, key), rounds=3)


@pytest.mark.benchmark(group="programmes, 187 394 vertices: embed")
@pytest.mark.parametrize("name", ["rolland2014", "rolland2014:along=normal", "son2017"])
def test_bench_programmes_embed(benchmark, larger, message, key, name):
    benchmark.pedantic(METHODS.make(name).embed, (larger, message, key), rounds=1)


@pytest.mark.benchmark(group="curvature and saliency, 187 394 vertices: embed")
@pytest.mark.parametrize("name", ["zhan2014", "nakazawa2010"])
def test_bench_others_embed(benchmark, larger, message, key, name):
    benchmark.pedantic(METHODS.make(name).embed, (larger, message, key), rounds=1)


@pytest.mark.benchmark(group="wavelets, 46 850 vertices: embed")
@pytest.mark.parametrize("name", WAVELETS)
def test_bench_wavelets_embed(benchmark, large, message, key, name):
    benchmark.pedantic(METHODS.make(name).embed, (large, message, key), rounds=3)


@pytest.mark.benchmark(group="wavelets, 46 850 vertices: analysis and synthesis")
def test_bench_lazy_wavelets(benchmark, large):
    surface = Surface.of(large)

    def both():
        levels = subdivisions(surface)
        return synthesis(analysis(surface.vertices, levels), levels)

    assert np.allclose(benchmark.pedantic(both, rounds=3), surface.vertices)
