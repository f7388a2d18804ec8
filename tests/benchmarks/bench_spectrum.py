"""Speed of shape-spectrum: `pytest tests/benchmarks --benchmark-only`. The peer is the sum that the NUFFT replaces."""

import numpy as np
import pytest

from o3dmark.attacks import attack_all
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface
from o3dmark.methods.shape_spectrum.method import ShapeSpectrum
from o3dmark.solid.quadrature import samples
from o3dmark.solid.solid import Solid
from o3dmark.solid.spectrum import Band, Spectrum

METHOD = ShapeSpectrum()
SUMMED = 20  # waves that the plain sum takes; the transform takes all


@pytest.fixture(scope="module")
def quadrature(large):
    solid = Solid.of(Surface.of(large))
    return samples(solid, 0.1, 0.02)


@pytest.mark.benchmark(group="spectrum, 46 850 vertices")
def test_bench_spectrum(benchmark, quadrature):
    band = Band(4.0, 12.0, 6.0)
    benchmark(Spectrum.of, band, quadrature.points, quadrature.area_vectors)


@pytest.mark.benchmark(group="spectrum, 46 850 vertices")
def test_bench_plain_sum(benchmark, quadrature):
    """One wave in 170 of the band."""
    waves = Band(4.0, 12.0, 6.0).waves[:SUMMED]

    def summed():
        return [np.sum((quadrature.area_vectors @ k) * np.exp(-1j * quadrature.points @ k)) for k in waves]

    benchmark(summed)


@pytest.mark.benchmark(group="area vectors, 93 696 triangles")
def test_bench_area_vectors(benchmark, large):
    surface = Surface.of(large)
    benchmark(geometry.area_vectors, surface.vertices, surface.triangles)


@pytest.mark.benchmark(group="area vectors, 93 696 triangles")
def test_bench_cross(benchmark, large):
    surface = Surface.of(large)

    def crossed():
        a, b, c = surface.vertices[surface.triangles.T]
        return 0.5 * np.cross(b - a, c - a)

    benchmark(crossed)


@pytest.mark.benchmark(group="shape-spectrum, 46 850 vertices")
def test_bench_embed(benchmark, large, message, key):
    benchmark.pedantic(METHOD.embed, (large, message, key), rounds=3)


@pytest.mark.benchmark(group="shape-spectrum, 46 850 vertices")
@pytest.mark.parametrize("attack", ["identity", "smooth:iterations=30"])
def test_bench_extract(benchmark, marked, key, attack):
    attacked = attack_all(marked, [attack])
    benchmark.pedantic(METHOD.extract, (attacked, 64, key), rounds=3)


@pytest.mark.benchmark(group="shape-spectrum, 46 850 vertices")
def test_bench_extract_in_vain(benchmark, large, key):
    """The whole search: an unmarked mesh."""
    benchmark.pedantic(METHOD.extract, (large, 64, key), rounds=1)
