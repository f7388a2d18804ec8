"""The camera: every mesh is in the picture, the right way up."""

import numpy as np
import open3d as o3d
import pytest

from fixtures.pictures import SMALL, covered
from o3dmark.errors import SpecError
from o3dmark.mesh.surface import TriangleMesh
from o3dmark.view import (
    Camera,
    render,
)
from o3dmark.view.camera import MARGIN


@pytest.fixture(scope="module")
def sphere() -> TriangleMesh:
    return o3d.geometry.TriangleMesh.create_sphere(1.0, 16)


@pytest.mark.parametrize(
    ("azimuth", "elevation", "up"), [(0, 0, "y"), (-32, 18, "z"), (123, -90, "x"), (1000, 90, "z")]
)
def test_a_cameras_axes_are_a_rotation(azimuth, elevation, up):
    axes = Camera(azimuth, elevation, up=up).axes
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)


@pytest.mark.parametrize(("up", "front"), [("y", [0, 0, 1]), ("z", [0, -1, 0]), ("x", [0, 0, -1])])
def test_what_is_up_is_up_and_the_front_is_seen(up, front):
    axes = Camera(0, 0, up=up).axes
    np.testing.assert_allclose(axes[1], np.eye(3)["xyz".index(up)], atol=1e-12)
    np.testing.assert_allclose(axes[2], front, atol=1e-12)


@pytest.mark.parametrize("size", [(640, 480), (300, 900)])
def test_every_point_is_in_the_picture_and_one_touches_the_margin(size):
    points = np.random.default_rng(1).normal(size=(50, 3)) * [0.2, 0.1, 0.3]
    rays = Camera().rays(points, *size).astype(float)
    eye, corner = rays[0, 0, :3], rays[0, 0, 3:]
    sight = points - eye
    assert (sight[:, 2] < 0).all()
    tangent = np.abs(corner[:2] / corner[2]) * size / (np.array(size) - 1)  # the corner ray is half a pixel inside
    place = np.abs(sight[:, :2] / sight[:, 2:]) / tangent
    assert place.max() == pytest.approx(1 - 2 * MARGIN, abs=1e-4)


def test_zoom_magnifies(sphere):
    near, far = (covered(render(sphere, camera=Camera(zoom=zoom), size=SMALL)).sum() for zoom in (1.0, 0.5))
    assert near == pytest.approx(4 * far, rel=0.1)


@pytest.mark.parametrize("bad", [{"zoom": 0}, {"azimuth": np.nan}, {"up": "w"}])
def test_a_bad_camera_is_refused(bad):
    with pytest.raises(ValueError, match=r"camera|up should"):
        Camera(**bad)


def test_a_camera_in_words():
    assert Camera.parse("front") == Camera(0, 0)
    assert Camera.parse("-30, 12.5") == Camera(-30, 12.5)
    assert Camera.parse("top,z") == Camera(0, 90, up="z")
    for name, way in {"right": [1, 0, 0], "back": [0, 0, -1], "left": [-1, 0, 0], "top": [0, 1, 0]}.items():
        np.testing.assert_allclose(Camera.parse(name).axes[2], way, atol=1e-12)


@pytest.mark.parametrize("text", ["", "up", "1", "1,2,3", "front,1", "nan,0", "1,2,w", "z", "1,2,z,z"])
def test_other_words_are_no_camera(text):
    with pytest.raises(SpecError, match="AZIMUTH,ELEVATION"):
        Camera.parse(text)
