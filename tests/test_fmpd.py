"""FMPD: roughness by hand and as slow Python, invariances, and monotony in noise."""

import math

import numpy as np
import open3d as o3d
import pytest

from fixtures.paths import GOLDEN
from fixtures.shapes import noisy
from o3dmark.errors import MeshError
from o3dmark.files import read_mesh
from o3dmark.mesh.surface import Surface, mesh_arrays, triangle_mesh
from o3dmark.metrics.fmpd import FMPD, roughness

# Of spot and each of these, by the authors' MATLAB program (Wang_perceptual_distance.m in psapirstein/mesh-comparing),
# written again line by line in numpy, with its order of operations, and run on 2026-11-22.
AUTHORS = {
    "spot_gauss0.1": 0.2639498508013869,
    "spot_unif0.5": 0.555943737626517,
    "spot_lap10": 0.0827517823778986,
    "spot_quant8": 0.4323225151858834,
}


def roughness_slowly(surface):
    """Corner by corner, from the definition."""
    V, n = surface.vertices, len(surface.vertices)
    angle, weight, used = np.zeros(n), np.zeros((n, n)), {}
    for triangle in surface.triangles.tolist():
        for k in range(3):
            a, b, c = triangle[k], triangle[k - 2], triangle[k - 1]
            u, v = V[b] - V[a], V[c] - V[a]
            corner = math.acos(np.clip(u @ v / np.linalg.norm(u) / np.linalg.norm(v), -1, 1))
            angle[a] += corner
            weight[b, c] += np.clip(0.5 / math.tan(corner), 0.001, 1000)
            weight[c, b] = weight[b, c]
            used[frozenset((b, c))] = used.get(frozenset((b, c)), 0) + 1
    boundary = {v for edge, count in used.items() if count == 1 for v in edge}
    defect = np.array([abs((math.pi if v in boundary else 2 * math.pi) - angle[v]) for v in range(n)])
    return abs(defect - weight @ defect / weight.sum(axis=1))


def fmpd_slowly(one, other):
    local, mean, area = [], [], []
    for surface in (one, other):
        local.append(roughness_slowly(surface))
        area.append(surface.vertex_areas)
        mean.append(sum(r * a for r, a in zip(local[-1], area[-1], strict=True)) / sum(area[-1]))
    least, most, turn = 0.0005, max(0.2, 5 * min(mean)), max(min(mean), 0.0005)
    total = []
    for values, areas in zip(local, area, strict=True):
        seen = []
        for r in values:
            s = min(max(r, least), most) ** 0.15 - least**0.15
            bend = turn**0.15 - least**0.15
            seen.append(bend + 0.5 * (s - bend) if s > bend else s)
        total.append(sum(s * a for s, a in zip(seen, areas, strict=True)) / sum(areas))
    return min(8 * abs(total[0] - total[1]), 1)


def torus(amplitude, cut=0):
    mesh = noisy(o3d.geometry.TriangleMesh.create_torus(1.0, 0.4, 24, 16), amplitude)
    vertices, triangles = mesh_arrays(mesh)
    return triangle_mesh(vertices, triangles[cut:])


@pytest.mark.parametrize("cut", [0, 40])
def test_is_its_definition(cut):
    one, other = torus(0.001, cut), torus(0.004, cut)
    assert roughness(Surface.of(other)) == pytest.approx(roughness_slowly(Surface.of(other)), rel=1e-9, abs=1e-12)
    slow = fmpd_slowly(Surface.of(one), Surface.of(other))
    assert 0.01 < slow < 1
    assert FMPD()(one, other) == pytest.approx(slow, rel=1e-9)


@pytest.mark.parametrize("pair", AUTHORS)
def test_agrees_with_the_authors_program(pair, spot):
    assert FMPD()(spot, read_mesh(GOLDEN / f"{pair}.ply")) == pytest.approx(AUTHORS[pair], rel=1e-9)


def test_what_is_everywhere_alike_is_not_rough():
    for mesh in (o3d.geometry.TriangleMesh.create_octahedron(), o3d.geometry.TriangleMesh.create_icosahedron()):
        assert roughness(Surface.of(mesh)) == pytest.approx(0, abs=1e-12)


def test_a_spike_on_a_plane_is_rough_where_it_is():
    grid = np.array([[x, y, 0.0] for x in range(7) for y in range(7)])
    corners = [[i, i + 7, i + 8] for i in range(42) if i % 7 < 6] + [[i, i + 8, i + 1] for i in range(42) if i % 7 < 6]
    flat = Surface.from_arrays(grid, np.array(corners))
    inner = (grid[:, :2] % 6 > 0).all(axis=1)
    deep = ((grid[:, :2] > 1) & (grid[:, :2] < 5)).all(axis=1)
    assert roughness(flat)[deep].max() < 1e-12
    spike = grid.copy()
    spike[24] += [0, 0, 1]  # the middle
    rough = roughness(flat.moved(spike))
    assert np.argmax(np.where(inner, rough, 0)) == 24


def test_axioms(spot):
    other = noisy(spot, 1e-3)
    assert FMPD()(spot, spot) == 0
    assert FMPD()(spot, other) == FMPD()(other, spot)
    assert 0 < FMPD()(spot, other) <= 1


def test_grows_with_noise_and_smoothing(spot):
    for stronger in (
        [noisy(spot, amplitude) for amplitude in (1e-5, 1e-4, 1e-3, 3e-3)],
        [spot.filter_smooth_laplacian(n, 0.1) for n in (5, 10, 30)],
    ):
        values = [FMPD()(spot, mesh) for mesh in stronger]
        assert 0 < values[0] < 0.2
        assert values == sorted(values)


def test_of_one_mesh_moved_turned_and_scaled(spot):
    alike = o3d.geometry.TriangleMesh(spot)
    alike.rotate(o3d.geometry.get_rotation_matrix_from_xyz([0.3, 1.0, 2.0])).scale(100.0, [1.0, 2, 3])
    assert FMPD()(spot, alike) == pytest.approx(0, abs=1e-6)
    other = noisy(spot, 1e-3)
    assert FMPD()(alike, other) == pytest.approx(FMPD()(spot, other), rel=1e-6)


def test_triangles_without_area_are_measured(spot):
    vertices, triangles = mesh_arrays(spot)
    vertices[triangles[40, 0]] = vertices[triangles[40, 1:]].mean(axis=0)
    assert 0 <= FMPD()(spot, triangle_mesh(vertices, triangles)) < 0.1


def test_a_mesh_without_triangles_is_refused(spot):
    with pytest.raises(MeshError, match="no triangle"):
        FMPD()(o3d.geometry.TriangleMesh(), spot)
