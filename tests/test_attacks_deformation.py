"""Bending and twisting."""

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from fixtures.attacked import moved
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays, triangle_mesh


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_twist_keeps_distances_to_its_axis(spot: TriangleMesh, axis: str) -> None:
    v, w = mesh_arrays(spot)[0], moved(f"twist:angle=40,axis={axis}", spot, 1)
    column = "xyz".index(axis)
    across = np.delete(v, column, axis=1), np.delete(w, column, axis=1)
    centre = (across[0].min(axis=0) + across[0].max(axis=0)) / 2.0
    assert np.array_equal(v[:, column], w[:, column])
    radii = [np.linalg.norm(points - centre, axis=1) for points in across]
    assert radii[0] == pytest.approx(radii[1])


@pytest.mark.parametrize("name", ["twist", "bend"])
@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_both_ends_of_a_deformation_move_rigidly(spot: TriangleMesh, name: str, axis: str) -> None:
    v = mesh_arrays(spot)[0]
    w = moved(f"{name}:angle=60,axis={axis},band=0.3", spot, 1)
    along = v[:, "xyz".index(axis)]
    order = np.argsort(along)
    low, high = order[:10], order[-10:]
    assert w[low] == pytest.approx(v[low], abs=1e-12)
    assert pdist(w[high]) == pytest.approx(pdist(v[high]))
    turn = np.linalg.lstsq(v[high] - v[high].mean(axis=0), w[high] - w[high].mean(axis=0), rcond=None)[0]
    assert np.degrees(np.arccos((np.trace(turn) - 1.0) / 2.0)) == pytest.approx(60.0, abs=1e-4)


def test_a_bend_is_continuous_and_keeps_the_length_of_the_axis() -> None:
    height = np.linspace(0.0, 1.0, 400)
    strip = np.concatenate([np.c_[np.full(400, side), np.zeros(400), height] for side in (-0.1, 0.1)])
    triangles = np.array([[i, i + 1, i + 400] for i in range(399)] + [[i + 1, i + 401, i + 400] for i in range(399)])
    w = moved("bend:angle=90,axis=z,band=0.5", triangle_mesh(strip, triangles), 0)
    middle = (w[:400] + w[400:]) / 2.0
    steps = np.linalg.norm(np.diff(middle, axis=0), axis=1)
    assert steps == pytest.approx(np.full(399, 1 / 399), rel=1e-3)
    first, last = np.diff(middle[:2], axis=0)[0], np.diff(middle[-2:], axis=0)[0]
    assert first @ last == pytest.approx(0.0, abs=1e-9)
    assert last[0] > 0  # towards the next axis
