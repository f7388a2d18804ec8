"""Undoing umbrella smoothing: the inverse of the attack, written here step by step, and never a noise amplifier."""

import numpy as np
import pytest
from test_geometry import icosphere

from o3dmark import geometry
from o3dmark.mesh import Surface, mesh_arrays
from o3dmark.unsmooth import unsmooth


def smoothed(surface, steps, lam=0.1):
    """The attack: every vertex that is not on a border goes ``lam`` of the way to the mean of its neighbours."""
    inside = ~geometry.border_vertices(surface.triangles, len(surface.vertices))[:, None]
    vertices = np.array(surface.vertices)
    for _ in range(steps):
        vertices += lam * inside * (surface.neighbour_mean @ vertices - vertices)
    return surface.moved(vertices)


def rms(difference):
    return np.sqrt(np.mean(np.sum(difference**2, axis=1)))


def error(got, wanted):
    """RMS distance of the vertices, over the diagonal."""
    return rms(got.vertices - wanted.vertices) / wanted.diagonal


@pytest.fixture(scope="module")
def closed(spot):
    return Surface.of(spot)


@pytest.fixture(scope="module")
def opened(spot):
    """Spot without the triangles of its upper fifth and around one vertex: two holes."""
    vertices, triangles = mesh_arrays(spot)
    low = (vertices[triangles][:, :, 1] < np.quantile(vertices[:, 1], 0.8)).all(axis=1)
    kept = triangles[low & (triangles != triangles[low][0, 0]).all(axis=1)]
    surface = Surface.from_arrays(vertices, kept)
    assert geometry.border_vertices(surface.triangles, len(surface.vertices)).sum() > 10
    return surface


@pytest.mark.parametrize(("steps", "tolerance"), [(1, 1e-8), (5, 1e-8), (10, 1e-7), (20, 1e-6), (30, 2e-5)])
@pytest.mark.parametrize("shape", ["closed", "opened"])
def test_smoothing_is_undone(shape, steps, tolerance, request):
    """To eight digits for few steps; after thirty, the finest details need more gain than there is."""
    surface = request.getfixturevalue(shape)
    received = smoothed(surface, steps)
    (restored,) = unsmooth(received, [steps])
    assert error(restored, surface) < tolerance
    assert error(restored, surface) < 0.1 * error(received, surface)


def test_borders_stay(opened):
    border = geometry.border_vertices(opened.triangles, len(opened.vertices))
    (restored,) = unsmooth(opened, [10])
    np.testing.assert_allclose(restored.vertices[border], opened.vertices[border], atol=1e-9)


@pytest.mark.parametrize("lam", [0.05, 0.2, 0.3])
def test_other_factors(closed, lam):
    (restored,) = unsmooth(smoothed(closed, 4, lam), [4], lam=lam)
    assert error(restored, closed) < 1e-7


def test_no_step_does_nothing(closed):
    (restored,) = unsmooth(closed, [0])
    np.testing.assert_allclose(restored.vertices, closed.vertices, atol=1e-12)


def test_many_numbers_of_steps_at_once_are_what_they_are_alone(closed):
    together = unsmooth(closed, [3, 10, 50])
    for steps, surface in zip([3, 10, 50], together, strict=True):
        np.testing.assert_allclose(surface.vertices, unsmooth(closed, [steps])[0].vertices, atol=1e-10)


def test_steps_may_be_undone_in_parts(closed):
    received = smoothed(closed, 6)
    (half,) = unsmooth(received, [3])
    assert error(half, smoothed(closed, 3)) < 1e-7
    (fraction,) = unsmooth(received, [2.5])
    assert error(fraction, closed) < error(received, closed)


@pytest.mark.parametrize(("steps", "gain"), [(30, 5.0), (30, 10.0), (70, 10.0), (70, 100.0)])
def test_the_gain_is_the_most_that_any_detail_is_amplified_by(closed, steps, gain):
    """The greatest amplification, by power iteration, in the norm weighed by the degrees (there all is symmetric)."""
    degree = np.diff(geometry.adjacency(closed.triangles, len(closed.vertices)).indptr)[:, None]
    detail = np.random.default_rng(0).normal(size=closed.vertices.shape)
    for _ in range(12):
        detail = detail / rms(np.sqrt(degree) * detail)
        detail = unsmooth(closed.moved(detail), [steps], gain=gain)[0].vertices
    assert 0.9 * gain < rms(np.sqrt(degree) * detail) < 1.03 * gain


def test_more_gain_restores_more_and_amplifies_more(closed):
    received = smoothed(closed, 30)
    noise = 1e-9 * np.random.default_rng(0).normal(size=closed.vertices.shape)
    errors, amplified = [], []
    for gain in (3.0, 30.0, 300.0):
        (restored,) = unsmooth(received, [30], gain=gain)
        (noisy,) = unsmooth(received.moved(received.vertices + noise), [30], gain=gain)
        errors.append(error(restored, closed))
        amplified.append(rms(noisy.vertices - restored.vertices))
    assert errors == sorted(errors, reverse=True)
    assert amplified == sorted(amplified)


def test_it_commutes_with_similarities(closed):
    rotation, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))
    (there,) = unsmooth(closed.moved(7 * closed.vertices @ rotation + [100.0, 0, 5]), [10])
    (here,) = unsmooth(closed, [10])
    np.testing.assert_allclose(there.vertices, 7 * here.vertices @ rotation + [100.0, 0, 5], atol=1e-8)


def test_a_smoothed_sphere_is_blown_up_again():
    surface = Surface.from_arrays(*icosphere(2))
    received = smoothed(surface, 20)
    assert np.linalg.norm(received.vertices, axis=1).max() < 0.99
    (restored,) = unsmooth(received, [20])
    np.testing.assert_allclose(np.linalg.norm(restored.vertices, axis=1), 1.0, atol=1e-4)


def test_what_is_given_stays(closed):
    before = np.array(closed.vertices)
    unsmooth(closed, [5])
    np.testing.assert_array_equal(closed.vertices, before)
