"""Closest points: hand-computed cases, a slow obvious search, and what a float32 search would lose."""

import numpy as np
import pytest

from fixtures.shapes import fan_of_polygon
from o3dmark.errors import MeshError
from o3dmark.mesh.box_tree import tree_of
from o3dmark.mesh.proximity import closest_points
from o3dmark.mesh.surface import Surface

TRIANGLE = Surface.from_arrays(np.array([[0.0, 0, 0], [4, 0, 0], [0, 3, 0]]), np.array([[0, 1, 2]]))


def closest_slowly(point, corner):
    """The closest point of one triangle: its projection where that is inside, else the best of its edges' points."""
    a, b, c = corner
    candidates = []
    normal = np.cross(b - a, c - a)
    if normal.any():
        foot = point - normal * (normal @ (point - a)) / (normal @ normal)
        if all(np.cross(q - p, foot - p) @ normal >= 0 for p, q in ((a, b), (b, c), (c, a))):
            candidates.append(foot)
    for p, q in ((a, b), (b, c), (c, a)):
        length = (q - p) @ (q - p)
        candidates.append(p + (q - p) * np.clip((point - p) @ (q - p) / length, 0, 1) if length else p)
    return min(candidates, key=lambda x: np.linalg.norm(point - x))


def random_surface(seed, n=60, m=120):
    rng = np.random.default_rng(seed)
    triangles = np.array([rng.choice(n, 3, replace=False) for _ in range(m)])
    return Surface.from_arrays(rng.normal(size=(n, 3)), triangles)


@pytest.mark.parametrize(
    ("point", "closest", "distance"),
    [
        ([1, 1, 5], [1, 1, 0], 5),  # above the face
        ([1, 1, -2], [1, 1, 0], 2),  # below it
        ([2, -3, 4], [2, 0, 0], 5),  # beside an edge
        ([5, 4.5, 0], [2.48, 1.14, 0], 4.2),  # beside the slanted edge
        ([-3, -4, 0], [0, 0, 0], 5),  # before a corner
        ([4, 0, 7], [4, 0, 0], 7),  # above a corner
        ([0, 3, 0], [0, 3, 0], 0),  # on a corner
    ],
)
def test_of_one_triangle(point, closest, distance):
    found = closest_points(np.array([point], float), TRIANGLE)
    assert found.distance[0] == pytest.approx(distance, abs=1e-15)
    assert found.point[0] == pytest.approx(closest, abs=1e-15)
    assert found.triangle[0] == 0


@pytest.mark.parametrize("seed", range(3))
def test_agrees_with_the_search_of_every_triangle(seed):
    surface = random_surface(seed)
    points = np.random.default_rng(100 + seed).normal(size=(50, 3)) * 2
    found = closest_points(points, surface)
    for i, point in enumerate(points):
        slow = [closest_slowly(point, corner) for corner in surface.vertices[surface.triangles]]
        distances = np.linalg.norm(point - slow, axis=1)
        assert found.distance[i] == pytest.approx(distances.min(), rel=1e-12)
        assert found.distance[i] == pytest.approx(distances[found.triangle[i]], rel=1e-12)
        assert found.point[i] == pytest.approx(slow[found.triangle[i]], abs=1e-12)


def test_the_point_is_on_the_triangle_and_at_the_distance():
    surface = random_surface(7)
    points = np.random.default_rng(8).normal(size=(200, 3))
    found = closest_points(points, surface)
    assert np.linalg.norm(points - found.point, axis=1) == pytest.approx(found.distance, rel=1e-12)
    for point, corner in zip(found.point, surface.vertices[surface.triangles[found.triangle]], strict=True):
        assert np.linalg.norm(point - closest_slowly(point, corner)) < 1e-12


def test_vertices_lie_on_their_own_surface(spot):
    surface = Surface.of(spot)
    found = closest_points(surface.vertices, surface)
    assert not found.distance.any()
    assert (surface.triangles[found.triangle] == np.arange(len(surface.vertices))[:, None]).any(axis=1).all()


def test_of_equally_close_triangles_the_lowest_is_named(spot):
    surface = Surface.of(spot)
    found = closest_points(surface.vertices, surface).triangle
    lowest = np.full(len(surface.vertices), len(surface.triangles))
    np.minimum.at(lowest, surface.triangles.ravel(), np.repeat(np.arange(len(surface.triangles)), 3))
    assert np.array_equal(found, lowest)


