"""Where on a surface patches were found, seen from the side that shows most of them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from o3dmark.arrays import Floats
from o3dmark.mesh.patch import Patch
from o3dmark.mesh.similarity import UnitSize
from o3dmark.mesh.surface import Surface
from o3dmark.view.camera import THREE_QUARTER, Camera
from o3dmark.view.sheet import Panel
from o3dmark.view.side import cameras, looks, uprightness

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

    Each counts by what is seen of it, beside what is seen of it at best.
    """
    surface = Surface.of(mesh)
    if not patches:
        return THREE_QUARTER, 0
    tried = cameras()
    pixels = _pixels(surface, patches, tried)
    shown = pixels / np.maximum(pixels.max(axis=0), 1)
    best = int((uprightness(tried) * shown.sum(axis=1)).argmax())
    middles = [patch._replace(radius=MIDDLE * patch.radius) for patch in patches]
    return tried[best], int(np.count_nonzero(_pixels(surface, middles, tried[best : best + 1])))


def _pixels(surface: Surface, patches: Sequence[Patch], tried: Sequence[Camera]) -> Floats:
    """How many pixels of each patch (p,) each camera (c,) sees from without: (c, p)."""
    unit, place = UnitSize.about_box(surface.vertices), np.eye(4)
    place[:3] = np.column_stack([np.eye(3), -unit.centre]) / unit.size
    there = [patch.placed(place) for patch in patches]
    found = np.zeros((len(tried), len(patches)))
    for number, seen in enumerate(looks(unit, surface, tried)):
        found[number] = [np.count_nonzero(p.holds(seen.points) & (seen.ways @ p.axis < 0.0)) for p in there]
    return found
