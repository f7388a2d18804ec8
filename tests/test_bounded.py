"""Meshes made to be expensive: each is read or refused, within memory and time that do not grow with its absurdity."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fixtures.shapes import fan_of_polygon, needles
from o3dmark.coding.keys import Key
from o3dmark.errors import MeshError
from o3dmark.mesh.proximity import closest_points
from o3dmark.mesh.surface import Surface, TriangleMesh, mesh_arrays, triangle_mesh
from o3dmark.metrics import METRICS
from o3dmark.profiles import PROFILES
from o3dmark.solid.quadrature import _MOST_PARTS, rule
from o3dmark.solid.solid import Solid

MARK = PROFILES["robust-2026"]
QUICK = replace(MARK, method=MARK.method.quick)  # every spectrum of a search costs the same; one is enough to see it


def with_triangle(arrays: tuple[np.ndarray, np.ndarray], *corners: tuple[float, float, float]):
    """A mesh and one more triangle, its corners in diagonals of the mesh."""
    vertices, triangles = arrays
    diagonal = np.linalg.norm(np.ptp(vertices, axis=0))
    n = len(vertices)
    more = np.vstack([vertices, diagonal * np.array(corners)])
    return triangle_mesh(more, np.vstack([triangles, [[n, n + 1, n + 2]]]))


COLLINEAR = ((0.0, 0.0, 0.0), (1e5, 0.0, 0.0), (5e4, 0.0, 0.0))
CRAFTED = {
    "needle": ((0.0, 0.0, 0.0), (1e5, 0.0, 0.0), (5e4, 1e-4, 0.0)),
    "huge": ((0.0, 0.0, 0.0), (1e3, 0.0, 0.0), (5e2, 1e3, 0.0)),
}


@pytest.mark.parametrize("kind", CRAFTED)
def test_one_absurd_triangle_is_read_or_refused(kind: str, spot: TriangleMesh, key: Key) -> None:
    mesh = with_triangle(mesh_arrays(spot), *CRAFTED[kind])
    assert not QUICK.extract(mesh, key).found
    with pytest.raises(MeshError, match=r"proportion|slender|longer than"):
        MARK.embed(mesh, "m", key)


def test_a_marked_mesh_with_a_collinear_triangle_is_still_read(spot: TriangleMesh, key: Key) -> None:
    vertices, triangles = mesh_arrays(spot)
    marked = MARK.embed(triangle_mesh(vertices, triangles), "mine", key)
    mesh = with_triangle((np.asarray(marked.vertices), triangles), *COLLINEAR)
    assert MARK.extract(mesh, key).message == "mine"


def test_triangles_are_not_cut_without_end() -> None:
    corner = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    solid = Solid.of(Surface.from_arrays(corner, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])))
    assert len(rule(solid, 0.01).triangle) < 10 * _MOST_PARTS
    with pytest.raises(MeshError, match="longer than the solid"):
        rule(solid, 1e-5)


def test_a_cluster_of_vertices_is_read_or_refused(key: Key) -> None:
    rng = np.random.default_rng(0)
    vertices = np.concatenate([np.eye(3), 1e-9 * rng.standard_normal((300, 3))])
    mesh = triangle_mesh(vertices, rng.integers(0, len(vertices), (600, 3)))
    with pytest.raises(MeshError):
        MARK.embed(mesh, "m", key)
    assert not QUICK.extract(mesh, key).found


@pytest.mark.parametrize("metric", ["msdm", "msdm2"])
def test_a_mesh_that_is_a_speck_beside_its_box_has_no_windows(metric: str) -> None:
    ball = TriangleMesh.create_icosahedron().subdivide_loop(5)
    mesh = with_triangle(mesh_arrays(ball), (1e4, 0.0, 0.0), (1e4, 1.0, 0.0), (1e4, 0.0, 1.0))
    with pytest.raises(MeshError, match="most of the mesh lies in one window"):
        METRICS.make(metric)(mesh, mesh)


@pytest.mark.parametrize("make", [lambda: needles(20_000), lambda: fan_of_polygon(10_000)])
def test_closest_points_among_what_overlaps_take_little_work(make: Callable[[], Surface]) -> None:
    """To look at every triangle would be 320 000 a point and more, at those in whose box it lies 30 000."""
    surface = make()
    middle = surface.vertices[surface.triangles].mean(axis=1)[::5]
    found = closest_points(middle, surface, most_work=5_000 * len(middle))
    assert found.distance.max() < 1e-7  # as exact as needles are


def test_what_a_fan_about_one_edge_costs_is_told() -> None:
    """There is no hinge: each edge has one triangle, or all of them."""
    n = 300
    vertices = np.vstack([np.eye(3)[:2], np.random.default_rng(0).random((n, 3))])
    book = triangle_mesh(vertices, np.array([[0, 1, k] for k in range(2, n + 2)]))
    assert METRICS.make("bending")(book, book) == 0.0


def test_a_speck_is_looked_at_from_nearby() -> None:
    """From the middle of the box its planes cannot be told apart, which would cost five times as much."""
    rng, n = np.random.default_rng(0), 10_000
    vertices = np.vstack([np.eye(3), 1e-9 * rng.standard_normal((n, 3))])
    surface = Surface.from_arrays(vertices, np.vstack([[[0, 1, 2]], rng.integers(3, n + 3, (n, 3))]))
    found = closest_points(surface.vertices, surface, most_work=12_000 * len(surface.vertices))
    assert found.distance.max() < 1e-20
