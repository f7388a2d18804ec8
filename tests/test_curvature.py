"""Curvature of surfaces that textbooks know, its symmetries, the definition in slow motion, and other programs' values.

Provenance of tests/golden/saliency_spot.npz (2026-11-22, a row a vertex of spot.ply):
  lee_taubin (n, 9)  S, S_1 .. S_5, H, k1, k2 by an independent program written from Taubin 1995 and Lee et al. 2005
                     alone: Householder reflection and Givens rotation for the tensor, levels over their maximum, strict
                     one-ring local maxima
  cpp_taubin (n,)    H by climberpi/Mesh-Saliency f579dbd (C++, single precision)
  octave (n, 6)      S_1 .. S_5 and the curvature they start from, by daeyun/saliency-for-3d-meshes ca81bee, unmodified,
                     under Octave 7.3; it rounds sigma to six decimals
"""

import numpy as np
import pytest

from fixtures.paths import GOLDEN
from fixtures.shapes import icosphere
from o3dmark.files import read_mesh
from o3dmark.mesh import geometry
from o3dmark.mesh.curvature import of_points, taubin
from o3dmark.mesh.surface import mesh_arrays

QUADRICS = [(1.0, -1.0), (2.0, 0.5), (-1.0, -3.0), (0.0, -2.0), (0.0, 0.0)]


def lattice(rows, columns, size):
    """Points (n, 2) of an equilateral lattice, its triangles (m, 3), and a mask (n,) of the points not on its rim."""
    row, column = np.divmod(np.arange(rows * columns), columns)
    points = size * np.stack([column + 0.5 * (row % 2), np.sqrt(0.75) * row], axis=1)
    triangles = []
    for r in range(rows - 1):
        for c in range(columns - 1):
            a, b = r * columns + c, (r + 1) * columns + c
            triangles += [(a, a + 1, b), (a + 1, b + 1, b)] if r % 2 == 0 else [(a, b + 1, b), (a, a + 1, b + 1)]
    inner = (row > 0) & (row < rows - 1) & (column > 0) & (column < columns - 1)
    return points, np.array(triangles), inner


def quadric(p, q, size=1e-3):
    """z = (p x^2 + q y^2) / 2 around the origin: vertices, their unit normals, triangles, the index of the origin."""
    points, triangles, _ = lattice(7, 7, size)
    origin = 3 * 7 + 3
    x, y = (points - points[origin]).T
    x, y = 0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y  # so that no edge lies in a principal direction
    vertices = np.stack([x, y, 0.5 * (p * x**2 + q * y**2)], axis=1)
    return vertices, geometry.unit(np.stack([-p * x, -q * y, np.ones(len(x))], axis=1)), triangles, origin


def cylinder(radius, around=60, rows=15):
    """An open cylinder of equilateral triangles about the z axis, and a mask of the vertices not on its boundaries."""
    side = 2 * np.pi * radius / around
    points, triangles, _ = lattice(rows, around + 1, side)
    row, column = np.divmod(np.arange(len(points)), around + 1)
    angle = points[:, 0] / radius
    vertices = np.stack([radius * np.cos(angle), radius * np.sin(angle), points[:, 1]], axis=1)
    wrapped = np.where(column == around, row * (around + 1), np.arange(len(points)))
    return vertices, wrapped[triangles], (row > 0) & (row < rows - 1) & (column < around)


def taubin_slowly(vertices, triangles, chosen):
    """H, k1, k2 (c, 3) at some vertices by the definition: the tensor's eigenvalues but for the one of the normal."""
    rows = []
    for i, p in zip(chosen, vertices[chosen], strict=True):
        ring = triangles[(triangles == i).any(axis=1)]
        normal = geometry.area_vectors(vertices, ring).sum(axis=0)
        normal /= np.linalg.norm(normal)
        tensor, total = np.zeros((3, 3)), 0.0
        for j in np.setdiff1d(ring, i):
            weight = geometry.areas(vertices, ring[(ring == j).any(axis=1)]).sum()
            offset = vertices[j] - p
            tangent = offset - (normal @ offset) * normal
            tangent /= np.linalg.norm(tangent)
            tensor += weight * 2 * (normal @ offset) / (offset @ offset) * np.outer(tangent, tangent)
            total += weight
        values, vectors = np.linalg.eigh(tensor / total)
        b, a = np.delete(values, np.abs(normal @ vectors).argmax())
        rows.append((a + b, 3 * a - b, 3 * b - a))
    return np.array(rows)


