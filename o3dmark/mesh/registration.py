"""Which vertex of a received mesh is which vertex of the cover mesh: for informed extraction.

Vertices are matched by number where the counts agree and a similarity fits; otherwise the meshes are aligned by their
principal axes and iterated closest points with unknown scale, and nearest vertices are matched. Fragments want more
than that: see `fragments`.
"""

import itertools

import numpy as np
import scipy

from o3dmark.arrays import Floats, Ints
from o3dmark.mesh import similarity
from o3dmark.mesh.geometry import diagonal

_FITS = 0.02  # RMS residual over the diagonal: 0.018 after a twist by 10 degrees, 0.26 where the order is another
_ROUNDS = 30  # where a tenth was cut off, 15 are enough


def numbered_alike(cover: Floats, received: Floats) -> bool:
    """Whether a similarity lays each vertex of ``received`` (m, 3) on that of its number in ``cover`` (n, 3), about."""
    if len(cover) != len(received):
        return False
    residual = similarity.apply(similarity.fitted(received, cover), received) - cover
    return bool(np.sqrt(np.mean(np.sum(residual**2, axis=1))) < _FITS * diagonal(cover))


def match_vertices(cover: Floats, received: Floats) -> Ints:
    """For each vertex of the ``cover`` (n, 3), the index of its counterpart in ``received`` (m, 3): an array (n,)."""
    if numbered_alike(cover, received):
        return np.arange(len(cover))
    aligned = similarity.apply(align(received, cover), received)
    return np.asarray(scipy.spatial.cKDTree(aligned).query(cover)[1], np.int64)


def align(source: Floats, target: Floats) -> Floats:
    """The similarity (4, 4) that lays the points ``source`` on ``target`` from any pose and scale, unmirrored."""
    tree = scipy.spatial.cKDTree(target)

    def mean_square(matrix: Floats) -> float:
        return float(np.mean(tree.query(similarity.apply(matrix, source))[0] ** 2))

    matrix = min(_by_principal_axes(source, target), key=mean_square)
    for _ in range(_ROUNDS):
        matrix = similarity.fitted(source, target[tree.query(similarity.apply(matrix, source))[1]])
    return matrix


def _by_principal_axes(source: Floats, target: Floats) -> list[Floats]:
    """The four proper similarities that lay the principal axes of the points on each other."""
    (a, rms_a, axes_a), (b, rms_b, axes_b) = _frame(source), _frame(target)
    matrices = []
    for signs in itertools.product((1.0, -1.0), repeat=2):
        rotation = (axes_b * np.array([*signs, signs[0] * signs[1]])) @ axes_a.T
        matrix = np.eye(4)
        matrix[:3, :3] = rms_b / rms_a * rotation
        matrix[:3, 3] = b - matrix[:3, :3] @ a
        matrices.append(matrix)
    return matrices


def _frame(points: Floats) -> tuple[Floats, float, Floats]:
    """Centre (3,), RMS distance from it, and right-handed principal axes (3, 3), in columns."""
    centre = points.mean(axis=0)
    offset = points - centre
    axes = np.linalg.eigh(offset.T @ offset)[1]
    axes[:, 2] *= np.linalg.det(axes)
    return centre, float(np.sqrt(np.mean(np.sum(offset**2, axis=1)))), axes
