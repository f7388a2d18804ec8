"""The Fourier transform of a solid, read off its surface; the only door to finufft.

For a solid Omega and a wave vector k != 0 the divergence theorem turns the volume integral into one over the surface:

    chi(k) = integral over Omega of exp(-i k.x) dx = (i / |k|^2) sum over surface samples of (k . a) exp(-i k.x)

with points x and area vectors a. Moving the surface outward by delta changes it, to first order, by the integral of
exp(-i k.x) delta dA: vertices, their number, their order and their noise hardly matter.

The wave vectors are those of a cubic lattice, k = 2 pi n / box with n in a band of integers, one of n and -n (the
transform at -k is the conjugate). All of them come out of non-uniform fast Fourier transforms
(Barnett, Magland, af Klinteberg, SIAM J. Sci. Comput. 2019), whose cost is linear in the samples.
"""

from dataclasses import dataclass
from functools import cached_property

import finufft
import numpy as np
from numpy.typing import NDArray

from o3dmark.arrays import Floats, Ints
from o3dmark.solid.quadrature import Rule, rule
from o3dmark.solid.solid import Solid

Complex = NDArray[np.complex128]
LONGEST_EDGE = 0.35  # of a quadrature triangle, over the shortest wavelength
_ONE_POINT = 0.05  # edges below which one point a triangle will do, over the shortest wavelength
_EPS = 1e-5  # relative accuracy of the transforms, a thousandth of what the mark needs
_EPS_FUNCTIONS = 1e-4  # and of functions on the surface, which only steer Newton's method


