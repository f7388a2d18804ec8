"""Undoing umbrella smoothing, the attack that a mark on vertices feels most.

One step of umbrella smoothing is v <- M v with M = I - lam (I - D^-1 A), whose eigenvalues lie in [1 - 2 lam, 1]: far
from zero, so n steps can be inverted. The inverse is a matrix function f(M), evaluated for many n at once through the
Chebyshev polynomials of M, which are applied to the coordinates only once. Its gain is limited, because the finest
details of a file that was rounded, or made noisy, after the smoothing must not be blown up:

    f(m) = m^n (1 + e) / (m^2n + e),    e = 1 / (4 gain^2)
"""

from collections.abc import Sequence

import numpy as np
from numpy.polynomial import chebyshev

from o3dmark import geometry
from o3dmark.geometry import Floats
from o3dmark.mesh import Surface

_DEGREE = 64


def unsmooth(surface: Surface, steps: Sequence[float], *, lam: float = 0.1, gain: float = 1000.0) -> list[Surface]:
    """The surface before 1, 2, ... umbrella smoothing steps: one surface for each number in ``steps``.

    ``lam`` in (0, 0.5) is the attack's factor; border vertices are taken to have stayed in place, as the attack leaves
    them; ``gain`` bounds the amplification of any detail.
    """
    low = 1.0 - 2.0 * lam
    fixed = geometry.border_vertices(surface.triangles, len(surface.vertices))

    def shifted(x: Floats) -> Floats:
        """(2 M - low - 1) x / (1 - low): the operator with its spectrum moved to [-1, 1]."""
        y = x + lam * (surface.neighbour_mean @ x - x)
        y[fixed] = x[fixed]
        return np.asarray((2.0 * y - (low + 1.0) * x) / (1.0 - low))

    e = 0.25 / gain**2

    nodes = chebyshev.chebpts1(_DEGREE + 1)
    coefficients = []
    for n in steps:
        power = (0.5 * ((1.0 - low) * nodes + low + 1.0)) ** n
        coefficients.append(chebyshev.chebfit(nodes, power * (1.0 + e) / (power**2 + e), _DEGREE))
    origin = surface.vertices.mean(axis=0)
    previous, current = surface.vertices - origin, shifted(surface.vertices - origin)
    results = [c[0] * previous + c[1] * current for c in coefficients]
    for k in range(2, _DEGREE + 1):
        previous, current = current, 2.0 * shifted(current) - previous
        for result, c in zip(results, coefficients, strict=True):
            result += c[k] * current
    return [surface.moved(origin + result) for result in results]
