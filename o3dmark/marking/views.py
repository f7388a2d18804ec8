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
from o3dmark.errors import MeshError
from o3dmark.files import Asset, Part
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import is_cloud, mesh_arrays, triangle_mesh

_MOST = 16  # views: each may take as long as a reading that finds nothing
_FEWEST_VERTICES, _FEWEST_TRIANGLES = 100, 200  # fewer hold no message of any profile


@dataclass(frozen=True, eq=False)
class View:
    """A mesh or cloud to look for a mark in; ``part`` says what of the file it is."""

    part: str
    shape: Any


def views(received: Any) -> list[View]:
    """What to look at in an `Asset`, or in an Open3D mesh or point cloud; at least one view, the likeliest first.

    Errors: MeshError for an asset without meshes.
    """
    if is_cloud(received):
        return [View("all of it", received)]
    if not isinstance(received, Asset):
        return [View("all of it", received), *_pieces(*mesh_arrays(received))][:_MOST]
    if not received.parts:
        raise MeshError(f"{received.name} holds no mesh of triangles")
    largest, *others = sorted(received.parts, key=lambda part: -len(part.triangles))
    if not others:
        return [_of_part(largest), *_pieces(largest.vertices, largest.triangles)][:_MOST]
    whole = View("all of it", received.mesh())
    smaller = [_of_part(part) for part in others if len(part.vertices) >= _FEWEST_VERTICES]
    return [_of_part(largest), whole, *smaller, *_pieces(*mesh_arrays(whole.shape))][:_MOST]


def _of_part(part: Part) -> View:
    return View(part.name, triangle_mesh(part.vertices, part.triangles))


def _pieces(vertices: Floats, triangles: Ints) -> list[View]:
    """The connected pieces of a mesh, largest first by area, if there is more than one: by equal positions."""
    if _components(triangles) == 1:
        return []
    corners = geometry.weld(vertices)[1][triangles]
    piece = _component(corners)[corners[:, 0]]
    areas, sizes = np.bincount(piece, geometry.areas(vertices, triangles)), np.bincount(piece)
    if np.count_nonzero(sizes) < 2:
        return []
    order = [number for number in np.argsort(-areas, kind="stable") if sizes[number] >= _FEWEST_TRIANGLES]
    return [_piece(rank, vertices, triangles[piece == number]) for rank, number in enumerate(order[:_MOST], start=1)]


def _components(triangles: Ints) -> int:
    """How many pieces the triangles make by their vertex numbers: at least as many as by positions."""
    return len(np.unique(_component(triangles)[triangles[:, 0]])) if len(triangles) else 1


def _component(corners: Ints) -> Ints:
    """For each vertex the number of the piece that it belongs to."""
    n = int(corners.max()) + 1
    links = (np.ones(2 * len(corners), bool), (corners[:, [0, 0]].ravel(), corners[:, 1:].ravel()))
    return connected_components(sp.coo_array(links, shape=(n, n)), directed=False)[1]


def _piece(rank: int, vertices: Floats, triangles: Ints) -> View:
    used, rows = np.unique(triangles, return_inverse=True)
    return View(f"piece {rank}, by area", triangle_mesh(vertices[used], rows.reshape(-1, 3)))
