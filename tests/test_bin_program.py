"""The quadratic programme over bins of distances: its derivatives are right, and its solution meets the constraints."""

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from fixtures.shapes import bits_of
from o3dmark.coding.keys import Key
from o3dmark.errors import MeshError
from o3dmark.mesh.surface import Surface, TriangleMesh
from o3dmark.methods import METHODS
from o3dmark.methods._bin_program import Distances, Programme, area_growth, nearest_point
from o3dmark.methods._distortion import estimated_mrms
from o3dmark.methods._norm_bins import Bins
from o3dmark.methods.rolland2014 import quadrics
from o3dmark.metrics.distance import surface_distance

HELD = bits_of(2, 8)


def programme_of(mesh: Any, along: str, cost: float = 1.0) -> Programme:
    surface = Surface.of(mesh)
    seen = Distances.of(surface)
    bins = Bins.equal_width(seen.rho, len(HELD))
    ways = seen.u if along == "radius" else surface.normals
    move = np.flatnonzero((bins.of >= 0) & (np.abs(np.sum(ways * seen.u, axis=1)) > 0.3))
    return Programme(surface, bins, move, ways[move], np.full(len(move), cost), seen.centre)


def test_the_nearest_point_under_constraints() -> None:
    """On x + y = 1 with x <= 0.2, from (1, 1): dear y stays as near as it may. Nothing is nearer to no point."""
    rows, start = sp.csc_array(np.array([[1.0, 1.0], [1.0, 0.0]])), np.ones(2)
    found = nearest_point(start, np.array([1.0, 1.0]), rows, np.array([1.0, 0.2]), 1)
    np.testing.assert_allclose(found, [0.2, 0.8], atol=1e-7)
    found = nearest_point(start, np.array([1.0, 9.0]), rows, np.array([1.0, 0.2]), 1)
    np.testing.assert_allclose(found, [0.1, 0.9], atol=1e-7)
    contradiction = sp.csc_array(np.array([[1.0, 0.0], [1.0, 0.0], [-1.0, 0.0]]))
    assert nearest_point(start, np.ones(2), contradiction, np.array([1.0, 0.0, 0.0]), 1) is None


def test_area_growth_is_the_derivative_of_the_areas(spot: TriangleMesh) -> None:
    surface, rng = Surface.of(spot), np.random.default_rng(0)
    ways, step = rng.normal(size=surface.vertices.shape), 1e-6
    measured = [surface.moved(surface.vertices + s * step * ways).areas for s in (1.0, -1.0)]
    expected = (measured[0] - measured[1]) / (2 * step)
    np.testing.assert_allclose(area_growth(surface, ways).sum(axis=1), expected, atol=1e-8)


@pytest.mark.parametrize("along", ["radius", "normal"])
def test_derivatives_are_those_of_what_is_measured(spot: TriangleMesh, along: str) -> None:
    programme = programme_of(spot, along)
    width, step = programme.bins.edges[1] - programme.bins.edges[0], 1e-6
    centre, means = programme.derivatives(programme.surface, Distances.of(programme.surface))
    motion = np.random.default_rng(1).normal(size=len(programme.move))
    ahead, behind = (Distances.of(programme.surface.moved(programme.moved(s * step * motion))) for s in (1.0, -1.0))
    np.testing.assert_allclose(centre @ motion, (ahead.centre - behind.centre) / (2 * step), atol=1e-7)
    motion -= np.linalg.lstsq(centre, centre @ motion, rcond=None)[0]  # the centre rests
    ahead, behind = (Distances.of(programme.surface.moved(programme.moved(s * step * motion))) for s in (1.0, -1.0))
    measured = (ahead.means(programme.bins) - behind.means(programme.bins)) / (2 * step) * width
    np.testing.assert_allclose(means @ motion, measured, atol=1e-6)


@pytest.mark.parametrize("along", ["radius", "normal"])
def test_the_solution_meets_every_constraint(spot: TriangleMesh, along: str) -> None:
    programme = programme_of(spot, along)
    before = Distances.of(programme.surface)
    vertices = programme.solve(HELD, 0.05)
    after = Distances.of(programme.surface.moved(vertices))
    np.testing.assert_allclose(after.centre, before.centre, atol=1e-3 * np.diff(programme.bins.edges)[0])
    assert ((2.0 * HELD - 1.0) * (after.means(programme.bins) - 0.5) > 0.05 - 1.1e-3).all()
    place = (after.rho - programme.bins.edges[0]) / (programme.bins.edges[1] - programme.bins.edges[0])
    inside = programme.bins.of >= 0
    assert (np.abs(place - programme.bins.of - 0.5)[inside] < 0.5 + 1e-2).all()
    still = np.setdiff1d(np.arange(len(vertices)), programme.move)
    np.testing.assert_array_equal(vertices[still], programme.surface.vertices[still])
    across = np.cross(vertices[programme.move] - programme.surface.vertices[programme.move], programme.directions)
    np.testing.assert_allclose(across, 0.0, atol=1e-12)


