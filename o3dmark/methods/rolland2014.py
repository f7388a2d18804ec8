"""A bit in the mean of each bin of distances to the centre, by a quadratic programme over integrals of the surface.

Rolland-Nevière, Doërr, Alliez, "Triangle surface mesh watermarking based on a constrained optimization framework",
IEEE Transactions on Information Forensics and Security 9 (9), 2014.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from o3dmark.arrays import Floats
from o3dmark.mesh import curvature, geometry
from o3dmark.mesh.surface import Surface
from o3dmark.methods import METHODS
from o3dmark.methods._bin_program import BinProgrammeMethod, Distances
from o3dmark.registry import option

_LEAST_ROUGHNESS = 0.1  # added to roughness over its mean, so that smooth places cost ten times the mean at most
_LEAST_QUADRIC = 0.1  # added to the squared cosine: with 0.01, vertices of smooth meshes slid past one another


@METHODS.register("rolland2014")
@dataclass(frozen=True)
class Rolland2014(BinProgrammeMethod):
    """The cheapest motion that moves the means of bins of distances (Rolland-Nevière, Doërr and Alliez 2014); blind.

    Invariant to similarities and to the order of vertices and triangles; centre and means are integrals, so that they
    hardly notice other triangles on the same surface. Cannot survive cropping, nor what moves the extreme distances.

    Reconstructed: the published strength, the margin at the edges of bins, roughness as the change of the mean
    curvature, a diagonal of the quadrics, the rounds of linearisation. The key is ours.
    """

    claims = ("identity", "reorder", "similarity", "noise:amplitude=0.003", "quantise:bits=9", "smooth:iterations=5")

    along: Literal["radius", "normal"] = option("radius", "direction in which vertices move")
    weights: Literal["uniform", "roughness", "quadric"] = option("quadric", "what a motion costs")

    def directions(self, surface: Surface) -> Floats:
        return Distances.of(surface).u if self.along == "radius" else surface.normals

    def costs(self, surface: Surface, directions: Floats) -> Floats:
        if self.weights == "roughness":
            rough = roughness(surface)
            return np.asarray(1.0 / (_LEAST_ROUGHNESS + rough / max(float(rough.mean()), 1e-300)))
        return _LEAST_QUADRIC + quadrics(surface, directions) if self.weights == "quadric" else np.ones(len(directions))


def roughness(surface: Surface) -> Floats:
    """How far the mean curvature is from that of the neighbours (n,), averaged over these."""
    mean = curvature.taubin(surface.vertices, surface.triangles).mean
    around = surface.neighbour_mean
    return np.asarray(around @ np.abs(mean - around @ mean))


def quadrics(surface: Surface, directions: Floats) -> Floats:
    """Mean squared distance (n,) to the planes around each vertex, by area, when it moves by 1 along its direction."""
    normals = geometry.unit(surface.area_vectors)
    n = len(surface.vertices)
    cosine = np.einsum("mcd,md->mc", directions[surface.triangles], normals)
    total = np.bincount(surface.triangles.ravel(), (cosine**2 * surface.areas[:, None]).ravel(), minlength=n)
    return np.asarray(total / np.maximum(3.0 * surface.vertex_areas, 1e-300))
