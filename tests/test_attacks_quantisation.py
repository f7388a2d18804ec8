"""Coordinates rounded to a grid."""

import numpy as np
import pytest

from fixtures.attacked import moved
from o3dmark.attacks import ATTACKS
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays, triangle_mesh


def test_quantisation_by_hand() -> None:
    vertices = np.array([[0, 0, 0], [8, 0, 0], [0, 4, 0], [3.9, 1.1, 2], [4.1, 0.4, 0.2]], np.float64)
    mesh = triangle_mesh(vertices, np.array([[0, 1, 2], [1, 2, 3], [2, 3, 4], [0, 1, 4]]))
    by_axis = np.array([[0, 0, 0], [8, 0, 0], [0, 4, 0], [4, 1, 2], [4, 0, 0]], np.float64)  # steps 2, 1, 0.5
    by_axis[4, 2] = 0.0
    assert np.array_equal(moved("quantise:bits=2", mesh), by_axis)
    cube = np.array([[0, 0, 0], [8, 0, 0], [0, 4, 0], [4, 2, 2], [4, 0, 0]], np.float64)  # one step, 2
    assert np.array_equal(moved("quantise:bits=2,grid=cube", mesh), cube)


def test_a_quantised_cube_by_hand() -> None:
    thirds = TriangleMesh.create_box(3.0, 3.0, 3.0)
    thirds = triangle_mesh(np.r_[mesh_arrays(thirds)[0], [[1, 2, 0], [2, 1, 3]]], [*mesh_arrays(thirds)[1], [0, 8, 9]])
    before, after = mesh_arrays(thirds)[0], moved("quantise:bits=2", thirds)  # levels 0, 0.75, 1.5, 2.25, 3
    assert np.array_equal(after[:8], before[:8])
    assert np.array_equal(after[8:], [[0.75, 2.25, 0], [2.25, 0.75, 3]])
    assert moved("quantise:bits=1", thirds)[8:].tolist() == [[1.5, 1.5, 0], [1.5, 1.5, 3]]  # levels 0, 1.5, 3


@pytest.mark.parametrize("bits", [7, 9, 11])
def test_quantisation_moves_by_half_a_step_at_most_and_once(spot: TriangleMesh, bits: int) -> None:
    v, spec = mesh_arrays(spot)[0], f"quantise:bits={bits}"
    once = ATTACKS.make(spec)(spot)
    w = mesh_arrays(once)[0]
    steps = np.ptp(v, axis=0) / 2**bits
    assert (np.abs(w - v) <= 0.5 * steps * (1 + 1e-9)).all()
    levels = (w - w.min(axis=0)) / steps
    assert levels == pytest.approx(np.round(levels), abs=1e-9)
    assert levels.max() == pytest.approx(2**bits)
    assert moved(spec, once) == pytest.approx(w, abs=1e-12)


def test_a_flat_mesh_stays_in_its_plane() -> None:
    flat = triangle_mesh(np.array([[0, 0, 5.5], [1, 0, 5.5], [0.3, 1, 5.5]]), np.array([[0, 1, 2]]))
    assert (moved("quantise:bits=4", flat)[:, 2] == 5.5).all()
