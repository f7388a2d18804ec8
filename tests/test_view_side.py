"""The side that shows most."""

import numpy as np
import pytest

from fixtures.shapes import mapped
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays, point_cloud, triangle_mesh
from o3dmark.view import Camera, best_side


@pytest.mark.parametrize("up", ["x", "y", "z"])
@pytest.mark.parametrize("side", [(1.0, 0.2, -0.3), (-0.5, 0.3, 0.8), (-0.2, 0.1, -1.0)])
def test_what_rises_is_looked_at(ball: TriangleMesh, side: tuple[float, float, float], up: str) -> None:
    vertices = mesh_arrays(ball)[0]
    way = np.array(side) / np.linalg.norm(side)
    camera = best_side(ball, np.exp(8.0 * (vertices @ way)), up)
    assert camera.up == up
    assert camera.axes[2] @ way > 0.6


def test_a_thin_plate_is_seen_from_its_broad_side() -> None:
    """A plate edge-on to the usual camera, wherever it lies and however small it is."""
    right = Camera().axes[0]
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    axes = np.stack([Camera().axes[2], Camera().axes[1], right])
    plate = triangle_mesh(1e-3 * corners @ axes + 7.0, np.array([[0, 1, 2], [0, 2, 3]]))
    assert abs(best_side(plate).axes[2] @ right) > 0.8


def test_a_ball_and_a_cloud_are_seen_from_three_quarters(ball: TriangleMesh) -> None:
    assert best_side(ball) == Camera()
    assert best_side(ball, np.zeros(len(ball.vertices))) == Camera()
    assert best_side(point_cloud(mesh_arrays(ball)[0])) == Camera()


def test_seams_and_size_do_not_matter(spot: TriangleMesh) -> None:
    vertices, triangles = mesh_arrays(spot)
    values = np.exp(vertices @ [5.0, 0.0, -5.0])
    soup = triangle_mesh(1e4 * vertices[triangles].reshape(-1, 3), np.arange(triangles.size).reshape(-1, 3))
    assert best_side(soup, values[triangles].ravel()) == best_side(spot, values)
    assert best_side(mapped(spot, lambda v: 1e-5 * v + 3.0)) == best_side(spot)
