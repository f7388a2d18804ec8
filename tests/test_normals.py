"""Normals that follow a surface: rotation, closed seams, hard edges, and nothing where nothing moved."""

import numpy as np
import pytest

from fixtures.shapes import UNIT_SQUARE, icosphere, rotation
from o3dmark.mesh import geometry
from o3dmark.mesh.normals import Turns, turned

SPHERE, TRIANGLES = icosphere(2)
LENGTHS = np.random.default_rng(0).uniform(0.5, 2.0, (len(SPHERE), 1))


def bumpy(vertices: np.ndarray, seed: int = 0) -> np.ndarray:
    """Vertices with a smooth motion of a few percent."""
    waves = np.random.default_rng(seed).normal(size=(3, 3))
    return vertices + 0.03 * np.sin(2.0 * vertices @ waves)


@pytest.mark.parametrize("seed", range(3))
def test_normals_go_along_with_a_rotation_that_is_small(seed: int) -> None:
    turn = rotation(seed)
    axis_angle = 0.1 * (turn - turn.T)  # skew: exp of it is a rotation by less than half a turn
    small = np.linalg.matrix_power(np.eye(3) + axis_angle / 64, 64)
    small = np.linalg.svd(small)[0] @ np.linalg.svd(small)[2]
    after = turned(SPHERE, SPHERE @ small.T, TRIANGLES, SPHERE)(SPHERE)
    np.testing.assert_allclose(geometry.unit(after), SPHERE @ small.T, atol=5e-3)  # not quite an icosphere's own


def test_lengths_stay_and_what_did_not_move_is_left_exactly() -> None:
    normals = LENGTHS * SPHERE
    after = turned(SPHERE, bumpy(SPHERE), TRIANGLES, normals)(normals)
    np.testing.assert_allclose(np.linalg.norm(after, axis=1), LENGTHS[:, 0], rtol=1e-12)
    assert np.abs(after - normals).max() > 1e-3
    np.testing.assert_array_equal(turned(SPHERE, SPHERE, TRIANGLES, normals)(normals), normals)


def test_turned_normals_are_those_of_the_new_surface_where_they_were_those_of_the_old() -> None:
    before = geometry.unit(geometry.vertex_area_vectors(SPHERE, TRIANGLES))
    wanted = geometry.unit(geometry.vertex_area_vectors(bumpy(SPHERE), TRIANGLES))
    np.testing.assert_allclose(turned(SPHERE, bumpy(SPHERE), TRIANGLES, before)(before), wanted, atol=1e-12)


def test_a_seam_stays_closed() -> None:
    """Every triangle with corners of its own, as after unwelding: equal normals at equal positions stay equal."""
    corners = TRIANGLES.ravel()
    soup, moved, triangles = SPHERE[corners], bumpy(SPHERE)[corners], np.arange(len(corners)).reshape(-1, 3)
    after = turned(soup, moved, triangles, soup)(soup)
    welded = turned(SPHERE, bumpy(SPHERE), TRIANGLES, SPHERE)(SPHERE)
    np.testing.assert_allclose(after, welded[corners], atol=1e-12)
    for corner in range(len(SPHERE)):
        assert len(np.unique(after[corners == corner], axis=0)) == 1


def test_a_hard_edge_stays_hard() -> None:
    """A roof: two squares that share an edge but not its normals. One is lifted; the other's normals stay."""
    square, two = UNIT_SQUARE
    vertices = np.vstack([square, square * [-1, 1, 0]])
    triangles = np.vstack([two, two[:, ::-1] + 4])
    normals = np.vstack([np.tile([0.0, 0, 1], (4, 1)), np.tile([0.0, 0.6, 0.8], (4, 1))])
    after = vertices.copy()
    after[[1, 2], 2] += 0.1
    new = turned(vertices, after, triangles, normals)(normals)
    np.testing.assert_array_equal(new[4:], normals[4:])
    np.testing.assert_allclose(new[:4], np.tile(geometry.unit(np.array([[-0.1, 0, 1]])), (4, 1)), atol=1e-12)


def test_normals_may_be_numbered_by_corner() -> None:
    """As in OBJ files, where a normal serves any vertices: the six of a cube turn with the whole of their faces."""
    square, two = UNIT_SQUARE
    after = square + [0.0, 0.0, 0.1] * square[:, [0]]
    normals = np.array([[0.0, 0, 1], [1.0, 0, 0]])
    new = turned(square, after, two, normals, np.array([[0, 0, 0], [0, 0, -1]]))(normals)
    np.testing.assert_allclose(new[0], geometry.unit(np.array([[-0.1, 0, 1]]))[0], atol=1e-12)
    np.testing.assert_array_equal(new[1], normals[1])  # no corner uses it


def test_normals_that_say_nothing_are_left() -> None:
    normals = SPHERE.copy()
    normals[0], normals[1] = 0.0, np.nan
    after = turned(SPHERE, bumpy(SPHERE), TRIANGLES, normals)(normals)
    np.testing.assert_array_equal(after[0], 0.0)
    assert np.isnan(after[1]).all()
    assert np.isfinite(after[2:]).all()


def test_a_surface_turned_over_says_nothing_of_the_turn() -> None:
    up, down = np.array([[0.0, 0, 1]]), np.array([[0.0, 0, -1]])
    np.testing.assert_array_equal(Turns(up, down)(np.eye(3)), np.eye(3))
    np.testing.assert_array_equal(Turns(up, 0 * up)(up), up)


@pytest.mark.parametrize("wild", [np.nan, np.inf, 1e300])
def test_where_numbers_are_wild_nothing_turns(wild: float) -> None:
    before, normals = SPHERE.copy(), SPHERE.copy()
    after = bumpy(before)
    before[0] = after[7] = wild
    normals[5] = np.nan if wild == 1e300 else wild
    new = turned(before, after, TRIANGLES, normals)(normals)
    np.testing.assert_array_equal(new[[0, 5, 7]], normals[[0, 5, 7]])
    others = np.setdiff1d(np.arange(len(SPHERE)), [*TRIANGLES[np.isin(TRIANGLES, [0, 5, 7]).any(axis=1)].ravel()])
    assert np.isfinite(new[others]).all()
    assert (np.abs(new[others] - normals[others]).max(axis=1) > 0.0).all()
