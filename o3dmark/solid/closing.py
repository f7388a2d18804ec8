"""Any surface as the boundary of a solid: triangles wound alike, pieces outward, holes closed by fans.

A mesh with holes, open or non-manifold edges is closed as a chain: with the fans, every edge is used equally often in
both directions, which is all that the divergence theorem asks for.
"""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from o3dmark.arrays import Bools, Floats, Ints
from o3dmark.mesh import geometry

# Part of the format: volume of a piece, over the power 3/2 of its area, below which it does not decide what is outward.
# A ball has 0.094, a square sheet bent by 42 degrees 0.03.
_FLAT = 0.03


def oriented(vertices: Floats, triangles: Ints) -> Ints:
    """The triangles (m, 3) wound alike across every edge that two of them share, and outward in every piece.

    A one-sided piece (a Moebius strip) cannot be wound alike and keeps its winding; a flat one keeps it too, unless
    the volume of all pieces together is negative.
    """
    edge = geometry.edge_keys(triangles).ravel()
    forward = (triangles < np.roll(triangles, -1, axis=1)).ravel()
    face = np.repeat(np.arange(len(triangles)), 3)
    order = np.argsort(edge, kind="stable")
    first = np.flatnonzero(np.diff(edge[order], prepend=-1))
    pair = first[np.diff(first, append=len(edge)) == 2]
    one, other = order[pair], order[pair + 1]
    unlike = forward[one] == forward[other]
    flip, piece = _two_colouring(face[one], face[other], unlike, len(triangles))
    area = geometry.areas(vertices, triangles)
    size = np.bincount(piece, area)
    flip ^= (np.bincount(piece, area * flip) > 0.5 * size)[piece]  # the winding that most of a piece has
    wound = np.where(flip[:, None], triangles[:, ::-1], triangles)
    volume = _piece_volumes(vertices, wound, piece)
    inward = np.where(np.abs(volume) > _FLAT * size**1.5, volume < 0.0, volume.sum() < 0.0)
    return np.where(inward[piece][:, None], wound[:, ::-1], wound)


def fans(vertices: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    """Triangles (c, 3) that close a surface, and the vertices (n, 3) with the centre of each fan appended.

    One fan for each connected part of the boundary, around its length-weighted centroid.
    """
    start, end = boundary(triangles, len(vertices))
    if not len(start):
        return vertices, np.empty((0, 3), np.int64)
    links = sp.coo_array((np.ones(len(start)), (start, end)), shape=(len(vertices), len(vertices)))
    loop = np.unique(connected_components(links, directed=False)[1][start], return_inverse=True)[1]
    length = np.maximum(np.linalg.norm(vertices[end] - vertices[start], axis=1), 1e-300)
    middle = 0.5 * (vertices[start] + vertices[end])
    total = np.stack([np.bincount(loop, length * column) for column in middle.T], axis=1)
    centre = total / np.bincount(loop, length)[:, None]
    return np.concatenate([vertices, centre]), np.stack([end, start, len(vertices) + loop], axis=1)


def boundary(triangles: Ints, n_vertices: int) -> tuple[Ints, Ints]:
    """Start and end (b,) of the directed edges left over when opposite ones cancel: the boundary of the chain."""
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    links = sp.coo_array((np.ones(len(start)), (start, end)), shape=(n_vertices, n_vertices)).tocsr()
    net = sp.coo_array(links - links.T)
    times = np.maximum(np.rint(net.data), 0).astype(np.int64)
    return np.repeat(net.row.astype(np.int64), times), np.repeat(net.col.astype(np.int64), times)


def _two_colouring(a: Ints, b: Ints, unlike: Bools, count: int) -> tuple[Bools, Ints]:
    """Which of ``count`` things to flip so that each pair (a, b) that is ``unlike`` becomes alike; and their pieces.

    Connected components of the double cover: every thing is there as it is and flipped (+ count).
    """
    cross = np.where(unlike, count, 0)
    row = np.concatenate([a, a + count])
    column = np.concatenate([b + cross, b + count - cross])
    cover = sp.coo_array((np.ones(len(row)), (row, column)), shape=(2 * count, 2 * count))
    label = connected_components(cover, directed=False)[1]
    base = sp.coo_array((np.ones(len(a)), (a, b)), shape=(count, count))
    pieces, piece = connected_components(base, directed=False)
    leader = np.full(pieces, -1)
    leader[piece[::-1]] = np.arange(count)[::-1]
    return label[:count] != label[leader[piece]], piece.astype(np.int64)


def _piece_volumes(vertices: Floats, triangles: Ints, piece: Ints) -> Floats:
    """Signed volume (p,) of each piece, its holes coned to the mean of their edges' midpoints."""
    start, end = boundary(triangles, len(vertices))
    of_vertex = np.zeros(len(vertices), np.int64)
    of_vertex[triangles.ravel()] = np.repeat(piece, 3)
    middle, at = 0.5 * (vertices[start] + vertices[end]), of_vertex[start]
    pieces = int(piece.max(initial=-1)) + 1
    count = np.bincount(at, minlength=pieces)
    total = np.stack([np.bincount(at, column, minlength=pieces) for column in middle.T], axis=1)
    apex = total / np.maximum(count, 1)[:, None]
    arm = vertices[triangles[:, 0]] - apex[piece]
    cones = np.einsum("md,md->m", geometry.area_vectors(vertices, triangles), arm) / 3.0
    return np.asarray(np.bincount(piece, cones, pieces), np.float64)
