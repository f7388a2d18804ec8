"""Mesh saliency: what must come out for certain fields, invariances, slow definitions, and other programs' values."""

import numpy as np
import open3d as o3d
import pytest
import scipy.sparse as sp
from scipy.stats import spearmanr

from fixtures.paths import GOLDEN
from fixtures.references import means_slowly
from fixtures.shapes import icosphere
from o3dmark.errors import MeshError
from o3dmark.files import read_mesh
from o3dmark.mesh import curvature, geometry
from o3dmark.mesh.saliency import LEE_SCALES, Saliency, combine, gaussian_means
from o3dmark.mesh.surface import Surface, mesh_arrays, point_cloud, triangle_mesh

PAPER = Saliency(scales=(2.0,))
LEE = Saliency()


def combine_slowly(levels, triangles):
    """Lee's sum (n,), a vertex at a time."""
    around = {}
    for a, b in geometry.edges(triangles):
        around.setdefault(a, set()).add(b)
        around.setdefault(b, set()).add(a)
    total = np.zeros(levels.shape[1])
    for level in levels / levels.max(axis=1, keepdims=True):
        peaks = [v for v in around if all(level[v] > level[w] for w in around[v]) and v != level.argmax()]
        total += level * (1.0 - (np.mean(level[peaks]) if peaks else 0.0)) ** 2
    return total


def ring(n):
    """The graph of a closed chain of n points."""
    place = np.arange(n)
    pairs = np.concatenate([place, place]), np.concatenate([(place + 1) % n, (place - 1) % n])
    return sp.csr_array((np.ones(2 * n), pairs), shape=(n, n))


rng = np.random.default_rng(0)
POINTS = {
    "cube": rng.random((800, 3)),
    "dense and sparse": np.concatenate([rng.normal(size=(400, 3)), 0.01 * rng.normal(size=(400, 3))]),
    "far outlier": np.concatenate([rng.random((300, 3)), [[40.0, 0, 0]]]),
    "line": np.outer(rng.random(300), [1.0, 2, 3]),
    "coincident": np.repeat(rng.random((100, 3)), 3, axis=0),
    "far from the origin": 1e4 + rng.random((300, 3)),
    "one": np.zeros((1, 3)),
}


# Gaussian means


@pytest.mark.parametrize("points", POINTS.values(), ids=POINTS)
def test_gaussian_means_against_the_definition(points):
    values = np.random.default_rng(1).normal(size=len(points))
    sigmas = np.array([0.01, 0.03, 0.06, 0.12, 0.3]) * (geometry.diagonal(points) or 1.0)
    moved = points - points.mean(axis=0)  # the definition loses digits far from the origin
    np.testing.assert_allclose(gaussian_means(points, values, sigmas), means_slowly(moved, values, sigmas), atol=1e-12)


def test_gaussian_means_of_a_mesh_against_the_definition(spot):
    vertices, _ = mesh_arrays(spot)
    values = np.sin(9 * vertices).sum(axis=1)
    sigmas = 0.003 * geometry.diagonal(vertices) * np.array([2.0, 6, 12])
    np.testing.assert_allclose(
        gaussian_means(vertices, values, sigmas), means_slowly(vertices, values, sigmas), atol=1e-12
    )


def test_sigmas_come_in_any_order_and_more_than_once():
    points, values = POINTS["cube"], POINTS["cube"][:, 0]
    sigmas = np.array([0.2, 0.05, 0.2, 0.1])
    means = gaussian_means(points, values, sigmas)
    for sigma, row in zip(sigmas, means, strict=True):
        np.testing.assert_allclose(row, gaussian_means(points, values, np.array([sigma]))[0], atol=1e-13)


def test_means_are_means():
    """Of a constant the constant, never beyond the extremes, and the value itself in a window with nothing else."""
    points, values = POINTS["cube"], np.random.default_rng(1).normal(size=800)
    means = gaussian_means(points, values, np.array([0.05, 0.5]))
    assert (means.min(), means.max()) > (values.min(), -np.inf)
    assert means.max() < values.max()
    np.testing.assert_allclose(gaussian_means(points, np.full(800, 7.0), np.array([0.05, 0.5])), 7.0)
    np.testing.assert_array_equal(gaussian_means(points, values, np.array([1e-5]))[0], values)


def test_the_window_is_an_open_ball_of_two_sigma():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [3, 0, 0]])
    values = np.array([0.0, 1.0, 100.0])
    outside, inside = gaussian_means(points, values, np.array([0.4999999, 0.5000001]))[:, 0]
    assert (outside, inside) == (0.0, pytest.approx(np.exp(-2) / (1 + np.exp(-2)), rel=1e-6))


# Levels and their sum


def test_a_constant_field_is_not_salient(spot):
    vertices, _ = mesh_arrays(spot)
    np.testing.assert_allclose(LEE.levels(vertices, np.full(len(vertices), 3.0)), 0.0, atol=1e-14)


