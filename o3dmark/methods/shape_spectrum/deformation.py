"""A solid that was stretched, sheared, bent or twisted a little: what its spectrum was before.

A deformation d (23,) moves a point x of the frame by E x + q(x): E the five strains that leave volume and pose alone, q
the 18 quadratic fields, of which bends and twists about any axis are made, to first order. It moves the frame as well,
which is derived from the moments; what is left of it after the mesh has been put into its frame again is nearly linear.
So 39 deformed solids give a surrogate of the spectrum, once a mesh and for every key:

    S(E, q) = S_0 + sum_i L_i E_i + sum_ij Q_ij E_i E_j + sum_k B_k q_k

A key's values under a deformation are then a product of small matrices. Of very many deformations those are fitted
whose values lie nearest to codewords. Which these are looks at the values modulo half a period, and says nothing about
the message: of all deformations tried, only the readings kept are charged against it.
"""

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit

from o3dmark.arrays import Floats, Ints
from o3dmark.methods.shape_spectrum.projections import Projections
from o3dmark.solid.frame import Frame, FrameRule
from o3dmark.solid.solid import Solid
from o3dmark.solid.spectrum import Band, Complex, Spectrum, band_rule

# Largest strains looked for, one range after the other, by the Frobenius norm: a stretch by 1 % has 0.0082
_STRAINS = (0.009, 0.018, 0.03)
_BENDS = 100_000  # bends and twists tried, half of them each
_CURVATURE = 0.035  # of the strongest, over the radius of gyration: 5 degrees over the 2.5 to 4 that a solid measures
_OFF_CENTRE = 0.25  # how far from the centroid their axes pass, over the radius of gyration
_STRAIN_STEP, _BEND_STEP = 0.02, 0.002  # deformations that the surrogate goes through
_COVERED = 0.09  # how far, in RMS periods, a strain may be from the nearest one tried
_D5_RADIUS = 0.75  # covering radius of the lattice D5*, the integers and the integers plus a half
_MOST = 200_000  # strains of a range; where the metric wants more, the largest are left out,
_TOO_MANY = 5_000_000  # and where so many more, all: values that answer so sharply are not those of a mark
_WORST = 1e10  # condition of the metric of strains
_CHUNK = 4096


@dataclass(frozen=True, eq=False)
class Surrogate:
    """Coefficients (39, M) of the spectrum: of 1, E_i, E_i E_j and q_k."""

    coefficients: Complex

    @classmethod
    def of(cls, band: Band, solid: Solid, rule: FrameRule, frame: Frame) -> "Surrogate":
        """From deformed solids. Errors: MeshError where one of them has no frame."""
        points = band_rule(band, frame.solid(solid))

        def spectrum(deformation: Floats) -> Complex:
            deformed = _deformed(solid, frame, deformation)
            return Spectrum.of_solid(band, rule.near(deformed, frame).solid(deformed), points=points).values

        strains = np.pad(_design(), ((0, 0), (0, 18)))
        found = np.array([spectrum(each) for each in strains])
        bends = np.pad(_BEND_STEP * np.eye(18), ((0, 0), (5, 0)))
        slopes = (np.array([spectrum(each) for each in bends]) - found[0]) / _BEND_STEP
        quadratic = np.linalg.solve(_monomials(strains)[:, :21], found)
        return cls(np.asarray(np.concatenate([quadratic, slopes]), np.complex128))

    def turned(self, band: Band, symmetry: Floats) -> "Surrogate":
        """The same with the axes permuted and flipped by ``symmetry`` (3, 3), deformations as they were given."""
        return Surrogate(Spectrum(band, self.coefficients).turned(symmetry).values)

    def measured(self, projections: Projections) -> "Values":
        """What a key's values are under each deformation."""
        return Values(projections(self.coefficients))


