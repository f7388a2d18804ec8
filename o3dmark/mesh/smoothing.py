"""Smoothing undone: the inverse of a known polynomial of a mesh's umbrella operator.

Smoothing with umbrella weights multiplies each eigenvector of L = I - D^-1 A (D^-1 A takes a vertex to the mean of its
neighbours) by a transfer function h(x) of its eigenvalue x, 0 <= x <= 2, and so can be undone by multiplying with

    f(x) = h (1 + e) / (h^2 + e),    e = 1 / (4 gain^2)

which is 1 / h where the smoothing left something, and small where it did not: no detail grows by more than about
``gain``. The Chebyshev polynomials of L, applied to the coordinates once, serve any number of such functions.
"""

from collections.abc import Callable

import numpy as np
from numpy.polynomial import chebyshev

from o3dmark.arrays import Floats
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface

Transfer = Callable[[Floats], Floats]
_DEGREE = 64  # resolves gains of 1000 for umbrella, about 30 for Taubin and 8 for HC, whose transfers have zeros


def umbrella(steps: float, factor: float) -> Transfer:
    """``steps`` passes of v <- v + factor (mean of the neighbours - v)."""
    return lambda x: (1.0 - factor * x) ** steps


def taubin(steps: float, forth: float, back: float) -> Transfer:
    """``steps`` double passes, one with the factor ``forth`` and one with the negative ``back`` (Taubin 1995)."""
    return lambda x: np.maximum((1.0 - forth * x) * (1.0 - back * x), 0.0) ** steps


def hc(steps: float) -> Transfer:
    """``steps`` passes of the HC algorithm with alpha 0 and beta 1/2 (Vollmer et al. 1999)."""
    return lambda x: (1.0 - 0.5 * x * x) ** steps


class InverseSmoothing:
    """A surface whose smoothing is to be undone in many ways.

    Vertices on the boundary are taken to have stayed where they were, as smoothing usually leaves them.
    """

    def __init__(self, surface: Surface) -> None:
        self._centre = surface.vertices.mean(axis=0)
        self._basis = _chebyshev_basis(surface, surface.vertices - self._centre)

    def undo(self, transfer: Transfer, gain: float) -> Floats:
        """The vertices (n, 3) before a smoothing with ``transfer``."""
        nodes = chebyshev.chebpts1(_DEGREE + 1)
        h, e = transfer(nodes + 1.0), 0.25 / gain**2
        coefficients = chebyshev.chebfit(nodes, h * (1.0 + e) / (h * h + e), _DEGREE)
        return np.asarray(self._centre + np.tensordot(coefficients, self._basis, axes=1))


def _chebyshev_basis(surface: Surface, x: Floats) -> Floats:
    """T_0 .. T_64 of L - I applied to x (n, 3): (65, n, 3)."""
    fixed = geometry.boundary_vertices(surface.triangles, len(x))[:, None]

    def shifted(y: Floats) -> Floats:
        return -np.where(fixed, y, surface.neighbour_mean @ y)

    basis = np.empty((_DEGREE + 1, *x.shape))
    basis[0], basis[1] = x, shifted(x)
    for k in range(2, _DEGREE + 1):
        basis[k] = 2.0 * shifted(basis[k - 1]) - basis[k - 2]
    return basis
