"""Open edges that lie on each other but for a little: torn triangles, cracks and seams, closed again.

Only vertices on open edges are welded, so that a fine mesh does not collapse, however small its triangles are.
"""

from collections.abc import Sequence

import numpy as np
import scipy
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from o3dmark.arrays import Bools, Ints
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface

# Of the diagonal of most of the surface. The third closes torn triangles whose corners were moved by 1e-5, the last
# cracks of 1e-4; it also glues crossing shells, so the finest that helps is taken.
TOLERANCES = (1e-6, 1e-5, 1e-4, 5e-4)
_MOST = 0.05  # quantile left out at either end: a speck far away does not stretch the tolerance
_HELPS = 0.5  # of the open edges that a weld may leave to be worth it


def welded(surface: Surface, tolerance: float) -> Surface:
    """The surface with vertices on open edges merged that lie within ``tolerance`` of each other, in a chain or all.

    `Surface.vertex_map` still says where each of the mesh's vertices went. Errors: MeshError when no area is left.
    """
    rim = np.flatnonzero(on_open_edges(surface))
    if not len(rim):
        return surface
    cell = np.unique(np.floor(surface.vertices[rim] / tolerance), axis=0, return_inverse=True)[1].ravel()
    size = np.bincount(cell)
    centre = np.stack([np.bincount(cell, column) for column in surface.vertices[rim].T], axis=1) / size[:, None]
    tree = scipy.spatial.cKDTree(centre)
    near = tree.query_pairs(tolerance, output_type="ndarray")  # of cells: a cluster costs no more than these
    links = sp.coo_array((np.ones(len(near), bool), near.T), shape=(len(centre), len(centre)))
    group = connected_components(links, directed=False)[1][cell]
    size = np.bincount(group)
    mean = np.stack([np.bincount(group, column) for column in surface.vertices[rim].T], axis=1) / size[:, None]
    vertices = np.array(surface.vertices)
    moved = size[group] > 1
    vertices[rim[moved]] = mean[group[moved]]
    once = Surface.from_arrays(vertices, surface.triangles)
    inner = surface.vertex_map >= 0
    row = np.full(len(surface.vertex_map), -1, np.int64)
    row[inner] = once.vertex_map[surface.vertex_map[inner]]
    return Surface(np.array(once.vertices), np.array(once.triangles), row)


def mended(surface: Surface) -> Surface:
    """The finest weld that closes half of the open edges; the surface as it is where none does."""
    return mended_by(surface, ladder(surface))


def mended_by(surface: Surface, welds: Sequence[Surface]) -> Surface:
    """As `mended`, of the welds that `ladder` gave."""
    before = open_edges(surface) if welds else 0
    for each in welds:
        if open_edges(each) <= _HELPS * before:
            return each
    return surface


def ladder(surface: Surface) -> list[Surface]:
    """The surface welded within ever larger tolerances, those that make a difference."""
    found: list[Surface] = []
    if not open_edges(surface):
        return found
    low, high = np.quantile(surface.vertices, [_MOST, 1.0 - _MOST], axis=0)
    extent = float(np.linalg.norm(high - low)) or surface.diagonal
    for tolerance in TOLERANCES:
        before = found[-1] if found else surface
        after = welded(surface, tolerance * extent)
        if len(after.vertices) < len(before.vertices):
            found.append(after)
    return found


def open_edges(surface: Surface) -> int:
    """The number of edges that one triangle has, or an odd number of them."""
    return int(np.count_nonzero(_uses(surface)[1] % 2))


def on_open_edges(surface: Surface) -> Bools:
    """Which vertices (n,) such edges end in."""
    edges, uses = _uses(surface)
    rim = np.zeros(len(surface.vertices), bool)
    rim[edges[uses % 2 == 1]] = True
    return rim


def _uses(surface: Surface) -> tuple[Ints, Ints]:
    """Each edge (e, 2), and the number of triangles (e,) that have it."""
    edges, side = geometry.numbered_edges(surface.triangles)
    return edges, np.bincount(side.ravel(), minlength=len(edges))
