"""How surely the mark is there: p-values, thresholds and intervals.

The null hypothesis is "wrong key, no mark, or another's mark". Every codeword is XORed with a keyed stream, and what
stands for another message or another copy is drawn from the key by itself (see `payload` and `identities`), so under
the null each received sign agrees with the expected bit with probability 1/2, independently of the others and of the
magnitudes, whatever the mesh and the method do. The p-values below are exact under that and under nothing else.

p-values travel as log10, so that none underflows. All logarithms are base 10 and never above 0.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from o3dmark.coding.words import one_in, table
from o3dmark.errors import SpecError

_LEVELS = 256  # integer weight of the median magnitude: finer than any soft bit is exact
_CAP = 4  # no bit weighs more than this many medians, so that one wild magnitude cannot outweigh the rest
_EXACT_BITS = 2000  # above this the counts of sign patterns leave the range of a double
_LOG2 = math.log10(2)


@dataclass(frozen=True, repr=False)
class Detection:
    """The answer to "is our mark there?": how many bits agree, how probable that is by chance, the rate asked for.

    ``other``: a message of the same key that reads better than the one that was asked about, if one does.
    """

    log10_p: float
    matches: int
    n_bits: int
    false_positive_rate: float
    hypotheses: int = 1
    other: str | None = None

    @property
    def p_value(self) -> float:
        """Probability of agreement this good by chance, every hypothesis charged; 0.0 when below a double's range."""
        return float(10.0**self.log10_p)

    def __repr__(self) -> str:
        other = "" if self.other is None else f", {self.other!r} reads better"
        return f"Detection({'present' if self.present else 'absent'}, p={self.p_value:.2g}{other})"

    def _repr_html_(self) -> str:
        rows = {
            "present": "yes" if self.present else "no",
            "mistaken": one_in(self.log10_p),
            "bits that agree": f"{self.matches} of {self.n_bits}",
            "false-positive rate": f"{self.false_positive_rate:g}",
        }
        return table(rows | ({} if self.other is None else {"reads better": self.other}))

    @property
    def present(self) -> bool:
        """Whether the p-value is within the false-positive rate that the caller named, and no message reads better."""
        return self.other is None and self.log10_p <= math.log10(self.false_positive_rate)

    def to_dict(self) -> dict[str, Any]:
        """Every field, with ``present`` and ``p_value``, ready for JSON."""
        return {"present": self.present, "p_value": self.p_value} | vars(self)


@dataclass(frozen=True)
class Rate:
    """``successes`` out of ``trials``, with Wilson's interval. Errors: ValueError unless 0 <= successes <= trials."""

    successes: int
    trials: int
    confidence: float = 0.95

    def __post_init__(self) -> None:
        if not 0 <= self.successes <= self.trials:
            raise ValueError(f"{self.successes} successes out of {self.trials} trials")

    @property
    def value(self) -> float:
        """successes / trials; nan without trials."""
        return self.successes / self.trials if self.trials else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """Lower and upper end of Wilson's score interval (1927); (0, 1) without trials."""
        from scipy.stats import binomtest  # half a second, which no reading should wait for

        if not self.trials:
            return 0.0, 1.0
        found = binomtest(self.successes, self.trials).proportion_ci(self.confidence, method="wilson")
        return float(found.low), float(found.high)


def detect(
    soft: ArrayLike,
    bits: ArrayLike,
    *,
    false_positive_rate: float = 1e-6,
    hypotheses: int = 1,
    shown: float | None = None,
) -> Detection:
    """Test soft bits (n,) for the expected ``bits`` (n,), 0 or 1.

    ``hypotheses`` is the number of readings among which this one was chosen. ``shown``: log10 of the p-value of what
    was read, whatever its bits, where the method tells (see `Extraction`). Errors: SpecError for a rate outside (0, 1].
    """
    _check_rate(false_positive_rate)
    values, expected = _pair(soft, bits)
    log10_p = charge(sign_test(values, expected), hypotheses)
    if shown is not None:
        log10_p = together([log10_p, shown])
    matches = int(np.count_nonzero((values > 0) == expected))
    return Detection(log10_p, matches, len(values), false_positive_rate, hypotheses)


