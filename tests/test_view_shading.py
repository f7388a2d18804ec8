"""Smooth normals and light, against slow definitions."""

import itertools

import numpy as np
import open3d as o3d
import pytest

from fixtures.pictures import FRONT
from o3dmark.mesh import geometry
from o3dmark.mesh.rays import scene_of
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays, point_cloud, triangle_mesh
from o3dmark.view import (
    Camera,
)
from o3dmark.view.model import CREASE, HALF_CREASE, Model, cloud_normals, corner_normals, shape_of
from o3dmark.view.shading import Hits, open_sky


@pytest.fixture(scope="module")
def sphere() -> TriangleMesh:
    return o3d.geometry.TriangleMesh.create_sphere(1.0, 16)


def slow_corner_normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    area = geometry.area_vectors(vertices, triangles)
    flat = geometry.unit(area)
    normals = np.empty((len(triangles), 3, 3))
    for (t, triangle), corner in itertools.product(enumerate(triangles), range(3)):
        around = np.flatnonzero((triangles == triangle[corner]).any(axis=1))
        mean = area[around].sum(axis=0)
        mean /= np.linalg.norm(mean)
        if (flat[around] @ mean < HALF_CREASE).any():
            mean = area[around[flat[around] @ flat[t] >= CREASE]].sum(axis=0)
        normals[t, corner] = mean / np.linalg.norm(mean)
    return normals


def test_corner_normals_are_means_within_the_crease_angle():
    rough = o3d.geometry.TriangleMesh.create_cylinder(1.0, 2.0, 12, 3)
    vertices, triangles = mesh_arrays(rough)
    vertices += 0.05 * np.random.default_rng(2).normal(size=vertices.shape)
    np.testing.assert_allclose(corner_normals(vertices, triangles), slow_corner_normals(vertices, triangles), atol=1e-6)


def test_a_box_has_flat_sides_and_a_sphere_none(sphere):
    box = o3d.geometry.TriangleMesh.create_box(1, 2, 3).subdivide_midpoint(2)  # edges whose mean leans 45 degrees
    vertices, triangles = mesh_arrays(box)
    flat = geometry.unit(geometry.area_vectors(vertices, triangles))
    np.testing.assert_allclose(corner_normals(vertices, triangles), np.repeat(flat[:, None], 3, axis=1), atol=1e-6)
    vertices, triangles = mesh_arrays(sphere)
    np.testing.assert_allclose(corner_normals(vertices, triangles), vertices[triangles], atol=0.05)


def test_a_convex_shape_sees_all_the_sky_and_the_bottom_of_a_well_little(sphere):
    def sky(mesh: TriangleMesh, camera: Camera) -> tuple[Hits, np.ndarray]:
        shape = shape_of(mesh)
        size = geometry.diagonal(shape.vertices)
        model = Model.of(shape, None, shape.vertices.mean(axis=0), camera.axes.T / size)
        scene = scene_of(model.points, model.triangles)
        hits = Hits.of(model, scene, camera.rays(model.points.astype(float), 120, 90))
        return hits, open_sky(scene, hits)

    assert sky(sphere, FRONT)[1].mean() > 0.999
    box, triangles = mesh_arrays(o3d.geometry.TriangleMesh.create_box(1, 1, 2))
    lid = (box[triangles][:, :, 2] == 2).all(axis=1)
    hits, open_part = sky(triangle_mesh(box, triangles[~lid]), FRONT)  # looking into it
    bottom = hits.points[:, 2] < np.quantile(hits.points[:, 2], 0.05)
    assert open_part[bottom].mean() < 0.6


def test_a_cloud_without_normals_has_those_of_its_surface(sphere):
    points = mesh_arrays(sphere)[0]
    far = point_cloud(1e-9 * points + 3e-9)
    assert np.abs(np.einsum("ij,ij->i", cloud_normals(far), points)).min() > 0.9
    own = point_cloud(points, -points)
    np.testing.assert_allclose(cloud_normals(own), -points)
    assert cloud_normals(point_cloud(points[:1])).shape == (1, 3)
