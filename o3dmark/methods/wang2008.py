"""A bit in the norms of the coarsest wavelet coefficients, in the order of the lengths of the base edges.

Wang, Lavoué, Denis, Baskurt, "Hierarchical watermarking of semiregular meshes based on wavelet transform", IEEE
Transactions on Information Forensics and Security 3 (4), 2008: the robust one of its three marks.
"""

from dataclasses import dataclass

import numpy as np

from o3dmark.arrays import Ints
from o3dmark.methods import METHODS
from o3dmark.methods._wavelet_norms import Multiresolution, WaveletNormsMethod
from o3dmark.registry import option


@METHODS.register("wang2008")
@dataclass(frozen=True)
class Wang2008(WaveletNormsMethod):
    """SCS on the norms of coarsest wavelet coefficients, by base-edge length (Wang et al. 2008); blind; semi-regular.

    Invariant to similarities, to the order of vertices and triangles, and to further 1-to-4 subdivision at midpoints.
    Cannot survive another change of connectivity, nor cropping.

    Reconstructed: epsilon and gamma, a block of successive edges for a bit, the direction of a zero coefficient.
    """

    claims = ("identity", "reorder", "similarity", "noise:amplitude=0.001", "subdivide:scheme=midpoint")

    gamma: float = option(0.85, "share of the way to the codeword; 1: plain quantisation (QIM)")

    def order(self, mesh: Multiresolution) -> Ints:
        """All base edges, the longest first."""
        return np.argsort(-mesh.lengths, kind="stable")
