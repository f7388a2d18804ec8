"""Speed of binary files against numpy's own for the same bytes: `pytest tests/benchmarks --benchmark-only`.

A torus of a million vertices and two million triangles. Numpy's part is to read the file, to make float64 and int64 of
its numbers, to put float32 in their place and to write it; beside it every use of a mesh welds its vertices.
"""

import time

import numpy as np
import pytest

from fixtures.ply import binary_ply
from fixtures.stl_files import binary_stl
from o3dmark.files.ply import Ply
from o3dmark.files.references import Source
from o3dmark.files.stl import Stl
from o3dmark.mesh import geometry

SIDE = 1000
MOST = 1.5  # times numpy and the welding
FACE = np.dtype([("n", "u1"), ("corners", "<i4", 3)])
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


@pytest.fixture(scope="module")
def torus():
    """Vertices (n, 3) and triangles (2 n, 3)."""
    i, j = (index.ravel() for index in np.indices((SIDE, SIDE)))
    u, v = 2 * np.pi * i / SIDE, 2 * np.pi * j / SIDE
    vertices = np.stack([(3 + np.cos(v)) * np.cos(u), (3 + np.cos(v)) * np.sin(u), np.sin(v)], axis=1)
    a, b, c, d = ((i + k) % SIDE * SIDE + (j + m) % SIDE for k, m in ((0, 0), (1, 0), (1, 1), (0, 1)))
    return vertices, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


@pytest.fixture(scope="module")
def files(torus, tmp_path_factory):
    folder, (vertices, triangles) = tmp_path_factory.mktemp("files"), torus
    (folder / "a.ply").write_bytes(binary_ply(vertices, triangles, kind="float"))
    normals = geometry.unit(geometry.area_vectors(vertices, triangles))
    (folder / "a.stl").write_bytes(binary_stl(vertices[triangles], normals=normals))
    return folder


def numpy_ply(path):
    content = np.fromfile(path, np.uint8)
    head = len(content) - 12 * SIDE**2 - 13 * 2 * SIDE**2
    rows = content[head:][: 12 * SIDE**2].view("<f4").reshape(-1, 3)
    vertices, _ = rows.astype(np.float64), content[head + rows.nbytes :].view(FACE)["corners"].astype(np.int64)
    rows[:] = vertices + 1e-3
    content.tofile(path.with_name("numpy.ply"))
    return vertices


def numpy_stl(path):
    content = np.fromfile(path, np.uint8)
    facets = content[84:].view(FACET)
    normals, corners = (facets[name].astype(np.float64) for name in ("normal", "corners"))
    facets["normal"], facets["corners"] = normals, corners + 1e-3
    content.tofile(path.with_name("numpy.stl"))
    return corners.reshape(-1, 3)


def asset_ply(path):
    _rewrite(Ply(Source(path)))


def asset_stl(path):
    _rewrite(Stl(Source(path)))


def _rewrite(asset):
    content = asset.with_positions({0: asset.parts[0].vertices + 1e-3})[asset.name]
    asset.path.with_name(f"asset{asset.path.suffix}").write_bytes(content)


KINDS = {"ply": (numpy_ply, asset_ply), "stl": (numpy_stl, asset_stl)}


@pytest.mark.benchmark(group="1 000 000 vertices: read, moved and written", timer=time.process_time)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("who", ["numpy", "asset"])
def test_bench_rewriting(benchmark, files, kind, who):
    benchmark.pedantic(KINDS[kind][who == "asset"], (files / f"a.{kind}",), rounds=5, warmup_rounds=1)


@pytest.mark.benchmark(group="1 000 000 vertices: ratios", timer=time.process_time)
@pytest.mark.parametrize("kind", KINDS)
def test_bench_within_budget(benchmark, files, kind):
    """Ratios of the asset to numpy: welded as well as numpy's only, and as both, and without."""
    path, (by_numpy, by_asset) = files / f"a.{kind}", KINDS[kind]
    vertices = by_numpy(path)
    least = min(_seconds(by_numpy, path) for _ in range(5))
    welding = min(_seconds(geometry.weld, vertices) for _ in range(2))
    benchmark.pedantic(by_asset, (path,), rounds=5, warmup_rounds=1)
    ours = benchmark.stats.stats.min
    benchmark.extra_info["numpy_welded"] = ours / (least + welding)
    benchmark.extra_info["both_welded"] = (ours + welding) / (least + welding)
    benchmark.extra_info["bytes_only"] = ours / least
    assert ours <= MOST * (least + welding)


def _seconds(function, argument):
    start = time.process_time()
    function(argument)
    return time.process_time() - start
