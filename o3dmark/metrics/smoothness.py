"""What a shiny surface shows of a motion: planes that wave, curvature that changes, reflections that turn.

All of them look at edges where the reference does not crease, and need the same triangles over the same vertices in the
same order, as `displacement.paired` says.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from o3dmark.arrays import Floats, Ints
from o3dmark.mesh import geometry
from o3dmark.metrics import METRICS, Metric
from o3dmark.metrics.displacement import paired
from o3dmark.motion.hinges import Hinges
from o3dmark.registry import option


@METRICS.register("planes")
@dataclass(frozen=True)
class Planes(Metric):
    """By how much the triangles of a plane tilt against each other, in degrees; 0 where the reference has no plane.

    The mean, by area, of how far the difference of a triangle's normal from the mean normal of its plane changes. A
    plane that moves or tilts as a whole counts nothing. Source: defined here.
    """

    needs_equal_connectivity: ClassVar[bool] = True

    tolerance: float = option(0.1, "degrees between neighbours' normals, up to which they are of one plane")
    share: float = option(0.005, "of the surface, that a plane has at least; it has 8 triangles at least")

    def __post_init__(self) -> None:
        if not (0 <= self.tolerance < 90 and 0 <= self.share <= 1):
            raise ValueError("wants tolerance in 0 .. 90 degrees and share in 0 .. 1")

    def __call__(self, reference: Any, distorted: Any) -> float:
        pair = paired(reference, distorted)
        triangles = pair.surface.triangles
        hinges, size = Hinges.of(triangles), geometry.areas(pair.surface.vertices, triangles)
        flat = np.abs(hinges.angles(pair.surface.vertices, triangles)) <= np.radians(self.tolerance)
        joined = sp.coo_array((np.ones(flat.sum()), hinges.triangle[flat].T), shape=(len(triangles), len(triangles)))
        count, plane = connected_components(joined, directed=False)
        counts = (np.bincount(plane, minlength=count) >= 8) & (np.bincount(plane, size) >= self.share * size.sum())
        inside = counts[plane]
        if not inside.any():
            return 0.0
        before, after = (_from_the_mean(each.vertices, triangles, plane) for each in (pair.surface, pair.moved))
        tilt = np.degrees(np.linalg.norm(after - before, axis=1))
        return float(np.average(tilt[inside], weights=size[inside]))


def _from_the_mean(vertices: Floats, triangles: Ints, plane: Ints) -> Floats:
    """Each triangle's unit normal less the mean one of its plane (m, 3)."""
    vectors = geometry.area_vectors(vertices, triangles)
    mean = geometry.unit(np.stack([np.bincount(plane, column) for column in vectors.T], axis=1))
    return np.asarray(geometry.unit(vectors) - mean[plane])


@METRICS.register("bending")
@dataclass(frozen=True)
class Bending(Metric):
    """Root mean square of the change of curvature where the reference does not crease, times its diagonal.

    By the angles between neighbouring triangles: right for equilateral ones, up to 1.75 times too large for
    halves of squares. Source: Grinspun, Hirani, Desbrun and Schroeder 2003, Discrete shells.
    """

    needs_equal_connectivity: ClassVar[bool] = True

    crease: float = option(20.0, "degrees between neighbours' normals, from which on they make a crease")

    def __call__(self, reference: Any, distorted: Any) -> float:
        pair = paired(reference, distorted)
        hinges, triangles = Hinges.of(pair.surface.triangles), pair.surface.triangles
        before, after = (hinges.angles(v, triangles) for v in (pair.surface.vertices, pair.moved.vertices))
        smooth = np.abs(before) < np.radians(self.crease)
        change = np.angle(np.exp(1j * (after - before)))[smooth]
        prices = hinges.prices(pair.surface.vertices, triangles)
        about = geometry.areas(pair.surface.vertices, triangles)[hinges.triangle[smooth]].sum() / 3.0
        energy = prices[smooth] @ change**2 / 3.0
        return float(np.sqrt(energy / about) * pair.surface.diagonal) if about else 0.0


@METRICS.register("reflection")
@dataclass(frozen=True)
class Reflection(Metric):
    """By how many degrees reflected rays turn: twice the root mean square, by area, of the turn of the normals.

    A reflection line, or the stripe of a zebra view, shifts by as much as the light that it is the picture of. Source:
    Klass 1980, Correction of local surface irregularities using reflection lines.
    """

    needs_equal_connectivity: ClassVar[bool] = True

    def __call__(self, reference: Any, distorted: Any) -> float:
        pair = paired(reference, distorted)
        before, after = (geometry.area_vectors(s.vertices, pair.surface.triangles) for s in (pair.surface, pair.moved))
        sine = np.linalg.norm(np.cross(before, after), axis=1)
        turn = np.degrees(np.arctan2(sine, np.einsum("md,md->m", before, after)))
        return float(2.0 * np.sqrt(np.average(turn**2, weights=np.linalg.norm(before, axis=1))))
