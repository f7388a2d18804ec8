"""The closed surface through a point cloud."""

import numpy as np
import pytest

from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.reconstruction import surface_of_points
from o3dmark.mesh.surface import PointCloud, point_cloud

RADII = np.array([1.0, 0.7, 0.5])


def ellipsoid(size: float = 1.0, place: float = 0.0, normals: bool = True) -> PointCloud:
    """5 000 points of an ellipsoid, with outward normals."""
    sphere = geometry.unit(np.random.default_rng(0).standard_normal((5_000, 3)))
    return point_cloud(size * sphere * RADII + place, geometry.unit(sphere / RADII) if normals else None)


@pytest.mark.parametrize("normals", [True, False])
def test_the_surface_goes_through_the_points(normals: bool) -> None:
    surface = surface_of_points(ellipsoid(normals=normals))
    assert np.abs(np.linalg.norm(surface.vertices / RADII, axis=1) - 1.0).max() < 0.03
    assert not geometry.boundary_vertices(surface.triangles, len(surface.vertices)).any()
    volume = geometry.volume(surface.vertices, surface.triangles)
    assert abs(volume) == pytest.approx(4.0 / 3.0 * np.pi * RADII.prod(), rel=0.01)
    assert volume > 0 or not normals  # estimated ones agree with each other, but not on what is outside


@pytest.mark.parametrize(("size", "place"), [(1e-6, 0.0), (1e7, 0.0), (1.0, 5e5)])
def test_neither_the_unit_of_length_nor_the_origin_matters(size: float, place: float) -> None:
    there, here = surface_of_points(ellipsoid(size, place)), surface_of_points(ellipsoid())
    radii = np.linalg.norm((there.vertices - place) / size / RADII, axis=1)
    assert np.abs(radii - 1.0).max() < 0.03
    assert len(there.vertices) == pytest.approx(len(here.vertices), rel=0.001)


def test_the_cloud_stays_as_it_is() -> None:
    cloud = ellipsoid(normals=False)
    surface_of_points(cloud)
    assert not cloud.has_normals()
    np.testing.assert_array_equal(cloud.points, ellipsoid().points)


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (np.eye(3), "3 points are too few"),
        (np.ones((2_000, 3)), "in one place"),
        (np.full((2_000, 3), np.nan), "finite"),
    ],
)
def test_what_is_no_surface_is_refused(points: np.ndarray, words: str) -> None:
    with pytest.raises(MeshError, match=words):
        surface_of_points(point_cloud(points))
