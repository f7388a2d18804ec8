"""Finding which vertex is which, from any pose, whatever the order of the vertices."""

import numpy as np
import pytest

from fixtures.shapes import some_similarity
from o3dmark.mesh import similarity
from o3dmark.mesh.geometry import diagonal
from o3dmark.mesh.registration import align, match_vertices


@pytest.mark.parametrize("seed", range(3))
def test_align_from_any_pose_and_scale_and_in_any_order(points, seed):
    matrix = some_similarity(seed)
    order = np.random.default_rng(seed).permutation(len(points))
    laid = similarity.apply(align(similarity.apply(matrix, points)[order], points), similarity.apply(matrix, points))
    np.testing.assert_allclose(laid, points, atol=1e-9 * diagonal(points))


@pytest.mark.parametrize("seed", range(3))
def test_align_after_a_tenth_was_cut_off(points, seed):
    """The principal axes are off by 8 % of the diagonal then; the iteration makes up for it."""
    matrix = some_similarity(seed)
    kept = points[:, 1] < np.quantile(points[:, 1], 0.9)
    laid = similarity.apply(align(similarity.apply(matrix, points[kept]), points), similarity.apply(matrix, points))
    np.testing.assert_allclose(laid, points, atol=1e-9 * diagonal(points))


@pytest.mark.parametrize("seed", range(3))
def test_match_after_similarity_and_small_noise(points, seed):
    """With the order kept, by number."""
    noise = 1e-3 * np.random.default_rng(seed).normal(size=points.shape)
    received = similarity.apply(some_similarity(seed), points + noise)
    np.testing.assert_array_equal(match_vertices(points, received), np.arange(len(points)))


@pytest.mark.parametrize("seed", range(3))
def test_match_after_permutation_similarity_and_small_noise(points, seed):
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(points))
    received = similarity.apply(some_similarity(seed), points + 1e-4 * rng.normal(size=points.shape))[order]
    np.testing.assert_array_equal(order[match_vertices(points, received)], np.arange(len(points)))


def test_match_where_vertices_are_missing_or_new(points):
    """Each vertex that is still there is found; one that is gone is matched to a neighbour."""
    rng = np.random.default_rng(0)
    order = rng.permutation(len(points))[:-100]
    received = similarity.apply(some_similarity(0), points[order])
    found = match_vertices(points, received)
    here = np.isin(np.arange(len(points)), order)
    assert np.mean(order[found[here]] == np.flatnonzero(here)) > 0.95
    assert np.linalg.norm(points[order[found]] - points, axis=1).max() < 0.1 * diagonal(points)


def test_vertices_of_equal_number_that_do_not_fit_are_not_taken_for_the_same(points):
    shuffled = np.random.default_rng(0).permutation(len(points))
    assert (match_vertices(points, points[shuffled]) != np.arange(len(points))).any()


def test_equal_meshes_match_by_number(points):
    np.testing.assert_array_equal(match_vertices(points, points), np.arange(len(points)))


def test_what_is_given_stays(points):
    before = points.copy()
    match_vertices(points, points[::-1])
    np.testing.assert_array_equal(points, before)
