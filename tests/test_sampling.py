"""Points drawn from a surface, uniform by area."""

import numpy as np
import pytest

from o3dmark.mesh.sampling import sampled, stratified
from o3dmark.mesh.surface import Surface


@pytest.fixture(scope="module")
def surface() -> Surface:
    """Two triangles, the one at z = 5 with three times the area of the one at z = 0."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 5], [3, 0, 5], [0, 1, 5]])
    return Surface.from_arrays(vertices, np.array([[0, 1, 2], [3, 4, 5]]))


@pytest.mark.parametrize("draw", [sampled, stratified])
def test_points_are_uniform_by_area(surface: Surface, draw) -> None:
    points, triangle = draw(surface, 40_000, np.random.default_rng(0))
    np.testing.assert_array_equal(triangle, points[:, 2] > 4.0)
    x, y, _ = points[triangle == 0].T
    assert (x >= 0).all()
    assert (x + y <= 1 + 1e-12).all()
    for part, share in (((x < 0.25) & (y < 0.25), 1 / 8), (x > 0.5, 1 / 4), (y > 0.5, 1 / 4), (x + y < 0.5, 1 / 4)):
        assert part.mean() == pytest.approx(share, abs=0.02)
    assert points.mean(axis=0) == pytest.approx(surface.centroid, abs=0.02)


def test_stratified_points_share_out_the_area_exactly(surface: Surface) -> None:
    _, triangle = stratified(surface, 40_000, np.random.default_rng(0))
    assert abs(np.sum(triangle == 0) - 10_000) <= 1
    assert (np.diff(triangle) >= 0).all()


def test_independent_points_do_not(surface: Surface) -> None:
    counts = [np.sum(sampled(surface, 1_000, np.random.default_rng(seed)).triangle == 0) for seed in range(200)]
    assert np.std(counts) == pytest.approx(np.sqrt(1_000 * 0.25 * 0.75), rel=0.2)


@pytest.mark.parametrize("draw", [sampled, stratified])
def test_the_same_seed_draws_the_same(surface: Surface, draw) -> None:
    one, other = (draw(surface, 100, np.random.default_rng(3)).points for _ in range(2))
    np.testing.assert_array_equal(one, other)
