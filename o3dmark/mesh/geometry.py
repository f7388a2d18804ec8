"""Quantities of a triangle mesh given as arrays: vertices (n, 3) float64 and triangles (m, 3) int.

Pure functions, no mesh object and no Open3D. Lengths, areas and volumes come in the units of the vertices.
Triangles wind counter-clockwise seen from outside, so that normals point outward and volumes are positive.
"""

import math

import numpy as np
import scipy.sparse as sp

from o3dmark.arrays import AnyArray, Bools, Floats, Ints

_INDEX_BITS = 31  # of a vertex: Open3D counts in 32, signed


def area_vectors(vertices: Floats, triangles: Ints) -> Floats:
    """Each triangle's normal times its area (m, 3): half the cross product of two edges."""
    corners = np.ascontiguousarray(triangles.T)
    (ux, vx), (uy, vy), (uz, vz) = (x[corners[1:]] - x[corners[0]] for x in np.ascontiguousarray(vertices.T))
    vectors = np.empty((len(triangles), 3))  # by columns: faster than numpy.cross of rows (see bench_spectrum)
    vectors[:, 0] = uy * vz - uz * vy
    vectors[:, 1] = uz * vx - ux * vz
    vectors[:, 2] = ux * vy - uy * vx
    vectors *= 0.5
    return vectors


def areas(vertices: Floats, triangles: Ints) -> Floats:
    """Triangle areas (m,)."""
    return np.asarray(np.linalg.norm(area_vectors(vertices, triangles), axis=1))


def sum_at_vertices(values: Floats, triangles: Ints, n_vertices: int) -> Floats:
    """Sum of a triangle quantity (m,) or (m, d) over the triangles around each vertex: (n,) or (n, d)."""
    columns = values.reshape(len(triangles), math.prod(values.shape[1:]))
    corners = triangles.ravel()
    sums = [np.bincount(corners, np.repeat(column, 3), minlength=n_vertices) for column in columns.T]
    return np.stack(sums, axis=1, dtype=np.float64).reshape(n_vertices, *values.shape[1:])


def vertex_area_vectors(vertices: Floats, triangles: Ints) -> Floats:
    """Sum of the area vectors around each vertex (n, 3): the un-normalised, area-weighted vertex normal."""
    return sum_at_vertices(area_vectors(vertices, triangles), triangles, len(vertices))


def vertex_areas(vertices: Floats, triangles: Ints) -> Floats:
    """A third of the area around each vertex (n,); they add up to the surface's area."""
    return sum_at_vertices(areas(vertices, triangles), triangles, len(vertices)) / 3.0


def unit(vectors: Floats) -> Floats:
    """Vectors (n, 3) scaled to length one; a zero vector stays zero."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0)


def angles(vertices: Floats, triangles: Ints) -> Floats:
    """The angle at each corner (m, 3) in radians; 0 or pi in triangles without area."""
    return np.arctan2(*_corner_products(vertices, triangles))


def cotangents(vertices: Floats, triangles: Ints) -> Floats:
    """The cotangent of the angle at each corner (m, 3); not finite where a triangle has no area."""
    sine, cosine = _corner_products(vertices, triangles)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(cosine / sine)


def _corner_products(vertices: Floats, triangles: Ints) -> tuple[Floats, Floats]:
    """Sine and cosine of the angle at each corner (m, 3), both times the lengths of its two edges."""
    corner = vertices[triangles]
    one, other = np.roll(corner, -1, axis=1) - corner, np.roll(corner, -2, axis=1) - corner
    return np.linalg.norm(np.cross(one, other), axis=2), np.sum(one * other, axis=2)


def motions_along(vertices: Ints, ways: Floats, n_vertices: int) -> sp.csr_array:
    """The matrix (q, 3 n) of sums of motions: row q takes those of vertices (q, c) along vectors ``ways`` (q, c, 3).

    Column 3 v + i is the motion of vertex v along axis i.
    """
    columns = 3 * vertices[:, :, None] + np.arange(3)
    rows = np.broadcast_to(np.arange(len(vertices))[:, None, None], columns.shape)
    return sp.csr_array((ways.ravel(), (rows.ravel(), columns.ravel())), shape=(len(vertices), 3 * n_vertices))


def barycentric(points: Floats, corners: Floats) -> Floats:
    """Barycentric coordinates (q, 3) of points (q, 3) in the planes of triangles (q, 3, 3)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = np.cross(b - a, c - a)
    square = np.maximum(np.einsum("qd,qd->q", normal, normal), 1e-300)
    v = np.einsum("qd,qd->q", np.cross(points - a, c - a), normal) / square
    w = np.einsum("qd,qd->q", np.cross(b - a, points - a), normal) / square
    return np.stack([1.0 - v - w, v, w], axis=1)


def normal_rms(areas: Floats, corners: Floats) -> float:
    """RMS distance between a surface and the same surface moved, to first order.

    areas (m, 3): area vectors of the triangles; corners (m, 3, 3): the motion of each triangle's corners. Its normal
    part, linear in each triangle, is integrated exactly.
    """
    a, b, c = np.einsum("mcd,md->cm", corners, unit(areas))
    size = np.linalg.norm(areas, axis=1)
    return float(np.sqrt(size @ (a * a + b * b + c * c + a * b + b * c + c * a) / 6.0 / size.sum()))


