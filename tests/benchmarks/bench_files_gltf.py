"""Speed of GLB files of a million vertices against numpy's own for the same bytes, and the welding that marking does.

`pytest tests/benchmarks/bench_files_gltf.py --benchmark-only`
"""

import numpy as np
import pytest

from fixtures.gltf_files import Builder, Case, Shape, bumpy, waved
from o3dmark.files.gltf import Gltf
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface


@pytest.fixture(scope="module")
def shape() -> Shape:
    return bumpy(1000, 999)


@pytest.fixture(scope="module")
def case(shape) -> Case:
    b = Builder()
    b.mesh({"attributes": {"POSITION": b.positions(shape.vertices)}, "indices": b.indices(shape.triangles, "<u4")})
    return b.glb()


@pytest.fixture(scope="module")
def with_normals(shape) -> Case:
    b = Builder()
    attributes = {"POSITION": b.positions(shape.vertices), "NORMAL": b.add(shape.normals)}
    b.mesh({"attributes": attributes, "indices": b.indices(shape.triangles, "<u4")})
    return b.glb()


def numbers_of(content: bytes, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    """What numpy alone makes of the bytes: positions and triangles as they are computed with."""
    start = content.index(b"BIN\0") + 4
    n, m = len(shape.vertices), len(shape.triangles)
    positions = np.frombuffer(content, "<f4", 3 * n, start).reshape(n, 3).astype(np.float64)
    return positions, np.frombuffer(content, "<u4", 3 * m, start + 12 * n).reshape(m, 3).astype(np.int64)


@pytest.mark.benchmark(group="read a GLB of a million vertices")
def test_bench_read(benchmark, case):
    def read():
        [part] = Gltf(case.source).parts
        return geometry.weld(part.vertices)

    benchmark.pedantic(read, rounds=5)


@pytest.mark.benchmark(group="read a GLB of a million vertices")
def test_bench_read_by_numpy(benchmark, case, shape):
    benchmark.pedantic(lambda: geometry.weld(numbers_of(case.files["a.glb"], shape)[0]), rounds=5)


@pytest.mark.benchmark(group="read a GLB of a million vertices, without the welding")
def test_bench_read_alone(benchmark, case):
    benchmark.pedantic(lambda: Gltf(case.source), rounds=5)


@pytest.mark.benchmark(group="read a GLB of a million vertices, without the welding")
def test_bench_read_alone_by_numpy(benchmark, case, shape):
    benchmark.pedantic(lambda: numbers_of(case.files["a.glb"], shape), rounds=5)


@pytest.mark.benchmark(group="write a GLB of a million vertices")
def test_bench_write(benchmark, case):
    asset = Gltf(case.source)
    moved = waved(asset.parts[0].vertices)
    benchmark.pedantic(lambda: asset.with_positions({0: moved}), rounds=5)


@pytest.mark.benchmark(group="write a GLB of a million vertices")
def test_bench_write_by_numpy(benchmark, case, shape):
    """The bytes, and their least and greatest numbers."""
    content = case.files["a.glb"]
    moved, start = waved(shape.vertices.astype(np.float64)), content.index(b"BIN\0") + 4

    def write():
        numbers = moved.astype("<f4")
        bounds = numbers.min(axis=0), numbers.max(axis=0)
        return content[:start] + numbers.tobytes() + content[start + numbers.nbytes :], bounds

    benchmark.pedantic(write, rounds=5)


@pytest.mark.benchmark(group="write a GLB of a million vertices with normals")
def test_bench_write_with_normals(benchmark, with_normals):
    asset = Gltf(with_normals.source)
    moved = waved(asset.parts[0].vertices)
    benchmark.pedantic(lambda: asset.with_positions({0: moved}), rounds=3)


@pytest.mark.benchmark(group="write a GLB of a million vertices with normals")
def test_bench_surface(benchmark, with_normals):
    """What marking takes at the least, to compare: the welded surface and its normals."""
    [part] = Gltf(with_normals.source).parts
    benchmark.pedantic(lambda: Surface.from_arrays(part.vertices, part.triangles).normals, rounds=3)
