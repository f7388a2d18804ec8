"""Where on a surface patches were found, seen from the side that shows most of them."""

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
import open3d as o3d

from o3dmark.arrays import Floats
from o3dmark.mesh.patch import Patch
from o3dmark.mesh.rays import scene_of
from o3dmark.mesh.similarity import UnitSize
from o3dmark.mesh.surface import Surface
from o3dmark.view.camera import THREE_QUARTER, Camera
from o3dmark.view.sheet import Panel

AZIMUTHS = THREE_QUARTER.azimuth + np.arange(0.0, 360.0, 15.0)  # where cameras are tried, in degrees
ELEVATIONS = THREE_QUARTER.elevation, -18.0, 50.0, -50.0, 80.0, -80.0
LOOK = 64, 48  # pixels of a look at a side
MIDDLE = 0.5  # of the radius: a patch is on this side where something of its middle is seen


def patches_panel(title: str, mesh: Any, patches: Sequence[Patch], note: str = "") -> Panel:
    """A mesh, its ``patches`` coloured, from the side that shows most of them; the caption counts them, and has a note.

    Errors: MeshError when there is nothing to draw, and for point clouds.
    """
    camera, seen = facing(mesh, patches)
    count = "no patch found" if not patches else f"{len(patches)} patch" + "es" * (len(patches) > 1) + " found"
    if seen < len(patches):
        count += f", {seen} on this side"
    return Panel(title, mesh, "; ".join(filter(None, (count, note))), camera=camera, patches=tuple(patches))


def facing(mesh: Any, patches: Sequence[Patch]) -> tuple[Camera, int]:
    """The camera that sees most of the patches, and of how many it sees the middle.

    Each counts by what is seen of it, beside what is seen of it at best; nobody likes to look at things from above.
    """
    surface = Surface.of(mesh)
    if not patches:
        return THREE_QUARTER, 0
    cameras = [Camera(float(azimuth), elevation) for elevation, azimuth in product(ELEVATIONS, AZIMUTHS)]
    pixels = _pixels(surface, patches, cameras)
    shown = pixels / np.maximum(pixels.max(axis=0), 1)
    upright = np.cos(np.radians([camera.elevation / 2 for camera in cameras]))
    best = int((upright * shown.sum(axis=1)).argmax())
    middles = [patch._replace(radius=MIDDLE * patch.radius) for patch in patches]
    return cameras[best], int(np.count_nonzero(_pixels(surface, middles, cameras[best : best + 1])))


def _pixels(surface: Surface, patches: Sequence[Patch], cameras: Sequence[Camera]) -> Floats:
    """How many pixels of each patch (p,) each camera (c,) sees from without: (c, p)."""
    unit = UnitSize.about_box(surface.vertices)
    points, place = unit.apply(surface.vertices), np.eye(4)
    place[:3] = np.column_stack([np.eye(3), -unit.centre]) / unit.size
    there = [patch.placed(place) for patch in patches]
    scene, found = scene_of(points, surface.triangles), np.zeros((len(cameras), len(patches)))
    for number, camera in enumerate(cameras):
        rays = camera.rays(points @ camera.axes.T, *LOOK).reshape(-1, 2, 3) @ camera.axes.astype(np.float32)
        distance = scene.cast_rays(o3d.core.Tensor(rays.reshape(-1, 6)))["t_hit"].numpy()
        hit = np.isfinite(distance)
        way = rays[hit, 1].astype(np.float64)
        seen = rays[hit, 0] + distance[hit, None] * way
        found[number] = [np.count_nonzero(patch.holds(seen) & (way @ patch.axis < 0.0)) for patch in there]
    return found
