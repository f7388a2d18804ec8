"""A bit in the variance of each bin of vertex norms.

Cho, Prost, Jung, "An oblivious watermarking for 3-D polygonal meshes using distribution of vertex norms", IEEE
Transactions on Signal Processing 55 (1), 2007, method II.
"""

from dataclasses import dataclass
from typing import ClassVar

from o3dmark.methods import METHODS
from o3dmark.methods._norm_bins import NormBinsMethod, Statistic, Variance
from o3dmark.registry import option


@METHODS.register("cho2007-variance")
@dataclass(frozen=True)
class Cho2007Variance(NormBinsMethod):
    """A bit in the variance of each bin of vertex norms (Cho, Prost and Jung 2007, method II); blind.

    Invariant to similarities and to the order of vertices and triangles. Cannot survive what moves the mean of the
    vertices or the extreme norms: cropping, uneven remeshing or simplification.

    Reconstructed: that the first and the last bin are not used, and the rounds that hold the centre. The key is ours.
    """

    claims = ("identity", "reorder", "similarity", "noise:amplitude=0.003", "quantise:bits=9", "smooth:iterations=5")
    statistic: ClassVar[Statistic] = Variance()
    largest: ClassVar[float] = 0.3

    alpha: float = option(
        0.05, "by how much a bin's variance differs from 1/3, of norms in [-1, 1]; published 0.03 to 0.1"
    )