# Surfaces of known curvature


@pytest.mark.parametrize("radius", [0.1, 1.0, 30.0])
def test_sphere(radius):
    """H is right to 1 % everywhere; the tensor takes the directions for evenly spread, and the rings are not quite."""
    found = taubin(*icosphere(4, radius))
    np.testing.assert_allclose(found.mean, -1.0 / radius, rtol=0.01)
    for curvature in (found.k1, found.k2):
        np.testing.assert_allclose(curvature, -1.0 / radius, rtol=0.2)
        assert np.median(curvature) == pytest.approx(-1.0 / radius, rel=0.06)
    assert np.median(found.gauss) == pytest.approx(1.0 / radius**2, rel=0.01)


def test_sphere_seen_from_inside():
    vertices, triangles = icosphere(3)
    np.testing.assert_allclose(taubin(vertices, triangles[:, ::-1]).mean, 1.0, rtol=0.02)


@pytest.mark.parametrize("radius", [0.5, 2.0])
def test_cylinder_away_from_its_boundaries(radius):
    vertices, triangles, inner = cylinder(radius)
    found = taubin(vertices, triangles)
    np.testing.assert_allclose(found.k1[inner], 0.0, atol=0.005 / radius)
    np.testing.assert_allclose(found.k2[inner], -1.0 / radius, rtol=0.005)
    np.testing.assert_allclose(found.mean[inner], -0.5 / radius, rtol=0.005)


def test_plane():
    points, triangles, _ = lattice(6, 8, 0.3)
    found = taubin(np.pad(points, ((0, 0), (0, 1))), triangles)
    for curvature in (found.mean, found.k1, found.k2, found.gauss):
        np.testing.assert_array_equal(curvature, 0.0)


@pytest.mark.parametrize(("p", "q"), QUADRICS)
def test_quadric_bends_towards_its_normal_where_curvature_is_positive(p, q):
    vertices, _, triangles, origin = quadric(p, q)
    found = taubin(vertices, triangles)
    expected = max(p, q), min(p, q), (p + q) / 2, p * q
    got = found.k1[origin], found.k2[origin], found.mean[origin], found.gauss[origin]
    np.testing.assert_allclose(got, expected, atol=1e-4)


# Symmetries


def assert_alike(got, wanted, factor=1.0):
    for name in ("mean", "k1", "k2"):
        expected = factor * getattr(wanted, name)
        np.testing.assert_allclose(getattr(got, name), expected, atol=1e-9 * np.abs(expected).max(), err_msg=name)


@pytest.mark.parametrize("scale", [1e-7, 0.25, 1e7])
def test_scaling_divides_curvature(spot, scale):
    vertices, triangles = mesh_arrays(spot)
    assert_alike(taubin(scale * vertices, triangles), taubin(vertices, triangles), 1.0 / scale)


def test_rotation_and_translation_change_nothing(spot):
    vertices, triangles = mesh_arrays(spot)
    rotation, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))
    rotation *= np.sign(np.linalg.det(rotation))
    assert_alike(taubin(vertices @ rotation.T + [1.0, -2, 3], triangles), taubin(vertices, triangles))


def test_reflection_keeps_curvature_if_the_winding_turns_too(spot):
    vertices, triangles = mesh_arrays(spot)
    assert_alike(taubin(vertices * [-1.0, 1, 1], triangles[:, ::-1]), taubin(vertices, triangles))


def test_flipping_the_winding_negates(spot):
    vertices, triangles = mesh_arrays(spot)
    found, flipped = taubin(vertices, triangles), taubin(vertices, triangles[:, ::-1])
    np.testing.assert_allclose(flipped.mean, -found.mean, atol=1e-12)
    np.testing.assert_allclose(flipped.k1, -found.k2, atol=1e-9)
    np.testing.assert_allclose(flipped.k2, -found.k1, atol=1e-9)


def test_mean_is_half_the_sum_of_the_principal_curvatures(spot):
    found = taubin(*mesh_arrays(spot))
    np.testing.assert_allclose((found.k1 + found.k2) / 2, found.mean, atol=1e-12 * np.abs(found.mean).max())
    assert (found.k1 >= found.k2).all()


