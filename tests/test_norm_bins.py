"""Bins on vertex norms: the bins hold what they say, powers reach the statistic asked for, and the ranges stay."""

from typing import Any

import numpy as np
import pytest

from fixtures.shapes import bits_of
from o3dmark.coding.keys import Key
from o3dmark.errors import MeshError, SpecError
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface, TriangleMesh, mesh_arrays
from o3dmark.methods import METHODS
from o3dmark.methods._distortion import OutOfReachError, estimated_mrms, with_mrms
from o3dmark.methods._norm_bins import (
    Bins,
    Mean,
    Statistic,
    Variance,
    check_filled,
    modulated,
    normalised,
    powers,
    soft_bits,
    vertex_norms,
)
from o3dmark.methods._published import Deal
from o3dmark.metrics.distance import surface_distance
from o3dmark.synthetic import make

BOTH = pytest.mark.parametrize("statistic", [Mean(), Variance()], ids=["mean", "variance"])
METHOD = pytest.mark.parametrize("name", ["cho2007-mean", "cho2007-variance"])


def some_values(n: int = 4000) -> Any:
    return np.random.default_rng(3).gamma(4.0, size=n)


def test_equal_width_leaves_the_outermost_bins_out() -> None:
    bins = Bins.equal_width(np.array([0.0, 0.9, 1.0, 1.99, 2.5, 3.0, 4.0, 5.0]), 3)
    np.testing.assert_array_equal(bins.of, [-1, -1, 0, 0, 1, 2, -1, -1])
    np.testing.assert_allclose(bins.edges, [1.0, 2.0, 3.0, 4.0])


def test_equal_count_bins_hold_equally_many() -> None:
    values = some_values(1000)
    bins = Bins.equal_count(values, 8)
    np.testing.assert_allclose(bins.sums(np.ones(1000)), 100, atol=1)
    assert values[bins.of == 3].max() <= values[bins.of == 4].min()


@BOTH
def test_the_statistic_of_uniform_values_is_its_level(statistic: Statistic) -> None:
    terms = statistic.terms((np.arange(100_000) + 0.5) / 100_000)
    assert np.isclose(terms.mean(), statistic.level, atol=1e-6)
    assert np.isclose(terms.std(), statistic.deviation, atol=1e-6)


@BOTH
def test_a_power_of_a_value_gives_that_power_of_its_term(statistic: Statistic) -> None:
    unit = np.linspace(0.0, 1.0, 11)
    np.testing.assert_allclose(statistic.terms(statistic.raised(unit, np.full(11, 1.7))), statistic.terms(unit) ** 1.7)


@pytest.mark.parametrize("alpha", [0.03, 0.1])
def test_powers_of_uniform_terms_are_those_of_the_paper(alpha: float) -> None:
    """k = (1 - 2 alpha) / (1 + 2 alpha), and (2 - 3 alpha) / (2 + 6 alpha) for squares."""
    unit = (np.arange(200_000) + 0.5) / 200_000
    bins = Bins(np.zeros(len(unit), np.int64), np.array([0.0, 1.0]))
    assert np.isclose(powers(unit, bins, np.array([0.5 + alpha]))[0], (1 - 2 * alpha) / (1 + 2 * alpha), rtol=1e-4)
    found = powers(unit**2, bins, np.array([1 / 3 + alpha]))[0]
    assert np.isclose(found, (2 - 3 * alpha) / (2 + 6 * alpha), rtol=1e-4)


@BOTH
def test_each_bin_gets_the_statistic_of_its_bit_and_keeps_its_range(statistic: Statistic) -> None:
    values, held = some_values(), bits_of(1, 8)
    bins = Bins.equal_width(values, 8)
    moved = modulated(values, bins, statistic, held, 0.05)
    size = bins.sums(np.ones(len(values)))
    measured = bins.sums(statistic.terms(normalised(moved, bins))) / size
    enough = size > 20
    np.testing.assert_allclose(measured[enough], (statistic.level + 0.05 * (2.0 * held - 1.0))[enough], atol=1e-8)
    np.testing.assert_allclose(bins.ranges(moved), bins.ranges(values), rtol=1e-12)
    np.testing.assert_array_equal(moved[bins.of < 0], values[bins.of < 0])
    np.testing.assert_array_equal((soft_bits(moved, bins, statistic) > 0)[enough], held[enough])


def test_soft_bits_of_uniform_values_have_deviation_one() -> None:
    rng = np.random.default_rng(0)
    bins = Bins(np.repeat(np.arange(2000), 50), np.linspace(0.0, 1.0, 2001))
    for statistic in (Mean(), Variance()):
        assert np.isclose(soft_bits(rng.uniform(size=100_000), bins, statistic).std(), 1.0, atol=0.1)


def test_bins_of_one_value_and_of_none_say_nothing() -> None:
    bins = Bins(np.array([0, 0, 0, 1, -1]), np.arange(4.0))
    soft = soft_bits(np.array([0.2, 0.5, 0.9, 1.5, 9.0]), bins, Mean())
    assert soft[1] == soft[2] == 0.0


