"""Theorems about triangle meshes: divergence, Euler, sums and invariances; welding against a dictionary."""

import numpy as np
import open3d as o3d
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from fixtures.shapes import UNIT_SQUARE, icosphere
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import mesh_arrays

BOX = mesh_arrays(o3d.geometry.TriangleMesh.create_box(2.0, 3.0, 4.0))
TETRAHEDRON = (
    np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
)


def open_strip(n):
    """A strip of 2 (n - 1) triangles in the plane z = 0, every vertex on its boundary."""
    vertices = np.array([[x, y, 0.0] for x in range(n) for y in range(2)])
    quads = [(2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1) for i in range(n - 1)]
    return vertices, np.array([corner for a, b, c, d in quads for corner in ((a, b, c), (a, c, d))])


CLOSED = {"box": BOX, "tetrahedron": TETRAHEDRON, "icosphere": icosphere(2)}


@pytest.mark.parametrize("shape", CLOSED.values(), ids=CLOSED)
def test_area_vectors_of_a_closed_surface_sum_to_zero(shape):
    np.testing.assert_allclose(geometry.area_vectors(*shape).sum(axis=0), 0.0, atol=1e-13)


def test_area_vectors_of_an_open_surface_do_not():
    np.testing.assert_allclose(geometry.area_vectors(*UNIT_SQUARE).sum(axis=0), [0, 0, 1])


def test_area_vector_of_a_triangle_is_half_a_cross_product():
    vertices = np.array([[1.0, 2, 3], [4, 1, 0], [2, 2, 7]])
    expected = 0.5 * np.cross(vertices[1] - vertices[0], vertices[2] - vertices[0])
    np.testing.assert_allclose(geometry.area_vectors(vertices, np.array([[0, 1, 2]])), [expected])


@pytest.mark.parametrize("shape", [*CLOSED.values(), UNIT_SQUARE, open_strip(5)])
def test_vertex_areas_sum_to_the_area(shape):
    assert geometry.vertex_areas(*shape).sum() == pytest.approx(geometry.areas(*shape).sum(), rel=1e-14)


def test_areas_of_known_shapes():
    assert geometry.areas(*BOX).sum() == pytest.approx(2 * (2 * 3 + 3 * 4 + 4 * 2))
    assert geometry.areas(*TETRAHEDRON).sum() == pytest.approx(1.5 + np.sqrt(3) / 2)


def test_volumes_of_known_shapes():
    assert geometry.volume(*BOX) == pytest.approx(24)
    assert geometry.volume(*TETRAHEDRON) == pytest.approx(1 / 6)


def test_volume_and_area_of_the_icosphere_reach_those_of_the_ball_quadratically():
    """Edges halve from level to level, so the errors fall by four."""
    shapes = [icosphere(level, radius=2.0) for level in (2, 3, 4)]
    volume = [32 / 3 * np.pi - geometry.volume(*shape) for shape in shapes]
    area = [16 * np.pi - geometry.areas(*shape).sum() for shape in shapes]
    for errors in (volume, area):
        assert errors[0] > errors[1] > errors[2] > 0
        np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 4.0, rtol=0.05)


def test_an_inside_out_surface_has_a_negative_volume():
    vertices, triangles = BOX
    assert geometry.volume(vertices, triangles[:, ::-1]) == pytest.approx(-24)


@pytest.mark.parametrize("shape", CLOSED.values(), ids=CLOSED)
def test_translation_changes_nothing_but_the_centroid(shape):
    vertices, triangles = shape
    shift = np.array([5.0, -7.0, 11.0])
    moved = vertices + shift, triangles
    np.testing.assert_allclose(geometry.area_vectors(*moved), geometry.area_vectors(*shape), atol=1e-13)
    assert geometry.volume(*moved) == pytest.approx(geometry.volume(*shape), rel=1e-12)
    assert geometry.diagonal(moved[0]) == pytest.approx(geometry.diagonal(vertices), rel=1e-14)
    np.testing.assert_allclose(geometry.area_centroid(*moved), geometry.area_centroid(*shape) + shift, atol=1e-12)


