"""Pictures: what must hold for any mesh (frame, shading, colours), then sheets, files and the window."""

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import open3d as o3d
import pytest

import o3dmark.view.comparison
import o3dmark.view.window
from fixtures.shapes import mapped
from o3dmark.errors import BackendError, MeshError, SpecError
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import PointCloud, TriangleMesh, mesh_arrays, point_cloud, triangle_mesh
from o3dmark.view import (
    Camera,
    Panel,
    coloured,
    comparison_sheet,
    distance_sheet,
    jpeg,
    render,
    render_scalars,
    save_png,
    sheet,
    show,
)
from o3dmark.view.camera import MARGIN
from o3dmark.view.colours import beyond, colour_limits, colours
from o3dmark.view.model import CREASE, Model, corner_normals, shape_of
from o3dmark.view.shading import Hits, open_sky, scene_of

SMALL = (96, 72)
FRONT = Camera(azimuth=0, elevation=0)


@pytest.fixture(scope="module")
def sphere() -> TriangleMesh:
    return o3d.geometry.TriangleMesh.create_sphere(1.0, 16)


def covered(picture: np.ndarray) -> np.ndarray:
    """True where the picture is not background."""
    return (picture < 255).any(axis=2)


# the camera


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


# pictures


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


# shading


def slow_corner_normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    area = geometry.area_vectors(vertices, triangles)
    flat = geometry.unit(area)
    normals = np.empty((len(triangles), 3, 3))
    for (t, triangle), corner in itertools.product(enumerate(triangles), range(3)):
        around = np.flatnonzero((triangles == triangle[corner]).any(axis=1))
        mean = area[around].sum(axis=0)
        mean /= np.linalg.norm(mean)
        if (flat[around] @ mean < CREASE).any():
            mean = area[around[flat[around] @ flat[t] >= CREASE]].sum(axis=0)
        normals[t, corner] = mean / np.linalg.norm(mean)
    return normals


def test_corner_normals_are_means_within_the_crease_angle():
    rough = o3d.geometry.TriangleMesh.create_cylinder(1.0, 2.0, 12, 3)
    vertices, triangles = mesh_arrays(rough)
    vertices += 0.05 * np.random.default_rng(2).normal(size=vertices.shape)
    np.testing.assert_allclose(corner_normals(vertices, triangles), slow_corner_normals(vertices, triangles), atol=1e-6)


def test_a_box_has_flat_sides_and_a_sphere_none(sphere):
    vertices, triangles = mesh_arrays(o3d.geometry.TriangleMesh.create_box(1, 2, 3))
    flat = geometry.unit(geometry.area_vectors(vertices, triangles))
    np.testing.assert_allclose(corner_normals(vertices, triangles), np.repeat(flat[:, None], 3, axis=1), atol=1e-6)
    vertices, triangles = mesh_arrays(sphere)
    np.testing.assert_allclose(corner_normals(vertices, triangles), vertices[triangles], atol=0.05)


def test_a_convex_shape_sees_all_the_sky_and_the_bottom_of_a_well_little(sphere):
    def sky(mesh: TriangleMesh, camera: Camera) -> tuple[Hits, np.ndarray]:
        shape = shape_of(mesh)
        size = geometry.diagonal(shape.vertices)
        model = Model.of(shape, None, shape.vertices.mean(axis=0), camera.axes.T / size)
        scene = scene_of(model)
        hits = Hits.of(model, scene, camera.rays(model.points.astype(float), 120, 90))
        return hits, open_sky(scene, hits)

    assert sky(sphere, FRONT)[1].mean() > 0.999
    box, triangles = mesh_arrays(o3d.geometry.TriangleMesh.create_box(1, 1, 2))
    lid = (box[triangles][:, :, 2] == 2).all(axis=1)
    hits, open_part = sky(triangle_mesh(box, triangles[~lid]), FRONT)  # looking into it
    bottom = hits.points[:, 2] < np.quantile(hits.points[:, 2], 0.05)
    assert open_part[bottom].mean() < 0.6


# colours


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


# sheets


def panels_of(monkeypatch: pytest.MonkeyPatch) -> list[Panel]:
    """The list that the panels of the next sheet will be put in, instead of being drawn."""
    panels: list[Panel] = []
    monkeypatch.setattr(o3dmark.view.comparison, "sheet", lambda drawn, **_: panels.extend(drawn))
    return panels


