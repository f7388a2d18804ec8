"""A bit in the mean of each bin of the norms of salient vertices.

Nakazawa, Kasahara, Takahashi, "A visually enhanced approach to watermarking 3D models", IIH-MSP 2010.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from o3dmark.arrays import Bools
from o3dmark.mesh.saliency import Saliency
from o3dmark.mesh.surface import Surface
from o3dmark.methods import METHODS
from o3dmark.methods._norm_bins import Mean, NormBinsMethod, Statistic
from o3dmark.registry import option


@METHODS.register("nakazawa2010")
@dataclass(frozen=True)
class Nakazawa2010(NormBinsMethod):
    """cho2007-mean on the vertices on one side of a threshold on mesh saliency (Nakazawa et al. 2010); blind.

    Invariant to similarities (but for the axis-aligned box that saliency is scaled by) and to the order of vertices and
    triangles. Cannot survive cropping, uneven remeshing or simplification, nor strong noise: it exchanges much of the
    salient set.

    Reconstructed: which side of the threshold is meant, the threshold (a share of the vertices), alpha, that the bins
    are those of all norms, and what cho2007-mean lists. The key is ours.
    """

    claims = ("identity", "reorder", "similarity", "noise:amplitude=0.0005", "quantise:bits=11")
    statistic: ClassVar[Statistic] = Mean()

    side: Literal["above", "below"] = option("above", "vertices with more saliency than the threshold, or with less")
    share: float = option(0.5, "share of the vertices on that side")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.share <= 1:
            raise ValueError(f"share must lie in (0, 1], not {self.share}")

    def carriers(self, surface: Surface) -> Bools:
        """See `NormBinsMethod.carriers`: the vertices on one side of the threshold."""
        saliency = Saliency().of_surface(surface)
        first = -saliency if self.side == "above" else saliency
        chosen = np.zeros(len(saliency), bool)
        chosen[np.argsort(first, kind="stable")[: round(self.share * len(saliency))]] = True
        return chosen
