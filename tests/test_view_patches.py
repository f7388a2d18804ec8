"""Patches in pictures: coloured where they are, and seen from the side that shows most of them."""

import numpy as np
import pytest

from fixtures.pictures import FRONT, SMALL, covered
from fixtures.shapes import mapped, rotation
from o3dmark.errors import MeshError
from o3dmark.mesh import similarity
from o3dmark.mesh.patch import Patch
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays, point_cloud, triangle_mesh
from o3dmark.view import Camera, patches_panel, render, sheet
from o3dmark.view.patches import facing

FAR = np.eye(4)
FAR[:3, :3], FAR[:3, 3] = 1e-3 * rotation(4), [50.0, -20.0, 7.0]


def on_ball(*way: float, radius: float = 0.3) -> Patch:
    """A patch of the unit ball, out in that direction."""
    axis = np.array(way) / np.linalg.norm(way)
    return Patch(axis, axis, radius, 0.8 * radius)


def red(picture: np.ndarray) -> np.ndarray:
    """True where a patch is drawn: clay is grey."""
    return picture[:, :, 0].astype(int) - picture[:, :, 2] > 60


def place(points: np.ndarray) -> np.ndarray:
    return similarity.apply(FAR, points)


def test_the_surface_of_a_patch_is_coloured_and_no_other(ball: TriangleMesh) -> None:
    """As many pixels as its rim holds beside the ball's outline, about the place where it is."""
    picture = render(ball, camera=FRONT, size=(240, 180), patches=[on_ball(0.0, 0.0, 1.0)])
    inside, eye = red(picture), FRONT.rays(mesh_arrays(ball)[0], 240, 180)[0, 0, 2]
    disk, outline = 0.3 / (eye - np.sqrt(1.0 - 0.3**2)), 1.0 / np.sqrt(eye**2 - 1.0)  # tangents of angles
    assert inside.sum() == pytest.approx((disk / outline) ** 2 * covered(picture).sum(), rel=0.05)
    assert np.argwhere(inside).mean(axis=0) == pytest.approx([89.5, 119.5], abs=1.0)
    aside = red(render(ball, camera=FRONT, size=(240, 180), patches=[on_ball(1.0, 0.5, 1.0)]))
    row, column = np.argwhere(aside).mean(axis=0)
    assert (row < 70, column > 150) == (True, True)
    behind = render(ball, camera=FRONT, size=(240, 180), patches=[on_ball(0.0, 0.0, -1.0)])
    assert not red(behind).any()


def test_patches_are_drawn_where_the_mesh_is(ball: TriangleMesh) -> None:
    """Also one that is small and far away."""
    patch = on_ball(0.2, -0.1, 1.0)
    there = mapped(ball, lambda v: 1e-3 * v + FAR[:3, 3])
    shift = np.diag([1e-3, 1e-3, 1e-3, 1.0])
    shift[:3, 3] = FAR[:3, 3]
    near, far = (
        red(render(mesh, camera=FRONT, size=SMALL, patches=[each]))
        for mesh, each in ((ball, patch), (there, patch.placed(shift)))
    )
    assert near.any()
    assert np.count_nonzero(near != far) <= 3


@pytest.mark.parametrize("way", [(0.0, 0.0, 1.0), (1.0, 0.2, -0.3), (-0.5, -0.8, 0.1), (0.1, 1.0, 0.0)])
def test_the_camera_looks_at_the_patch(ball: TriangleMesh, way: tuple[float, float, float]) -> None:
    camera, seen = facing(ball, [on_ball(*way)])
    assert seen == 1
    assert camera.axes[2] @ np.array(way) / np.linalg.norm(way) > 0.7


def test_of_two_sides_the_one_with_more_patches_is_shown_and_the_caption_counts(ball: TriangleMesh) -> None:
    patches = [on_ball(0.3, 0.3, 1.0), on_ball(-0.3, 0.3, 1.0), on_ball(0.0, 0.2, -1.0)]
    panel = patches_panel("ball", ball, patches, "a note")
    assert panel.camera is not None
    assert panel.camera.axes[2, 2] > 0.7
    assert panel.caption == "3 patches found, 2 on this side; a note"
    assert patches_panel("ball", ball, patches[:1]).caption == "1 patch found"
    nothing = patches_panel("ball", ball, [])
    assert (nothing.caption, nothing.camera, nothing.patches) == ("no patch found", Camera(), ())
    other = patches_panel("ball", mapped(ball, place), [patch.placed(FAR) for patch in patches])
    assert other.caption == "3 patches found, 2 on this side"
    assert other.camera is not None
    assert other.camera.axes[2] @ rotation(4)[:, 2] > 0.7


def test_what_is_hidden_does_not_count(ball: TriangleMesh) -> None:
    """A patch within a larger ball is on no side; one on that is seen, from wherever."""
    shell = mapped(ball, lambda v: 2.0 * v)
    both = shell + ball
    within, outside = on_ball(0.0, 0.0, 1.0), on_ball(0.0, 0.0, -2.0, radius=0.5)
    outside = outside._replace(centre=2.0 * outside.centre)
    camera, seen = facing(both, [within, outside])
    assert seen == 1
    assert camera.axes[2, 2] < -0.7


def test_a_patch_seen_from_within_does_not_count(ball: TriangleMesh) -> None:
    """Of half a ball, open to the front, whose inside shows all that lies behind."""
    vertices, triangles = mesh_arrays(ball)
    bowl = triangle_mesh(vertices, triangles[vertices[triangles, 2].mean(axis=1) < 0.0])
    camera, seen = facing(bowl, [on_ball(0.0, 0.1, -1.0), on_ball(0.6, 0.2, -1.0), on_ball(-0.6, 0.2, -1.0)])
    assert seen == 3
    assert camera.axes[2, 2] < -0.7


def test_a_sheet_takes_the_camera_of_each_panel(ball: TriangleMesh) -> None:
    panels = [patches_panel("one", ball, [on_ball(*way)]) for way in ((0.0, 0.2, 1.0), (0.0, 0.2, -1.0))]
    picture = sheet(panels, columns=2, width=480)
    for half in np.split(picture, 2, axis=1):
        assert red(half).sum() > 0.05 * covered(half).sum()


def test_patches_are_for_clay_and_for_surfaces(ball: TriangleMesh) -> None:
    patch = on_ball(0.0, 0.0, 1.0)
    for options in ({"look": "zebra"}, {"scalars": np.zeros(len(ball.vertices))}):
        with pytest.raises(ValueError, match="clay"):
            render(ball, size=SMALL, patches=[patch], **options)  # type: ignore[arg-type]
    with pytest.raises(MeshError):
        patches_panel("cloud", point_cloud(mesh_arrays(ball)[0]), [patch])
