"""Vertex displacement and SNR: by hand, by scaling laws, and what does not count as equal connectivity."""

import csv
import math

import numpy as np
import open3d as o3d
import pytest

from fixtures.paths import GOLDEN
from o3dmark.errors import MeshError
from o3dmark.files import read_mesh
from o3dmark.mesh.surface import Surface, mesh_arrays, triangle_mesh
from o3dmark.metrics import METRICS
from o3dmark.metrics.displacement import SNR, MaxDisplacement, RmsDisplacement, paired

SQUARE = np.array([[0.0, 0, 0], [3, 0, 0], [3, 4, 0], [0, 4, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
ALL = [MaxDisplacement(), RmsDisplacement(), SNR()]


def test_by_hand():
    after = SQUARE[0].copy()
    after[1] += [0, 0, 2]
    meshes = triangle_mesh(*SQUARE), triangle_mesh(after, SQUARE[1])
    assert MaxDisplacement()(*meshes) == pytest.approx(2 / 5)
    assert RmsDisplacement()(*meshes) == pytest.approx(1 / 5)
    assert SNR()(*meshes) == pytest.approx(10 * np.log10(4 * 2.5**2 / 4))


@pytest.mark.parametrize("metric", ALL)
def test_identity(metric, spot):
    assert metric(spot, spot) == metric.identity
    assert metric.needs_equal_connectivity


def test_snr_alone_grows_with_likeness():
    assert [name for name in METRICS if METRICS[name].identity] == ["snr"]
    assert math.isinf(SNR.identity)


def test_ten_times_the_noise_is_twenty_decibels_less(spot):
    vertices, triangles = mesh_arrays(spot)
    noise = np.random.default_rng(0).normal(size=vertices.shape)
    weak, strong = (triangle_mesh(vertices + a * noise, triangles) for a in (1e-4, 1e-3))
    assert SNR()(spot, weak) - SNR()(spot, strong) == pytest.approx(20)
    for metric in (MaxDisplacement(), RmsDisplacement()):
        assert metric(spot, strong) == pytest.approx(10 * metric(spot, weak))
    assert RmsDisplacement()(spot, weak) < MaxDisplacement()(spot, weak)


@pytest.mark.parametrize("metric", ALL)
def test_of_both_meshes_moved_and_scaled(metric, spot):
    vertices, triangles = mesh_arrays(spot)
    after = vertices + 0.01 * np.random.default_rng(0).normal(size=vertices.shape)
    both = [triangle_mesh(v, triangles) for v in (vertices, after)]
    alike = [triangle_mesh(v * 7 + [1.0, 2, 3], triangles) for v in (vertices, after)]
    assert metric(*alike) == pytest.approx(metric(*both), rel=1e-9)


def test_sliding_within_the_surface_is_seen():
    grid = np.array([[x, y, 0.0] for x in range(4) for y in range(4)])
    corners = np.array(
        [[i, i + 4, i + 5] for i in (0, 1, 2, 4, 5, 6)] + [[i, i + 5, i + 1] for i in (0, 1, 2, 4, 5, 6)]
    )
    slid = grid.copy()
    slid[5] += [0.25, 0, 0]
    meshes = triangle_mesh(grid, corners), triangle_mesh(slid, corners)
    assert MaxDisplacement()(*meshes) * Surface.of(meshes[0]).diagonal == pytest.approx(0.25)


def test_a_torn_seam_is_seen():
    vertices, triangles = SQUARE
    soup = vertices[triangles].reshape(-1, 3)
    corners = np.arange(6).reshape(2, 3)
    torn = soup.copy()
    torn[3] += [0, 0, 2]  # the second copy of vertex 0
    meshes = triangle_mesh(soup, corners), triangle_mesh(torn, corners)
    assert MaxDisplacement()(*meshes) == pytest.approx(2 / 5)
    pair = paired(*meshes)
    assert len(pair.surface.vertices) == 4
    assert np.array_equal(pair.moved.vertices, pair.surface.vertices)


def test_unused_vertices_do_not_count():
    extra = np.vstack([[[9.0, 9, 9]], SQUARE[0]])
    gone = extra.copy()
    gone[0] = -50
    meshes = triangle_mesh(extra, SQUARE[1] + 1), triangle_mesh(gone, SQUARE[1] + 1)
    assert MaxDisplacement()(*meshes) == 0


def test_the_order_of_triangles_and_of_their_corners_does_not_matter(spot):
    vertices, triangles = mesh_arrays(spot)
    shuffled = np.roll(np.random.default_rng(0).permutation(triangles), 1, axis=1)
    assert MaxDisplacement()(spot, triangle_mesh(vertices, shuffled)) == 0


@pytest.mark.parametrize("metric", ALL)
def test_other_connectivity_is_refused(metric, spot):
    vertices, triangles = mesh_arrays(spot)
    order = np.random.default_rng(0).permutation(len(vertices))
    others = [
        spot.subdivide_midpoint(1),
        triangle_mesh(vertices, triangles[1:]),
        triangle_mesh(vertices, triangles[:, ::-1]),
        triangle_mesh(vertices[order], np.argsort(order)[triangles]),
    ]
    for other in others:
        with pytest.raises(MeshError, match="same triangles"):
            metric(spot, other)
    with pytest.raises(MeshError, match="no triangle"):
        metric(spot, o3d.geometry.TriangleMesh())


def test_agrees_with_the_golden_values(spot):
    with open(GOLDEN / "metrics_spot.csv") as file:
        rows = [row for row in csv.DictReader(file) if row["metric"].startswith("vertex_")]
    assert len(rows) == 8
    for row in rows:
        metric = RmsDisplacement() if row["metric"] == "vertex_RMSE_index_corr" else MaxDisplacement()
        ours = metric(spot, read_mesh(GOLDEN / f"{row['pair']}.ply")) * Surface.of(spot).diagonal
        assert ours == pytest.approx(float(row["oracle"]), rel=1e-8)
