"""Similarities: fitted to points, small ones by their motions, and the one that brings points to size one."""

import numpy as np
import pytest

from fixtures.shapes import some_similarity
from o3dmark.mesh import geometry, similarity
from o3dmark.mesh.similarity import UnitSize


@pytest.mark.parametrize("seed", range(5))
def test_similarity_is_recovered_exactly(points, seed):
    matrix = some_similarity(seed)
    np.testing.assert_allclose(similarity.fitted(points, similarity.apply(matrix, points)), matrix, atol=1e-11)


def test_similarity_of_a_set_with_itself_is_the_identity(points):
    np.testing.assert_allclose(similarity.fitted(points, points), np.eye(4), atol=1e-13)


def test_similarity_composes_and_inverts(points):
    there = some_similarity(1)
    np.testing.assert_allclose(
        similarity.fitted(similarity.apply(there, points), points) @ there, np.eye(4), atol=1e-10
    )


def test_similarity_is_never_a_reflection(points):
    mirrored = similarity.fitted(points, points * [-1.0, 1, 1])
    assert np.linalg.det(mirrored[:3, :3]) > 0


def test_similarity_is_the_least_squares_one(points):
    """No similarity near it fits better."""
    noise = 0.02 * np.random.default_rng(0).normal(size=points.shape)
    target = similarity.apply(some_similarity(2, scale=1.0), points) + noise
    best = similarity.fitted(points, target)

    def misfit(matrix):
        return np.sum((similarity.apply(matrix, points) - target) ** 2)

    for seed in range(20):
        turn = some_similarity(seed, scale=1.0)[:3, :3]
        nearby = np.eye(4)
        nearby[:3, :3] += 1e-3 * (turn - turn.T)  # a small rotation, to first order
        nearby[:3, 3] = 1e-3 * turn[0]
        nearby[:3, :3] *= 1 + 1e-3 * turn[0, 0]
        assert misfit(nearby @ best) > misfit(best)


def test_apply_moves_points():
    matrix = np.array([[0, -2.0, 0, 1], [2.0, 0, 0, 2], [0, 0, 2.0, 3], [0, 0, 0, 1]])
    np.testing.assert_allclose(similarity.apply(matrix, np.array([[1.0, 0, 0], [0, 0, 1]])), [[1, 4, 3], [1, 2, 5]])


def test_motions_are_the_derivative_of_small_similarities() -> None:
    rng = np.random.default_rng(0)
    points, normals, motion = rng.normal(size=(20, 3)), rng.normal(size=(20, 3)), rng.normal(size=7)
    centre = points.mean(axis=0)
    there = similarity.apply(similarity.small(1e-6 * motion, centre), points)
    slope = np.einsum("nd,nd->n", there - points, normals) / 1e-6
    np.testing.assert_allclose(slope, similarity.motions(points - centre, normals) @ motion, atol=1e-4)


def test_a_step_along_normals_finds_a_small_motion() -> None:
    rng = np.random.default_rng(1)
    points, normals = rng.normal(size=(50, 3)), rng.normal(size=(50, 3))
    motion = 1e-5 * rng.normal(size=7)
    moved = similarity.apply(similarity.small(motion, points.mean(axis=0)), points)
    gap = np.einsum("nd,nd->n", moved - points, normals)
    step = similarity.step_along(points, normals, gap, np.ones(50))
    np.testing.assert_allclose(similarity.apply(step, points), moved, atol=1e-8)


@pytest.mark.parametrize("of", [UnitSize.about_mean, UnitSize.about_box])
def test_points_come_to_the_origin_and_to_size_one_and_back(points, of):
    there = 1e-3 * points + 7.0
    unit = of(there)
    assert geometry.diagonal(unit.apply(there)) == pytest.approx(1.0)
    np.testing.assert_allclose(unit.undo(unit.apply(there)), there, rtol=1e-15)
    np.testing.assert_allclose(unit.apply(there), of(points).apply(points), atol=1e-11)


def test_the_origin_is_the_mean_or_the_middle_of_the_box(points):
    np.testing.assert_allclose(UnitSize.about_mean(points).apply(points).mean(axis=0), 0.0, atol=1e-12)
    box = UnitSize.about_box(points).apply(points)
    np.testing.assert_allclose(box.min(axis=0), -box.max(axis=0), atol=1e-12)
