"""A solid that was stretched or sheared: its spectrum under each of the five strains that leave volume and pose alone.

A stretch moves the frame as well, which is derived from the moments; what is left of it after the mesh has been put
into its frame again is nearly linear in the strain. So 21 deformed solids give a quadratic surrogate of the spectrum,
once a mesh and for every key:

    S(e) = S_0 + sum_i L_i e_i + sum_ij Q_ij e_i e_j

A key's values at a strain are then a product of small matrices, and a lattice of strains, laid out in the metric by
which these values answer, finds the one that brings them near to codewords. Which of them that is looks at the values
modulo half a period, and says nothing about the message: of all the strains tried only the readings kept are charged.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from o3dmark.arrays import Floats
from o3dmark.methods.shape_spectrum.projections import Projections
from o3dmark.solid.frame import Frame, FrameRule
from o3dmark.solid.solid import Solid
from o3dmark.solid.spectrum import Band, Complex, Spectrum, band_rule

# The largest strain looked for, ring after ring, by its Frobenius norm: a stretch by 1 % has 0.0082, a shear 0.0071
RINGS = (0.009, 0.018, 0.03)
_STEP = 0.02  # strain of the deformed solids that the surrogate goes through
COVERED = 0.09  # how far, in RMS periods, a strain may be from the nearest one tried
_D5_RADIUS = 0.75  # covering radius of the lattice D5*, the integers and the integers plus a half
_MOST = 200_000  # strains of a ring; where the metric wants more, a part of it is left out, the smallest strains first
_CHUNK = 4096


@dataclass(frozen=True, eq=False)
class Surrogate:
    """A quadratic in the strain e (5,): coefficients (21, M) of the spectrum, of 1, e_i and e_i e_j."""

    coefficients: Complex

    @classmethod
    def of(cls, band: Band, solid: Solid, rule: FrameRule, frame: Frame) -> "Surrogate":
        """From 21 deformed solids. Errors: MeshError where one of them has no frame."""
        seen = frame.solid(solid)
        points = band_rule(band, seen)
        e = _design()
        found = [_spectrum(band, strained(solid, frame, each), rule, frame, points) for each in e]
        return cls(np.asarray(np.linalg.solve(monomials(e), np.array(found)), np.complex128))

    def turned(self, band: Band, symmetry: Floats) -> "Surrogate":
        """The same with the axes permuted and flipped by ``symmetry`` (3, 3), strains as they were given."""
        return Surrogate(Spectrum(band, self.coefficients).turned(symmetry).values)

    def measured(self, projections: Projections) -> "Values":
        """What a key's values are at each strain."""
        return Values(projections(self.coefficients))


@dataclass(frozen=True, eq=False)
class Values:
    """A key's values as a quadratic in the strain: coefficients (21, K)."""

    coefficients: Floats

    def at(self, e: Floats) -> Floats:
        """The values (h, K) at strains (h, 5)."""
        return np.asarray(monomials(e) @ self.coefficients)

    def slope(self, e: Floats) -> Floats:
        """The derivative (h, K, 5) at strains (h, 5)."""
        i, j = _PAIRS
        slope = np.broadcast_to(self.coefficients[1:6].T, (len(e), self.coefficients.shape[1], 5)).copy()
        for pair, (a, b) in enumerate(zip(i, j, strict=True)):
            slope[:, :, a] += e[:, None, b] * self.coefficients[6 + pair]
            slope[:, :, b] += e[:, None, a] * self.coefficients[6 + pair]
        return slope

    def metric(self, step: float) -> Floats:
        """G (5, 5): a strain e changes the values by a mean square of e' G e, in periods."""
        J = self.coefficients[1:6].T / step
        return np.asarray(J.T @ J / len(J))


class Starts(NamedTuple):
    """Strains (h, 5) and the place (h,) of a step for each, the most coherent first."""

    e: Floats
    step: np.ndarray


def ring(G: Floats, inner: float, outer: float) -> Floats:
    """Strains (h, 5) of norm inner to outer: a lattice D5* that covers them by the metric G (5, 5)."""
    spacing = COVERED / _D5_RADIUS
    root: Floats = np.asarray(
        np.linalg.cholesky(G).T / spacing
    )  # root e is a point among integers, or integers plus a half
    found = [_within(root, shift, outer) for shift in (0.0, 0.5)]
    e = np.concatenate(found) if found else np.empty((0, 5))
    size = np.linalg.norm(e, axis=1)
    e, size = e[size >= inner], size[size >= inner]
    return e[np.argsort(size, kind="stable")[:_MOST]]


