"""Speed of the metrics against a peer measured in the same run: `pytest tests/benchmarks --benchmark-only`."""

import numpy as np
import pymeshlab
import pytest

from fixtures.paths import GOLDEN
from fixtures.references import msdm_slowly
from o3dmark.attacks import ATTACKS
from o3dmark.files import read_mesh
from o3dmark.mesh.surface import mesh_arrays, triangle_mesh
from o3dmark.metrics import METRICS, distance
from o3dmark.metrics.distance import surface_distance
from o3dmark.metrics.fmpd import FMPD
from o3dmark.metrics.msdm import MSDM, MSDM2

MOST_SECONDS = {"mrms": 5.0, "msdm": 20.0, "msdm2": 20.0}  # of 34 835 vertices, kernels compiled


@pytest.fixture(scope="module")
def large(spot):
    """Two meshes of 46 850 vertices: spot, subdivided twice, and with noise."""
    vertices, triangles = mesh_arrays(spot.subdivide_loop(2))
    noise = 1e-4 * np.random.default_rng(0).normal(size=vertices.shape)
    return triangle_mesh(vertices, triangles), triangle_mesh(vertices + noise, triangles)


def meshlab_distance(reference, distorted, samples):
    """RMS both ways by MeshLab, from as many random points on the faces."""
    session = pymeshlab.MeshSet()
    for mesh in (reference, distorted):
        session.add_mesh(pymeshlab.Mesh(*mesh_arrays(mesh)))
    sampled = {"samplevert": True, "sampleface": True, "samplenum": samples}
    ways = ({"sampledmesh": 0, "targetmesh": 1}, {"sampledmesh": 1, "targetmesh": 0})
    return max(session.get_hausdorff_distance(**way, **sampled)["RMS"] for way in ways)


@pytest.mark.benchmark(group="distance, 46 850 vertices")
def test_bench_surface_distance(benchmark, large):
    surface_distance(*large, samples=10)
    benchmark.pedantic(surface_distance, large, setup=distance._last.clear, rounds=3)


@pytest.mark.benchmark(group="distance, 46 850 vertices")
def test_bench_meshlab_distance(benchmark, large):
    benchmark.pedantic(meshlab_distance, (*large, 200_000), rounds=3)


@pytest.mark.benchmark(group="msdm, spot")
def test_bench_msdm(benchmark, spot):
    other = read_mesh(GOLDEN / "spot_gauss0.1.ply")
    MSDM()(spot, other)
    benchmark.pedantic(MSDM(), (spot, other), rounds=3)


@pytest.mark.benchmark(group="msdm, spot")
def test_bench_msdm_in_python(benchmark, spot):
    benchmark.pedantic(msdm_slowly, (spot, read_mesh(GOLDEN / "spot_gauss0.1.ply")), rounds=1)


@pytest.mark.benchmark(group="perceptual, 46 850 vertices")
@pytest.mark.parametrize("metric", [MSDM(), MSDM2(), FMPD()], ids=lambda metric: metric.name)
def test_bench_perceptual(benchmark, metric, large):
    benchmark.pedantic(metric, large, rounds=2, warmup_rounds=1)


@pytest.mark.benchmark(group="bunny, 34 835 vertices")
@pytest.mark.parametrize("name", MOST_SECONDS)
def test_bench_within_budget(benchmark, shared, name):
    bunny = read_mesh(shared("meshes/paper/bunny.ply"))
    noisy = ATTACKS.make("noise:amplitude=0.001")(bunny, 1)
    benchmark.pedantic(METRICS.make(name), (bunny, noisy), setup=distance._last.clear, rounds=2, warmup_rounds=1)
    assert benchmark.stats.stats.min <= MOST_SECONDS[name]