@METHOD
def test_the_centre_and_the_range_of_the_norms_stay(name: str, carrier: TriangleMesh, key: Key) -> None:
    """What the reader finds anew: the mean of the vertices, the least and the largest norm."""
    before = mesh_arrays(carrier)[0]
    after = mesh_arrays(METHODS.make(f"{name}:alpha=0.1").embed(carrier, bits_of(1), key))[0]
    size = vertex_norms(before).max()
    assert np.linalg.norm(after.mean(axis=0) - before.mean(axis=0)) < 0.01 * size
    bins = Bins.equal_width(vertex_norms(after), 16)
    statistic = METHODS[name].statistic  # type: ignore[attr-defined]
    measured = bins.sums(statistic.terms(normalised(vertex_norms(after), bins))) / bins.sums(np.ones(len(after)))
    np.testing.assert_allclose(np.abs(measured - statistic.level), 0.1, atol=0.01)


@METHOD
@pytest.mark.parametrize("target", [2e-4, 4e-4])
def test_the_mark_has_the_distortion_asked_for(name: str, carrier: TriangleMesh, key: Key, target: float) -> None:
    marked = METHODS.make(f"{name}:mrms={target}").embed(carrier, bits_of(1, 32), key)
    assert 0.9 * target < surface_distance(carrier, marked, samples=50_000).mrms <= target


@METHOD
def test_a_distortion_that_cannot_be_had_is_refused_with_the_one_that_can(
    name: str, carrier: TriangleMesh, key: Key
) -> None:
    with pytest.raises(MeshError, match="at most"):
        METHODS.make(f"{name}:mrms=0.05").embed(carrier, bits_of(1), key)
    with pytest.raises(MeshError, match="at least"):
        METHODS.make(f"{name}:mrms=1e-6").embed(carrier, bits_of(1), key)
    with pytest.raises(SpecError, match="mrms"):
        METHODS.make(f"{name}:mrms=0")
    with pytest.raises(SpecError, match="strength"):
        METHODS.make(f"{name}:alpha=0.6")


@METHOD
def test_a_ball_has_no_bins(name: str, key: Key) -> None:
    vertices, triangles = mesh_arrays(TriangleMesh.create_sphere(1.0, 20))
    ball = Surface.from_arrays(geometry.unit(vertices), triangles)
    method = METHODS.make(name)
    with pytest.raises(MeshError, match="one distance"):
        method.writer(ball, bits_of(1), key)  # type: ignore[attr-defined]
    assert not method.extract(ball, 16, key).soft.any()


@pytest.mark.parametrize(
    ("name", "shape"),
    [("cho2007-mean", "cube"), ("rolland2014", "cube"), ("zhan2014", "plane"), ("nakazawa2010", "torus")],
)
def test_bins_that_hold_no_bit_are_refused(name: str, shape: str, key: Key) -> None:
    """Regular shapes have few different norms, a plane has no curvature."""
    with pytest.raises(MeshError, match=r"of 64 bins have fewer than 3 values"):
        METHODS.make(name).embed(make(shape), bits_of(1, 64), key)


def test_nearly_all_bins_have_to_hold_a_bit() -> None:
    bins = Bins(np.repeat(np.arange(20), 3), np.arange(21.0))
    values = np.arange(60.0)
    values[:6] = 0.5  # two of twenty
    check_filled(values, bins)
    values[6:9] = 2.5
    with pytest.raises(MeshError, match="3 of 20 bins"):
        check_filled(values, bins)


def test_a_deal_is_undone(key: Key) -> None:
    deal, message = Deal.of("any", 16, key), bits_of(5)
    np.testing.assert_array_equal(deal.read(2.0 * deal.written(message) - 1.0) > 0, message == 1)
    assert sorted(deal.bit) == list(range(16))
    assert 0 < deal.inverted.sum() < 16


def test_where_the_distortion_jumps_the_nearest_below_is_taken(spot: TriangleMesh) -> None:
    surface = Surface.of(spot)

    def moved(strength: float) -> Any:
        return surface.vertices * (1.0 + (strength if strength < 0.01 else 2.0 * strength))

    reached = estimated_mrms(surface, moved(0.01 - 1e-9))
    vertices = with_mrms(surface, moved, 1.5 * reached, 0.02, 1e-4, 1.0)
    assert np.isclose(estimated_mrms(surface, vertices), reached, rtol=1e-3)


def test_a_strength_that_a_mesh_cannot_bear_is_kept_away_from(spot: TriangleMesh) -> None:
    surface = Surface.of(spot)

    def moved(strength: float) -> Any:
        if strength > 0.05:
            raise OutOfReachError("too strong")
        return surface.vertices * (1.0 + strength)

    most = estimated_mrms(surface, moved(0.05))
    vertices = with_mrms(surface, moved, 0.5 * most, 0.5, 1e-4, 1.0)
    assert 0.45 * most < estimated_mrms(surface, vertices) <= 0.5 * most
    with pytest.raises(MeshError, match="at most"):
        with_mrms(surface, moved, 3.0 * most, 0.01, 1e-4, 1.0)