@dataclass(frozen=True, eq=False)
class Values:
    """A key's values as a function of the deformation: coefficients (39, K)."""

    coefficients: Floats

    def at(self, d: Floats) -> Floats:
        """The values (h, K) under deformations (h, 23)."""
        return np.asarray(_monomials(d) @ self.coefficients)

    def slope(self, d: Floats) -> Floats:
        """Their derivative (h, K, 23)."""
        strains = np.broadcast_to(self.coefficients[1:6].T, (len(d), self.coefficients.shape[1], 5)).copy()
        for pair, (a, b) in enumerate(zip(*_PAIRS, strict=True)):
            strains[:, :, a] += d[:, None, b] * self.coefficients[6 + pair]
            strains[:, :, b] += d[:, None, a] * self.coefficients[6 + pair]
        bends = np.broadcast_to(self.coefficients[21:].T, (*strains.shape[:2], 18))
        return np.concatenate([strains, bends], axis=2)

    def searches(self, step: float) -> "list[Search]":
        """What to try, the likeliest first: ever larger strains, then bends and twists; nothing for a solid without any
        answer to strains."""
        J = self.coefficients[1:6].T / step
        G = J.T @ J / len(J)  # a strain e changes the values by a mean square of e' G e, in periods
        if not np.isfinite(G).all() or np.linalg.cond(G) > _WORST:
            return []
        free: Floats = np.asarray(np.linalg.inv(G) * _COVERED**2)
        ranges = zip((0.0, *_STRAINS), _STRAINS, strict=False)
        found = [Search(np.pad(_strains(G, *each), ((0, 0), (0, 18))), free) for each in ranges]
        bends = _bends()
        covariance = np.cov(bends[:, 5:].T)
        size = (
            np.mean((self.coefficients[21:].T / step @ np.linalg.cholesky(covariance + 1e-18 * np.eye(18))) ** 2) * 18
        )
        prior = np.zeros((23, 23))
        prior[:5, :5] = 2.0 * free
        prior[5:, 5:] = covariance * (_COVERED**2 / size) + 1e-14 * np.eye(18)
        return [*found, Search(bends, prior)]


class Search(NamedTuple):
    """Deformations (h, 23) to start from, and the covariance (p, p) of what may be added to the first p numbers."""

    starts: Floats
    prior: Floats


class Starts(NamedTuple):
    """Deformations (h, 23) and the place (h,) of a step for each, the most coherent first."""

    d: Floats
    step: Ints


