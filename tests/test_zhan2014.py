"""Curvature fluctuations: what they are invariant to, how they answer to a motion, and that bins get their means."""

import numpy as np
import pytest

from fixtures.shapes import bits_of, some_similarity
from o3dmark.coding.keys import Key
from o3dmark.errors import SpecError
from o3dmark.mesh import curvature
from o3dmark.mesh.surface import Surface, TriangleMesh
from o3dmark.methods import METHODS
from o3dmark.methods._norm_bins import Bins, normalised
from o3dmark.methods.zhan2014 import Fluctuations, Zhan2014, bending


def test_a_sphere_does_not_fluctuate_and_scale_divides_what_does(spot: TriangleMesh) -> None:
    ball = Surface.of(TriangleMesh.create_icosahedron().subdivide_loop(0))
    np.testing.assert_allclose(Fluctuations(ball, 1).values, 0.0, atol=1e-12)
    matrix = some_similarity(4)
    scale = np.cbrt(np.linalg.det(matrix[:3, :3]))
    before, after = (Fluctuations(Surface.of(mesh), 2).values for mesh in (spot, TriangleMesh(spot).transform(matrix)))
    np.testing.assert_allclose(after * scale, before, atol=1e-9 * np.abs(before).max())


def test_what_is_far_does_not_matter(spot: TriangleMesh) -> None:
    """No centre: a change at one end leaves the fluctuations at the other."""
    surface = Surface.of(spot)
    far = surface.vertices[:, 0] > np.quantile(surface.vertices[:, 0], 0.9)
    moved = surface.moved(surface.vertices * np.where(far, 1.2, 1.0)[:, None])
    near = surface.vertices[:, 0] < np.median(surface.vertices[:, 0])
    before, after = (Fluctuations(each, 2).values[near] for each in (surface, moved))
    np.testing.assert_allclose(after, before, atol=1e-9)


def test_bending_is_the_derivative_of_the_mean_curvature_on_a_flat_mesh() -> None:
    """There the normals do not change the first-order response, which is exact."""
    rng = np.random.default_rng(0)
    flat = TriangleMesh.create_box().subdivide_midpoint(4)
    surface = Surface.of(flat)
    inner = (np.abs(surface.vertices - 0.5).max(axis=1) == 0.5) & (surface.normals.max(axis=1) > 0.999)
    inner &= (np.sort(np.abs(surface.vertices - 0.5), axis=1)[:, 1] < 0.3) & (surface.normals[:, 2] > 0.999)
    height = np.where(inner, rng.normal(size=len(inner)), 0.0)
    normals = np.broadcast_to([0.0, 0.0, 1.0], surface.vertices.shape)
    measured = [
        curvature.taubin(surface.vertices + side * 1e-6 * height[:, None] * normals, surface.triangles).mean
        for side in (1.0, -1.0)
    ]
    slope = (measured[0] - measured[1]) / 2e-6
    np.testing.assert_allclose((-bending(surface) @ height)[inner], slope[inner], rtol=1e-4, atol=1e-4)


def test_the_response_predicts_the_change(spot: TriangleMesh) -> None:
    surface = Surface.of(spot)
    seen = Fluctuations(surface, 2)
    height = np.random.default_rng(0).normal(size=len(surface.vertices))
    step = 1e-6
    ahead = Fluctuations(surface.moved(surface.vertices + step * height[:, None] * surface.normals), 2).values
    predicted = seen.response() @ height
    assert np.corrcoef(predicted, (ahead - seen.values) / step)[0, 1] > 0.7
    other = np.random.default_rng(1).normal(size=len(height))
    np.testing.assert_allclose(other @ predicted, height @ (seen.response().rmatvec(other)), rtol=1e-9)


def test_bins_get_the_means_of_their_bits(carrier: TriangleMesh, key: Key) -> None:
    marked = Zhan2014(alpha=0.05).embed(carrier, bits_of(1), key)
    values = Fluctuations(Surface.of(marked), 2).values
    bins = Bins.equal_count(values, 16)
    means = bins.sums(normalised(values, bins)) / bins.sums(np.ones(len(values)))
    assert np.abs(np.abs(means - 0.5) - 0.05).max() < 0.04


def test_misuse_is_an_error() -> None:
    for spec in ("zhan2014:window=0", "zhan2014:steps=0", "zhan2014:alpha=0.5"):
        with pytest.raises(SpecError):
            METHODS.make(spec)