def test_a_step_that_goes_too_far_is_cut(spot: TriangleMesh, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a full step of a fine mesh may, where it takes vertices past one another."""
    programme, whole = programme_of(spot, "radius"), Programme._nearest

    def too_far(self: Programme, motion: Any, held: Any, alpha: float) -> Any:
        return motion + 8.0 * (whole(self, motion, held, alpha) - motion)

    monkeypatch.setattr(Programme, "_nearest", too_far)
    after = Distances.of(programme.surface.moved(programme.solve(HELD, 0.05)))
    assert ((2.0 * HELD - 1.0) * (after.means(programme.bins) - 0.5) > 0.05 - 1.1e-3).all()


def test_no_motion_is_spent_on_a_bin_that_holds_its_bit(spot: TriangleMesh) -> None:
    """The constraints are inequalities, so the cover's own statistics are kept where they say the right thing."""
    programme = programme_of(spot, "radius")
    natural = (Distances.of(programme.surface).means(programme.bins) > 0.5).astype(np.uint8)
    costs = [estimated_mrms(programme.surface, programme.solve(held, 0.02)) for held in (natural, 1 - natural)]
    assert costs[0] < 0.2 * costs[1]


def test_what_is_dear_moves_less(spot: TriangleMesh) -> None:
    programme = programme_of(spot, "radius")
    programme.cost[::2] = 100.0
    moved = np.linalg.norm(programme.solve(HELD, 0.05) - programme.surface.vertices, axis=1)[programme.move]
    assert moved[::2].mean() < 0.1 * moved[1::2].mean()


def test_the_quadric_is_the_squared_cosine_to_the_planes(spot: TriangleMesh) -> None:
    surface = Surface.of(spot)
    along = quadrics(surface, surface.normals)
    assert 0.8 < np.median(along) <= 1.0
    side = np.cross(surface.normals, [0.3, 0.5, 0.8])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    assert np.median(quadrics(surface, side)) < 0.05


@pytest.mark.parametrize("weights", ["uniform", "roughness", "quadric"])
@pytest.mark.parametrize("along", ["radius", "normal"])
def test_every_cost_and_direction_is_read(carrier: TriangleMesh, key: Key, along: str, weights: str) -> None:
    method = METHODS.make(f"rolland2014:along={along},weights={weights}")
    bits = bits_of(1)
    assert np.count_nonzero(method.extract(method.embed(carrier, bits, key), 16, key).bits == bits) >= 15


@pytest.mark.parametrize("name", ["rolland2014", "son2017"])
def test_the_mark_has_the_distortion_asked_for(name: str, carrier: TriangleMesh, key: Key) -> None:
    marked = METHODS.make(f"{name}:mrms=0.0004").embed(carrier, bits_of(1), key)
    assert 0.9 * 4e-4 < surface_distance(carrier, marked, samples=50_000).mrms <= 4e-4


def test_what_no_motion_can_do_is_refused(carrier: TriangleMesh, key: Key) -> None:
    with pytest.raises(MeshError, match="smaller one or fewer bits"):
        METHODS.make("rolland2014:alpha=0.45").embed(carrier, bits_of(1, 64), key)
    with pytest.raises(MeshError, match="at most"):
        METHODS.make("rolland2014:mrms=0.05").embed(carrier, bits_of(1, 64), key)


def test_means_hardly_notice_other_triangles(carrier: TriangleMesh) -> None:
    """Integrals by area: a flat subdivision leaves the centre where it is, and the means of all bins nearly."""
    coarse, fine = Distances.of(Surface.of(carrier)), Distances.of(Surface.of(carrier.subdivide_midpoint(1)))
    np.testing.assert_allclose(fine.centre, coarse.centre, atol=1e-9)
    bins = [Bins.equal_width(each.rho, 16) for each in (coarse, fine)]
    np.testing.assert_allclose(coarse.means(bins[0]), fine.means(bins[1]), atol=0.04)
