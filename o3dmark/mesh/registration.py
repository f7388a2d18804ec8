"""Which vertex of a received mesh is which vertex of the cover mesh, and small motions: for informed extraction.

Vertices are matched by number where the counts agree and a similarity fits; otherwise the meshes are laid on each other
by their principal axes and iterated closest points with unknown scale, and nearest vertices are matched. Fragments want
more than that: see `placing`.
"""

import itertools

import numpy as np
from scipy.spatial import cKDTree

from o3dmark.arrays import Floats, Ints
from o3dmark.mesh.geometry import diagonal

_FITS = 0.02  # RMS residual, over the diagonal, below which vertices with equal numbers are taken as the same
_ROUNDS = 30
_RIDGE = 1e-9  # of a step along normals that leave a motion open, as on a plane or a ball


def similarity(source: Floats, target: Floats) -> Floats:
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


def numbered_alike(cover: Floats, received: Floats) -> bool:
    """Whether a similarity lays each vertex of ``received`` (m, 3) on that of its number in ``cover`` (n, 3), about."""
    if len(cover) != len(received):
        return False
    residual = apply(similarity(received, cover), received) - cover
    return bool(np.sqrt(np.mean(np.sum(residual**2, axis=1))) < _FITS * diagonal(cover))


def match_vertices(cover: Floats, received: Floats) -> Ints:
    """For each vertex of the ``cover`` (n, 3), the index of its counterpart in ``received`` (m, 3): an array (n,)."""
    if numbered_alike(cover, received):
        return np.arange(len(cover))
    aligned = apply(align(received, cover), received)
    return np.asarray(cKDTree(aligned).query(cover)[1], np.int64)


def align(source: Floats, target: Floats) -> Floats:
    """The similarity (4, 4) that lays the points ``source`` on ``target`` from any pose and scale, unmirrored."""
    tree = cKDTree(target)

    def misfit(matrix: Floats) -> float:
        return float(np.mean(tree.query(apply(matrix, source))[0] ** 2))

    matrix = min(_by_principal_axes(source, target), key=misfit)
    for _ in range(_ROUNDS):
        matrix = similarity(source, target[tree.query(apply(matrix, source))[1]])
    return matrix


def step_along(points: Floats, normals: Floats, gap: Floats, weight: Floats) -> Floats:
    """The small similarity (4, 4) that moves ``points`` (n, 3) by ``gap`` (n,) along ``normals``, by least squares."""
    centre = points.mean(axis=0)
    J = motions(points - centre, normals)
    lever = np.sqrt(np.mean(np.sum((points - centre) ** 2, axis=1)))
    ridge = _RIDGE * len(points) * np.diag([1.0, 1.0, 1.0, lever**2, lever**2, lever**2, lever**2])
    motion = np.linalg.solve((J.T * weight) @ J + ridge, (J.T * weight) @ gap)
    return small_similarity(np.asarray(motion, np.float64), centre)


def motions(offsets: Floats, normals: Floats) -> Floats:
    """Motion (n, 7) along ``normals`` of points at ``offsets`` (n, 3): per translation, rotation vector, log scale."""
    return np.concatenate(
        [normals, np.cross(offsets, normals), np.einsum("nd,nd->n", offsets, normals)[:, None]], axis=1
    )


def small_similarity(motion: Floats, centre: Floats) -> Floats:
    """The similarity (4, 4) of a ``motion`` (7,), as in `motions`, about ``centre`` (3,)."""
    a, b, c = motion[3:6]
    angle = float(np.linalg.norm(motion[3:6]))
    cross = np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]])
    sine, versine = np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2
    matrix = np.eye(4)
    matrix[:3, :3] = np.exp(motion[6]) * (np.eye(3) + sine * cross + versine * cross @ cross)  # Rodrigues
    matrix[:3, 3] = centre + motion[:3] - matrix[:3, :3] @ centre
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
    centre = points.mean(axis=0)
    offset = points - centre
    axes = np.linalg.eigh(offset.T @ offset)[1]
    axes[:, 2] *= np.linalg.det(axes)  # right-handed
    return centre, float(np.sqrt(np.mean(np.sum(offset**2, axis=1)))), axes
