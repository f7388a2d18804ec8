"""Whether an attacked mesh still tells which vertices are salient: Spearman's rank correlation with the cover.

A blind reader chooses its vertices by the saliency of the mesh that it gets, and only the order counts for that choice.
"""

from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from scipy.stats import spearmanr

from o3dmark.arrays import Floats, Ints
from o3dmark.mesh import similarity
from o3dmark.mesh.geometry import diagonal
from o3dmark.mesh.registration import align, numbered_alike

_FITS = 0.02  # RMS distance, over the cover's diagonal, below which a mesh is taken to lie where its cover lies
_PROBES = 5000  # vertices by which the pose is found: enough for it, and soon done


def rank_correlation(cover: Any, before: Floats, attacked: Any, after: Floats) -> float | None:
    """Spearman's rho between ``before`` (n,), the cover's saliency, and ``after`` (m,), the attacked mesh's.

    Over the vertices of the attacked mesh, each paired as `counterparts` says: what an attack cut away does not count,
    new vertices do. None where one of the two is constant, as on an exact sphere.
    """
    paired = before[counterparts(np.asarray(cover.vertices), np.asarray(attacked.vertices))]
    if not np.ptp(paired) or not np.ptp(after):
        return None
    return float(spearmanr(paired, after).statistic)


def counterparts(cover: Floats, attacked: Floats) -> Ints:
    """For each vertex of ``attacked`` (m, 3), the index of the vertex of ``cover`` (n, 3) that stands for it: (m,).

    - As many vertices on both sides, and a similarity that lays each on the one of its number: the number. The
      triangulation is as it was, in whatever pose.
    - Otherwise the nearest vertex of the cover, with the pose undone first: a mesh that lies on its cover as received
      (vertices renumbered, subdivided, simplified, cropped) is left there; any other is moved by the similarity of
      `registration.align` (principal axes, then iterated closest points with unknown scale). A fragment that was moved
      too, or a mesh with a foreign part, is not laid well by that; its correlation is a lower bound.
    """
    if numbered_alike(cover, attacked):
        return np.arange(len(cover))
    tree = cKDTree(cover)
    distance, nearest = tree.query(attacked)
    if np.sqrt(np.mean(distance**2)) > _FITS * diagonal(cover):
        pose = align(_probes(attacked), _probes(cover))
        nearest = tree.query(similarity.apply(pose, attacked))[1]
    return np.asarray(nearest, np.int64)


def _probes(points: Floats) -> Floats:
    """At most _PROBES of the points, evenly by number."""
    return points[:: -(-len(points) // _PROBES)]
