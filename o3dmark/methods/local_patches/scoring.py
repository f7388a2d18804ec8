"""Which of many places and angles agrees best with a key's share, compiled."""

from typing import NamedTuple

import numpy as np
from numba import njit

from o3dmark.arrays import Complexes, Floats
from o3dmark.methods.local_patches.codewords import Share
from o3dmark.threads import in_parts

_PROMISING = 1.4  # agreement of the pilots, over the root of their number, below which carriers are not looked at


class Scores(NamedTuple):
    """Of each place (p,) the best agreement T, and at which angle."""

    agreement: Floats
    angle: Floats


def best_angles(share: Share, found: Complexes, strength: float, n_angles: int) -> Scores:
    """The best of ``n_angles`` angles for each place, whose coefficients are ``found`` (p, q)."""
    angles = 2.0 * np.pi / n_angles * np.arange(float(n_angles))
    waves = [np.ascontiguousarray(each / strength, np.float32) for each in share.waves(found)]
    turns = [np.ascontiguousarray(each, np.float32) for each in share.turns(angles)]
    dither = share.dither.astype(np.float32)
    promising = np.float32(_PROMISING * np.sqrt(share.pilots))
    agreement, which = np.full(len(found), -np.inf, np.float32), np.zeros(len(found), np.int64)
    in_parts(len(found), lambda *part: _best(*part, *waves, *turns, dither, share.pilots, promising, agreement, which))
    return Scores(agreement.astype(np.float64), angles[which])


@njit(inline="always", fastmath=True)
def _cosine(x):  # type: ignore[no-untyped-def]
    """cos(2 pi x) to 2e-4: the sine, an odd polynomial, of a quarter period further on."""
    y = np.float32(0.25) - abs(x - np.rint(x))
    s = y * y
    return y * (np.float32(6.28174) + s * (np.float32(-41.133) + s * np.float32(74.165)))


@njit(nogil=True, cache=True, fastmath=True)
def _best(start, stop, cosine, sine, turn, turn_sine, dither, pilots, promising, best, which):  # type: ignore[no-untyped-def]
    size = cosine.shape[1]
    for i in range(start, stop):
        c, s = cosine[i], sine[i]
        for a in range(len(turn)):
            t, u = turn[a], turn_sine[a]
            total = np.float32(0.0)
            for j in range(pilots):
                total += _cosine(c[j] * t[j] + s[j] * u[j] - dither[j])
            if total < promising:
                continue
            rest = np.float32(0.0)
            for j in range(pilots, size):
                rest += _cosine(np.float32(2.0) * (c[j] * t[j] + s[j] * u[j] - dither[j]))
            total += np.float32(0.5) * rest
            if total > best[i]:
                best[i], which[i] = total, a
