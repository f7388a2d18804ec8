"""The key's view of a spectrum: its modes dealt at random, with random signs, to a handful of projections.

One real mode, a cosine or a sine, belongs to one projection. A projection is a random low-frequency function on the
surface (spread-spectrum), and to first order its value changes by the integral of that function times the motion.
"""

from dataclasses import dataclass

import numpy as np

from o3dmark.arrays import Complexes, Floats, Ints
from o3dmark.coding.keys import Key
from o3dmark.solid.spectrum import Band


@dataclass(frozen=True, eq=False)
class Projections:
    """K projections of the 2 M real modes of a band: owner (2M,) in 0 .. K-1, weight (2M,), dither (K,) in periods.

    The first M modes are the cosines (the spectrum's real part), the others the sines (minus its imaginary part).
    """

    band: Band
    owner: Ints
    weight: Floats
    dither: Floats

    @classmethod
    def of(cls, key: Key, band: Band, count: int) -> "Projections":
        """The ``count`` projections of a key; each has unit mean square on a surface that is not special."""
        modes = 2 * len(band.integers)
        owner = np.empty(modes, np.int64)
        owner[key.stream("shape-spectrum/deal").permutation(modes)] = np.arange(modes) % count
        sign = 1.0 - 2.0 * key.stream("shape-spectrum/sign").bits(modes)
        weight = np.asarray(sign * np.sqrt(2.0 / np.bincount(owner, minlength=count))[owner], np.float64)
        return cls(band, owner, weight, key.stream("shape-spectrum/dither").uniform(count))

    def __len__(self) -> int:
        return len(self.dither)

    def __call__(self, spectrum: Complexes) -> Floats:
        """The projections (..., K) of spectral values (..., M), or of their derivatives."""
        modes = np.concatenate([spectrum.real, -spectrum.imag], axis=-1) * self.weight
        rows = [np.bincount(self.owner, row, minlength=len(self)) for row in modes.reshape(-1, modes.shape[-1])]
        return np.array(rows, np.float64).reshape(*modes.shape[:-1], len(self))

    def functions(self, points: Floats) -> Floats:
        """The values (K, q) at points (q, 3) of the functions that the projections integrate over the solid."""
        modes = len(self.band.integers)
        c = np.zeros((len(self), modes), np.complex128)
        c[self.owner[:modes], np.arange(modes)] = self.weight[:modes]
        c[self.owner[modes:], np.arange(modes)] += 1j * self.weight[modes:]  # Re(i exp(-i k.x)) is the sine
        return self.band.functions(points, c)
