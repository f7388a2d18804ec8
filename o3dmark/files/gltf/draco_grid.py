"""The grid that Draco put positions on: it does not say which, but it can be seen."""

import math

import numpy as np

from o3dmark.arrays import Floats

_BITS = range(24, 1, -1)  # float32 tells no finer grid apart
_MOST_BITS = 30
_NOISE = 4.0  # of float32's steps at the rim: what Draco's own arithmetic, in float32, adds to a position
_CLEAR = 4.0  # times the noise: a step that can be told from it
_USUAL = (1 << 14) - 1  # steps along the longest side that glTF exporters make
_FINEST = (1 << 21) - 1  # steps for positions that are on no grid: as fine as Draco's arithmetic tells apart
_SAMPLE = 2000  # positions that tell grids apart; then all are looked at


def step_of(positions: Floats) -> float:
    """The step of the finest grid that Draco makes on which float32 positions (n, 3) lie; a finer one without any.

    Few positions lie on coarse grids by chance, so the finest is the safe one.
    """
    offsets, extent = (positions - positions.min(axis=0)).ravel(), extent_of(positions)
    noise = _NOISE * float(np.spacing(np.float32(np.abs(positions).max())))
    sample = offsets[:: max(len(offsets) // (3 * _SAMPLE), 1)]
    for count in [*((1 << bits) - 1 for bits in _BITS), *_own_counts(offsets, extent, noise)]:
        step = extent / count
        if step > _CLEAR * noise and _lie_on(sample, step, noise) and _lie_on(offsets, step, noise):
            return step
    return extent / _FINEST


def bits_for(positions: Floats, step: float) -> int:
    """How many bits Draco needs for a grid over the box of positions (n, 3) that is as fine as ``step``."""
    count = extent_of(positions) / step if step else 0.0
    return min(max(math.ceil(math.log2(count * (1.0 - 1e-5) + 1.0)), 1), _MOST_BITS)


def extent_of(positions: Floats) -> float:
    """The longest side of the box of positions (n, 3), which Draco divides into 2^bits - 1 steps."""
    return float(np.ptp(positions, axis=0).max())


def _lie_on(offsets: Floats, step: float, noise: float) -> bool:
    return bool((np.abs(offsets - np.rint(offsets / step) * step) <= noise).all())


def _own_counts(offsets: Floats, extent: float, noise: float) -> list[int]:
    """For positions on the grid of a larger box: how many steps their longest side has, if two are neighbours."""
    places = np.unique(np.rint(offsets / noise)) if noise else np.empty(0)
    gaps = np.diff(places)[np.diff(places) > _CLEAR] * noise
    if not len(gaps):
        return []
    count = round(extent / _exact(places * noise, float(gaps.min()), noise))
    return [count * max(-(-_USUAL // count), 1), count] if count else []


def _exact(offsets: Floats, step: float, error: float) -> float:
    """A step from a rough one: what lies some steps away tells it more exactly, and then what lies farther."""
    farthest, noise = float(offsets[-1]), error
    while error * farthest > step * step / 4.0:  # then its number of steps is not yet certain
        known = float(offsets[offsets <= max(step * step / (4.0 * error), step)][-1])
        steps = max(round(known / step), 1)
        if noise / steps >= error:
            break
        step, error = known / steps, noise / steps
    return farthest / max(round(farthest / step), 1)
