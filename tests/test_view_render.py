"""Pictures: what must hold for any mesh or point cloud."""

import numpy as np
import open3d as o3d
import pytest

from fixtures.pictures import FRONT, SMALL, covered
from fixtures.shapes import mapped
from o3dmark.errors import MeshError, SpecError
from o3dmark.mesh.surface import PointCloud, TriangleMesh, mesh_arrays, point_cloud, triangle_mesh
from o3dmark.view import (
    render,
)


@pytest.fixture(scope="module")
def sphere() -> TriangleMesh:
    return o3d.geometry.TriangleMesh.create_sphere(1.0, 16)


def test_a_picture_has_the_size_asked_for_and_an_object_on_white(spot, capfd):
    picture = render(spot, size=(120, 80))
    assert picture.shape == (80, 120, 3)
    assert picture.dtype == np.uint8
    assert (picture[[0, 0, -1, -1], [0, -1, 0, -1]] == 255).all()
    assert covered(picture)[40, 60]
    assert np.ptp(np.flatnonzero(covered(picture).any(axis=1))) > 0.85 * 80
    assert capfd.readouterr() == ("", "")


def test_the_same_call_gives_the_same_picture_and_changes_nothing(spot):
    before = [array.copy() for array in mesh_arrays(spot)]
    scalars = np.arange(len(spot.vertices), dtype=float)
    np.testing.assert_array_equal(render(spot, scalars, size=SMALL), render(spot, scalars, size=SMALL))
    for array, now in zip(before, mesh_arrays(spot), strict=True):
        np.testing.assert_array_equal(array, now)
    assert not spot.has_vertex_colors()
    np.testing.assert_array_equal(scalars, np.arange(len(scalars)))


@pytest.mark.parametrize(("scale", "offset"), [(1e-60, 0), (1e60, 0), (1e-3, 0), (1.0, 1e6)])
def test_size_and_place_do_not_show(spot, scale, offset):
    picture = render(mapped(spot, lambda v: v * scale + offset), size=SMALL).astype(int)
    assert np.abs(picture - render(spot, size=SMALL)).mean() < 0.05


def test_another_frame_draws_alike(sphere):
    apart = mapped(sphere, lambda v: 0.5 * v)
    alone, framed = covered(render(apart, size=SMALL)), covered(render(apart, size=SMALL, frame=sphere))
    assert framed.sum() < alone.sum() / 3
    assert not covered(render(mapped(sphere, lambda v: v + 100.0), size=SMALL, frame=sphere)).any()


def test_edges_are_antialiased(sphere):
    row = render(sphere, camera=FRONT, size=SMALL)[20, :, 0].astype(int)
    outside = np.flatnonzero(row == 255)
    first = outside[np.flatnonzero(np.diff(outside) > 1)[0]] + 1
    assert row[first + 2] + 10 < row[first] < 255


def test_light_comes_from_the_upper_left(sphere):
    picture = render(sphere, camera=FRONT, size=SMALL).astype(int).sum(axis=2)
    assert picture[20, 34] > picture[36, 48] > picture[52, 62]


def test_colours_follow_scalars(sphere):
    picture = render(sphere, np.asarray(sphere.vertices)[:, 0], camera=FRONT, size=SMALL).astype(int)
    left, right = picture[36, 28], picture[36, 68]
    assert left[2] > left[0]  # viridis: from violet
    assert right[0] > right[2]  # to yellow
    assert right.sum() > left.sum()


def test_a_mirror_shows_level_stripes_and_kinks_them_where_normals_turn(sphere):
    stripes = render(sphere, look="zebra", camera=FRONT, size=(120, 120))[:, :, 0].astype(float)
    column = stripes[20:100, 60]
    assert column.min() < 90
    assert column.max() > 230
    assert np.count_nonzero(np.diff(column > 160)) > 8
    assert np.abs(stripes[:, 59] - stripes[:, 60]).mean() < 5  # level about the middle
    vertices, triangles = mesh_arrays(sphere)
    bumpy = triangle_mesh(vertices * (1.0 + 0.004 * np.sin(25.0 * vertices[:, :1])), triangles)
    clay, mirror = (
        np.abs(
            render(sphere, look=look, size=(160, 120)) - render(bumpy, look=look, size=(160, 120)).astype(float)
        ).mean()
        for look in ("clay", "zebra")
    )
    assert mirror > 5 * clay


@pytest.mark.parametrize("look", ["gloss", "zebra", "texture"])
def test_only_clay_has_scalars(sphere, look):
    with pytest.raises(ValueError, match="no scalars"):
        render(sphere, np.zeros(len(sphere.vertices)), look=look)


def test_varnish_gleams(sphere):
    clay, gloss = (
        render(sphere, look=look, camera=FRONT, size=SMALL).astype(int).sum(axis=2) for look in ("clay", "gloss")
    )
    shown = clay < 3 * 255
    assert (gloss - clay).max() > 100  # in one place
    assert np.abs(np.median((gloss - clay)[shown])) < 15


