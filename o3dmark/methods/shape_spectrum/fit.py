"""Reading values whose frame is a little off: robust Gauss-Newton over a few parameters, the motions.

A value on a codeword of either bit stands at a multiple of half a period, so the nearest such multiple is the residual
to explain, and neither the message nor any record of the embedding is needed. Many hypotheses are fitted at once.
"""

from typing import NamedTuple

import numpy as np

from o3dmark.arrays import Floats
from o3dmark.coding.scs import coherence_log10p

# Measured on 24 blind readings of bimba, cup and ant: noise to 1.5 %, simplification, 7 bits, smoothing with noise.
_WIDTH = 0.10  # residuals expected, in periods: 0.05 lost one of 23, 0.2 none; starting from 0.14 made no difference
_STEPS = 8  # of Gauss-Newton: with 3 the bits and p-values were the same
_RANKED = 20  # readings, most coherent first, that get a p-value: 10, 40, 160 gave the same bits in 3, 6 and 12 s


class Fitted(NamedTuple):
    """Values u (h, K) in periods after the motions (h, p) that bring them nearest to codewords; log10 of trials."""

    u: Floats
    log10_trials: Floats
    motion: Floats


def fit(u: Floats, jacobian: Floats, prior: Floats) -> Fitted:
    """Motions that bring values u (h, K), in periods, near to codewords.

    ``jacobian`` (h, K, p): change of u by each motion; ``prior`` (h, p, p): covariance of the motions expected. The
    trials are the number of independent readings within the prior, which a p-value is to be multiplied by:
    the root of det(I + prior J' J / width^2).
    """
    precision, turned = np.linalg.inv(prior), np.swapaxes(jacobian, 1, 2)
    motion = np.zeros((len(u), jacobian.shape[-1], 1))
    for _ in range(_STEPS):
        r = u + (jacobian @ motion)[:, :, 0]
        r -= np.rint(2.0 * r) / 2.0
        weighted = turned * (np.cos(2.0 * np.pi * r) ** 2 / _WIDTH**2)[:, None, :]
        slope = weighted @ r[:, :, None] + precision @ motion
        motion -= np.linalg.solve(weighted @ jacobian + precision, slope)
    _, log_det = np.linalg.slogdet(np.eye(prior.shape[-1]) + prior @ (turned @ jacobian) / _WIDTH**2)
    return Fitted(u + (jacobian @ motion)[:, :, 0], 0.5 * log_det / np.log(10.0), motion[:, :, 0])


def log10_p(u: Floats, n_bits: int, log10_trials: Floats | float = 0.0) -> Floats:
    """log10 of the p-value (h,) of values u (h, K) in periods; projection j carries bit j modulo ``n_bits``.

    0 for readings that are not among the most coherent.
    """
    vectors = np.exp(2j * np.pi * u).reshape(len(u), -1, n_bits).sum(axis=1)
    agreement = (vectors**2).real.sum(axis=1)
    best = np.argsort(-agreement)[:_RANKED]
    found = np.zeros(len(u))
    trials = np.broadcast_to(log10_trials, len(u))[best]
    found[best] = np.minimum(coherence_log10p(vectors[best]) + trials, 0.0)
    return found
