"""Finding which vertex is which, from any pose, whatever the order of the vertices."""

import numpy as np
import pytest

from fixtures.shapes import some_similarity
from o3dmark.mesh import similarity
from o3dmark.mesh.geometry import diagonal
from o3dmark.mesh.registration import align, match_vertices
from o3dmark.mesh.surface import mesh_arrays


@pytest.fixture(scope="module")
def cover(spot):
    return mesh_arrays(spot)[0]


@pytest.mark.parametrize("seed", range(3))
def test_align_from_any_pose_and_scale_and_in_any_order(cover, seed):
    matrix = some_similarity(seed)
    order = np.random.default_rng(seed).permutation(len(cover))
    laid = similarity.apply(align(similarity.apply(matrix, cover)[order], cover), similarity.apply(matrix, cover))
    np.testing.assert_allclose(laid, cover, atol=1e-9 * diagonal(cover))


@pytest.mark.parametrize("seed", range(3))
def test_align_after_a_tenth_was_cut_off(cover, seed):
    """The principal axes are off by 8 % of the diagonal then; the iteration makes up for it."""
    matrix = some_similarity(seed)
    kept = cover[:, 1] < np.quantile(cover[:, 1], 0.9)
    laid = similarity.apply(align(similarity.apply(matrix, cover[kept]), cover), similarity.apply(matrix, cover))
    np.testing.assert_allclose(laid, cover, atol=1e-9 * diagonal(cover))


@pytest.mark.parametrize("seed", range(3))
def test_match_after_similarity_and_small_noise(cover, seed):
    """With the order kept, by number."""
    noise = 1e-3 * np.random.default_rng(seed).normal(size=cover.shape)
    received = similarity.apply(some_similarity(seed), cover + noise)
    np.testing.assert_array_equal(match_vertices(cover, received), np.arange(len(cover)))


@pytest.mark.parametrize("seed", range(3))
def test_match_after_permutation_similarity_and_small_noise(cover, seed):
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(cover))
    received = similarity.apply(some_similarity(seed), cover + 1e-4 * rng.normal(size=cover.shape))[order]
    np.testing.assert_array_equal(order[match_vertices(cover, received)], np.arange(len(cover)))


def test_match_where_vertices_are_missing_or_new(cover):
    """Each vertex that is still there is found; one that is gone is matched to a neighbour."""
    rng = np.random.default_rng(0)
    order = rng.permutation(len(cover))[:-100]
    received = similarity.apply(some_similarity(0), cover[order])
    found = match_vertices(cover, received)
    here = np.isin(np.arange(len(cover)), order)
    assert np.mean(order[found[here]] == np.flatnonzero(here)) > 0.95
    assert np.linalg.norm(cover[order[found]] - cover, axis=1).max() < 0.1 * diagonal(cover)


def test_vertices_of_equal_number_that_do_not_fit_are_not_taken_for_the_same(cover):
    shuffled = np.random.default_rng(0).permutation(len(cover))
    assert (match_vertices(cover, cover[shuffled]) != np.arange(len(cover))).any()


def test_equal_meshes_match_by_number(cover):
    np.testing.assert_array_equal(match_vertices(cover, cover), np.arange(len(cover)))


def test_what_is_given_stays(cover):
    before = cover.copy()
    match_vertices(cover, cover[::-1])
    np.testing.assert_array_equal(cover, before)