def test_centroid_is_of_the_surface_not_of_the_vertices():
    vertices = np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [0.0, 0.5, 0]])
    triangles = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4]])  # a rectangle, with one vertex more on its left
    np.testing.assert_allclose(geometry.area_centroid(vertices, triangles), [1, 0.5, 0], atol=1e-15)


def test_normals_of_a_sphere_point_along_the_radii():
    vertices, triangles = icosphere(3)
    normals = geometry.unit(geometry.vertex_area_vectors(vertices, triangles))
    assert np.sum(normals * vertices, axis=1).min() > 0.999


def test_unit_vectors_have_length_one_and_zero_stays_zero():
    vectors = np.array([[3.0, 0, 4], [0, 0, 0], [1e-100, 0, 0]])
    np.testing.assert_allclose(geometry.unit(vectors), [[0.6, 0, 0.8], [0, 0, 0], [1, 0, 0]])


@pytest.mark.parametrize("columns", [(), (2,)])
def test_sum_at_vertices_against_a_loop(columns):
    triangles = icosphere(1)[1]
    values = np.random.default_rng(0).normal(size=(len(triangles), *columns))
    expected = np.zeros((50, *columns))  # more vertices than the triangles use
    for value, triangle in zip(values, triangles, strict=True):
        for corner in triangle:
            expected[corner] += value
    np.testing.assert_allclose(geometry.sum_at_vertices(values, triangles, 50), expected, atol=1e-14)


@pytest.mark.parametrize("shape", CLOSED.values(), ids=CLOSED)
def test_euler_formula_of_the_sphere(shape):
    vertices, triangles = shape
    edges = geometry.edges(triangles)
    assert len(vertices) - len(edges) + len(triangles) == 2
    assert 2 * len(edges) == 3 * len(triangles)
    assert (edges[:, 0] < edges[:, 1]).all()
    assert edges.tolist() == sorted(edges.tolist())


def test_euler_formula_of_the_torus_and_the_disc():
    vertices, triangles = mesh_arrays(o3d.geometry.TriangleMesh.create_torus(1.0, 0.3, 12, 8))
    assert len(vertices) - len(geometry.edges(triangles)) + len(triangles) == 0
    vertices, triangles = open_strip(7)
    assert len(vertices) - len(geometry.edges(triangles)) + len(triangles) == 1


def test_numbered_edges_lead_from_each_corner_to_the_next():
    triangles = icosphere(2)[1]
    edges, side = geometry.numbered_edges(triangles)
    np.testing.assert_array_equal(edges, geometry.edges(triangles))
    for corner in range(3):
        ends = np.sort(triangles[:, [corner, (corner + 1) % 3]], axis=1)
        np.testing.assert_array_equal(edges[side[:, corner]], ends)


def test_numbered_pairs_against_a_dictionary():
    pairs = np.random.default_rng(0).integers(0, 2**31 - 1, (200, 2))[np.random.default_rng(1).integers(0, 200, 500)]
    pairs[::2] = pairs[::2, ::-1]
    distinct, number = geometry.numbered_pairs(pairs)
    assert [tuple(pair) for pair in distinct.tolist()] == sorted({tuple(sorted(pair)) for pair in pairs.tolist()})
    np.testing.assert_array_equal(distinct[number], np.sort(pairs, axis=1))


def test_angles_add_up_to_half_a_turn_and_cotangents_go_with_them():
    vertices, triangles = icosphere(1)
    vertices = vertices * [1.0, 0.2, 3.0]
    angles, cotangents = geometry.angles(vertices, triangles), geometry.cotangents(vertices, triangles)
    np.testing.assert_allclose(angles.sum(axis=1), np.pi)
    np.testing.assert_allclose(cotangents, 1.0 / np.tan(angles), rtol=1e-9, atol=1e-12)


def test_corners_of_triangles_without_area():
    vertices, triangles = np.array([[0.0, 0, 0], [1, 0, 0], [3, 0, 0]]), np.array([[0, 1, 2]])
    np.testing.assert_allclose(geometry.angles(vertices, triangles), [[0, np.pi, 0]])
    assert not np.isfinite(geometry.cotangents(vertices, triangles)).any()


