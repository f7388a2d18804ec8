"""A bit in the norms of the coarsest wavelet coefficients, in the order of the norms of the normals of base edges.

Hamidi, El Haziti, Cherifi, Aboutajdine, "A robust blind 3-D mesh watermarking based on wavelet transform for copyright
protection", ATSIP 2017 (arXiv 1911.03793).
"""

from dataclasses import dataclass

import numpy as np

from o3dmark.arrays import Ints
from o3dmark.methods import METHODS
from o3dmark.methods._wavelet_norms import Multiresolution, WaveletNormsMethod
from o3dmark.registry import option


@METHODS.register("hamidi2017")
@dataclass(frozen=True)
class Hamidi2017(WaveletNormsMethod):
    """The norms of coarsest wavelet coefficients, by edge-normal norm (Hamidi et al. 2017); blind; semi-regular.

    Invariant to similarities, to the order of vertices and triangles, and to further 1-to-4 subdivision at midpoints.
    Cannot survive another change of connectivity, nor cropping.

    Reconstructed from the abstract: the quantiser (SCS), step and gamma; an edge's normal as the sum of the area
    vectors of its two base triangles; a block of successive edges for a bit.
    """

    claims = ("identity", "reorder", "similarity", "noise:amplitude=0.001", "subdivide:scheme=midpoint")

    gamma: float = option(0.85, "share of the way to the codeword; 1: plain quantisation (QIM)")

    def order(self, mesh: Multiresolution) -> Ints:
        """All base edges, by the descending norm of their normals."""
        return np.argsort(-np.linalg.norm(mesh.edge_area_vectors, axis=1), kind="stable")