def test_levels_ignore_a_constant_and_the_sign(spot):
    vertices, triangles = mesh_arrays(spot)
    mean = curvature.taubin(vertices, triangles).mean
    levels = LEE.levels(vertices, mean)
    for changed in (mean + 5.0, -mean):
        np.testing.assert_allclose(LEE.levels(vertices, changed), levels, atol=1e-12)


def test_a_plane_is_not_salient():
    plane = o3d.geometry.TriangleMesh.create_box().subdivide_midpoint(3)
    vertices, triangles = mesh_arrays(plane)
    flat = triangle_mesh(vertices * [1.0, 1, 0], triangles[(vertices[triangles][:, :, 2] == 0).all(axis=1)])
    for saliency in (LEE, PAPER):
        np.testing.assert_array_equal(saliency(flat), 0.0)


def test_a_bump_on_a_sphere_is_the_most_salient_place():
    vertices, triangles = icosphere(4)
    bump = 1.0 + 0.05 * np.exp(-np.sum((vertices - vertices[0]) ** 2, axis=1) / 0.005)
    for saliency in (LEE, PAPER):
        values = saliency(triangle_mesh(bump[:, None] * vertices, triangles))
        assert np.linalg.norm(vertices[values.argmax()] - vertices[0]) < 0.1


def test_one_peak_counts_fully():
    level = 0.5 + 0.5 * np.cos(2 * np.pi * np.arange(40) / 40)
    np.testing.assert_allclose(combine(np.stack([level, level]), ring(40)), 2 * level)


def test_many_equal_peaks_count_for_nothing():
    level = 0.5 + 0.5 * np.cos(2 * np.pi * 5 * np.arange(40) / 40)
    np.testing.assert_allclose(combine(np.stack([level, level]), ring(40)), 0.0, atol=1e-30)


@pytest.mark.parametrize("other", [0.0, 0.3, 0.9])
def test_a_second_peak_counts_by_its_height(other):
    level = np.array([0.0, 1, 0, 0, other, 0])
    np.testing.assert_allclose(combine(np.stack([4.0 * level, level]), ring(6)), 2 * (1.0 - other) ** 2 * level)


def test_one_scale_is_left_as_it_is():
    level = np.array([0.0, 3, 0, 0, 2, 0])
    combined = combine(level[None], ring(6))
    np.testing.assert_array_equal(combined, level)
    combined[:] = -1.0
    assert level[1] == 3.0


def test_levels_of_zero_are_left_out():
    level = np.array([0.0, 1, 0, 0, 0, 0])
    np.testing.assert_array_equal(combine(np.stack([0.0 * level, level]), ring(6)), level)


def test_combine_against_the_definition(spot):
    vertices, triangles = mesh_arrays(spot)
    levels = LEE.levels(vertices, curvature.taubin(vertices, triangles).mean)
    got = combine(levels, geometry.adjacency(triangles, len(vertices)))
    np.testing.assert_allclose(got, combine_slowly(levels, triangles), atol=1e-13)


# Invariances of the whole


@pytest.mark.parametrize("scale", [1e-7, 3.0, 1e7])
def test_scaling_changes_nothing_but_the_unit_of_one_scale(spot, scale):
    vertices, triangles = mesh_arrays(spot)
    scaled = triangle_mesh(scale * vertices, triangles)
    np.testing.assert_allclose(LEE(scaled), LEE(spot), atol=1e-9)
    np.testing.assert_allclose(PAPER(scaled) * scale, PAPER(spot), atol=1e-9)


def test_translation_and_turns_about_the_axes_change_nothing(spot):
    vertices, triangles = mesh_arrays(spot)
    turned = triangle_mesh(vertices[:, [1, 2, 0]] + [5.0, -3, 2], triangles)
    np.testing.assert_allclose(LEE(turned), LEE(spot), atol=1e-9)


def test_inside_out_is_as_salient(spot):
    vertices, triangles = mesh_arrays(spot)
    np.testing.assert_allclose(LEE(triangle_mesh(vertices, triangles[:, ::-1])), LEE(spot), atol=1e-10)


def test_permuted_vertices_have_permuted_saliency(spot):
    vertices, triangles = mesh_arrays(spot)
    order = np.random.default_rng(0).permutation(len(vertices))
    shuffled = triangle_mesh(vertices[order], np.argsort(order)[triangles])
    for saliency in (LEE, PAPER):
        np.testing.assert_allclose(saliency(shuffled), saliency(spot)[order], atol=1e-9)


def test_unused_vertices_get_zero_and_copies_the_same(spot):
    vertices, triangles = mesh_arrays(spot)
    alone = triangle_mesh(np.vstack([[[0.1, 0.2, 0.3]], vertices, [[9.0, 9, 9]]]), triangles + 1)
    np.testing.assert_array_equal(LEE(alone), [0.0, *LEE(spot), 0.0])
    soup = triangle_mesh(vertices[triangles.ravel()], np.arange(triangles.size).reshape(-1, 3))
    np.testing.assert_allclose(LEE(soup), LEE(spot)[triangles.ravel()], atol=1e-9)


