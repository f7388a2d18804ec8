"""The meshes that a received file shows: its largest part, each other part, all of it.

What was marked as one mesh may come back as one of a scene, or cut into parts by its materials. What else a mesh may be
taken for, its pieces for one, is a matter of `received`: some methods look at that by themselves, for others the views
are added here.
"""

from dataclasses import dataclass, field
from itertools import islice
from typing import Any

import numpy as np

from o3dmark import received as surfaces
from o3dmark.arrays import Floats
from o3dmark.errors import MeshError
from o3dmark.files import STAYS, Asset, Part
from o3dmark.mesh.patch import Patch
from o3dmark.mesh.surface import MeshArrays, Surface, is_cloud
from o3dmark.methods import Extraction, Method

_MOST = 16  # parts: each may take as long as a reading that finds nothing
_FEWEST_VERTICES = 100  # fewer hold no message of any profile


@dataclass(frozen=True, eq=False)
class View:
    """A mesh or cloud to look for a mark in; ``part`` says what of the file it is.

    placements (k, 4, 4): from its frame to the file's, for each use that the file makes of it.
    """

    part: str
    shape: Any
    placements: Floats = field(default_factory=lambda: STAYS)

    def patches(self, extraction: Extraction) -> tuple[Patch, ...]:
        """The patches that spoke in what was read of it, where `Asset.mesh` has them: at each of its places."""
        places = [place for place in self.placements if np.linalg.det(place[:3, :3])]
        return tuple(patch.placed(place) for place in places for patch in extraction.patches)


def views(received: Any, method: Method) -> list[View]:
    """What a method is to look at in an `Asset`, or in an Open3D mesh or point cloud; at least one view.

    Errors: MeshError for an asset without meshes.
    """
    parts = _parts(received)
    if method.finds_pieces or is_cloud(parts[-1].shape):
        return parts
    return [*parts, *_pieces(parts[-1])]


def _parts(received: Any) -> list[View]:
    if not isinstance(received, Asset):
        return [View("all of it", received)]
    if not received.parts:
        raise MeshError(f"{received.name} holds no mesh of triangles")
    largest, *others = sorted(received.parts, key=lambda part: -len(part.triangles))
    if not others:
        return [_of_part(largest)]
    smaller = [_of_part(part) for part in others if len(part.vertices) >= _FEWEST_VERTICES]
    return [_of_part(largest), *smaller[: _MOST - 2], View("all of it", MeshArrays(*received.placed()))]


def _of_part(part: Part) -> View:
    return View(part.name, MeshArrays(part.vertices, part.triangles), part.placements)


def _pieces(whole: View) -> list[View]:
    """What else a mesh may be taken for, if it is a surface at all."""
    try:
        found = list(islice(surfaces.views(Surface.of(whole.shape)), 1, None))
    except MeshError:
        return []
    return [View(view.name, view.surface, whole.placements) for view in found]