@pytest.mark.parametrize("shape", CLOSED.values(), ids=CLOSED)
def test_a_closed_surface_has_no_boundary(shape):
    assert not geometry.boundary_vertices(shape[1], len(shape[0])).any()


def test_the_boundary_of_an_opened_surface_is_the_rim_of_the_hole():
    vertices, triangles = icosphere(2)
    apex = triangles[0, 0]
    around = (triangles == apex).any(axis=1)
    rim = np.setdiff1d(triangles[around], apex)
    mask = geometry.boundary_vertices(triangles[~around], len(vertices))
    assert np.flatnonzero(mask).tolist() == rim.tolist()
    assert geometry.boundary_vertices(open_strip(4)[1], 8).all()


@pytest.mark.parametrize("shape", [*CLOSED.values(), open_strip(5)])
def test_adjacency_is_symmetric_and_counts_edges(shape):
    vertices, triangles = shape
    matrix = geometry.adjacency(triangles, len(vertices))
    assert (matrix != matrix.T).nnz == 0
    assert matrix.diagonal().sum() == 0
    assert matrix.sum() == 2 * len(geometry.edges(triangles))
    assert set(matrix.data) == {1.0}


@pytest.mark.parametrize("shape", [*CLOSED.values(), open_strip(5)])
def test_neighbour_mean_has_rows_that_sum_to_one(shape):
    vertices, triangles = shape
    matrix = geometry.neighbour_mean(triangles, len(vertices))
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0)
    row = matrix[[0]].toarray().ravel()
    around = {a if b == 0 else b for a, b in geometry.edges(triangles) if 0 in (a, b)}
    np.testing.assert_allclose((matrix @ vertices)[0], vertices[sorted(around)].mean(axis=0))
    assert set(np.flatnonzero(row)) == around


def test_neighbour_mean_of_an_unused_vertex_is_zero():
    assert geometry.neighbour_mean(UNIT_SQUARE[1], 5)[[4]].nnz == 0


def weld_slowly(vertices):
    kept, position, seen = [], [], {}
    for index, vertex in enumerate(vertices):
        place = seen.setdefault(tuple(vertex + 0.0), len(kept))
        if place == len(kept):
            kept.append(index)
        position.append(place)
    return kept, position


@settings(max_examples=60, deadline=None)
@given(hnp.arrays(np.float64, st.tuples(st.integers(1, 30), st.just(3)), elements=st.sampled_from([0.0, -0.0, 1.0])))
def test_weld_against_a_dictionary(vertices):
    """Stable: positions in order of first appearance; -0 and 0 are one place."""
    kept, position = geometry.weld(vertices)
    assert (kept.tolist(), position.tolist()) == weld_slowly(vertices)


def test_weld_keeps_distinct_vertices_as_they_are():
    vertices, _ = icosphere(1)
    kept, position = geometry.weld(vertices)
    assert kept.tolist() == position.tolist() == list(range(len(vertices)))


def test_weld_merges_exactly_equal_positions_only():
    vertices = np.array([[1.0, 0, 0], [np.nextafter(1.0, 2.0), 0, 0], [1.0, -0.0, 0]])
    kept, position = geometry.weld(vertices)
    assert (kept.tolist(), position.tolist()) == ([0, 1], [0, 1, 0])


def test_what_is_given_stays_as_it_is():
    vertices, triangles = np.array(BOX[0]), np.array(BOX[1])
    for array in (vertices, triangles):
        array.setflags(write=False)
    geometry.vertex_areas(vertices, triangles)
    geometry.neighbour_mean(triangles, len(vertices))
    geometry.boundary_vertices(triangles, len(vertices))
    geometry.weld(vertices)


def test_barycentric_coordinates_give_the_point_back() -> None:
    rng = np.random.default_rng(0)
    corners, shares = rng.standard_normal((50, 3, 3)), rng.dirichlet(np.ones(3), 50)
    points = np.einsum("qc,qcd->qd", shares, corners)
    np.testing.assert_allclose(geometry.barycentric(points, corners), shares, atol=1e-9)
    np.testing.assert_allclose(
        geometry.barycentric(corners[:, 1], corners), np.tile([0.0, 1.0, 0.0], (50, 1)), atol=1e-9
    )
