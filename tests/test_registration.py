"""Finding which vertex is which: similarities are recovered, from any pose, whatever the order of the vertices."""

import numpy as np
import pytest

from o3dmark.mesh.geometry import diagonal
from o3dmark.mesh.registration import align, apply, match_vertices, similarity
from o3dmark.mesh.surface import mesh_arrays


def some_similarity(seed, scale=None):
    """A proper similarity (4, 4): any rotation, a translation, a scale between a tenth and ten."""
    rng = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    rotation *= np.linalg.det(rotation)
    matrix = np.eye(4)
    matrix[:3, :3] = (scale or 10 ** rng.uniform(-1, 1)) * rotation
    matrix[:3, 3] = 20 * rng.normal(size=3)
    return matrix


@pytest.fixture(scope="module")
def cover(spot):
    return mesh_arrays(spot)[0]


@pytest.mark.parametrize("seed", range(5))
def test_similarity_is_recovered_exactly(cover, seed):
    matrix = some_similarity(seed)
    np.testing.assert_allclose(similarity(cover, apply(matrix, cover)), matrix, atol=1e-11)


def test_similarity_of_a_set_with_itself_is_the_identity(cover):
    np.testing.assert_allclose(similarity(cover, cover), np.eye(4), atol=1e-13)


def test_similarity_composes_and_inverts(cover):
    there = some_similarity(1)
    np.testing.assert_allclose(similarity(apply(there, cover), cover) @ there, np.eye(4), atol=1e-10)


def test_similarity_is_never_a_reflection(cover):
    mirrored = similarity(cover, cover * [-1.0, 1, 1])
    assert np.linalg.det(mirrored[:3, :3]) > 0


def test_similarity_is_the_least_squares_one(cover):
    """No similarity near it fits better."""
    target = apply(some_similarity(2, scale=1.0), cover) + 0.02 * np.random.default_rng(0).normal(size=cover.shape)
    best = similarity(cover, target)

    def misfit(matrix):
        return np.sum((apply(matrix, cover) - target) ** 2)

    for seed in range(20):
        turn = some_similarity(seed, scale=1.0)[:3, :3]
        nearby = np.eye(4)
        nearby[:3, :3] += 1e-3 * (turn - turn.T)  # a small rotation, to first order
        nearby[:3, 3] = 1e-3 * turn[0]
        nearby[:3, :3] *= 1 + 1e-3 * turn[0, 0]
        assert misfit(nearby @ best) > misfit(best)


def test_apply_moves_points():
    matrix = np.array([[0, -2.0, 0, 1], [2.0, 0, 0, 2], [0, 0, 2.0, 3], [0, 0, 0, 1]])
    np.testing.assert_allclose(apply(matrix, np.array([[1.0, 0, 0], [0, 0, 1]])), [[1, 4, 3], [1, 2, 5]])


@pytest.mark.parametrize("seed", range(3))
def test_align_from_any_pose_and_scale_and_in_any_order(cover, seed):
    matrix = some_similarity(seed)
    order = np.random.default_rng(seed).permutation(len(cover))
    laid = apply(align(apply(matrix, cover)[order], cover), apply(matrix, cover))
    np.testing.assert_allclose(laid, cover, atol=1e-9 * diagonal(cover))


@pytest.mark.parametrize("seed", range(3))
def test_align_after_a_tenth_was_cut_off(cover, seed):
    """The principal axes are off by 8 % of the diagonal then; the iteration makes up for it."""
    matrix = some_similarity(seed)
    kept = cover[:, 1] < np.quantile(cover[:, 1], 0.9)
    laid = apply(align(apply(matrix, cover[kept]), cover), apply(matrix, cover))
    np.testing.assert_allclose(laid, cover, atol=1e-9 * diagonal(cover))


@pytest.mark.parametrize("seed", range(3))
def test_match_after_similarity_and_small_noise(cover, seed):
    """With the order kept, by number."""
    received = apply(some_similarity(seed), cover + 1e-3 * np.random.default_rng(seed).normal(size=cover.shape))
    np.testing.assert_array_equal(match_vertices(cover, received), np.arange(len(cover)))


@pytest.mark.parametrize("seed", range(3))
def test_match_after_permutation_similarity_and_small_noise(cover, seed):
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(cover))
    received = apply(some_similarity(seed), cover + 1e-4 * rng.normal(size=cover.shape))[order]
    np.testing.assert_array_equal(order[match_vertices(cover, received)], np.arange(len(cover)))


def test_match_where_vertices_are_missing_or_new(cover):
    """Each vertex that is still there is found; one that is gone is matched to a neighbour."""
    rng = np.random.default_rng(0)
    order = rng.permutation(len(cover))[:-100]
    received = apply(some_similarity(0), cover[order])
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
