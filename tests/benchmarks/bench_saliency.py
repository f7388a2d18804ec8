"""Saliency's speed against the straightforward version in the same process, and its memory in a process of its own.

pytest tests/benchmarks/bench_saliency.py --benchmark-only -s            (add -m slow for a million vertices)
"""

import subprocess
import sys
import time

import numpy as np
import pytest

from fixtures.references import means_slowly
from o3dmark.files import read_mesh
from o3dmark.mesh.curvature import taubin
from o3dmark.mesh.saliency import LEE_SCALES, Saliency, gaussian_means
from o3dmark.mesh.surface import Surface

LEAST_RATIO = 5.0
GIB = 2**20  # in the kB of /proc
MOST_GIB, MOST_GIB_OF_A_MILLION = 3.0, 4.0

# What the measuring processes run: `surface` comes from one of the two, then peak memory and seconds are printed.
HORSE = """
from o3dmark.files import read_mesh
surface = Surface.of(read_mesh(sys.argv[1]))
"""
MILLION = """
from open3d.geometry import TriangleMesh
from o3dmark.mesh.surface import mesh_arrays
vertices, triangles = mesh_arrays(TriangleMesh.create_torus(1.0, 0.4, 1000, 1000))
vertices *= 1 + 0.02 * np.sin(9 * vertices).sum(axis=1, keepdims=True)
surface = Surface.from_arrays(vertices, triangles)
"""
MEASURE = """
import sys, time
import numpy as np
from o3dmark.mesh.surface import Surface
from o3dmark.mesh.saliency import Saliency
{source}
start = time.perf_counter()
Saliency(scales={scales}).of_surface(surface)
seconds = time.perf_counter() - start
peak = next(line for line in open("/proc/self/status") if line.startswith("VmHWM"))  # ru_maxrss is the parent's, too
print(len(surface.vertices), seconds, peak.split()[1])
"""


def measured(source, scales, *arguments):
    """(vertices, seconds with compilation, peak memory in GiB) of saliency in a new process."""
    code = MEASURE.format(source=source, scales=scales)
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True)
    vertices, seconds, peak = done.stdout.split()
    return int(vertices), float(seconds), int(peak) / GIB


@pytest.fixture(scope="module")
def horse(shared):
    """112 642 vertices: positions, curvature, and the ten sigmas of Lee's five scales."""
    surface = Surface.of(read_mesh(shared("meshes/paper/horse_112642_derived.ply")))
    sigmas = np.array(LEE_SCALES) * 0.003 * surface.diagonal
    mean = taubin(surface.vertices, surface.triangles).mean
    return surface.vertices, mean, np.concatenate([sigmas, 2 * sigmas])


@pytest.mark.benchmark(group="Gaussian means, 112 642 points, 10 sigmas")
def test_bench_gaussian_means(benchmark, horse):
    points, values, sigmas = horse
    gaussian_means(points[:1000], values[:1000], sigmas)
    means = benchmark.pedantic(gaussian_means, horse, rounds=3)
    blocks = np.concatenate([np.arange(first, first + 500) for first in range(0, len(points) - 500, 10_000)])
    start = time.perf_counter()
    expected = means_slowly(points, values, sigmas, points[blocks], rows=500)
    slowly = (time.perf_counter() - start) * len(points) / len(blocks)
    np.testing.assert_allclose(means[:, blocks], expected, atol=1e-12 * np.abs(expected).max())
    ratio = slowly / benchmark.stats.stats.min
    benchmark.extra_info.update(straightforward_seconds=slowly, ratio=ratio)
    print(f"\n{slowly:.1f} s straightforward, {benchmark.stats.stats.min:.2f} s here: {ratio:.1f} times faster")
    assert ratio >= LEAST_RATIO


@pytest.mark.benchmark(group="saliency of a surface")
@pytest.mark.parametrize("scales", [LEE_SCALES, (2.0,)], ids=["lee", "paper"])
def test_bench_saliency(benchmark, spot, scales):
    surface = Surface.of(spot.subdivide_loop(2))
    benchmark.pedantic(Saliency(scales=scales).of_surface, (surface,), rounds=3, warmup_rounds=1)


@pytest.mark.benchmark(group="memory")
@pytest.mark.parametrize("scales", [LEE_SCALES, (2.0,)], ids=["lee", "paper"])
def test_bench_memory(benchmark, shared, scales):
    path = str(shared("meshes/paper/horse_112642_derived.ply"))
    vertices, seconds, peak = benchmark.pedantic(measured, (HORSE, scales, path), rounds=1)
    benchmark.extra_info.update(vertices=vertices, seconds=seconds, gib=peak)
    print(f"\n{vertices} vertices, {len(scales)} scales: {seconds:.1f} s, {peak:.2f} GiB")
    assert peak <= MOST_GIB


@pytest.mark.slow
@pytest.mark.benchmark(group="a million vertices")
@pytest.mark.parametrize("scales", [(2.0,), LEE_SCALES], ids=["paper", "lee"])
def test_bench_a_million_vertices(benchmark, scales):
    vertices, seconds, peak = benchmark.pedantic(measured, (MILLION, scales), rounds=1)
    benchmark.extra_info.update(vertices=vertices, seconds=seconds, gib=peak)
    print(f"\n{vertices} vertices, {len(scales)} scales: {seconds:.1f} s, {peak:.2f} GiB")
    assert vertices == 1_000_000
    assert peak <= MOST_GIB_OF_A_MILLION