def test_saliency_is_never_negative_and_leaves_the_mesh_as_it_is(spot):
    before = np.array(spot.vertices)
    for saliency in (LEE, PAPER):
        assert saliency(spot).min() >= 0
    np.testing.assert_array_equal(spot.vertices, before)


# Other programs (provenance: test_curvature.py)


def assert_golden(mesh, lee_taubin):
    """S and every S_i to a millionth of a millionth of the largest value of its column."""
    surface = Surface.of(mesh)
    levels = LEE.levels(surface.vertices, curvature.taubin(surface.vertices, surface.triangles).mean)
    for got, expected in zip([LEE.of_surface(surface), *levels], lee_taubin.T[:6], strict=True):
        np.testing.assert_allclose(got, expected, atol=1e-12 * expected.max())


def assert_octave(mesh, octave):
    """The levels of another program, from its own curvature.

    With sigma rounded to six decimals, as it does, they agree to 1e-12 of the largest value. With sigma as it is, a
    neighbour may be just within one window and just without the other: most agree to 1e-4 all the same, none is off
    by more than such a neighbour at the edge weighs, exp(-2) of the one at the centre.
    """
    vertices, _ = mesh_arrays(mesh)
    values = np.ascontiguousarray(octave[:, 5])
    sigmas = np.round(np.array(LEE_SCALES) * 0.003 * geometry.diagonal(vertices), 6)
    fine, coarse = gaussian_means(vertices, values, np.concatenate([sigmas, 2 * sigmas])).reshape(2, 5, -1)
    for got, exact, expected in zip(LEE.levels(vertices, values), np.abs(fine - coarse), octave.T[:5], strict=True):
        np.testing.assert_allclose(exact, expected, atol=1e-12 * expected.max())
        error = np.abs(got - expected) / expected.max()
        assert np.mean(error < 1e-4) > 0.99
        assert error.max() < np.exp(-2)


def test_golden_spot(spot):
    golden = np.load(GOLDEN / "saliency_spot.npz")
    assert_golden(spot, golden["lee_taubin"])
    assert_octave(spot, golden["octave"])


def test_golden_rocker(shared):
    rocker = read_mesh(shared("oracle/saliency/rocker.off"))
    assert_golden(rocker, np.load(shared("oracle/saliency/saliency_rocker_lee_taubin.npy")))
    assert_octave(rocker, np.load(shared("oracle/saliency/saliency_rocker_octave.npy"))[:, 1:])


# Point clouds


@pytest.mark.parametrize(("saliency", "least"), [(LEE, 0.85), (PAPER, 0.65)], ids=["lee", "paper"])
def test_a_cloud_is_as_salient_as_its_mesh(spot, saliency, least):
    """On a mesh this coarse twelve neighbours blur the curvature, which the finest scale feels most."""
    surface = Surface.of(spot)
    got = saliency(point_cloud(surface.vertices, surface.normals))
    assert spearmanr(got, saliency(spot)).statistic > least


def test_a_cloud_without_normals_gets_some_and_stays_as_it_is(spot):
    surface = Surface.of(spot)
    cloud = point_cloud(surface.vertices)
    got = LEE(cloud)
    assert not cloud.has_normals()
    assert spearmanr(got, LEE(point_cloud(surface.vertices, surface.normals))).statistic > 0.8


def test_length_of_the_normals_does_not_matter(spot):
    surface = Surface.of(spot)
    short, long = (point_cloud(surface.vertices, length * surface.normals) for length in (1.0, 20.0))
    np.testing.assert_allclose(LEE(short), LEE(long), atol=1e-9)


def test_a_sphere_of_points_is_hardly_salient():
    directions = geometry.unit(np.random.default_rng(0).normal(size=(2000, 3)))
    np.testing.assert_allclose(PAPER(point_cloud(directions, directions)), 0.0, atol=1e-9)


BAD_CLOUDS = {
    "empty": (np.zeros((0, 3)), "0 points is too small"),
    "few": (np.eye(3), "3 points is too small.*13"),
    "NaN": (np.vstack([np.random.default_rng(0).random((50, 3)), [[np.nan, 0, 0]]]), "not finite"),
    "one place": (np.ones((50, 3)), "all the same"),
}


@pytest.mark.parametrize(("points", "words"), BAD_CLOUDS.values(), ids=BAD_CLOUDS)
def test_an_unusable_cloud_says_why(points, words):
    with pytest.raises(MeshError, match=words):
        LEE(point_cloud(points))


def test_coincident_points_are_no_trouble():
    points = np.repeat(icosphere(3)[0], 2, axis=0)
    assert np.isfinite(LEE(point_cloud(points, points))).all()