def dressed(picture, *, repeated=False):
    """A square towards the eye that wears a picture, its triangles in an order that leaves a repeated one out."""
    square = triangle_mesh(
        np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float), np.array([[0, 1, 2], [0, 2, 3]])
    )
    uvs = np.array([[0, 1], [1, 1], [1, 0], [0, 1], [1, 0], [0, 0]], float)
    if repeated:
        square.triangles = o3d.utility.Vector3iVector(np.array([[0, 1, 2], [1, 2, 0], [0, 2, 3]]))
        uvs = np.insert(uvs, 3, np.zeros((3, 2)), axis=0)
    square.triangle_uvs = o3d.utility.Vector2dVector(uvs)
    square.textures = [o3d.geometry.Image(picture)]
    square.triangle_material_ids = o3d.utility.IntVector(np.zeros(len(square.triangles), np.int32))
    return square


def test_a_texture_is_where_its_coordinates_say():
    picture = np.zeros((8, 8, 3), np.uint8)
    picture[:4, :4], picture[:4, 4:], picture[4:, :4] = [255, 0, 0], [0, 255, 0], [0, 0, 255]
    plain, repeated = (
        render(dressed(picture, repeated=each), look="texture", camera=FRONT, size=SMALL).astype(int)
        for each in (False, True)
    )
    quarters = [plain[28, 40], plain[28, 56], plain[44, 40]]  # v = 0 is up here
    assert [int(each.argmax()) for each in quarters] == [0, 1, 2]
    assert all(each.max() - np.median(each) > 100 for each in quarters)
    assert np.array_equal(plain, repeated)


def test_a_texture_that_is_not_there_is_missed(sphere):
    with pytest.raises(MeshError, match="no texture"):
        render(sphere, look="texture", size=SMALL)
    with pytest.raises(MeshError, match="point cloud has no texture"):
        render(point_cloud(np.eye(3)), look="texture", size=SMALL)
    bare = dressed(np.zeros((2, 2, 3), np.uint8))
    bare.triangle_material_ids = o3d.utility.IntVector([0, 3])
    with pytest.raises(MeshError, match="wears 4 pictures and has 1"):
        render(bare, look="texture", size=SMALL)


def test_limits_and_colormap_are_those_asked_for(sphere):
    ones = np.ones(len(sphere.vertices))
    low, high = (render(sphere, ones, limits=limits, size=SMALL)[36, 48].astype(int) for limits in ((1, 2), (0, 1)))
    assert low[2] > low[1]
    assert high[1] > high[2]
    greys = render(sphere, ones, colormap="gray", size=SMALL)[36, 48].astype(int)
    assert np.ptp(greys) < 12


def test_welded_seams_keep_their_scalars():
    vertices, triangles = mesh_arrays(o3d.geometry.TriangleMesh.create_sphere(1.0, 12))
    soup = triangle_mesh(vertices[triangles].reshape(-1, 3), np.arange(triangles.size).reshape(-1, 3))
    one = render(triangle_mesh(vertices, triangles), vertices[:, 0], size=SMALL, limits=(-1, 1)).astype(int)
    two = render(soup, vertices[triangles].reshape(-1, 3)[:, 0], size=SMALL, limits=(-1, 1))
    assert np.abs(one - two).max() <= 3


@pytest.mark.parametrize("normals", [False, True])
def test_point_clouds_are_drawn_as_discs(sphere, normals):
    vertices = mesh_arrays(sphere)[0]
    cloud = point_cloud(vertices, vertices if normals else None)
    picture, solid = render(cloud, vertices[:, 1], camera=FRONT, size=SMALL), render(sphere, camera=FRONT, size=SMALL)
    assert covered(picture).sum() > 0.3 * covered(solid).sum()
    assert np.asarray(cloud.points).shape == vertices.shape


def test_a_triangle_a_plane_and_a_point_are_drawn():
    triangle = triangle_mesh(np.eye(3), np.array([[0, 1, 2]]))
    plane = triangle_mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]), np.array([[0, 1, 2], [1, 3, 2]]))
    for thing in (triangle, plane, point_cloud(np.ones((1, 3)))):
        assert covered(render(thing, size=SMALL)).any()


def test_both_sides_of_an_open_mesh_are_lit():
    quad = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    front, back = (
        render(triangle_mesh(quad, np.array(triangles)), camera=FRONT, size=SMALL)[36, 48]
        for triangles in ([[0, 1, 2], [1, 3, 2]], [[0, 2, 1], [1, 2, 3]])
    )
    np.testing.assert_array_equal(front, back)


def test_what_cannot_be_drawn_is_refused(sphere):
    n = len(sphere.vertices)
    nan = np.where(np.arange(n) == 3, np.nan, 1.0)
    with pytest.raises(MeshError, match="no triangle"):
        render(TriangleMesh())
    with pytest.raises(MeshError, match="no point"):
        render(PointCloud())
    with pytest.raises(MeshError, match="not finite"):
        render(point_cloud(np.full((2, 3), np.inf)))
    with pytest.raises(MeshError, match="1 scalars are not finite; the first is at vertex 3"):
        render(sphere, nan)
    with pytest.raises(MeshError, match="one number to each"):
        render(sphere, np.ones(n + 1))
    with pytest.raises(SpecError, match="no colormap 'rainbowish'"):
        render(sphere, np.ones(n), colormap="rainbowish", size=SMALL)
    with pytest.raises(ValueError, match="finite and rise"):
        render(sphere, np.ones(n), limits=(1, 1), size=SMALL)
    with pytest.raises(ValueError, match="no pixel"):
        render(sphere, size=(0, 10))
