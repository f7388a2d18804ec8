"""The scalar Costa scheme with two symbols (Eggers, Bauml, Tzschoppe, Girod, IEEE Trans. Signal Processing 2003).

The codebook of a bit b (Hamidi et al., eq. 4) is the comb

    u = (z + b / 2 + dither) step,    z an integer,

so the combs of 0 and 1 interleave at half a step. Embedding (eq. 5) moves a value part of the way, gamma, to the
nearest codeword of its bit; reading finds the comb with the nearer codeword. Values and step share one unit; dither and
phase are in periods, a period being one step.

With gamma = 1 a value lands on its codeword and survives any disturbance below step / 4. With gamma < 1 a residue of up
to (1 - gamma) step / 2 stays: at gamma = 0.5 it reaches the decision boundary, which hides the codebook from a
statistician but leaves single values no margin.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from o3dmark.arrays import Bits, Complexes, Floats, Ints

# l in the bound: any is valid. These lose 0.05 in log10 p against the best one, more only below 10^-19.
_SLOPES = np.geomspace(0.02, 200.0, 60)


@dataclass(frozen=True)
class ScalarCosta:
    """Two combs of period ``step``; ``gamma`` in (0, 1] is the share of the way that embedding goes."""

    step: float
    gamma: float = 1.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.step) and self.step > 0):
            raise ValueError(f"step must be positive, not {self.step}")
        if not 0 < self.gamma <= 1:
            raise ValueError(f"gamma must lie in (0, 1], not {self.gamma}")

    def codeword(self, values: ArrayLike, bits: ArrayLike, dither: ArrayLike) -> Floats:
        """The codeword of each bit that is nearest to each value; arrays of one shape, or broadcast to it."""
        offset = self.step * np.asarray(bits, np.float64) / 2.0 + self.step * np.asarray(dither, np.float64)
        periods = np.rint((np.asarray(values, np.float64) - offset) / self.step)
        return np.asarray(periods * self.step + offset)

    def embed(self, values: ArrayLike, bits: ArrayLike, dither: ArrayLike) -> Floats:
        """Each value moved by gamma of its way to the codeword: at most gamma step / 2."""
        values = np.asarray(values, np.float64)
        return np.asarray(values + self.gamma * (self.codeword(values, bits, dither) - values))

    def phase(self, values: ArrayLike, dither: ArrayLike) -> Floats:
        """Where values stand, in periods: an integer on a codeword of 0, an integer and a half on a codeword of 1."""
        return np.asarray(np.asarray(values, np.float64) / self.step - np.asarray(dither, np.float64))

    def soft(self, values: ArrayLike, dither: ArrayLike) -> Floats:
        """Soft bits in [-1, 1]: +1 on a codeword of 1, -1 on a codeword of 0, 0 half way between."""
        return np.asarray(-np.cos(2.0 * np.pi * self.phase(values, dither)))

    def decide(self, values: ArrayLike, dither: ArrayLike) -> Bits:
        """The bit whose comb has the codeword nearest to each value."""
        return (self.soft(values, dither) > 0).astype(np.uint8)


def coherence(phase: Floats) -> Floats:
    """How near phases (..., K) are to codewords, whatever their bits: 1 on them, about 0 at random."""
    return np.asarray(np.cos(4.0 * np.pi * phase).mean(axis=-1))


def bit_vectors(values: Floats, dither: Floats, bit: Ints, steps: Floats, n_bits: int, weights: Floats) -> Complexes:
    """For every step (s,) and bit: the sum of exp(2 pi i phase) over the values (c,) that carry it, (s, n_bits).

    Each value counts as its weight (c,) says. Vectors are in units of their deviation at random phases.
    """
    power = np.bincount(bit, weights**2, minlength=n_bits)
    vectors = np.empty((len(steps), n_bits), np.complex128)
    for row, step in zip(vectors, steps, strict=True):
        angle = 2.0 * np.pi * ScalarCosta(step).phase(values, dither)
        row.real = np.bincount(bit, weights * np.cos(angle), minlength=n_bits)
        row.imag = np.bincount(bit, weights * np.sin(angle), minlength=n_bits)
    return vectors / np.sqrt(np.where(power > 0, power, 1.0) / 2.0)


def vector_coherence(vectors: Complexes) -> float:
    """How far vectors (k,) lie along 0 or pi: 1 when all do, about 0 when their angles are random."""
    return float((vectors**2).real.sum() / np.maximum(np.sum(np.abs(vectors) ** 2), 1e-300))


def coherence_log10p(vectors: Complexes) -> Floats:
    """How unlikely the agreement of ``vectors`` (..., k) is without a mark: log10 of a p-value (...).

    vectors[j] adds exp(2 pi i phase) over the values that carry bit j, so a mark turns it to an angle of 0 or pi,
    whatever the bit. Under a wrong key, or in an unmarked mesh, the dither of bit j turns it by an angle that is
    uniform and independent of all else. The agreement c = sum_j a_j cos(2 angle_j), a_j = |vectors[j]|^2, is then a sum
    of independent cosines, and Chernoff's bound P <= min_l prod_j I0(l a_j) exp(-l c) holds for every mesh.
    """
    squares = vectors**2
    weight = np.abs(squares)
    agreement = squares.real.sum(axis=-1)
    unit = np.sqrt((weight**2).mean(axis=-1, keepdims=True))
    slope = _SLOPES / np.where(unit > 0, unit, 1.0)  # (..., 60)
    exponent = slope[..., None] * weight[..., None, :]
    log_p = (np.log(special.i0e(exponent)) + exponent).sum(axis=-1) - slope * agreement[..., None]
    return np.asarray(np.minimum(log_p.min(axis=-1), 0.0) / np.log(10.0))
