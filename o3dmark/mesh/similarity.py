"""Similarities: rotation, translation and uniform scale, never a reflection, as matrices (4, 4).

Fitted to pairs of points, small ones from seven parameters, and the one that brings points to the origin and to size
one.
"""

from typing import NamedTuple

import numpy as np
import scipy

from o3dmark.arrays import Floats
from o3dmark.mesh import geometry

_RIDGE = 1e-9  # of a step along normals that leave a motion open, as on a plane or a ball; far below what noise does


class UnitSize(NamedTuple):
    """Points about the origin with a bounding box of diagonal one, and back: ``centre`` (3,) and ``size`` taken off.

    For libraries that compute in float32 or with thresholds that are lengths.
    """

    centre: Floats
    size: float

    @classmethod
    def about_mean(cls, points: Floats) -> "UnitSize":
        return cls(points.mean(axis=0), geometry.diagonal(points))

    @classmethod
    def about_box(cls, points: Floats) -> "UnitSize":
        return cls(geometry.box_centre(points), geometry.diagonal(points))

    def apply(self, points: Floats) -> Floats:
        """Points (n, 3) at the origin, of size one."""
        return np.asarray((points - self.centre) / self.size)

    def undo(self, points: Floats) -> Floats:
        """Points (n, 3) back where they were."""
        return np.asarray(self.centre + self.size * points)


def fitted(source: Floats, target: Floats) -> Floats:
    """The similarity that moves ``source`` (n, 3) nearest to ``target`` (n, 3), as a matrix (4, 4).

    Least squares with rotation, translation and scale, no reflection (Umeyama 1991).
    """
    a, b = source.mean(axis=0), target.mean(axis=0)
    u, s, vt = np.linalg.svd((target - b).T @ (source - a))
    sign = np.array([1.0, 1.0, np.linalg.det(u @ vt)])
    rotation = (u * sign) @ vt
    scale = (s * sign).sum() / np.sum((source - a) ** 2)
    matrix = np.eye(4)
    matrix[:3, :3] = scale * rotation
    matrix[:3, 3] = b - scale * rotation @ a
    return matrix


def apply(matrix: Floats, points: Floats) -> Floats:
    """``points`` (n, 3) moved by an affine matrix (4, 4)."""
    return np.asarray(points @ matrix[:3, :3].T + matrix[:3, 3])


def small(motion: Floats, centre: Floats) -> Floats:
    """The similarity (4, 4) of a ``motion`` (7,), as in `motions`, about ``centre`` (3,)."""
    matrix = np.eye(4)
    matrix[:3, :3] = np.exp(motion[6]) * scipy.spatial.transform.Rotation.from_rotvec(motion[3:6]).as_matrix()
    matrix[:3, 3] = centre + motion[:3] - matrix[:3, :3] @ centre
    return matrix


def motions(offsets: Floats, normals: Floats) -> Floats:
    """How far points at ``offsets`` (n, 3) from the centre move along ``normals`` for each of seven motions: (n, 7).

    Per unit of translation (3), rotation vector (3) and log scale (1), to first order.
    """
    return np.concatenate(
        [normals, np.cross(offsets, normals), np.einsum("nd,nd->n", offsets, normals)[:, None]], axis=1
    )


def step_along(points: Floats, normals: Floats, gap: Floats, weight: Floats) -> Floats:
    """The small similarity (4, 4) that moves ``points`` (n, 3) by ``gap`` (n,) along ``normals``, by least squares."""
    centre = points.mean(axis=0)
    J = motions(points - centre, normals)
    lever = np.sqrt(np.mean(np.sum((points - centre) ** 2, axis=1)))
    ridge = _RIDGE * len(points) * np.diag([1.0, 1.0, 1.0, lever**2, lever**2, lever**2, lever**2])
    motion = np.linalg.solve((J.T * weight) @ J + ridge, (J.T * weight) @ gap)
    return small(np.asarray(motion, np.float64), centre)
