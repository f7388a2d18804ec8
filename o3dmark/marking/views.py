"""The meshes that a received file shows: its largest part, all of it, each other part, each connected piece.

What was marked as one mesh may come back as one of a scene, cut into parts by its materials, or several times on a
print plate. The first view of an honest file reads it; a mark is charged for all views, looked at or not.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from o3dmark.arrays import Floats, Ints
from o3dmark.files import Asset
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import is_cloud, mesh_arrays, triangle_mesh

_MOST = 16  # views: each may take as long as a reading that finds nothing
_FEWEST_VERTICES = 100  # fewer hold no message of any profile


@dataclass(frozen=True, eq=False)
class View:
    """A mesh or cloud to look for a mark in; ``part`` says what of the file it is."""

    part: str
    shape: Any


def views(received: Any) -> list[View]:
    """What to look at in an `Asset`, or in an Open3D mesh or point cloud; at least one view, the likeliest first."""
    if is_cloud(received):
        return [View("all of it", received)]
    if not isinstance(received, Asset):
        return [View("all of it", received), *_pieces(*mesh_arrays(received))][:_MOST]
    whole = View("all of it", received.mesh())
    if len(received.parts) <= 1:
        parts = [
            View(part.name or "all of it", triangle_mesh(part.vertices, part.triangles)) for part in received.parts
        ]
        moved = [whole] if not parts else []
    else:
        by_size = sorted(received.parts, key=lambda part: -len(part.triangles))
        parts = [View(part.name, triangle_mesh(part.vertices, part.triangles)) for part in by_size]
        parts, moved = [parts[0], whole, *(part for part in parts[1:] if _is_large(part))], []
    return [*parts, *moved, *_pieces(*mesh_arrays(whole.shape))][:_MOST]


def _is_large(view: View) -> bool:
    return len(view.shape.vertices) >= _FEWEST_VERTICES


def _pieces(vertices: Floats, triangles: Ints) -> list[View]:
    """The connected pieces of a mesh, largest first by area, if there is more than one: by equal positions."""
    if not len(triangles):
        return []
    corners = geometry.weld(vertices)[1][triangles]
    n = int(corners.max()) + 1
    links = sp.coo_array(
        (np.ones(2 * len(corners), bool), (corners[:, [0, 0]].ravel(), corners[:, 1:].ravel())), shape=(n, n)
    )
    piece = connected_components(links, directed=False)[1][corners[:, 0]]
    areas = np.bincount(piece, geometry.areas(vertices, triangles))
    sizes = np.bincount(piece)
    order = [number for number in np.argsort(-areas) if sizes[number] >= _FEWEST_VERTICES]
    if np.count_nonzero(sizes) < 2:
        return []
    return [_piece(rank, vertices, triangles[piece == number]) for rank, number in enumerate(order[:_MOST], start=1)]


def _piece(rank: int, vertices: Floats, triangles: Ints) -> View:
    used, rows = np.unique(triangles, return_inverse=True)
    return View(f"piece {rank}, by area", triangle_mesh(vertices[used], rows.reshape(-1, 3)))