def motion_mrms(vertices: Floats, moved: Floats, triangles: Ints) -> float:
    """`normal_rms` of vertices (n, 3) that were moved (n, 3), over the diagonal of the box about those in use."""
    motion = (moved - vertices)[triangles]
    return normal_rms(area_vectors(vertices, triangles), motion) / diagonal(vertices[used_vertices(triangles)])


def edges(triangles: Ints) -> Ints:
    """Each undirected edge once (e, 2), the lower index first, in lexicographic order."""
    keys, _ = np.unique(edge_keys(triangles), return_counts=True)  # without counts numpy hashes, 20 times slower
    return _pairs_of(keys)


def numbered_edges(triangles: Ints) -> tuple[Ints, Ints]:
    """The edges (e, 2) as `edges` gives them, and which of them leads from each corner to the next (m, 3)."""
    pairs, side = numbered_pairs(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2))
    return pairs, side.reshape(-1, 3)


def numbered_pairs(pairs: Ints) -> tuple[Ints, Ints]:
    """Of undirected pairs of indices (k, 2) each once (e, 2), lower first, in order; and which of them each is (k,)."""
    keys, number = np.unique(_keys_of(pairs[:, 0], pairs[:, 1]), return_inverse=True)
    return _pairs_of(keys), number


def used_vertices(triangles: Ints) -> Ints:
    """The vertices (k,) that some triangle has as a corner, ascending."""
    return np.flatnonzero(np.bincount(triangles.ravel()))


def boundary_vertices(triangles: Ints, n_vertices: int) -> Bools:
    """True (n,) at the vertices of an edge that only one triangle uses."""
    keys, counts = np.unique(edge_keys(triangles), return_counts=True)
    mask = np.zeros(n_vertices, bool)
    mask[_pairs_of(keys[counts == 1]).ravel()] = True
    return mask


def boundary_edges(vertices: Floats, triangles: Ints) -> tuple[Floats, Floats]:
    """Start and end (e, 3) of the edges that only one triangle uses."""
    keys, counts = np.unique(edge_keys(triangles), return_counts=True)
    start, end = _pairs_of(keys[counts == 1]).T
    return vertices[start], vertices[end]


def edge_keys(triangles: Ints) -> Ints:
    """A number (m, 3) for the edge from each corner to the next, the same wherever two vertices are joined."""
    return _keys_of(triangles, np.roll(triangles, -1, axis=1))


def _keys_of(one: Ints, other: Ints) -> Ints:
    """A number for each undirected pair of indices, in the shape of both arrays; in lexicographic order.

    numpy sorts such numbers several times faster than rows.
    """
    return np.asarray((np.minimum(one, other) << _INDEX_BITS) + np.maximum(one, other))


def _pairs_of(keys: Ints) -> Ints:
    """The pairs (e, 2) that keys (e,) stand for, the lower index first."""
    return np.stack([keys >> _INDEX_BITS, keys & ((1 << _INDEX_BITS) - 1)], axis=1)


def adjacency(triangles: Ints, n_vertices: int) -> sp.csr_array:
    """Symmetric 0/1 matrix (n, n): one where an edge joins two vertices."""
    pairs = edges(triangles)
    row, column = np.concatenate([pairs, pairs[:, ::-1]]).T
    return sp.csr_array((np.ones(len(row)), (row, column)), shape=(n_vertices, n_vertices))


def neighbour_mean(triangles: Ints, n_vertices: int) -> sp.csr_array:
    """The matrix D^-1 A (n, n) that replaces each vertex by the mean of its neighbours (umbrella weights)."""
    neighbours = adjacency(triangles, n_vertices)
    degree = np.asarray(neighbours.sum(axis=1)).ravel()
    return sp.csr_array(sp.diags_array(1.0 / np.maximum(degree, 1.0)) @ neighbours)


def area_centroid(vertices: Floats, triangles: Ints) -> Floats:
    """Centre of mass (3,) of the surface with uniform density."""
    weight = areas(vertices, triangles)
    return np.asarray(weight @ vertices[triangles].mean(axis=1) / weight.sum())


def volume(vertices: Floats, triangles: Ints) -> float:
    """Signed volume that a closed surface bounds (divergence theorem); positive for outward winding."""
    return float(np.sum(area_vectors(vertices, triangles) * vertices[triangles[:, 0]]) / 3.0)


def box_centre(vertices: Floats) -> Floats:
    """Centre (3,) of the axis-aligned bounding box."""
    return np.asarray((vertices.min(axis=0) + vertices.max(axis=0)) / 2.0)


def diagonal(vertices: Floats) -> float:
    """Length of the diagonal of the axis-aligned bounding box."""
    return float(np.linalg.norm(np.ptp(vertices, axis=0)))


def weld(vertices: Floats) -> tuple[Ints, Ints]:
    """Merge vertices at exactly equal positions.

    Returns ``kept`` (k,), the index of the first vertex at each position, in order of appearance, and ``position``
    (n,), for every vertex its place in ``kept``.
    """
    first, group = distinct_rows(vertices)
    order = np.argsort(first)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    return first[order], place[group]


def distinct_rows(rows: AnyArray) -> tuple[Ints, Ints]:
    """Where each of the different rows (k,) of a table (n, d) comes first, and for every row which of these it is (n,).

    In lexicographic order from the last column; numpy.unique by rows, several times faster.
    """
    order = np.lexsort(rows.T)  # stable
    ranked = rows[order]
    new = np.ones(len(rows), bool)
    new[1:] = (ranked[1:] != ranked[:-1]).any(axis=1)
    group = np.empty(len(rows), np.int64)
    group[order] = np.cumsum(new) - 1
    return order[new], group
