"""The quadratic programme over bins of distances, with the mesh saliency as what a motion costs.

Son, Kim, Choi, Jang, Choi, "Perceptual 3D watermarking using mesh saliency", Information Science and Applications
(ICISA), 2017.
"""

from dataclasses import dataclass

import numpy as np

from o3dmark.arrays import Floats
from o3dmark.mesh.saliency import Saliency
from o3dmark.mesh.surface import Surface
from o3dmark.methods import METHODS
from o3dmark.methods._bin_program import BinProgrammeMethod, Distances

_LEAST_SALIENCY = 0.1  # added to saliency over its mean, so that no motion is free


@METHODS.register("son2017")
@dataclass(frozen=True)
class Son2017(BinProgrammeMethod):
    """The programme of rolland2014 with costs that grow with mesh saliency (Son, Kim, Choi, Jang and Choi 2017); blind.

    Invariant to similarities and to the order of vertices and triangles; centre and means are integrals, so that they
    hardly notice other triangles on the same surface. Cannot survive cropping, nor what moves the extreme distances.

    Reconstructed: the published strength, cost as saliency over its mean and a tenth, and what rolland2014 lists. The
    key is ours.
    """

    claims = ("identity", "reorder", "similarity", "noise:amplitude=0.003", "quantise:bits=9", "smooth:iterations=5")

    def directions(self, surface: Surface) -> Floats:
        return Distances.of(surface).u

    def costs(self, surface: Surface, directions: Floats) -> Floats:  # noqa: ARG002
        saliency = Saliency().of_surface(surface)
        return np.asarray(_LEAST_SALIENCY + saliency / max(float(saliency.mean()), 1e-300))
