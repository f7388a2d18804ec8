"""Quadrature points of a surface: integrals over it are sums over them."""

import numpy as np
import pytest

from o3dmark.mesh.surface import Surface
from o3dmark.solid.quadrature import samples
from o3dmark.solid.solid import Solid


@pytest.fixture(scope="module")
def surface(spot: object) -> Surface:
    return Surface.of(spot)


@pytest.mark.parametrize("longest", [1.0, 0.1, 0.03])
def test_samples_integrate_quadratics_exactly(surface: Surface, longest: float) -> None:
    solid = Solid.of(surface)
    exact = samples(solid, 10.0)
    q = samples(solid, longest)
    assert len(q.points) >= len(exact.points)
    assert q.area_vectors.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)
    for f in (lambda x: x[:, 0], lambda x: x[:, 0] * x[:, 1], lambda x: x[:, 2] ** 2):
        assert f(q.points) @ q.area_vectors == pytest.approx(f(exact.points) @ exact.area_vectors, rel=1e-9)
    rebuilt = np.einsum("qc,qcd->qd", q.weights, solid.vertices[q.corners])
    assert rebuilt == pytest.approx(q.points)


def test_no_sampled_triangle_is_longer_than_asked_for(surface: Surface) -> None:
    """The three points of a triangle lie half way from its centroid to its corners."""
    points = samples(Solid.of(surface), 0.02, 0.0).points.reshape(-1, 3, 3)
    sides = 2.0 * np.linalg.norm(points - np.roll(points, 1, axis=1), axis=2)
    assert 0.019 < sides.max() <= 0.02


def test_small_triangles_get_one_point(surface: Surface) -> None:
    assert len(samples(Solid.of(surface), 10.0, 10.0).points) == len(surface.triangles)
