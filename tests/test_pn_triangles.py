"""The curved surface that a coarse mesh stands for."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from o3dmark.mesh.geometry import volume
from o3dmark.mesh.pn_triangles import pn_triangles
from o3dmark.mesh.surface import Surface

GOLDEN_RATIO = 0.5 * (1.0 + np.sqrt(5.0))


def icosahedron() -> Surface:
    """Inscribed in the unit sphere."""
    p = GOLDEN_RATIO
    corners = [(0, a, b * p) for a in (-1, 1) for b in (-1, 1)]
    v = np.array([np.roll(c, i) for c in corners for i in range(3)]) / np.hypot(1.0, p)
    t = ConvexHull(v).simplices
    outward = np.einsum("md,md->m", np.cross(v[t[:, 1]] - v[t[:, 0]], v[t[:, 2]] - v[t[:, 0]]), v[t[:, 0]]) > 0
    return Surface.from_arrays(v, np.where(outward[:, None], t, t[:, ::-1]).astype(np.int64))


def test_each_triangle_becomes_four_and_the_vertices_stay() -> None:
    coarse = icosahedron()
    fine = pn_triangles(coarse)
    assert len(fine.triangles) == 4 * len(coarse.triangles)
    assert {tuple(v) for v in coarse.vertices.tolist()} <= {tuple(v) for v in fine.vertices.tolist()}


def test_a_coarse_sphere_grows_rounder() -> None:
    coarse = icosahedron()
    fine = pn_triangles(coarse)
    ball = 4.0 / 3.0 * np.pi
    assert volume(coarse.vertices, coarse.triangles) < 0.65 * ball
    assert 0.8 * ball < volume(fine.vertices, fine.triangles) < ball
    assert np.linalg.norm(fine.vertices, axis=1).min() > 0.95


def test_flat_parts_stay_flat() -> None:
    x, y = np.meshgrid(np.arange(4.0), np.arange(3.0))
    v = np.stack([x.ravel(), y.ravel(), 0.0 * x.ravel()], axis=1)
    t = np.array([(i, i + 1, i + 5) for i in (0, 1, 2)] + [(i, i + 5, i + 4) for i in (0, 1, 2)])
    fine = pn_triangles(Surface.from_arrays(v, t))
    assert np.ptp(fine.vertices[:, 2]) == pytest.approx(0.0, abs=1e-12)
