"""The price of a motion: how far the surface goes, and how much it bends where it is smooth.

A motion that is least by mean square alone shows: planes wave, and reflections break. With a price on bending it is
smooth where the surface is, and planes move and tilt as wholes. Creases may open or close a little, which nobody sees;
so that the planes beside them stay plane, their vertices may go anywhere, and not along an averaged normal only.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from o3dmark.arrays import Bools, Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.motion.hinges import Hinges

# Chosen on fandisk, fandisk_large, joint, casting, rocker_arm, bimba, cup, max_planck and ant, one key each, lengths
# over the frame's scale, about the radius of gyration: more stiffness makes steps shorter, less shows.
_STIFFNESS = 2e-5  # of every surface, as the price of bending over that of motion
_FLAT_STIFFNESS = 3e-4  # more of it, where the surface is flat; with 8e-4 steps of machine parts are a quarter shorter
_FLAT = 1e-4  # roughness at which that has fallen to half
_CREASE = np.radians(20.0)  # of a hinge, where its price has fallen to 1/e
_SHARP = np.radians(25.0)  # of a hinge from which on its vertices may go anywhere
_RINGS = 4  # triangles around one that say how rough it is there
_MOST = 300_000  # vertices, above which bending has no price: factors of 112 642 take 5 s and 0.7 GiB, of more too much


@dataclass(frozen=True, eq=False)
class Motions:
    """The motions of n vertices that are made up of d ``directions`` (3 n, d), row 3 v + i for axis i of vertex v.

    What one costs is a quadratic form; see `least`.
    """

    directions: sp.csr_array
    _mass: Floats
    _factor: Any = None

    @classmethod
    def along(cls, normals: Floats, weights: Floats, movable: Bools) -> "Motions":
        """Each movable vertex along its normal (n, 3), its square counting with its weight (n,), and nothing else."""
        free = np.flatnonzero(movable)
        return cls(_directions(normals, free, free[:0]), weights[free])

    @classmethod
    def unseen(cls, vertices: Floats, triangles: Ints, normals: Floats, weights: Floats, movable: Bools) -> "Motions":
        """The same, and in any direction at creases; bending costs besides, where the surface is smooth.

        Errors: MeshError where parts of the mesh are out of all proportion.
        """
        if len(vertices) > _MOST:
            return cls.along(normals, weights, movable)
        hinges = Hinges.of(triangles)
        angle = hinges.angles(vertices, triangles)
        sharp = np.zeros(len(vertices), bool)
        sharp[hinges.edge[np.abs(angle) > _SHARP]] = True
        flat = 1.0 / (1.0 + (roughness(vertices, triangles, hinges) / _FLAT) ** 2)
        change, price = hinges.bending(vertices, triangles)
        price *= np.exp(-((angle / _CREASE) ** 2)) * (_STIFFNESS + _FLAT_STIFFNESS * flat[hinges.triangle].prod(axis=1))
        free = [np.flatnonzero(movable & ~sharp), np.flatnonzero(movable & sharp)]
        directions = _directions(normals, *free)
        mass = np.concatenate([weights[free[0]], np.repeat(weights[free[1]], 3)])
        bent = change @ directions
        form = sp.diags_array(mass) + bent.T @ (sp.diags_array(price) @ bent)
        try:  # symmetric and positive: no pivoting
            factor = splu(form.tocsc(), "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        except RuntimeError:
            raise MeshError("the surface cannot be moved: parts of it are out of all proportion") from None
        return cls(directions, mass, factor)

    def least(self, pulls: Floats) -> Floats:
        """The form's inverse times each of the pulls (K, d): motions (K, d), cheapest for what they do along them."""
        if self._factor is None:
            return np.asarray(pulls / self._mass)
        return np.asarray(self._factor.solve(np.ascontiguousarray(pulls.T)).T)


def roughness(vertices: Floats, triangles: Ints, hinges: Hinges) -> Floats:
    """How far from smooth the surface is around each triangle (m,): one minus the length of the mean unit normal.

    0 in a plane; about r^2 / 4 within a distance r of a triangle, over the radius of a ball. Means do not reach over
    creases.
    """
    vectors = geometry.area_vectors(vertices, triangles)
    weight = np.linalg.norm(vectors, axis=1)
    one, other = hinges.triangle.T
    link = np.exp(-((hinges.angles(vertices, triangles) / _CREASE) ** 2))
    ends = np.concatenate([one, other]), np.concatenate([other, one])
    neighbours = sp.csr_array((np.concatenate([link, link]), ends), shape=(len(triangles), len(triangles)))
    for _ in range(_RINGS):
        vectors, weight = vectors + neighbours @ vectors, weight + neighbours @ weight
    length = np.linalg.norm(vectors, axis=1)
    return np.asarray(1.0 - np.divide(length, weight, out=np.ones_like(length), where=weight > 0.0))


def _directions(normals: Floats, along: Ints, anywhere: Ints) -> sp.csr_array:
    """A column for each vertex that moves along its normal, then three for each that may go anywhere."""
    vertices = np.concatenate([along, np.repeat(anywhere, 3)])
    ways = np.concatenate([normals[along], np.tile(np.eye(3), (len(anywhere), 1))])
    directions = geometry.motions_along(vertices[:, None], ways[:, None], len(normals)).T.tocsr()
    directions.eliminate_zeros()
    return directions
