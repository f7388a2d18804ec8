"""Rings, folds and curvature: small meshes by hand, shapes of known curvature, and the walk as its text says it."""

import math

import numpy as np
import open3d as o3d
import pytest

from fixtures.references import neighbours, walk_slowly
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface, mesh_arrays
from o3dmark.metrics.normal_cycle import bends, curvature, rings_of, steps_for, walk

TENT = np.array([[0.0, 0, 0], [0, 4, 0], [1, 2, -1], [-1, 2, -1]]), np.array([[0, 2, 1], [0, 1, 3]])


def curvature_slowly(points, triangles, ring, radius):
    normals = {}
    for a, b, c in triangles:
        normal = np.cross(points[b] - points[a], points[c] - points[a])
        for edge in ((a, b), (b, c), (c, a)):
            normals[edge] = normal / np.linalg.norm(normal)
    values = []
    for v in range(len(points)):
        M = np.zeros((3, 3))
        for p, q, inside, _ in walk_slowly(v, radius, points, ring):
            if (p, q) in normals and (q, p) in normals:
                edge = points[q] - points[p]
                u = edge / np.linalg.norm(edge)
                beta = math.asin(np.clip(np.cross(normals[q, p], normals[p, q]) @ u, -1, 1))
                M += beta * inside * np.linalg.norm(edge) * np.outer(u, u)
        sizes = sorted(np.abs(np.linalg.eigvalsh(M / (math.pi * radius**2))))
        values.append((sizes[1] + sizes[2]) / 2)
    return np.array(values)


def test_rings_are_the_neighbours(spot):
    _, triangles = mesh_arrays(spot)
    rings = rings_of(triangles, len(spot.vertices))
    edges = {(v, w) for v, ring in enumerate(neighbours(rings)) for w in ring}
    assert edges == {(v, w) for pair in geometry.edges(triangles).tolist() for v, w in (pair, pair[::-1])}
    assert len(rings.target) == len(edges)


def test_a_ring_starts_at_the_last_triangle_and_goes_on_over_next_and_opposite():
    closed = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]])
    assert neighbours(rings_of(closed, 5))[0] == [1, 4, 3, 2]
    assert neighbours(rings_of(closed[[2, 0, 3, 1]], 5))[0] == [3, 2, 1, 4]
    opened = closed[:3]
    assert neighbours(rings_of(opened, 5))[0] == [4, 3, 2, 1]
    assert neighbours(rings_of(opened[[1, 2, 0]], 5))[0] == [2, 1, 4, 3]  # past the gap


def test_fans_that_meet_in_one_vertex_are_both_in_its_ring():
    bow = np.array([[0, 1, 2], [0, 3, 4], [0, 4, 5]])
    assert sorted(neighbours(rings_of(bow, 6))[0]) == [1, 2, 3, 4, 5]


def test_rings_of_any_triangles_are_the_neighbours():
    for seed in range(20):
        rng = np.random.default_rng(seed)
        triangles = np.array([rng.choice(9, 3, replace=False) for _ in range(25)])
        rings = neighbours(rings_of(triangles, 9))
        for v, ring in enumerate(rings):
            around = set(triangles[(triangles == v).any(axis=1)].ravel()) - {v}
            assert sorted(ring) == sorted(around)


def test_a_fold_is_its_angle_over_its_length_from_both_ends():
    rings = rings_of(TENT[1], 4)
    bend = bends(*TENT, rings)
    ridge = {(v, w): bend[rings.start[v] + i] for v, ring in enumerate(neighbours(rings)) for i, w in enumerate(ring)}
    assert abs(ridge[0, 1]) == pytest.approx(math.pi / 2 / 4)
    assert ridge[0, 1] == ridge[1, 0]
    assert not any(value for edge, value in ridge.items() if set(edge) != {0, 1})
    valley = TENT[0] * [1, 1, -1]
    assert bends(valley, TENT[1], rings)[rings.start[0] + neighbours(rings)[0].index(1)] == -ridge[0, 1]


