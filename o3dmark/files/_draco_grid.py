"""The grid that Draco put positions on: it does not say which, but it can be seen."""

from dataclasses import dataclass, replace

import numpy as np

from o3dmark.arrays import AnyArray, Floats

_BITS = range(24, 1, -1)  # float32 tells no finer grid apart
_NOISE = 4.0  # of float32's steps at the rim: what Draco's own arithmetic, in float32, adds to a position
_CLEAR = 4.0  # times the noise: a step that can be told from it
_USUAL = (1 << 14) - 1  # steps along the longest side that glTF exporters make
_FINEST = (1 << 23) - 1  # steps for positions that are on no grid: as fine as float32 at the rim
_SAMPLE = 2000  # positions that tell grids apart; then all are looked at


@dataclass(frozen=True)
class Grid:
    """The points origin (3,) + step k, with whole numbers k from 0 to ``count`` on each axis."""

    origin: Floats
    step: float
    count: int

    @classmethod
    def of(cls, positions: Floats) -> "Grid":
        """The finest grid that Draco makes on which float32 positions (n, 3) lie; a finer one where they lie on none.

        Few positions lie on coarse grids by chance, so the finest is the safe one.
        """
        origin = positions.min(axis=0)
        offsets, extent = (positions - origin).ravel(), float(np.ptp(positions, axis=0).max())
        noise = _NOISE * float(np.spacing(np.float32(np.abs(positions).max())))
        sample = offsets[:: max(len(offsets) // (3 * _SAMPLE), 1)]
        for count in [*((1 << bits) - 1 for bits in _BITS), *_own_counts(offsets, extent, noise)]:
            step = extent / count
            if step > _CLEAR * noise and _lie_on(sample, step, noise) and _lie_on(offsets, step, noise):
                return cls(origin, step, count)
        return cls(origin, extent / _FINEST, _FINEST)

    def holding(self, positions: Floats) -> "Grid":
        """The grid with as many steps more on each side as positions (n, 3) need; itself if they need none."""
        below = np.maximum(np.ceil((self.origin - positions.min(axis=0)) / self.step - 0.5), 0.0)
        origin = self.origin - below * self.step
        count = max(self.count, int(np.rint((positions.max(axis=0) - origin) / self.step).max()))
        return replace(self, origin=origin, count=count) if count > self.count or below.any() else self

    @property
    def bits(self) -> int:
        return self.count.bit_length()

    @property
    def range(self) -> float:
        """The width that Draco divides into 2^bits - 1 steps."""
        return self.step * ((1 << self.bits) - 1)

    def nearest(self, positions: Floats) -> AnyArray:
        """Positions (n, 3) on the grid, in float32, by the arithmetic of Draco's decoder."""
        origin = self.origin.astype(np.float32)
        delta = np.float32(self.range) / np.float32((1 << self.bits) - 1)
        places = np.rint((positions - self.origin) / self.step).astype(np.float32)
        return places * delta + origin


def _lie_on(offsets: Floats, step: float, noise: float) -> bool:
    return bool((np.abs(offsets - np.rint(offsets / step) * step) <= noise).all())


def _own_counts(offsets: Floats, extent: float, noise: float) -> list[int]:
    """For positions on the grid of a larger box: how many steps their longest side has, if two are neighbours."""
    gaps = np.diff(np.unique(np.rint(offsets / noise))) if noise else np.empty(0)
    gaps = gaps[gaps > _CLEAR] * noise
    if not len(gaps):
        return []
    count = round(extent / gaps.min())
    return [count * max(-(-_USUAL // count), 1)] if count else []
