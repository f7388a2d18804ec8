"""The tree of boxes: what is cut, how much at most, and that no part of a triangle is lost."""

import numpy as np
import pytest

from fixtures.shapes import fan_of_polygon, needles
from o3dmark.mesh import geometry
from o3dmark.mesh.box_tree import tree_of
from o3dmark.mesh.surface import Surface


def leaves_of(tree):
    return [(tree.box[k], tree.order[tree.first[k] : tree.last[k]]) for k in np.flatnonzero(tree.child < 0)]


def crossing(seed, far=0.0):
    """300 triangles with random corners, 100 of them needles."""
    rng = np.random.default_rng(seed)
    corners = rng.random((300, 3, 3))
    corners[200:, 2] = corners[200:, 1] + 1e-3 * rng.random((100, 3))
    return Surface.from_arrays(corners.reshape(-1, 3) + far, np.arange(900).reshape(-1, 3))


@pytest.mark.parametrize("shape", ["spot", "flat"])
def test_triangles_that_meet_at_edges_only_are_never_cut(shape, spot):
    surface = Surface.of(spot)
    if shape == "flat":
        surface = surface.moved(surface.vertices * [1.0, 1.0, 1e-9])
    assert np.array_equal(np.sort(tree_of(surface).order), np.arange(len(surface.triangles)))


@pytest.mark.parametrize("far", [0.0, 1e6])
def test_no_part_of_a_triangle_is_lost(far):
    surface, rng = crossing(1, far), np.random.default_rng(2)
    tree = tree_of(surface)
    assert len(tree.order) > 2 * len(surface.triangles)
    shares = rng.dirichlet([0.5, 0.5, 0.5], 400)
    points = np.einsum("qs,msd->mqd", shares, surface.vertices[surface.triangles])
    found = np.zeros(points.shape[:2], bool)
    for box, triangles in leaves_of(tree):
        room = 1e-12 * np.abs(box).max()  # the points themselves are rounded
        within = (points[triangles] >= box[0] - room) & (points[triangles] <= box[1] + room)
        np.logical_or.at(found, triangles, within.all(axis=2))
    assert found.all()


def test_boxes_hold_their_children():
    tree = tree_of(crossing(3))
    for child in tree.child[tree.child >= 0]:
        parent = tree.box[tree.child == child][0]
        assert (tree.box[child : child + 2, 0] >= parent[0] - 1e-12).all()
        assert (tree.box[child : child + 2, 1] <= parent[1] + 1e-12).all()


@pytest.mark.parametrize("make", [lambda: needles(2_000), lambda: fan_of_polygon(4_000), lambda: crossing(4)])
def test_pieces_are_at_most_so_many(make):
    surface = make()
    tree, m = tree_of(surface), len(surface.triangles)
    assert len(np.unique(tree.order)) == m
    assert sum(len(triangles) for _, triangles in leaves_of(tree)) <= 33 * m


def test_planes_are_those_of_the_triangles(spot):
    surface = Surface.of(spot)
    tree = tree_of(surface)
    corner = surface.vertices[surface.triangles[tree.order]]
    away = np.einsum("dr,rcd->rc", tree.plane[:3], corner - tree.box[0].mean(axis=0)) - tree.plane[3][:, None]
    assert np.abs(away).max() < 1e-12
    normals = geometry.unit(geometry.area_vectors(surface.vertices, surface.triangles))[tree.order]
    assert np.abs(tree.plane[:3].T - normals).max() < 1e-9