@pytest.mark.parametrize(
    "triangles",
    [
        [[0, 2, 1], [0, 1, 3], [0, 1, 4]],  # three triangles at one edge
        [[0, 2, 1], [0, 3, 1]],  # wound against each other
    ],
)
def test_an_edge_that_is_no_surface_does_not_bend(triangles):
    vertices = np.vstack([TENT[0], [[0, 2, 3]]])
    triangles = np.array(triangles)
    assert not bends(vertices, triangles, rings_of(triangles, 5)).any()


def test_triangles_without_area_do_not_bend():
    vertices = np.array([[0.0, 0, 0], [0, 4, 0], [0, 2, 0], [-1, 2, -1]])
    assert not bends(vertices, TENT[1], rings_of(TENT[1], 4)).any()


def test_an_edge_without_length_gives_no_curvature():
    sphere = Surface.of(o3d.geometry.TriangleMesh.create_sphere(1.0, 10))
    vertices = sphere.vertices.copy()
    a, b = sphere.triangles[50, :2]
    vertices[a] = vertices[b]
    rings = rings_of(sphere.triangles, len(vertices))
    values = curvature(vertices, sphere.triangles, rings, 0.3)
    assert np.isfinite(values).all()
    assert values[a] == 0
    assert (values > 0).sum() > len(vertices) / 2


def test_a_sphere_is_curved_alike_all_over_and_less_when_larger():
    surface = Surface.of(o3d.geometry.TriangleMesh.create_icosahedron().subdivide_loop(4))
    sphere, rings = geometry.unit(surface.vertices), rings_of(surface.triangles, len(surface.vertices))
    values = curvature(sphere, surface.triangles, rings, 0.4)
    assert values.std() < 0.05 * values.mean()
    assert 0.8 < values.mean() < 0.9  # less than 1: edges across the walk's way are used from neither end
    assert curvature(8 * sphere, surface.triangles, rings, 3.2) == pytest.approx(values / 8, rel=1e-9)


def test_a_plane_is_not_curved():
    cube = Surface.of(o3d.geometry.TriangleMesh.create_box().subdivide_midpoint(4))
    values = curvature(cube.vertices, cube.triangles, rings_of(cube.triangles, len(cube.vertices)), 0.2)
    from_edge = np.sort(np.minimum(cube.vertices, 1 - cube.vertices), axis=1)[:, 1]
    assert values[from_edge > 0.2].max() < 1e-12
    assert values[from_edge == 0].min() > 0.1


@pytest.mark.parametrize("radius", [0.1, 0.4, 0.8])
def test_curvature_agrees_with_its_definition(radius):
    torus = Surface.of(o3d.geometry.TriangleMesh.create_torus(1.0, 0.4, 12, 8))
    points = torus.vertices + 0.03 * np.random.default_rng(0).normal(size=torus.vertices.shape)
    triangles = torus.triangles[5:]  # with a boundary
    rings = rings_of(triangles, len(points))
    slow = curvature_slowly(points, triangles.tolist(), neighbours(rings), radius)
    assert curvature(points, triangles, rings, radius) == pytest.approx(slow, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("name", ["spot", "grid"])
def test_a_walk_follows_its_definition_to_the_letter(name, spot):
    grid = o3d.geometry.TriangleMesh.create_box().subdivide_midpoint(4)  # where edges are exactly across the way
    surface = Surface.of(spot if name == "spot" else grid)
    points = surface.vertices
    rings = rings_of(surface.triangles, len(points))
    ring, steps = neighbours(rings), steps_for(rings)
    for v in range(0, len(points), 100):
        n = walk(v, 0.16, points, rings, steps)
        slow = walk_slowly(v, 0.16, points, ring)
        assert list(zip(steps.source[:n], rings.target[steps.entry[:n]], strict=True)) == [step[:2] for step in slow]
        assert steps.inside[:n] == pytest.approx(np.array([step[2] for step in slow]), abs=1e-9)
        assert steps.fresh[:n].tolist() == [step[3] for step in slow]
