"""Functions on the unit disk that neither offset, tilt nor curvature of the surface below reaches.

    f(r, theta) = G(r) exp(-i m theta),      G a combination of J_m(a r) t(r) at the zeros a of J_m

The taper t lets them end smoothly at the rim. Each radial part is orthogonal to r^m, r^(m+2), ... up to the third
degree, so that a cubic surface has the coefficient zero, and one that is seen from a place a little aside nearly the
same coefficients. For each m the combinations are those of least wave number, sqrt(Dirichlet energy / square integral).
"""

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import scipy.linalg
from scipy import special

from o3dmark.arrays import Floats, Ints
from o3dmark.methods.local_patches.format import PatchFormat, smooth_end

_HIGHEST_ORDER = 16  # of m looked at: the wave numbers of those beyond are above all that are used
_HIGHEST_ZERO = 40.0
_NODES = 160  # of the quadrature along a radius
_TABLE = 2048  # intervals of the radial tables


@dataclass(frozen=True, eq=False)
class DiskFunctions:
    """The functions in the sequence of their order m (q,) and wave number (q,), that over the radius.

    Column k of the radial ``table`` (q, s) is the radial part at r = k / (s - 1); the square integral of each function
    over the disk, as a complex one, is pi.
    """

    order: Ints
    wave_number: Floats
    table: Floats

    @cached_property
    def by_radius(self) -> Floats:
        """The table with a row for each radius (s, q)."""
        return np.ascontiguousarray(self.table.T)

    @property
    def n_real(self) -> int:
        """Real coefficients that they have: one where m is 0, two elsewhere."""
        return int((1 + (self.order > 0)).sum())


@cache
def disk_functions(form: PatchFormat) -> DiskFunctions:
    """The functions of least wave number that together have the format's real coefficients, or one more."""
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    r, w = 0.5 * (nodes + 1.0), 0.25 * weights * (nodes + 1.0)  # of integrals of g(r) r dr over 0 .. 1
    found = [each for m in range(_HIGHEST_ORDER) for each in _radial(form, m, r, w)]
    found.sort(key=lambda each: each[1])
    real = np.cumsum([1 + (m > 0) for m, _, _ in found])
    kept = sorted(found[: int(np.searchsorted(real, form.n_real)) + 1], key=lambda each: each[:2])
    order, wave_number, table = zip(*kept, strict=True)
    return DiskFunctions(np.array(order, np.int64), np.array(wave_number), np.array(table))


def _radial(form: PatchFormat, m: int, r: Floats, w: Floats) -> list[tuple[int, float, Floats]]:
    """The radial parts of an order, on the table's radii, with their wave numbers; radii and weights (s,) are those of
    a quadrature."""
    zeros = special.jn_zeros(m, 20)
    zeros = zeros[zeros < _HIGHEST_ZERO]
    values, slopes = _tapered(form.rim, m, zeros, r)
    free = np.eye(len(zeros))
    if m <= form.degree:
        moments = np.array([(values * w * r**power).sum(axis=1) for power in range(m, form.degree + 1, 2)])
        free = scipy.linalg.null_space(moments).T
    values, slopes = free @ values, free @ slopes
    energy = (slopes * w) @ slopes.T + (values * (w * m**2 / r**2)) @ values.T
    square, combination = scipy.linalg.eigh(energy, (values * w) @ values.T)
    table = combination.T @ free @ _tapered(form.rim, m, zeros, np.linspace(0.0, 1.0, _TABLE + 1))[0]
    first = np.abs(table) > 0.5 * np.abs(table).max(axis=1, keepdims=True)
    sign = np.sign(np.take_along_axis(table, first.argmax(axis=1)[:, None], axis=1))
    unit = np.sqrt(0.5)  # the eigenvectors have the integral of g^2 r dr at 1; the disk's is 2 pi times that
    return [(m, float(np.sqrt(s)), unit * row) for s, row in zip(square, sign * table, strict=True)]


def _tapered(rim: float, m: int, zeros: Floats, r: Floats) -> tuple[Floats, Floats]:
    """J_m(a r) t(r) and its derivative (z, q)."""
    taper, slope = smooth_end(r, rim)
    bessel, bessel_slope = special.jv(m, np.outer(zeros, r)), zeros[:, None] * special.jvp(m, np.outer(zeros, r))
    return bessel * taper, bessel_slope * taper + bessel * slope
