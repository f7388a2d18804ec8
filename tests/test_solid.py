"""The solid that a mesh bounds, closed and outward, and how far it moves."""

import numpy as np
import pytest
import scipy.sparse as sp

from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface
from o3dmark.solid.closing import boundary
from o3dmark.solid.solid import Solid, normal_square


@pytest.fixture(scope="module")
def surface(spot: object) -> Surface:
    return Surface.of(spot)


def test_a_good_mesh_is_left_alone(surface: Surface) -> None:
    solid = Solid.of(surface)
    assert np.array_equal(solid.triangles, surface.triangles)
    assert solid.movable.all()


def test_non_manifold_edges_are_closed_too(surface: Surface) -> None:
    a, b = surface.triangles[0, :2]
    fin = np.array([[a, b, len(surface.vertices)]])
    vertices = np.concatenate([surface.vertices, surface.vertices[[a]] * 1.3])
    solid = Solid.of(Surface.from_arrays(vertices, np.concatenate([surface.triangles, fin])))
    assert not len(boundary(solid.triangles, len(solid.vertices))[0])
    assert not solid.movable[[a, b]].any()


def test_moving_movable_vertices_leaves_the_fans_where_they_are(surface: Surface) -> None:
    open_surface = Surface.from_arrays(surface.vertices, surface.triangles[40:])
    solid = Solid.of(open_surface)
    moved = open_surface.vertices + 1e-4 * solid.movable[:, None]
    again = Solid.of(open_surface.moved(moved))
    assert np.array_equal(again.vertices, solid.moved(moved).vertices)
    assert np.array_equal(again.triangles, solid.triangles)


def along(directions: np.ndarray) -> sp.csr_array:
    """Each vertex goes along its direction (n, 3)."""
    n = len(directions)
    return sp.csr_array((directions.ravel(), (np.arange(3 * n), np.repeat(np.arange(n), 3))), shape=(3 * n, n))


def test_the_normal_square_of_inflating_a_sphere_is_that_of_the_step() -> None:
    t, u = np.meshgrid(np.linspace(0, np.pi, 60)[1:-1], np.linspace(0, 2 * np.pi, 100, endpoint=False), indexing="ij")
    v = np.stack([np.sin(t) * np.cos(u), np.sin(t) * np.sin(u), np.cos(t)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(57), np.arange(100), indexing="ij")
    a, b, c, d = 100 * i + j, 100 * i + 100 + j, 100 * i + 100 + (j + 1) % 100, 100 * i + (j + 1) % 100
    triangles = np.concatenate([np.stack(x, axis=-1).reshape(-1, 3) for x in ((a, b, c), (a, c, d))])
    solid = Solid.of(Surface.from_arrays(v, triangles))
    points, step = solid.vertices[: len(solid.movable)], np.full(len(solid.movable), 0.01)
    assert step @ normal_square(solid, along(points)) @ step == pytest.approx(0.01**2, rel=2e-2)
    assert step @ normal_square(solid, along(np.cross([0.0, 0.0, 1.0], points))) @ step < 1e-6


def test_the_normal_square_is_that_of_the_normal_rms(surface: Surface) -> None:
    """Of any motion along any directions, on a surface with a hole as well, whose fans count in neither."""
    rng = np.random.default_rng(0)
    for triangles in (surface.triangles, surface.triangles[40:]):
        solid = Solid.of(Surface.from_arrays(surface.vertices, triangles))
        directions = rng.standard_normal((len(solid.movable), 3))
        motion = rng.standard_normal(len(solid.movable))
        square = motion @ normal_square(solid, along(directions)) @ motion
        real = (solid.triangles < len(motion)).all(axis=1)
        areas, moved = solid.area_vectors[real], (motion[:, None] * directions)[solid.triangles[real]]
        assert np.sqrt(square) == pytest.approx(geometry.normal_rms(areas, moved), rel=1e-12)
