"""Normals that follow a surface when it moves: each is turned as its own surface turns.

Recomputed normals would smooth what a modeller made sharp, and open seams: normals that were equal on both sides of a
texture seam would not be any more. Turned ones keep both.
"""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from o3dmark.arrays import Floats, Ints
from o3dmark.mesh import geometry


def turned(before: Floats, after: Floats, triangles: Ints, normals: Floats, used: Ints | None = None) -> "Turns":
    """The turn of each of normals (k, 3) when positions (n, 3) go from ``before`` to ``after``.

    ``used`` (m, 3): which normal stands at each corner of triangles (m, 3), or -1; by default normals and positions are
    numbered alike. A normal turns as the area-weighted mean of the triangles that use it does. Equal normals at equal
    positions turn alike, whatever else tells them apart, so seams stay closed; different ones at one position turn on
    their own, so hard edges stay hard. Where numbers are not finite, or too large to multiply, nothing turns.
    """
    used = triangles if used is None else used
    corners, numbers = triangles.ravel(), used.ravel()
    kept = numbers >= 0
    group = _groups(geometry.weld(before)[1][corners[kept]], numbers[kept], normals)
    corner_group, size = group[numbers[kept]], int(group.max(initial=-1)) + 1
    with np.errstate(all="ignore"):
        start, end = (
            _sums(np.repeat(geometry.area_vectors(positions, triangles), 3, axis=0)[kept], corner_group, size)
            for positions in (before, after)
        )
        return Turns(geometry.unit(start)[group], geometry.unit(end)[group])


class Turns:
    """The least turns (k,) that take unit vectors (k, 3) to others; none where they are zero, equal or opposite."""

    def __init__(self, start: Floats, end: Floats) -> None:
        axis, cosine = np.cross(start, end), _dot(start, end)  # of length sin
        turns = (cosine > -0.5) & (_dot(axis, axis) > 0.0)  # of a surface turned over, the least turn says nothing
        self._axis = np.where(turns[:, None], axis, 0.0)
        self._cosine = np.where(turns, cosine, 1.0)  # a unit vector times itself is not quite 1

    def __call__(self, vectors: Floats) -> Floats:
        """Vectors (k, 3), each turned; their lengths stay. (Rodrigues' formula, with the axis not of unit length.)"""
        axis, cosine = self._axis, self._cosine[:, None]
        with np.errstate(all="ignore"):
            along = _dot(axis, vectors)[:, None]
            new = vectors * cosine + np.cross(axis, vectors) + axis * along / (1.0 + cosine)
        return np.where(np.isfinite(new).all(axis=1, keepdims=True), new, vectors)


def _dot(one: Floats, other: Floats) -> Floats:
    """Products (k,) of vectors (k, 3); a sum along short rows takes three times longer."""
    return np.asarray(np.einsum("kd,kd->k", one, other))


def _groups(positions: Ints, numbers: Ints, normals: Floats) -> Ints:
    """For each normal (k,) a number shared by all that are equal at one position, or are one."""
    k = len(normals)
    _, value = geometry.distinct_rows(normals)
    pairs = positions * (int(value.max(initial=-1)) + 1) + value[numbers]  # as one number: sorted in half the time
    _, place = np.unique(pairs, return_inverse=True)
    n_places = int(place.max(initial=-1)) + 1
    links = sp.coo_array((np.ones(len(numbers), bool), (numbers, k + place)), shape=(k + n_places,) * 2)
    return connected_components(links, directed=False)[1][:k].astype(np.int64)


def _sums(vectors: Floats, group: Ints, size: int) -> Floats:
    return np.stack([np.bincount(group, vectors[:, axis], size) for axis in range(3)], axis=1, dtype=np.float64)