def most_coherent(values: Values, e: Floats, steps: Floats, dither: Floats, n_bits: int, count: int) -> Starts:
    """Of all strains (h, 5) and steps (s,) those whose values lie nearest to codewords of either bit."""
    kept_e, kept_step, kept_score = np.empty((0, 5)), np.empty(0, np.int64), np.empty(0, np.float32)
    for start in range(0, len(e), _CHUNK):
        some = e[start : start + _CHUNK]
        score = _agreement(values.at(some).astype(np.float32), 1.0 / steps, dither, n_bits).ravel()
        best = np.argpartition(-score, min(count, len(score) - 1))[:count]
        kept_e = np.concatenate([kept_e, some[best // len(steps)]])
        kept_step = np.concatenate([kept_step, best % len(steps)])
        kept_score = np.concatenate([kept_score, score[best]])
        order = np.argsort(-kept_score, kind="stable")[:count]
        kept_e, kept_step, kept_score = kept_e[order], kept_step[order], kept_score[order]
    return Starts(kept_e, kept_step)


def strained(solid: Solid, frame: Frame, e: Floats) -> Solid:
    """A solid under a strain (5,), given as seen in the frame."""
    linear = np.eye(3) + frame.axes.T @ np.tensordot(e, _BASIS, axes=1) @ frame.axes
    return Solid((solid.vertices - frame.origin) @ linear.T + frame.origin, solid.triangles, solid.movable)


def monomials(e: Floats) -> Floats:
    """1, e_i and e_i e_j, i <= j, (h, 21) of strains (h, 5)."""
    i, j = _PAIRS
    return np.concatenate([np.ones((len(e), 1)), e, e[:, i] * e[:, j]], axis=1)


def _spectrum(band: Band, solid: Solid, rule: FrameRule, frame: Frame, points) -> Complex:  # type: ignore[no-untyped-def]
    return Spectrum.of_solid(band, rule.near(solid, frame).solid(solid), points=points).values


def _design() -> Floats:
    """The strains (21, 5) that settle a quadratic."""
    unit = np.eye(5)
    i, j = np.triu_indices(5, 1)
    mixed = (unit[i] + unit[j]) / np.sqrt(2.0)
    return np.asarray(_STEP * np.concatenate([np.zeros((1, 5)), unit, -unit, mixed]))


def _within(root: Floats, shift: float, radius: float) -> Floats:
    """The e (h, 5) of norm up to ``radius`` with root e among the integers plus ``shift``; root is upper triangular.

    Coordinate by coordinate from the last, as a tree: the interval of each follows from those settled.
    """
    # root e = z; |e| <= radius is an ellipsoid in z, whose box is known
    inverse = np.linalg.inv(root)
    reach = radius * np.linalg.norm(root, axis=1)
    points = np.zeros((1, 0))
    # settle z from the last coordinate on; e_k..5 follow, and their norm must not exceed the radius
    for k in range(4, -1, -1):
        z = np.arange(np.ceil(-reach[k] - shift), np.floor(reach[k] - shift) + 1.0) + shift
        points = np.concatenate([np.repeat(z, len(points))[:, None], np.tile(points, (len(z), 1))], axis=1)
        tail = points @ inverse[k:, k:].T
        points = points[np.linalg.norm(tail, axis=1) <= radius]
    return np.asarray(points @ inverse.T)


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
                    total += 1.0 + y * (-19.739 + y * (64.93 + y * (-85.2 + y * 54.0)))  # cos(2 pi x)
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


_PAIRS = np.triu_indices(5)
_BASIS = np.zeros((5, 3, 3))  # of the strains: symmetric, of trace zero, orthonormal
_BASIS[0] = np.diag([1.0, -1.0, 0.0]) / np.sqrt(2.0)
_BASIS[1] = np.diag([1.0, 1.0, -2.0]) / np.sqrt(6.0)
for _number, (_a, _b) in enumerate(((0, 1), (0, 2), (1, 2))):
    _BASIS[2 + _number][_a, _b] = _BASIS[2 + _number][_b, _a] = np.sqrt(0.5)
