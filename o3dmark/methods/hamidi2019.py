"""A bit in the norms of the coarsest wavelet coefficients of salient base edges, in the order of their distances.

Hamidi, Chetouani, El Haziti, El Hassouni, Cherifi, "Blind robust 3D mesh watermarking based on mesh saliency and
wavelet transform for copyright protection", Information 10 (2), 67, 2019.
"""

from dataclasses import dataclass

import numpy as np

from o3dmark.arrays import Ints
from o3dmark.mesh.saliency import Saliency
from o3dmark.methods import METHODS
from o3dmark.methods._wavelet_norms import Multiresolution, WaveletNormsMethod
from o3dmark.registry import option


@METHODS.register("hamidi2019")
@dataclass(frozen=True)
class Hamidi2019(WaveletNormsMethod):
    """QIM on the norms of wavelet coefficients at salient points (Hamidi et al. 2019); blind; semi-regular.

    Invariant to similarities, to the order of vertices and triangles, and to further 1-to-4 subdivision at midpoints.
    Cannot survive another change of connectivity, nor cropping.

    Reconstructed from the abstract: salient points as the midpoints of base edges, with the mean saliency of their ends
    in the base mesh, which the mark does not move; the share of them; the step; a block of successive ones for a bit.
    """

    claims = ("identity", "reorder", "similarity", "noise:amplitude=0.001", "subdivide:scheme=midpoint")

    share: float = option(0.7, "salient share of the base edges")
    reach: float = option(0.25, "epsilon of the base mesh's saliency, over its mean edge")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (0 < self.share <= 1 and self.reach > 0):
            raise ValueError(f"share must lie in (0, 1] and reach be positive, not {self.share} and {self.reach}")

    def order(self, mesh: Multiresolution) -> Ints:
        """The salient base edges, those with midpoints far from the centre first."""
        epsilon = self.reach * float(mesh.lengths.mean()) / mesh.base.diagonal  # in all, a rotation changes nothing
        saliency = Saliency(epsilon=epsilon).of_surface(mesh.base)[mesh.edges].mean(axis=1)
        salient = np.argsort(-saliency, kind="stable")[: round(self.share * len(saliency))]
        base = mesh.wavelets.base
        distance = np.linalg.norm(base[mesh.edges[salient]].mean(axis=1) - base.mean(axis=0), axis=1)
        return salient[np.argsort(-distance, kind="stable")]
