"""How well extracted bits agree with the embedded ones: the paper's Corr, and the bit error rate with its interval.

These act on bits, not on meshes, so they are functions and no registered metrics.
"""

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from o3dmark.coding.detection import Rate


@dataclass(frozen=True)
class BitErrors:
    """``errors`` wrong bits of ``n``: their ``rate`` and its Wilson score interval, ``low`` to ``high``."""

    n: int
    errors: int
    rate: float
    low: float
    high: float

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)


def correlation(embedded: ArrayLike, extracted: ArrayLike) -> float:
    """The paper's Corr in [-1, 1]: Pearson's correlation of two strings (m,) of 0 and 1. Chance gives 0 on average.

    A constant string has no variance, and the formula no value. Then Corr is 1 if all bits agree, -1 if none does, and
    0 otherwise. Errors: ValueError unless the strings are equally long, not empty and made of 0 and 1.
    """
    w, read = _strings(embedded, extracted)
    a, b = w - w.mean(), read - read.mean()
    if a.any() and b.any():
        return float(np.clip((a @ b) / math.sqrt((a @ a) * (b @ b)), -1.0, 1.0))
    agree = np.mean(w == read)
    return float(agree == 1) - float(agree == 0)


def bit_errors(embedded: ArrayLike, extracted: ArrayLike, *, confidence: float = 0.95) -> BitErrors:
    """Count the bits that differ between two strings (m,) of 0 and 1.

    The interval (Wilson, 1927) covers the true rate with about ``confidence``, which is in (0, 1). Errors as in
    `correlation`.
    """
    if not 0 < confidence < 1:
        raise ValueError(f"confidence should lie between 0 and 1, not {confidence}")
    w, read = _strings(embedded, extracted)
    n, errors = len(w), int(np.sum(w != read))
    return BitErrors(n, errors, errors / n, *Rate(errors, n, confidence).interval)


def _strings(embedded: ArrayLike, extracted: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    w, read = np.asarray(embedded), np.asarray(extracted)
    if w.ndim != 1 or w.shape != read.shape or not len(w):
        raise ValueError(f"two strings of equally many bits are wanted, not shapes {w.shape} and {read.shape}")
    for bits in (w, read):
        if not np.isin(bits, (0, 1)).all():
            raise ValueError(f"bits are 0 or 1, not {bits[~np.isin(bits, (0, 1))][0]}")
    return w.astype(np.float64), read.astype(np.float64)
