"""What meshes wear is drawn: textures, colours of vertices, colours of points."""

import numpy as np
import open3d as o3d
import pytest

from fixtures.pictures import FRONT, SMALL, covered
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays, point_cloud, triangle_mesh
from o3dmark.view import render
from o3dmark.view.model import shape_of
from o3dmark.view.worn import worn

RED, BLUE = [0.9, 0.1, 0.1], [0.1, 0.1, 0.9]


def halves(points: np.ndarray) -> o3d.utility.Vector3dVector:
    """Red on the left, blue on the right."""
    return o3d.utility.Vector3dVector(np.where(points[:, :1] < 0.0, RED, BLUE))


def sides(picture: np.ndarray) -> tuple[float, float]:
    """How much more red than blue the left and the right half are, where something is drawn."""
    excess, there = picture[:, :, 0].astype(float) - picture[:, :, 2], covered(picture)
    middle = picture.shape[1] // 2
    left, right = slice(middle - 6), slice(middle + 6, None)
    return float(excess[:, left][there[:, left]].mean()), float(excess[:, right][there[:, right]].mean())


def test_colours_of_vertices_and_points_are_drawn(ball: TriangleMesh) -> None:
    mesh = TriangleMesh(ball)
    points = mesh_arrays(ball)[0]
    mesh.vertex_colors = halves(points)
    cloud = point_cloud(points)
    cloud.colors = halves(points)
    tensor = o3d.t.geometry.PointCloud.from_legacy(cloud)
    for thing in (mesh, o3d.t.geometry.TriangleMesh.from_legacy(mesh), cloud, tensor):
        left, right = sides(render(thing, look="worn", camera=FRONT, size=SMALL))
        assert left > 60
        assert right < -60


def test_colours_stay_at_their_own_side_of_a_seam(ball: TriangleMesh) -> None:
    """Of two vertices at one place, which the surface welds, each colours its own triangles."""
    vertices, triangles = mesh_arrays(ball)
    soup = triangle_mesh(vertices[triangles].reshape(-1, 3), np.arange(triangles.size).reshape(-1, 3))
    flat = np.random.default_rng(5).random((len(triangles), 3)).repeat(3, axis=0)
    soup.vertex_colors = o3d.utility.Vector3dVector(flat)
    shape = shape_of(soup)
    dress = worn(soup, shape)
    assert dress is not None
    drawn = np.arange(len(shape.triangles))
    centres = dress.at(drawn, np.full((len(drawn), 3), 1.0 / 3.0))
    where = {
        tuple(row): colour for row, colour in zip(vertices[triangles].mean(axis=1).round(9), flat[::3], strict=True)
    }
    for centre, colour in zip(shape.vertices[shape.triangles].mean(axis=1).round(9), centres, strict=True):
        np.testing.assert_allclose(colour, where[tuple(centre)], atol=1e-12)


def test_a_texture_goes_before_colours_and_without_either_it_is_clay(ball: TriangleMesh) -> None:
    np.testing.assert_array_equal(render(ball, look="worn", size=SMALL), render(ball, size=SMALL))
    mesh = TriangleMesh(ball)
    mesh.paint_uniform_color(BLUE)
    mesh.triangle_uvs = o3d.utility.Vector2dVector(np.zeros((3 * len(mesh.triangles), 2)))
    mesh.textures = [o3d.geometry.Image(np.full((2, 2, 3), [230, 20, 20], np.uint8))]
    mesh.triangle_material_ids = o3d.utility.IntVector([0] * len(mesh.triangles))
    picture = render(mesh, look="worn", camera=FRONT, size=SMALL)
    assert min(sides(picture)) > 60
    np.testing.assert_array_equal(picture, render(mesh, look="texture", camera=FRONT, size=SMALL))


def test_worn_goes_without_scalars(ball: TriangleMesh) -> None:
    with pytest.raises(ValueError, match="worn view has no scalars"):
        render(ball, np.zeros(len(ball.vertices)), look="worn", size=SMALL)
