"""Hinges: the edges where two triangles meet, and how the angle there answers to moving the four corners.

Source: Grinspun, Hirani, Desbrun and Schroeder 2003, Discrete shells, whose bending energy is
sum (change of angle)^2 3 |edge|^2 / (area of both triangles); linearised here.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from o3dmark.arrays import Floats, Ints
from o3dmark.mesh import geometry

_LOWEST = 0.05  # height of a triangle over its edge, below which the price falls: slivers would outweigh all others
_SMALLEST = 1e-3  # area about an edge that counts, over the mean


class Hinges(NamedTuple):
    """The edges (h, 2) that exactly two triangles share; the triangles (h, 2), and their third corners (h, 2)."""

    edge: Ints
    opposite: Ints
    triangle: Ints

    @classmethod
    def of(cls, triangles: Ints) -> "Hinges":
        """Those of triangles (m, 3)."""
        keys = geometry.edge_keys(triangles).ravel()  # from each corner to the next, triangle by triangle
        order = np.argsort(keys, kind="stable")
        first = np.flatnonzero(np.concatenate([[True], np.diff(keys[order]) != 0]))
        shared = first[np.diff(np.concatenate([first, [len(keys)]])) == 2]
        one, other = order[shared], order[shared + 1]
        following, third = (np.roll(triangles, -i, axis=1).ravel() for i in (1, 2))
        edge = np.stack([triangles.ravel()[one], following[one]], axis=1)
        return cls(edge, np.stack([third[one], third[other]], axis=1), np.stack([one // 3, other // 3], axis=1))

    def angles(self, vertices: Floats, triangles: Ints) -> Floats:
        """From the normal of one triangle to the other's, in radians (h,): above zero where the surface is convex.

        Of triangles that are wound differently, near pi.
        """
        one, other = geometry.unit(geometry.area_vectors(vertices, triangles))[self.triangle.T]
        along = geometry.unit(vertices[self.edge[:, 1]] - vertices[self.edge[:, 0]])
        sine = np.einsum("hd,hd->h", np.cross(one, other), along)
        return np.asarray(np.arctan2(sine, np.einsum("hd,hd->h", one, other)))

    def bending(self, vertices: Floats, triangles: Ints) -> tuple[sp.csr_array, Floats]:
        """The change of each angle (h, 3 n) as vertex v moves along axis i (column 3 v + i), and its price (h,)."""
        area_vectors = geometry.area_vectors(vertices, triangles)
        area, normals = np.linalg.norm(area_vectors, axis=1), geometry.unit(area_vectors)
        start = vertices[self.edge[:, 0]]
        along = vertices[self.edge[:, 1]] - start
        length2 = self._length2(vertices)
        heights = self._heights(area, length2)
        slopes = np.zeros((len(along), 4, 3))  # of both ends, and of both third corners
        for side in range(2):
            height = np.maximum(heights[:, side], 1e-9) * np.sqrt(length2)
            slope = -normals[self.triangle[:, side]] / height[:, None]
            foot = (np.einsum("hd,hd->h", vertices[self.opposite[:, side]] - start, along) / length2)[:, None]
            slopes[:, 2 + side] = slope
            slopes[:, 0] -= (1.0 - foot) * slope
            slopes[:, 1] -= foot * slope
        corners = np.concatenate([self.edge, self.opposite], axis=1)
        change = geometry.motions_along(corners, slopes, len(vertices))
        return change, self.prices(vertices, triangles)

    def prices(self, vertices: Floats, triangles: Ints) -> Floats:
        """What the square of a change of each angle costs (h,); that of equilateral triangles bent by one, three times
        their area."""
        area, length2 = geometry.areas(vertices, triangles), self._length2(vertices)
        about = area[self.triangle].sum(axis=1)
        if not len(about):
            return about
        sliver = np.clip(self._heights(area, length2).min(axis=1) / _LOWEST, 1e-9, 1.0) ** 2
        return np.asarray(sliver * 3.0 * length2 / np.maximum(about, _SMALLEST * about.mean()))

    def _length2(self, vertices: Floats) -> Floats:
        """The squared length of each edge (h,), above zero."""
        along = vertices[self.edge[:, 1]] - vertices[self.edge[:, 0]]
        return np.maximum(np.einsum("hd,hd->h", along, along), np.finfo(np.float64).tiny)

    def _heights(self, area: Floats, length2: Floats) -> Floats:
        """Heights of both triangles over their edge, in its length (h, 2), from areas (m,) and squared lengths (h,)."""
        return np.asarray(2.0 * area[self.triangle] / length2[:, None])
