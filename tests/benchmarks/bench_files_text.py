"""Speed of text files against Open3D in the same run: `pytest tests/benchmarks/bench_files_text.py --benchmark-only`.

A torus of a million vertices and two million triangles as OBJ; a smaller one as text PLY and STL.
"""

import time

import numpy as np
import open3d as o3d
import pytest

from o3dmark.files import open_asset
from o3dmark.mesh import geometry

SIDES = {"obj": 1000, "ply": 400, "stl": 300}
MOST = 2.0  # times Open3D, for OBJ


def torus(side):
    """Vertices (n, 3) and triangles (2 n, 3)."""
    i, j = (index.ravel() for index in np.indices((side, side)))
    u, v = 2 * np.pi * i / side, 2 * np.pi * j / side
    vertices = np.stack([(3 + np.cos(v)) * np.cos(u), (3 + np.cos(v)) * np.sin(u), np.sin(v)], axis=1)
    a, b, c, d = ((i + k) % side * side + (j + m) % side for k, m in ((0, 0), (1, 0), (1, 1), (0, 1)))
    return vertices.round(6), np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def obj(vertices, triangles):
    rows = "v %.6f %.6f %.6f\n" * len(vertices) % tuple(vertices.ravel().tolist())
    return (rows + "f %d %d %d\n" * len(triangles) % tuple((triangles + 1).ravel().tolist())).encode()


def stl(vertices, triangles):
    normals = geometry.unit(geometry.area_vectors(vertices, triangles))
    numbers = np.concatenate([normals[:, None], vertices[triangles]], axis=1).reshape(-1, 12)
    corner = "vertex %.6f %.6f %.6f\n"
    facet = f"facet normal %.6f %.6f %.6f\nouter loop\n{3 * corner}endloop\nendfacet\n"
    return f"solid torus\n{len(numbers) * facet % tuple(numbers.ravel().tolist())}endsolid torus\n".encode()


def ply(vertices, triangles):
    properties = "".join(f"property double {axis}\n" for axis in "xyz")
    head = f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\n{properties}element face {len(triangles)}\n"
    rows = "%.6f %.6f %.6f\n" * len(vertices) % tuple(vertices.ravel().tolist())
    faces = "3 %d %d %d\n" * len(triangles) % tuple(triangles.ravel().tolist())
    return f"{head}property list uchar int vertex_indices\nend_header\n{rows}{faces}".encode()


MAKERS = {"obj": obj, "ply": ply, "stl": stl}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("files")
    for kind, make in MAKERS.items():
        (folder / f"a.{kind}").write_bytes(make(*torus(SIDES[kind])))
    return folder


def ours(path):
    started = time.process_time()
    asset = open_asset(path)
    read = time.process_time() - started
    content = asset.with_positions({0: asset.parts[0].vertices + 1e-3})[asset.name]
    path.with_name(f"ours{path.suffix}").write_bytes(content)
    return read, time.process_time() - started - read


def open3d_s(path):
    started = time.process_time()
    mesh = o3d.io.read_triangle_mesh(str(path))
    read = time.process_time() - started
    mesh.translate((1e-3, 1e-3, 1e-3))
    if path.suffix == ".stl":
        mesh.compute_triangle_normals()
    assert o3d.io.write_triangle_mesh(
        str(path.with_name(f"open3d{path.suffix}")), mesh, write_ascii=path.suffix == ".ply"
    )
    return read, time.process_time() - started - read


@pytest.mark.benchmark(group="text: read, moved and written", timer=time.process_time)
@pytest.mark.parametrize("kind", MAKERS)
def test_bench_text(benchmark, files, kind):
    """Open3D writes STL in binary only; what is compared there is reading."""
    path = files / f"a.{kind}"
    peers = np.array([open3d_s(path) for _ in range(3)])
    mine = np.array([ours(path) for _ in range(3)])
    ratio = (np.median(mine, axis=0) / np.median(peers, axis=0)).round(2).tolist()
    benchmark.extra_info |= {"times Open3D's, reading and writing": ratio, "seconds": np.median(mine, axis=0).tolist()}
    benchmark.pedantic(ours, (path,), rounds=1)
    print(kind, benchmark.extra_info)
    assert kind != "obj" or max(ratio) < MOST
