"""The few ways in which a report sums up readings: means, shares, and their 95 % intervals."""

from collections.abc import Iterable

import numpy as np
from scipy.stats import binomtest

from o3dmark.campaign.row import Row

_BOOTSTRAPS = 1000


def mean(values: Iterable[float | None]) -> float | None:
    """The mean of those that are there; None without any."""
    present = [float(value) for value in values if value is not None]
    return sum(present) / len(present) if present else None


def corr(rows: Iterable[Row]) -> float | None:
    """Mean Corr: the paper's equation for each reading, then the mean over the readings that have one."""
    return mean(row.corr for row in rows)


def ber(rows: Iterable[Row]) -> float | None:
    """Mean bit error rate over the readings that took place."""
    return mean(row.ber for row in rows)


def interval(values: Iterable[float]) -> tuple[float, float]:
    """The 95 % bootstrap interval of a mean (percentiles, 1000 resamples, always the same)."""
    sample = np.asarray(list(values), np.float64)
    chosen = np.random.default_rng(0).integers(0, len(sample), (_BOOTSTRAPS, len(sample)))
    low, high = np.percentile(sample[chosen].mean(axis=1), [2.5, 97.5])
    return float(low), float(high)


def share_interval(successes: int, trials: int) -> tuple[float, float]:
    """The 95 % interval of a share (Wilson). Errors: ValueError without trials."""
    low, high = binomtest(successes, trials).proportion_ci(method="wilson")
    return float(low), float(high)
