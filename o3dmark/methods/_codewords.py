"""Which codewords to go to: each bit has a whole comb of them, and the cheapest combination is wanted.

The projections of a small mesh are not independent, so the nearest codeword of each is not the nearest of all. With
``cost`` Q (K, K), the squared size of a change r is r' Q r; a closest-vector search over the combs makes it small.
"""

import numpy as np

from o3dmark.geometry import Floats
from o3dmark.scs import ScalarCosta

_SWEEPS = 30


def cheapest_change(values: Floats, bits: Floats, dither: Floats, step: float, cost: Floats, slack: float) -> Floats:
    """The change (K,) that takes ``values`` (K,) to codewords of ``bits``, or to within ``slack`` steps of them.

    ``dither`` (K,) in periods; ``cost`` (K, K) is symmetric and positive.
    """
    change = ScalarCosta(step).codeword(values, bits, step * dither) - values
    return _relaxed(_lattice_search(change, step, cost), slack * step, cost)


def _lattice_search(r: Floats, step: float, Q: Floats) -> Floats:
    """r + step z with a small r' Q r: the best move of one or two integers z by one, until no move helps."""
    diagonal = np.diag(Q) * step**2
    while True:
        slope = 2.0 * step * (Q @ r)
        single = diagonal - np.abs(slope)  # gain of moving each by the better of +- 1
        sign = np.where(slope > 0, -1.0, 1.0)
        both = single[:, None] + single + 2.0 * step**2 * np.outer(sign, sign) * Q
        against = single[:, None] + (diagonal + np.abs(slope)) - 2.0 * step**2 * np.outer(sign, sign) * Q
        np.fill_diagonal(both, single)
        np.fill_diagonal(against, single)
        best = min(both.min(), against.min())
        if best > -1e-12 * diagonal.mean():
            return r
        turned = both.min() > best
        i, j = np.unravel_index(np.argmin(against if turned else both), Q.shape)
        r = r.copy()
        r[i] += step * sign[i]
        if i != j:
            r[j] += step * sign[j] * (-1.0 if turned else 1.0)


def _relaxed(r: Floats, reach: float, Q: Floats) -> Floats:
    """r + e with |e| <= reach and the least (r + e)' Q (r + e), by cyclic coordinate descent."""
    e = np.zeros_like(r)
    pull = Q @ r
    for _ in range(_SWEEPS if reach else 0):
        for j, weight in enumerate(np.diag(Q)):
            new = min(max(e[j] - pull[j] / weight, -reach), reach)
            pull = pull + (new - e[j]) * Q[:, j]
            e[j] = new
    return r + e
