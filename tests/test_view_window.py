"""Pictures as files, and the window."""

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import open3d as o3d
import pytest

import o3dmark.view.comparison
import o3dmark.view.window
from o3dmark.errors import BackendError, MeshError
from o3dmark.mesh.surface import PointCloud, TriangleMesh
from o3dmark.view import (
    jpeg,
    render,
    save_png,
    show,
)


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


def test_the_window_shows_copies_side_by_side(spot, ball, monkeypatch):
    shown: list[Any] = []
    monkeypatch.setattr(o3dmark.view.window, "has_display", lambda: True)
    monkeypatch.setattr(o3d.visualization, "draw_geometries", lambda things, *_, **__: shown.extend(things))
    cloud = PointCloud(ball.vertices)
    show([spot, ball, cloud], [None, np.asarray(ball.vertices)[:, 0], np.asarray(ball.vertices)[:, 0]])
    assert [type(thing) for thing in shown] == [TriangleMesh, TriangleMesh, PointCloud]
    for left, right in itertools.pairwise(shown):
        assert left.get_max_bound()[0] < right.get_min_bound()[0]
    assert shown[0].has_vertex_normals()
    assert len(np.unique(np.asarray(shown[0].vertex_colors), axis=0)) == 1
    assert len(np.unique(np.asarray(shown[1].vertex_colors), axis=0)) > 10
    assert not spot.has_vertex_colors()
    shown.clear()
    tinted, dressed = TriangleMesh(ball), TriangleMesh(ball)
    tinted.vertex_colors = o3d.utility.Vector3dVector(np.abs(np.asarray(ball.vertices)))
    cloud.colors = tinted.vertex_colors
    dressed.triangle_uvs = o3d.utility.Vector2dVector(np.zeros((3 * len(ball.triangles), 2)))
    dressed.textures = [o3d.geometry.Image(np.zeros((2, 2, 3), np.uint8))]
    show([tinted, cloud, dressed])
    np.testing.assert_array_equal(shown[0].vertex_colors, tinted.vertex_colors)
    np.testing.assert_array_equal(shown[1].colors, tinted.vertex_colors)
    assert shown[2].has_textures()
    with pytest.raises(ValueError, match="1 meshes"):
        show([spot], [None, None])
    with pytest.raises(MeshError, match="no triangle"):
        show([TriangleMesh()])
