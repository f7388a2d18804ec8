"""Whether an eye can tell two meshes apart by their shading, in just noticeable differences.

A turn of the normal by d radians changes the light of a matt surface by about the share d. Whether that is seen
hangs on how wide the change is, and on what else there is: wide, slow changes are hard to see, and so are those in the
midst of others as strong.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import cg

from o3dmark.arrays import Floats
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface
from o3dmark.metrics import METRICS, Metric
from o3dmark.metrics.displacement import paired
from o3dmark.registry import option

_FINEST, _BANDS = 0.005, 4  # standard deviation of the finest blur, over the diagonal; bands, each twice as wide
_SENSITIVITY = 200.0  # at its best: a contrast of half a per cent is seen
_MASKING = 0.7  # exponent by which the threshold rises with the contrast that is there
_GAIN = 0.45  # of a wave, in all bands together: that of blurs by t and 4 t alone is a third at most
_TOLERANCE = 1e-3  # of a blurred signal
_WAVE = 7.5  # length of the waves that a band shows best, over its width


@METRICS.register("jnd")
@dataclass(frozen=True)
class JND(Metric):
    """How many just noticeable differences the shading changes by, at the place that 95 % of the surface stay below.

    1 is at the threshold: half of the viewers who look for it there would find it. Normals are compared in bands of
    scale; the threshold of each follows from how sensitive eyes are to such waves, and rises with the reference's own
    contrast there. Needs the same triangles over the same vertices in the same order. Matt surfaces only: a mirror
    shows far smaller changes, see `reflection`. Source: Mannos and Sakrison 1974, The effects of a visual fidelity
    criterion on the encoding of images (sensitivity); Legge and Foley 1980, Contrast masking in human vision.
    """

    needs_equal_connectivity: ClassVar[bool] = True

    angle: float = option(30.0, "degrees that the mesh's diagonal takes up to the eye")
    share: float = option(0.95, "of the surface, that stays below the value")

    def __post_init__(self) -> None:
        if not (0 < self.angle <= 180 and 0 < self.share <= 1):
            raise ValueError("wants angle in 0 .. 180 degrees and share in 0 .. 1")

    def __call__(self, reference: Any, distorted: Any) -> float:
        pair = paired(reference, distorted)
        local, area = self.local(pair.surface, pair.moved), pair.surface.vertex_areas
        order = np.argsort(local)
        below = np.cumsum(area[order]) / area.sum()
        return float(local[order[min(int(np.searchsorted(below, self.share)), len(order) - 1)]])

    def local(self, before: Surface, after: Surface) -> Floats:
        """The same at each vertex (n,) of a surface and the same surface moved."""
        signals = np.concatenate([after.normals - before.normals, before.normals], axis=1)
        blur, squares = _Blur(before), np.zeros(len(before.vertices))
        for band in range(_BANDS):
            width = _FINEST * 2.0**band
            deviation = 2.0 * width * before.diagonal
            finer, signals = signals, blur(signals, deviation)
            energy = (finer - signals) ** 2 / _GAIN**2
            around = blur(np.stack([energy[:, :3].sum(axis=1), energy[:, 3:].sum(axis=1)], axis=1), deviation)
            contrast, mask = 2.0 * np.maximum(around.T, 0.0)  # squared, as high as waves rise: twice the mean square
            threshold = 1.0 / (_SENSITIVITY * _relative_sensitivity(1.0 / (self.angle * _WAVE * width)))
            squares += contrast / threshold**2 / np.maximum(1.0, mask / threshold**2) ** _MASKING
        return np.asarray(np.sqrt(squares))


def _relative_sensitivity(frequency: float) -> float:
    """Of the eye to waves of so many cycles a degree, over that at its best; Mannos and Sakrison's fit."""
    return float(2.6 * (0.0192 + 0.114 * frequency) * np.exp(-((0.114 * frequency) ** 1.1)))


class _Blur:
    """Diffusion over a surface, by one implicit step: its cost grows little with the width."""

    def __init__(self, surface: Surface) -> None:
        edges, n = geometry.edges(surface.triangles), len(surface.vertices)
        one, other = np.concatenate([edges, edges[:, ::-1]]).T
        self._edge2 = float(np.mean(np.sum((surface.vertices[one] - surface.vertices[other]) ** 2, axis=1)))
        self._joined = sp.csr_array((np.ones(len(one)), (one, other)), shape=(n, n))
        self._degree = np.asarray(self._joined.sum(axis=1), np.float64)

    def __call__(self, signals: Floats, deviation: float) -> Floats:
        """Signals (n, d) blurred by so much, in the unit of the vertices."""
        t = deviation**2 / self._edge2  # a step to the neighbours' mean has the variance of an edge
        form = sp.diags_array((1.0 + t) * self._degree) - t * self._joined
        easy = sp.diags_array(1.0 / ((1.0 + t) * self._degree))
        columns = [cg(form, self._degree * each, x0=each, rtol=_TOLERANCE, M=easy)[0] for each in signals.T]
        return np.stack(columns, axis=1)