def test_both_triangles_of_an_edge_are_equally_close():
    rng = np.random.default_rng(3)
    for _ in range(50):
        a, b = rng.normal(size=(2, 3))
        axis = np.cross(b - a, rng.normal(size=3))
        wings = [b - a - 2 * axis, a - b - 3 * axis] + (a + b) / 2  # both fall away from a ridge along a, b
        ridge = Surface.from_arrays(np.array([a, b, *wings]), np.array([[0, 1, 2], [1, 0, 3]]))
        above = a + rng.uniform(0.2, 0.8) * (b - a) + axis
        turned = Surface.from_arrays(ridge.vertices, ridge.triangles[::-1])
        for surface in (ridge, turned):
            assert closest_points(above[None], surface).triangle[0] == 0


def test_the_order_of_the_points_does_not_matter(spot):
    surface = Surface.of(spot)
    points = np.random.default_rng(1).uniform(-1, 1, (300, 3))
    shuffle = np.random.default_rng(2).permutation(300)
    one, other = closest_points(points, surface), closest_points(points[shuffle], surface)
    assert np.array_equal(one.triangle[shuffle], other.triangle)
    assert np.array_equal(one.distance[shuffle], other.distance)


def test_triangles_without_area_are_segments():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [3, 0, 0], [0, 9, 0], [1, 9, 0], [0, 9, 1]])
    surface = Surface.from_arrays(vertices, np.array([[0, 1, 2], [3, 4, 5]]))
    found = closest_points(np.array([[2.0, 0, 0.5], [4, 0, 0]]), surface)
    assert found.distance == pytest.approx([0.5, 1])
    assert found.triangle.tolist() == [0, 0]


@pytest.mark.parametrize("offset", [0.0, 1e3])
def test_a_millionth_of_a_millionth_is_seen(offset):
    points = np.array([[1 + offset, 1, 1e-12], [2 + offset, 0.5, -1e-9]])
    surface = Surface.from_arrays(TRIANGLE.vertices + np.array([offset, 0, 0]), TRIANGLE.triangles)
    assert closest_points(points, surface).distance == pytest.approx([1e-12, 1e-9], rel=1e-9)


def test_no_point_is_no_answer():
    found = closest_points(np.empty((0, 3)), TRIANGLE)
    assert [len(column) for column in found] == [0, 0, 0]


@pytest.mark.parametrize("spread", [0.0, 0.3])
def test_needles_are_found_as_other_triangles_are(spread):
    rng = np.random.default_rng(5)
    angle = np.linspace(0.0, 2.0 * np.pi, 300, endpoint=False)
    rim = np.array([7.0, -3.0, 1.0]) + np.stack(
        [np.cos(angle), np.sin(angle), spread * rng.standard_normal(300)], axis=1
    )
    fan = np.stack([np.zeros(298, int), np.arange(1, 299), np.arange(2, 300)], axis=1)
    surface = Surface.from_arrays(rim, fan)
    points = np.concatenate([rim[:20], rim.mean(axis=0) + rng.normal(size=(40, 3))])
    found = closest_points(points, surface)
    for i, point in enumerate(points):
        slow = [closest_slowly(point, corner) for corner in surface.vertices[surface.triangles]]
        distances = np.linalg.norm(point - slow, axis=1)
        assert found.distance[i] == pytest.approx(distances.min(), rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("flat", [False, True])
def test_triangles_that_all_overlap_are_found_as_others_are(flat):
    surface, rng = fan_of_polygon(300, flat=flat), np.random.default_rng(6)
    points = np.concatenate([rng.random((30, 3)), surface.vertices[:10]])
    assert len(tree_of(surface).order) > 2 * len(surface.triangles)
    found = closest_points(points, surface)
    for i, point in enumerate(points):
        slow = [closest_slowly(point, corner) for corner in surface.vertices[surface.triangles]]
        assert found.distance[i] == pytest.approx(np.linalg.norm(point - slow, axis=1).min(), rel=1e-9, abs=1e-14)


def test_what_takes_too_much_work_is_refused():
    surface = fan_of_polygon(1_000)
    points = np.random.default_rng(7).random((100, 3))
    allowed = closest_points(points, surface, most_work=100 * 32 * 1_000)
    assert all(map(np.array_equal, allowed, closest_points(points, surface)))
    with pytest.raises(MeshError, match="bounded time"):
        closest_points(points, surface, most_work=100)


def test_a_triangle_without_area_is_in_boxes_that_hold_it():
    corners = np.array([[0.0, 0, 0], [1, 2, 3], [2, 4, 6], [9, 0, 0], [9, 1, 0], [9, 0, 1]]) / 3.0
    surface = Surface.from_arrays(corners, np.array([[0, 1, 2], [3, 4, 5]]))
    points = np.linspace(0.0, 1.0, 50)[:, None] * surface.vertices[2]
    found = closest_points(points, surface)
    assert found.distance == pytest.approx(0.0, abs=1e-15)
    assert (found.triangle == 0).all()
