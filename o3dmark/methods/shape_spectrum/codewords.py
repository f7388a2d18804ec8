"""Which codewords to go to: each bit has a whole comb of them, and the cheapest combination is wanted.

The projections of a small mesh are not independent, so the nearest codeword of each is not the nearest of all. With the
metric Q (K, K), the squared size of a change r is r' Q r; a closest-vector search over the combs makes it small.

What a mark survives is told by its margin: how far a value stands from the boundary to codewords of the other bit. A
longer step widens it, and costs motion; stopping short of the codewords saves motion, and costs margin.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numba import njit

from o3dmark.arrays import Floats
from o3dmark.coding.scs import ScalarCosta
from o3dmark.methods.shape_spectrum.lattice import Lattice

_SWEEPS = 30  # of coordinate descent; after 5 the size changes by less than 1e-5 (bimba, ant, vase, fandisk)
_SHARES = (0.25, 0.5, 0.75, 1.0)  # of the slack, tried where going all the way costs too much
_MAX_SAVING = 1.4  # no slack saves more: one of 0.04 saves a factor of 1.11 to 1.19 (the same meshes)


class Comb(NamedTuple):
    """Values (K,) to be changed, their bits (K,) and dithers (K,) in periods; the metric Q (K, K) of a change, and the
    lattice that has it for its form."""

    values: Floats
    bits: Floats
    dither: Floats
    metric: Floats
    lattice: Lattice


class Plan(NamedTuple):
    """A ``change`` (K,) of the values that takes all of them to codewords of ``step``, but for a slack.

    ``size`` is the RMS motion that it costs, by the metric; ``margin`` the least distance left to the other bit's half.
    """

    step: float
    change: Floats
    size: float
    margin: float


def plans(comb: Comb, steps: Floats, slack: float, limit: float) -> Iterator[Plan]:
    """Ways to write the bits at a size of ``limit`` at most, widest margin first; ``slack`` in steps.

    ``steps`` (s,) descend. A step is searched only when no plan of a larger one has a wider margin than it could have.
    """
    waiting: list[Plan] = []
    for step in map(float, steps):
        while waiting and waiting[0].margin >= 0.25 * step:
            yield waiting.pop(0)
        codeword = ScalarCosta(step).codeword(comb.values, comb.bits, comb.dither)
        nearest = _nearest(codeword - comb.values, step, comb.lattice)
        waiting += (plan for plan in _with_slack(nearest, step, comb.metric, slack, limit) if plan.size <= limit)
        waiting.sort(key=lambda plan: -plan.margin)
    yield from waiting


def _with_slack(nearest: Floats, step: float, Q: Floats, slack: float, limit: float) -> Iterator[Plan]:
    exact = Plan(step, nearest, _size(nearest, Q), 0.25 * step)
    yield exact
    if limit < exact.size < _MAX_SAVING * limit:
        for reach in (slack * share for share in _SHARES):
            change = _relaxed(nearest, reach * step, Q)
            yield Plan(step, change, _size(change, Q), (0.25 - reach) * step)


def _size(r: Floats, Q: Floats) -> float:
    return float(np.sqrt(r @ Q @ r))


def _nearest(r: Floats, step: float, lattice: Lattice) -> Floats:
    """r + step z, z integers, that is small by the lattice's form."""
    return r + step * lattice.closest(-r / step).z[0]


@njit(cache=True, nogil=True)
def _relaxed(r, reach, Q):  # type: ignore[no-untyped-def]
    """r + e with |e| <= reach and the least (r + e)' Q (r + e), by cyclic coordinate descent."""
    e = np.zeros_like(r)
    pull = Q @ r
    for _ in range(_SWEEPS if reach else 0):
        for j in range(len(r)):
            new = min(max(e[j] - pull[j] / Q[j, j], -reach), reach)
            pull += (new - e[j]) * Q[j]
            e[j] = new
    return r + e
