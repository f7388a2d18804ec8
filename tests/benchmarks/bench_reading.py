"""Speed of looking at what is there: `pytest tests/benchmarks/bench_reading.py --benchmark-only`.

Each edit is read beside the mesh as it was marked; crafted files beside Open3D, which has boxes alone, and float32.
"""

import numpy as np
import open3d as o3d
import pytest

from fixtures.shapes import fan_of_polygon, needles
from o3dmark.attacks import attack_all
from o3dmark.coding.keys import Key
from o3dmark.mesh.proximity import closest_points
from o3dmark.mesh.surface import Surface
from o3dmark.mesh.welding import ladder
from o3dmark.methods.shape_spectrum.method import ShapeSpectrum

METHOD = ShapeSpectrum()
CRAFTED = {  # 1 MB of OBJ each
    "a cone of 20 000 needles": lambda: needles(20_000),
    "a polygon of 40 000 corners": lambda: fan_of_polygon(40_000),
}


def beside(surface):
    """Its vertices, a little moved."""
    return surface.vertices + 1e-3 * np.random.default_rng(0).standard_normal(surface.vertices.shape)


@pytest.mark.benchmark(group="reading after an edit, 46 850 vertices")
@pytest.mark.parametrize(
    "attack",
    [
        "identity",
        "soup:jitter=1e-6",
        "crack:pieces=64",
        "inside",
        "dust",
        "scene",
        "strain:amount=0.02",
        "bend:angle=2",
    ],
)
def test_bench_extract_after(benchmark, marked, key, attack):
    edited = attack_all(marked, [attack], 0)
    benchmark.pedantic(METHOD.extract, (edited, 64, key), rounds=1)


@pytest.mark.benchmark(group="a key, 46 850 vertices")
def test_bench_a_key_in_vain_when_all_is_observed(benchmark, large, key):
    observed = METHOD.observe(large)
    METHOD.extract(observed, 64, key)
    benchmark.pedantic(METHOD.extract, (observed, 64, Key(bytes(32))), rounds=3)


@pytest.mark.benchmark(group="a key, 46 850 vertices")
def test_bench_the_first_key_in_vain(benchmark, large):
    benchmark.pedantic(METHOD.extract, (large, 64, Key(bytes(32))), rounds=1)


@pytest.mark.benchmark(group="welding, 281 088 corners")
def test_bench_ladder_of_welds(benchmark, large):
    soup = Surface.of(attack_all(large, ["soup:jitter=1e-6"], 0))
    benchmark.pedantic(lambda: list(ladder(soup)), rounds=1)


@pytest.mark.benchmark(group="welding, 281 088 corners")
def test_bench_open3d_weld(benchmark, large):
    soup = attack_all(large, ["soup:jitter=1e-6"], 0)
    benchmark.pedantic(lambda: o3d.geometry.TriangleMesh(soup).merge_close_vertices(1e-5), rounds=1)


@pytest.mark.benchmark(group="closest points among triangles that overlap")
@pytest.mark.parametrize("shape", CRAFTED)
def test_bench_closest_points_among(benchmark, shape):
    surface = CRAFTED[shape]()
    benchmark.pedantic(closest_points, (beside(surface), surface), rounds=2, warmup_rounds=1)


@pytest.mark.benchmark(group="closest points among triangles that overlap")
@pytest.mark.parametrize("shape", CRAFTED)
def test_bench_open3d_among(benchmark, shape):
    """A fiftieth of the points, for it takes 2 ms for each in a polygon."""
    surface = CRAFTED[shape]()
    points = beside(surface)[::50]

    def nearest():
        scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        scene.add_triangles(
            o3d.core.Tensor(surface.vertices.astype(np.float32)), o3d.core.Tensor(surface.triangles.astype(np.uint32))
        )
        return scene.compute_closest_points(o3d.core.Tensor(points.astype(np.float32)))

    benchmark.pedantic(nearest, rounds=1)