def shifted(mesh: TriangleMesh, length: float) -> TriangleMesh:
    """The mesh with every other vertex moved by ``length`` along x."""
    vertices, triangles = mesh_arrays(mesh)
    vertices[::2, 0] += length
    return triangle_mesh(vertices, triangles)


def test_the_comparison_sheet_shows_five_different_pictures(spot):
    marked = shifted(spot, 0.002)
    attacked = TriangleMesh(marked).scale(3.0, np.zeros(3)).rotate(o3d.geometry.get_rotation_matrix_from_xyz([1, 2, 3]))
    saliency = np.asarray(spot.vertices)[:, 1]
    picture = comparison_sheet(
        spot, marked, attacked, saliency=saliency, title="spot", notes=["method", "消息"], width=480
    )
    assert picture.shape[1:] == (480, 3)
    assert picture.dtype == np.uint8
    rows, columns = (picture.shape[0] - 20) // 2, 480 // 3
    cells = [picture[20 + rows * r :][:rows, columns * c :][:, :columns] for r in (0, 1) for c in (0, 1, 2)]
    for cell in cells[:5]:
        assert 0.1 < covered(cell).mean() < 0.9
    assert 0 < covered(cells[5]).mean() < 0.1  # the notes
    for one, other in itertools.combinations(cells[:5], 2):
        assert (one != other).any(axis=2).mean() > 0.01


def test_the_displacement_panel_says_what_it_draws(spot, monkeypatch):
    panels = panels_of(monkeypatch)
    diagonal = geometry.diagonal(mesh_arrays(spot)[0])
    comparison_sheet(spot, shifted(spot, 1e-4 * diagonal), spot)
    assert [panel.title for panel in panels] == ["Original", "Marked", "Displacement", "Attacked"]
    _, marked, displacement, attacked = panels
    assert "0.1 · 10⁻³" in marked.caption
    assert displacement.caption == "drawn 100 times as large as it is"
    np.testing.assert_allclose(displacement.scalars[:2], [0.1, 0.0], rtol=1e-9)
    np.testing.assert_allclose(mesh_arrays(displacement.mesh)[0], mesh_arrays(shifted(spot, 1e-2 * diagonal))[0])
    assert displacement.limits[0] == 0
    assert marked.frame is displacement.frame
    assert attacked.frame is None


@pytest.mark.parametrize(
    ("length", "asked", "factor"), [(0, None, 1), (1e-15, None, 1), (0.4, None, 1), (1e-3, 7.5, 7.5)]
)
def test_the_exaggeration_is_the_one_asked_for_or_sensible(spot, monkeypatch, length, asked, factor):
    panels = panels_of(monkeypatch)
    comparison_sheet(spot, shifted(spot, length), spot, exaggeration=asked)
    expected = mesh_arrays(shifted(spot, factor * length))[0]
    np.testing.assert_allclose(mesh_arrays(panels[2].mesh)[0], expected, atol=1e-12)


def test_an_unmarked_mesh_and_constant_saliency_make_a_sheet(sphere):
    picture = comparison_sheet(sphere, sphere, sphere, saliency=np.zeros(len(sphere.vertices)), width=360)
    assert covered(picture).any()


def test_a_displacement_needs_as_many_vertices(spot, sphere):
    with pytest.raises(MeshError, match="distance_sheet"):
        comparison_sheet(spot, sphere, sphere)


def test_the_distance_sheet_measures_by_the_marked_meshs_diagonal(spot, sphere, monkeypatch):
    panels = panels_of(monkeypatch)
    distance_sheet(sphere, spot, np.full(len(spot.vertices), 0.5))
    expected = 500 / geometry.diagonal(mesh_arrays(sphere)[0])
    np.testing.assert_allclose(panels[2].scalars, expected)
    with pytest.raises(MeshError, match="one number to each"):
        distance_sheet(sphere, spot, np.zeros(3))