def sign_test(soft: ArrayLike, bits: ArrayLike) -> float:
    """log10 of the probability that random signs agree with ``bits`` (n,) as well as those of ``soft`` (n,) do.

    The statistic is the total weight (see `weights`) of the signs that agree; its distribution over the 2^n sign
    patterns is counted exactly. Above 2000 bits Hoeffding's bound (1963, theorem 2) stands in: valid, not tight.
    """
    values, expected = _pair(soft, bits)
    w = weights(values)
    missed = int(w[(values > 0) != expected].sum())
    if len(w) > _EXACT_BITS:
        margin = int(w.sum()) - 2 * missed
        return -(margin**2) / (2 * float(w @ w)) / math.log(10) if margin > 0 else 0.0
    return _log10_at_most(w[w > 0], missed)


def weights(soft: ArrayLike) -> NDArray[np.int64]:
    """Integer trust (n,) in each soft bit: its magnitude, 256 at the median of those that are not 0, 1024 at most.

    Weights depend on magnitudes alone, so rounding and capping cost no exactness. Errors: ValueError when not finite.
    """
    magnitude = np.abs(np.asarray(soft, np.float64))
    if not np.isfinite(magnitude).all():
        raise ValueError("soft bits must be finite; 0 says that nothing is known of a bit")
    largest = magnitude.max(initial=0.0)
    if largest == 0:
        return np.zeros(len(magnitude), np.int64)
    magnitude /= largest
    median = np.median(magnitude[magnitude > 0])
    return np.rint(_LEVELS * (np.minimum(magnitude, _CAP * median) / median)).astype(np.int64)


def binomial_tail(matches: int, n_bits: int) -> float:
    """log10 of the probability that ``matches`` or more of ``n_bits`` fair coins agree; exact integers inside."""
    patterns = sum(math.comb(n_bits, i) for i in range(max(matches, 0), n_bits + 1))
    return min(0.0, math.log10(patterns) - n_bits * _LOG2) if patterns else -math.inf


def charge(log10_p: float, hypotheses: int) -> float:
    """log10 of the p-value after the best of ``hypotheses`` (1 or more, of any size) was taken: Bonferroni's bound.

    For a blind message, the hypotheses are all the messages that could have been there, times the readings tried.
    """
    return min(0.0, log10_p + math.log10(hypotheses))


def together(log10_ps: Sequence[float]) -> float:
    """log10 of the p-value of several independent ones, from their product q (Fisher): the sum of q (-ln q)^j / j!."""
    q = sum(log10_ps)
    nats = -q * math.log(10)
    return min(0.0, q + math.log10(sum(nats**j / math.factorial(j) for j in range(len(log10_ps)))))


def threshold(false_positive_rate: float, n_bits: int) -> int:
    """The least number of matches out of ``n_bits`` that chance reaches at most at ``false_positive_rate``.

    Errors: SpecError when even ``n_bits`` matches are too few; says how many bits it takes.
    """
    _check_rate(false_positive_rate)
    wanted = math.log10(false_positive_rate)
    if n_bits * _LOG2 < -wanted:
        needed = math.ceil(-wanted / _LOG2)
        raise SpecError(f"{n_bits} bits cannot show a false-positive rate of {false_positive_rate:g}; {needed} can")
    patterns, matches = 1, n_bits
    while matches > 0 and math.log10(patterns + math.comb(n_bits, matches - 1)) - n_bits * _LOG2 <= wanted:
        matches -= 1
        patterns += math.comb(n_bits, matches)
    return matches


def _pair(soft: ArrayLike, bits: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    values, expected = np.asarray(soft, np.float64), np.asarray(bits)
    if values.ndim != 1 or values.shape != expected.shape:
        raise ValueError(f"soft bits {values.shape} and expected bits {expected.shape} should be two equal (n,)")
    return values, expected.astype(bool)


def _check_rate(rate: float) -> None:
    if not 0 < rate <= 1:
        raise SpecError(f"a false-positive rate lies above 0 and is at most 1, not {rate:g}")


def _log10_at_most(w: NDArray[np.int64], limit: int) -> float:
    """log10 of the share of the 2^n subsets of the positive integers ``w`` (n,) whose sum is ``limit`` at most."""
    total = int(w.sum())
    if limit >= total:
        return 0.0
    if 2 * limit >= total:  # a subset above the limit is the complement of one below total - limit
        return math.log1p(-(10.0 ** _log10_at_most(w, total - limit - 1))) / math.log(10)
    step = math.gcd(*w.tolist())
    subsets = np.zeros(limit // step + 1)
    subsets[0] = 2.0**-1020  # counts reach 2^2000: start at the bottom of a double's range
    for weight in (w // step).tolist():
        if weight < len(subsets):
            subsets[weight:] += subsets[:-weight]
    return min(0.0, math.log10(subsets.sum()) + (1020 - len(w)) * _LOG2)
