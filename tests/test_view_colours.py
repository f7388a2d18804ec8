"""Numbers as colours."""

import numpy as np
import open3d as o3d
import pytest

from o3dmark.errors import MeshError
from o3dmark.mesh.surface import PointCloud, TriangleMesh
from o3dmark.view import (
    coloured,
)
from o3dmark.view.colours import beyond, colour_limits, colours


@pytest.fixture(scope="module")
def sphere() -> TriangleMesh:
    return o3d.geometry.TriangleMesh.create_sphere(1.0, 16)


def test_colour_limits_leave_out_the_tails():
    assert colour_limits(np.arange(101.0)) == (2, 98)
    assert colour_limits(np.append(np.zeros(99), 5.0)) == (0, 5)  # the percentiles fall together
    for constant in (0.0, 3.0, -2e-9, 1e12):
        low, high = colour_limits(np.full(7, constant))
        assert low < constant < high


def test_beyond_names_the_ends_that_are_cut():
    values = np.array([0.0, 1.0])
    ends = [beyond(values, limits) for limits in ((0, 1), (0.5, 1), (0, 0.5), (0.2, 0.5))]
    assert ends == ["neither", "min", "max", "both"]


def test_colours_are_the_colormaps_own():
    import matplotlib

    values = np.array([-9.0, 0.0, 0.5, 1.0, 9.0])
    expected = matplotlib.colormaps["plasma"](np.clip(values, 0, 1))[:, :3]
    np.testing.assert_allclose(colours(values, (0.0, 1.0), "plasma"), expected, atol=0.02)


def test_a_coloured_copy_is_a_copy(spot, sphere):
    copy = coloured(spot, np.asarray(spot.vertices)[:, 1])
    assert copy.has_vertex_colors()
    assert not spot.has_vertex_colors()
    assert len(coloured(PointCloud(sphere.vertices), np.zeros(len(sphere.vertices))).colors) == len(sphere.vertices)
    with pytest.raises(MeshError, match="is wanted"):
        coloured("mesh", [1.0])