def test_order_of_the_vertices_does_not_matter(spot):
    vertices, triangles = mesh_arrays(spot)
    order = np.random.default_rng(0).permutation(len(vertices))
    shuffled = taubin(vertices[order], np.argsort(order)[triangles])
    np.testing.assert_allclose(shuffled.mean, taubin(vertices, triangles).mean[order], atol=1e-10)


# Degenerate meshes: zero, never NaN


def test_unused_vertices_and_cancelling_normals_have_zero():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5]])
    found = taubin(vertices, np.array([[0, 1, 2], [2, 1, 0]]))
    for curvature in (found.mean, found.k1, found.k2):
        np.testing.assert_array_equal(curvature, 0.0)


def test_zero_edges_and_zero_areas_stay_finite(spot):
    vertices, triangles = mesh_arrays(spot)
    vertices[triangles[::50, 0]] = vertices[triangles[::50, 1]]
    found = taubin(vertices, triangles)
    for curvature in (found.mean, found.k1, found.k2):
        assert np.isfinite(curvature).all()


# The definition and other programs


def test_taubin_against_the_definition(spot):
    vertices, triangles = mesh_arrays(spot)
    chosen = np.arange(0, len(vertices), 7)
    found = taubin(vertices, triangles)
    expected = taubin_slowly(vertices, triangles, chosen)
    for column, got in zip(expected.T, (found.mean, found.k1, found.k2), strict=True):
        np.testing.assert_allclose(got[chosen], column, atol=1e-11 * np.abs(column).max())


def assert_golden(mesh, lee_taubin, cpp_taubin):
    found = taubin(*mesh_arrays(mesh))
    for got, column in ((found.mean, 6), (found.k1, 7), (found.k2, 8)):
        expected = lee_taubin[:, column]
        np.testing.assert_allclose(got, expected, atol=1e-11 * np.abs(expected).max())
    np.testing.assert_allclose(found.mean, cpp_taubin, atol=1e-6 * np.abs(cpp_taubin).max())  # a single's precision


def test_golden_spot(spot):
    golden = np.load(GOLDEN / "saliency_spot.npz")
    assert_golden(spot, golden["lee_taubin"], golden["cpp_taubin"])


def test_golden_rocker(shared):
    lee_taubin = np.load(shared("oracle/saliency/saliency_rocker_lee_taubin.npy"))
    cpp_taubin = np.load(shared("oracle/saliency/saliency_rocker_cpp_taubin_climberpi.npy"))[:, 0]
    assert_golden(read_mesh(shared("oracle/saliency/rocker.off")), lee_taubin, cpp_taubin)


# Point clouds


def nearest(points, count):
    """The ``count`` nearest other points, by sorting all distances."""
    distance = np.linalg.norm(points[:, None] - points[None], axis=2)
    return np.argsort(distance, axis=1)[:, 1 : count + 1]


@pytest.mark.parametrize("radius", [0.5, 3.0])
def test_points_of_a_sphere(radius):
    """On a sphere the normal turns by |d| / r along every chord d, so this is exact for any sampling."""
    normals = geometry.unit(np.random.default_rng(0).normal(size=(500, 3)))
    found = of_points(radius * normals, normals, nearest(normals, 12))
    np.testing.assert_allclose(found.mean, -1.0 / radius, rtol=1e-9)


@pytest.mark.parametrize(("p", "q"), QUADRICS)
def test_points_of_a_quadric(p, q):
    vertices, normals, _, origin = quadric(p, q)
    found = of_points(vertices, normals, nearest(vertices, 6))
    got = found.k1[origin], found.k2[origin], found.mean[origin]
    np.testing.assert_allclose(got, (max(p, q), min(p, q), (p + q) / 2), atol=1e-4)


def test_points_noise_disturbs_less_than_it_disturbs_the_chord_formula():
    vertices, triangles = icosphere(3)
    noisy = vertices + 0.01 * np.random.default_rng(0).normal(size=vertices.shape)
    from_points = of_points(noisy, vertices, nearest(vertices, 6)).mean
    assert np.std(from_points) < 0.2 * np.std(taubin(noisy, triangles).mean)


def test_coincident_points_count_for_nothing():
    points = np.repeat(icosphere(1)[0], 2, axis=0)
    normals = geometry.unit(points)
    found = of_points(points, normals, nearest(points, 7))
    np.testing.assert_allclose(found.mean, -1.0)
