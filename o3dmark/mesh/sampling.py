"""Points drawn from a surface, uniform by area."""

from typing import NamedTuple

import numpy as np

from o3dmark.arrays import Floats, Ints
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface


class SurfacePoints(NamedTuple):
    """Points (q, 3) of a surface and the triangle (q,) that each lies in."""

    points: Floats
    triangle: Ints


def sampled(surface: Surface, count: int, rng: np.random.Generator) -> SurfacePoints:
    """``count`` points, independent of each other."""
    return _at(surface, rng.random(count), rng)


def stratified(surface: Surface, count: int, rng: np.random.Generator) -> SurfacePoints:
    """``count`` points, one from each of ``count`` equal shares of the area: more even, in the triangles' order."""
    return _at(surface, (np.arange(count) + rng.random(count)) / count, rng)


def _at(surface: Surface, shares: Floats, rng: np.random.Generator) -> SurfacePoints:
    """Points where the area of all triangles before has the given ``shares`` (q,) in the whole; random within them."""
    reach = np.cumsum(geometry.areas(surface.vertices, surface.triangles))
    triangle = np.minimum(np.searchsorted(reach, shares * reach[-1], side="right"), len(reach) - 1)
    a, b, c = surface.vertices[surface.triangles[triangle]].transpose(1, 0, 2)
    s, t = np.sqrt(rng.random((len(shares), 1))), rng.random((len(shares), 1))
    return SurfacePoints((1.0 - s) * a + s * (1.0 - t) * b + s * t * c, triangle)