def test_a_colour_bar_shows_the_colormap(sphere):
    picture = render_scalars(sphere, np.arange(len(sphere.vertices)), "rank, a $ number_of", title="Rank", width=300)
    bar = picture[int(0.84 * len(picture)) : int(0.87 * len(picture)), 60:-60].astype(int)
    coloured_rows = bar[np.ptp(bar, axis=2).min(axis=1) > 20]
    assert len(coloured_rows)
    assert coloured_rows[0, 5, 2] > coloured_rows[0, 5, 0]
    assert coloured_rows[0, -5, 0] > coloured_rows[0, -5, 2]


@pytest.mark.parametrize("width", [101, 333, 480])
def test_a_sheet_is_as_wide_as_asked(sphere, width):
    assert sheet([Panel("a", sphere), Panel("b", sphere)], columns=2, width=width).shape[1] == width


# files and the window


def test_a_png_is_complete_or_not_there(tmp_path: Path, monkeypatch):
    image = np.random.default_rng(3).integers(0, 256, (5, 7, 3), np.uint8)
    path = tmp_path / "picture.png"
    save_png(path, image)
    np.testing.assert_array_equal(np.asarray(o3d.io.read_image(str(path))), image)

    def fails(name: str, image: Any) -> bool:
        Path(name).write_bytes(b"half")
        return False

    monkeypatch.setattr(o3d.io, "write_image", fails)
    with pytest.raises(BackendError, match=r"picture\.png"):
        save_png(path, 0 * image)
    monkeypatch.undo()
    np.testing.assert_array_equal(np.asarray(o3d.io.read_image(str(path))), image)
    assert list(tmp_path.iterdir()) == [path]


def test_a_png_needs_its_ending_a_folder_and_colours(tmp_path: Path, capfd):
    with pytest.raises(BackendError, match=r"picture\.xyz"):
        save_png(tmp_path / "picture.xyz", np.zeros((2, 2, 3), np.uint8))
    with pytest.raises(MeshError, match="no folder"):
        save_png(tmp_path / "nowhere" / "picture.png", np.zeros((2, 2, 3), np.uint8))
    with pytest.raises(ValueError, match="uint8"):
        save_png(tmp_path / "picture.png", np.zeros((2, 2, 3)))
    assert capfd.readouterr().out == ""


def test_a_jpeg_is_the_picture_but_for_what_eyes_do_not_see(tmp_path: Path, spot: TriangleMesh) -> None:
    image = render(spot, size=(60, 50))
    (tmp_path / "picture.jpg").write_bytes(jpeg(image))
    back = np.asarray(o3d.io.read_image(str(tmp_path / "picture.jpg")))
    assert back.shape == image.shape
    assert np.abs(back.astype(float) - image).mean() < 4
    assert len(jpeg(image, 30)) < len(jpeg(image))


@pytest.mark.parametrize("display", [None, "", ":4095"])
def test_without_a_display_no_window_opens(spot, monkeypatch, display):
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.delenv("DISPLAY", raising=False)
    if display is not None:
        monkeypatch.setenv("DISPLAY", display)
    monkeypatch.setattr(o3d.visualization, "draw_geometries", lambda *_, **__: pytest.fail("a window was opened"))
    with pytest.raises(BackendError, match="--png"):
        show([spot])


def test_the_window_shows_copies_side_by_side(spot, sphere, monkeypatch):
    shown: list[Any] = []
    monkeypatch.setattr(o3dmark.view.window, "has_display", lambda: True)
    monkeypatch.setattr(o3d.visualization, "draw_geometries", lambda things, *_, **__: shown.extend(things))
    cloud = PointCloud(sphere.vertices)
    show([spot, sphere, cloud], [None, np.asarray(sphere.vertices)[:, 0], np.asarray(sphere.vertices)[:, 0]])
    assert [type(thing) for thing in shown] == [TriangleMesh, TriangleMesh, PointCloud]
    for left, right in itertools.pairwise(shown):
        assert left.get_max_bound()[0] < right.get_min_bound()[0]
    assert shown[0].has_vertex_normals()
    assert len(np.unique(np.asarray(shown[0].vertex_colors), axis=0)) == 1
    assert len(np.unique(np.asarray(shown[1].vertex_colors), axis=0)) > 10
    assert not spot.has_vertex_colors()
    with pytest.raises(ValueError, match="1 meshes"):
        show([spot], [None, None])
    with pytest.raises(MeshError, match="no triangle"):
        show([TriangleMesh()])
