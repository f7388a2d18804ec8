"""Fast mesh perceptual distance: how much rougher or smoother one mesh looks than another.

Wang, Torkhani, Montanvert, "A fast roughness-based approach to the assessment of 3D mesh visual quality" (Computers &
Graphics, 2012). Roughness is the Laplacian of the Gaussian curvature; a power law stands for the eye. The definition
and every constant are taken from the authors' own program, as two public repositories keep it; the article's text could
not be reached. Left out of it: an absolute 1e-10 below which it calls an edge zero.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from o3dmark.arrays import Floats
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface
from o3dmark.metrics import METRICS, Metric

_LEAST, _MOST = 0.0005, 0.20  # roughness, in radians, is clamped to this range,
_MOST_OF_MEAN = 5.0  # or up to this many times the smoother mesh's mean where that is more
_EXPONENT = 0.15  # of the power law
_MASKED = 0.5  # weight of roughness beyond the smoother mesh's mean: rough parts mask
_SCALE = 8.0  # brings the distances of the authors' test meshes into [0, 1]
_COTANGENTS = 0.001, 1000.0  # each half cotangent is clamped to this range


@METRICS.register("fmpd")
@dataclass(frozen=True)
class FMPD(Metric):
    """Fast mesh perceptual distance in [0, 1]: the difference of both global roughnesses.

    Any two meshes can be compared, and swapping them changes nothing. Being the difference of two totals, it is zero
    also for meshes that are equally rough in different places. Without unit, blind to scale. Source: Wang, Torkhani and
    Montanvert 2012, A fast roughness-based approach to the assessment of 3D mesh visual quality.
    """

    def __call__(self, reference: Any, distorted: Any) -> float:
        surfaces = Surface.of(reference), Surface.of(distorted)
        local = [roughness(surface) for surface in surfaces]
        mean = min(_area_mean(r, surface) for r, surface in zip(local, surfaces, strict=True))
        seen = [_area_mean(_perceived(r, mean), surface) for r, surface in zip(local, surfaces, strict=True)]
        return min(_SCALE * abs(seen[0] - seen[1]), 1.0)


def roughness(surface: Surface) -> Floats:
    """Local roughness (n,) in radians: how far |angle defect| is from its cotangent-weighted mean over the neighbours.

    The defect counts from 2 pi, on the boundary from pi. No length enters: similar meshes are equally rough.
    """
    n = len(surface.vertices)
    angles = geometry.angles(surface.vertices, surface.triangles)
    cotangents = geometry.cotangents(surface.vertices, surface.triangles)
    full = np.where(geometry.boundary_vertices(surface.triangles, n), np.pi, 2.0 * np.pi)
    defect = np.abs(full - np.bincount(surface.triangles.ravel(), angles.ravel(), minlength=n))
    i, j = np.roll(surface.triangles, -1, axis=1).ravel(), np.roll(surface.triangles, -2, axis=1).ravel()
    weights = sp.csr_array((np.clip(0.5 * cotangents, *_COTANGENTS).ravel(), (i, j)), shape=(n, n))
    weights = weights + weights.T
    return np.asarray(np.abs(defect - weights @ defect / weights.sum(axis=1)))


def _area_mean(values: Floats, surface: Surface) -> float:
    return float(surface.vertex_areas @ values / surface.area)


def _perceived(local: Floats, mean: float) -> Floats:
    """Roughness as seen: a power law, flatter beyond ``mean``, the mean roughness of the smoother mesh."""
    seen = np.clip(local, _LEAST, max(_MOST, _MOST_OF_MEAN * mean)) ** _EXPONENT - _LEAST**_EXPONENT
    knee = max(mean, _LEAST) ** _EXPONENT - _LEAST**_EXPONENT
    return np.where(seen > knee, knee + _MASKED * (seen - knee), seen)