def most_coherent(values: Values, d: Floats, steps: Floats, dither: Floats, n_bits: int, count: int) -> Starts:
    """Of all deformations (h, 23) and steps (s,) those under which values lie nearest to codewords of either bit."""
    kept, place, score = np.empty((0, 23)), np.empty(0, np.int64), np.empty(0, np.float32)
    for start in range(0, len(d), _CHUNK):
        some = d[start : start + _CHUNK]
        found = _agreement(values.at(some).astype(np.float32), 1.0 / steps, dither, n_bits).ravel()
        best = np.argpartition(-found, min(count, len(found) - 1))[:count]
        score = np.concatenate([score, found[best]])
        order = np.argsort(-score, kind="stable")[:count]
        kept = np.concatenate([kept, some[best // len(steps)]])[order]
        place, score = np.concatenate([place, best % len(steps)])[order], score[order]
    return Starts(kept, place)


def _monomials(d: Floats) -> Floats:
    """1, E_i, E_i E_j with i <= j, and q_k, (h, 39), of deformations (h, 23)."""
    i, j = _PAIRS
    return np.concatenate([np.ones((len(d), 1)), d[:, :5], d[:, i] * d[:, j], d[:, 5:]], axis=1)


def _deformed(solid: Solid, frame: Frame, d: Floats) -> Solid:
    """A solid under a deformation (23,), given as seen in the frame."""
    x = frame.points(solid.vertices)
    products = x[:, _QUADRATIC[0]] * x[:, _QUADRATIC[1]]
    moved = x + x @ np.tensordot(d[:5], _BASIS, axes=1) + products @ d[5:].reshape(6, 3)
    return Solid(moved * frame.scale @ frame.axes + frame.origin, solid.triangles, solid.movable)


def _design() -> Floats:
    """The strains (21, 5) that settle a quadratic, none first."""
    unit = np.eye(5)
    i, j = np.triu_indices(5, 1)
    mixed = (unit[i] + unit[j]) / np.sqrt(2.0)
    return np.asarray(_STRAIN_STEP * np.concatenate([np.zeros((1, 5)), unit, -unit, mixed]))


def _strains(G: Floats, inner: float, outer: float) -> Floats:
    """Strains (h, 5) of norm inner to outer: a lattice D5* that covers them by the metric G (5, 5)."""
    root: Floats = np.asarray(np.linalg.cholesky(G).T * _D5_RADIUS / _COVERED)  # of a lattice: integers, or plus a half
    e = np.concatenate([_lattice(root, shift, outer) for shift in (0.0, 0.5)])
    size = np.linalg.norm(e, axis=1)
    e, size = e[size >= inner], size[size >= inner]
    return e[np.argsort(size, kind="stable")[:_MOST]]


def _lattice(root: Floats, shift: float, radius: float) -> Floats:
    """The e (h, 5) of norm up to ``radius`` with root e among the integers plus ``shift``; root is upper triangular.

    Coordinate by coordinate from the last on: those settled say the last numbers of e, whose norm is bounded.
    """
    inverse = np.linalg.inv(root)
    reach = radius * np.linalg.norm(root, axis=1)
    points = np.zeros((1, 0))
    for k in range(4, -1, -1):
        z = np.arange(np.ceil(-reach[k] - shift), np.floor(reach[k] - shift) + 1.0) + shift
        if len(z) * len(points) > _TOO_MANY:
            return np.empty((0, 5))
        points = np.concatenate([np.repeat(z, len(points))[:, None], np.tile(points, (len(z), 1))], axis=1)
        points = points[np.linalg.norm(points @ inverse[k:, k:].T, axis=1) <= radius]
    return np.asarray(points @ inverse.T)


@cache
def _bends() -> Floats:
    """Deformations (h, 23) that bend or twist, axes and strengths drawn once and for all.

    A bend towards b of the line along a, and a twist about a, with centre c and y = x - c:

        k/2 (a.y)^2 b - k (a.y)(b.y) a          k (a.y) a x y

    Of what they do at first order in x the strain is kept; the rest is a motion of the frame.
    """
    rng = np.random.default_rng(0)
    a, towards = rng.standard_normal((2, _BENDS, 3))
    a /= np.linalg.norm(a, axis=1)[:, None]
    b = towards - np.sum(a * towards, axis=1)[:, None] * a
    b /= np.linalg.norm(b, axis=1)[:, None]
    k, centre = rng.uniform(-_CURVATURE, _CURVATURE, _BENDS), _OFF_CENTRE * rng.standard_normal((_BENDS, 3))
    bent = 0.5 * np.einsum("ni,nj,nl->nlij", a, a, b) - np.einsum("ni,nj,nl->nlij", a, b, a)
    twisted = np.einsum("ni,lmj,nm->nlij", a, _CROSS, a)
    form = np.where(np.arange(_BENDS)[:, None, None, None] % 2, bent, twisted) * k[:, None, None, None]
    form = 0.5 * (form + form.transpose(0, 1, 3, 2))  # coordinate l of the motion is y' form_l y
    linear = -2.0 * np.einsum("nlij,ni->nlj", form, centre)
    strain = np.einsum("kij,nij->nk", _BASIS, linear)
    i, j = _QUADRATIC
    quadratic = form[:, :, i, j] * np.where(i == j, 1.0, 2.0)  # (n, 3, 6)
    return np.concatenate([strain, quadratic.transpose(0, 2, 1).reshape(_BENDS, 18)], axis=1)


@njit(cache=True, nogil=True, fastmath=True)
def _agreement(values, rates, dither, n_bits):  # type: ignore[no-untyped-def]
    """How near values (h, K) lie to codewords of either bit at each of the steps 1 / rates (s,): (h, s)."""
    h, K = values.shape
    found = np.zeros((h, len(rates)), np.float32)
    for i in range(h):
        for s in range(len(rates)):
            total = 0.0
            if n_bits == K:
                for k in range(K):
                    x = 2.0 * (values[i, k] * rates[s] - dither[k])
                    x -= np.rint(x)
                    y = x * x
                    total += 1.0 + y * (-19.739 + y * (64.93 + y * (-85.2 + y * 54.0)))  # cos(2 pi x) but for 0.003
            else:
                for b in range(n_bits):
                    re, im = 0.0, 0.0
                    for k in range(b, K, n_bits):
                        angle = 2.0 * np.pi * (values[i, k] * rates[s] - dither[k])
                        re += np.cos(angle)
                        im += np.sin(angle)
                    total += re * re - im * im
            found[i, s] = total
    return found


_PAIRS = np.triu_indices(5)  # of strains, i <= j
_QUADRATIC = np.triu_indices(3)  # x x, x y, x z, y y, y z, z z
_CROSS = np.zeros((3, 3, 3))  # (u x v)_l = sum _CROSS[l, m, n] u_m v_n
for _a, _b, _c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    _CROSS[_a, _b, _c], _CROSS[_a, _c, _b] = 1.0, -1.0
_BASIS = np.zeros((5, 3, 3))  # of the strains: symmetric, of trace zero, orthonormal
_BASIS[0] = np.diag([1.0, -1.0, 0.0]) / np.sqrt(2.0)
_BASIS[1] = np.diag([1.0, 1.0, -2.0]) / np.sqrt(6.0)
for _number, (_a, _b) in enumerate(((0, 1), (0, 2), (1, 2))):
    _BASIS[2 + _number][_a, _b] = _BASIS[2 + _number][_b, _a] = np.sqrt(0.5)
