"""Curvature per vertex by Taubin's tensor, for triangle meshes and for oriented point clouds.

Taubin, "Estimating the tensor of curvature of a surface from a polyhedral approximation", ICCV 1995. Around vertex i
with unit normal N_i, every neighbour j gives a tangent direction T_ij and a normal curvature k_ij along it; the tensor
M_i = sum_j w_ij k_ij T_ij T_ij^T has N_i in its kernel and two more eigenvalues, a = (3 k1 + k2) / 8 and
b = (k1 + 3 k2) / 8, so that k1 = 3 a - b and k2 = 3 b - a. The mean curvature is the trace a + b = sum_j w_ij k_ij.

Sign: Taubin's. With outward normals curvature is negative on convex parts; a sphere of radius r has -1/r.
Unit: one over the unit of the vertices.
"""

from dataclasses import dataclass

import numpy as np

from o3dmark.arrays import Floats, Ints
from o3dmark.mesh import geometry


@dataclass(frozen=True, eq=False)
class Curvature:
    """Per vertex (n,): mean curvature H = (k1 + k2) / 2 and the principal curvatures, k1 >= k2."""

    mean: Floats
    k1: Floats
    k2: Floats

    @property
    def gauss(self) -> Floats:
        """Gaussian curvature k1 k2 (n,)."""
        return self.k1 * self.k2


def taubin(vertices: Floats, triangles: Ints) -> Curvature:
    """Curvature of a triangle mesh; a neighbour weighs as the area of the triangles on its edge.

    Vertices that no triangle uses, or whose normals cancel, get zero.
    """
    i = triangles[:, [0, 0, 1, 1, 2, 2]].ravel()
    j = triangles[:, [1, 2, 2, 0, 0, 1]].ravel()
    weights = np.repeat(geometry.areas(vertices, triangles), 6)
    normals = geometry.unit(geometry.vertex_area_vectors(vertices, triangles))
    offset = vertices[j] - vertices[i]
    return _tensor(i, offset, 2.0 * np.sum(normals[i] * offset, axis=1), weights, normals)


def of_points(points: Floats, normals: Floats, neighbours: Ints) -> Curvature:
    """Curvature of an oriented point cloud: points (n, 3), unit normals (n, 3), neighbours (n, k) by index.

    Along each neighbour the normal curvature is the turning of the normal, k_ij = -(N_j - N_i).d / |d|^2, which noise
    in the points disturbs less than Taubin's chord formula; all neighbours weigh the same.
    """
    i = np.repeat(np.arange(len(points)), neighbours.shape[1])
    j = neighbours.ravel()
    offset = points[j] - points[i]
    turning = np.sum((normals[i] - normals[j]) * offset, axis=1)
    return _tensor(i, offset, turning, np.ones(len(i)), normals)


def _tensor(i: Ints, offset: Floats, rise: Floats, weights: Floats, normals: Floats) -> Curvature:
    """Curvatures from directed pairs (p,): vertex i, offset (p, 3) to its neighbour, rise k_ij |d|^2, weight."""
    n = len(normals)
    square = np.sum(offset**2, axis=1)
    good = square > 0
    k = np.divide(rise, square, out=np.zeros_like(rise), where=good)
    tangent = geometry.unit(offset - np.sum(normals[i] * offset, axis=1, keepdims=True) * normals[i])
    total = np.bincount(i, weights * good, minlength=n)
    wk = weights * k / np.where(total > 0, total, 1.0)[i]

    def around(values: Floats) -> Floats:
        return np.asarray(np.bincount(i, values, minlength=n), np.float64)

    mean = around(wk)
    m = {(r, c): around(wk * tangent[:, r] * tangent[:, c]) for r in range(3) for c in range(r, 3)}
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    square_trace = sum(m[r, c] ** 2 * (1.0 if r == c else 2.0) for r, c in m)  # trace of M M
    root = np.sqrt(np.maximum(2.0 * square_trace - trace**2, 0.0))  # a - b, the third eigenvalue being zero
    return Curvature(mean, trace + 2.0 * root, trace - 2.0 * root)