@dataclass(frozen=True)
class Band:
    """The wave vectors k = 2 pi n / box with lowest <= |n| <= highest, one of n and -n."""

    lowest: float
    highest: float
    box: float

    @cached_property
    def integers(self) -> Ints:
        """The integer vectors n (M, 3); the last coordinate that is not zero is positive. Lexicographic order."""
        reach = np.arange(-int(self.highest), int(self.highest) + 1)
        n = np.stack(np.meshgrid(reach, reach, reach, indexing="ij"), axis=-1).reshape(-1, 3)
        x, y, z = n.T
        half = (z > 0) | ((z == 0) & ((y > 0) | ((y == 0) & (x > 0))))
        size = np.linalg.norm(n, axis=1)
        return n[half & (size >= self.lowest) & (size <= self.highest)]

    @cached_property
    def waves(self) -> Floats:
        """The wave vectors k (M, 3)."""
        return np.asarray(2.0 * np.pi / self.box * self.integers, np.float64)

    @property
    def shortest(self) -> float:
        """The shortest wavelength."""
        return self.box / self.highest

    @cached_property
    def _shape(self) -> tuple[int, int, int]:
        return (2 * int(self.highest) + 1,) * 3

    @cached_property
    def _places(self) -> tuple[Ints, Ints]:
        """Where n, and where -n, stand in the flattened cube of all integers up to ``highest``."""
        centre = int(self.highest)
        plus = np.ravel_multi_index(tuple((self.integers + centre).T), self._shape)
        return plus, np.prod(self._shape) - 1 - plus

    def turned(self, symmetry: Floats) -> tuple[Ints, NDArray[np.bool_]]:
        """For a signed permutation (3, 3): where its transpose times n stands in `integers` (M,), True for minus it."""
        plus, minus = self._places
        where = np.full(np.prod(self._shape), -1)
        where[plus] = where[minus] = np.arange(len(plus))
        image = self.integers @ np.rint(symmetry).astype(np.int64)
        place = np.ravel_multi_index(tuple((image + int(self.highest)).T), self._shape)
        index = where[place]
        return index, place != plus[index]

    def transform(self, points: Floats, strengths: Floats) -> Complex:
        """sum over q of strengths[s, q] exp(-i k.x_q) for every k: (s, M), from points (q, 3) and strengths (s, q)."""
        pairs = -(-len(strengths) // 2)
        packed = np.zeros((pairs, len(points)), np.complex64)  # two real sums for the price of one
        packed += strengths[0::2]
        packed[: len(strengths) // 2] += 1j * strengths[1::2]
        plan = finufft.Plan(1, self._shape, pairs, eps=_EPS, isign=-1, dtype="complex64", nthreads=1)
        plan.setpts(*self._angles(points))
        cube = np.reshape(plan.execute(packed.squeeze()), (pairs, -1)).astype(np.complex128)
        plus, minus = cube[:, self._places[0]], cube[:, self._places[1]].conj()
        return np.stack([0.5 * (plus + minus), -0.5j * (plus - minus)], axis=1).reshape(2 * pairs, -1)[: len(strengths)]

    def functions(self, points: Floats, coefficients: Complex) -> Floats:
        """Re sum over k of coefficients[j, k] exp(-i k.x_q): (j, q), from coefficients (j, M) and points (q, 3)."""
        pairs = -(-len(coefficients) // 2)
        c = np.zeros((2 * pairs, coefficients.shape[1]), np.complex128)
        c[: len(coefficients)] = 0.5 * coefficients
        cube = np.zeros((pairs, np.prod(self._shape)), np.complex64)
        cube[:, self._places[0]] = c[0::2] + 1j * c[1::2]
        cube[:, self._places[1]] = c[0::2].conj() + 1j * c[1::2].conj()
        plan = finufft.Plan(2, self._shape, pairs, eps=_EPS_FUNCTIONS, isign=-1, dtype="complex64", nthreads=1)
        plan.setpts(*self._angles(points))
        values = np.atleast_2d(plan.execute(cube.reshape(pairs, *self._shape).squeeze()))
        return np.stack([values.real, values.imag], axis=1).reshape(2 * pairs, -1)[: len(coefficients)].astype(float)

    def _angles(self, points: Floats) -> Floats:
        turns = points / self.box
        return np.ascontiguousarray((2.0 * np.pi * (turns - np.rint(turns))).T, np.float32)


def band_rule(band: Band, seen: Solid) -> Rule:
    """Where to take points of a solid for the waves of a band."""
    return rule(seen, LONGEST_EDGE * band.shortest, _ONE_POINT * band.shortest)


@dataclass(frozen=True, eq=False)
class Spectrum:
    """The transform of a solid on a band: values (M,) and, where asked for, their gradient (3, M) in k."""

    band: Band
    values: Complex
    gradient: Complex | None = None

    @classmethod
    def of(cls, band: Band, points: Floats, area_vectors: Floats, *, gradient: bool = False) -> "Spectrum":
        """From surface samples: points (q, 3) and area vectors (q, 3)."""
        k = band.waves.T
        square = np.sum(k * k, axis=0)
        first = band.transform(points, area_vectors.T)  # sum of a exp
        values = 1j / square * np.sum(k * first, axis=0)
        if not gradient:
            return cls(band, values)
        strengths = (area_vectors[:, :, None] * points[:, None, :]).reshape(-1, 9).T
        second = band.transform(points, strengths).reshape(3, 3, -1)  # sum of a_i x_j exp
        slope = (1j * first + np.einsum("im,ijm->jm", k, second) - 2.0 * k * values) / square
        return cls(band, values, slope)

    @classmethod
    def of_solid(cls, band: Band, seen: Solid, *, gradient: bool = False, points: Rule | None = None) -> "Spectrum":
        """Of a solid as seen in its frame; ``points``: those of `band_rule` for a solid that was moved to this one."""
        q = (points or band_rule(band, seen)).samples(seen)
        return cls.of(band, q.points, q.area_vectors, gradient=gradient)

    def turned(self, symmetry: Floats) -> "Spectrum":
        """The spectrum of the solid whose points x went to P x, P a signed permutation (3, 3): no new transform."""
        index, negative = self.band.turned(symmetry)

        def carried(values: Complex) -> Complex:
            return np.where(negative, values[..., index].conj(), values[..., index])

        if self.gradient is None:
            return Spectrum(self.band, carried(self.values))
        # chi(-k) is conj(chi(k)), so its gradient there is -conj(gradient at k)
        slope = symmetry @ (np.where(negative, -1.0, 1.0) * carried(self.gradient))
        return Spectrum(self.band, carried(self.values), slope)

    def frame_derivative(self) -> Complex:
        """d values / d (translation, rotation, log scale) of the frame that the solid is seen in: (7, M).

        The frame moves by t and omega and grows by e^s, so that a point x is then seen at x - t - omega x x - s x.
        """
        if self.gradient is None:
            raise ValueError("the spectrum was taken without its gradient")
        k = self.band.waves.T
        turn = np.cross(k, self.gradient, axis=0)
        grow = -np.sum(k * self.gradient, axis=0) - 3.0 * self.values
        return np.concatenate([1j * k * self.values, turn, grow[None]])
