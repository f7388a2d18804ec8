"""p-values against the slow obvious count, against SciPy, and against chance itself."""

import itertools
import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from o3dmark.coding.detection import (
    Rate,
    binomial_tail,
    charge,
    detect,
    sign_test,
    threshold,
    together,
    weights,
)
from o3dmark.errors import SpecError

LOG2 = math.log10(2)
MAGNITUDES = st.floats(0, 1e3).map(lambda x: round(x, 3))
SOFT = st.lists(st.tuples(MAGNITUDES, st.booleans(), st.booleans()), min_size=1, max_size=12)


def count_patterns(w: np.ndarray, missed: int) -> float:
    """log10 of the share of all sign patterns that miss no more weight than ``missed``: one by one."""
    patterns = np.array(list(itertools.product([0, 1], repeat=len(w))))
    return math.log10(np.mean(patterns @ w <= missed))


# ---- the weighted sign test ----


@given(SOFT)
def test_agrees_with_counting_every_pattern(bits: list[tuple[float, bool, bool]]) -> None:
    soft = np.array([size if positive else -size for size, positive, _ in bits])
    expected = np.array([bit for *_, bit in bits])
    w = weights(soft)
    slow = count_patterns(w, int(w[(soft > 0) != expected].sum()))
    assert sign_test(soft, expected) == pytest.approx(slow, abs=1e-12)


@pytest.mark.parametrize("n", [1, 2, 7, 64, 65, 256, 1999])
def test_equal_weights_are_the_binomial(n: int) -> None:
    for matches in sorted({0, 1, n // 3, n // 2, n - n // 4, n - 1, n}):
        expected = np.arange(n) < matches
        assert sign_test(np.full(n, 0.3), expected) == pytest.approx(binomial_tail(matches, n), abs=1e-9)


@pytest.mark.parametrize(("n", "matches"), [(16, 16), (64, 60), (64, 20), (256, 200), (1000, 530)])
def test_binomial_tail_is_scipys(n: int, matches: int) -> None:
    assert binomial_tail(matches, n) == pytest.approx(stats.binom.logsf(matches - 1, n, 0.5) / math.log(10), rel=1e-9)


def test_binomial_tail_at_its_ends() -> None:
    assert binomial_tail(0, 64) == binomial_tail(-1, 64) == 0.0
    assert binomial_tail(64, 64) == pytest.approx(-64 * LOG2)
    assert binomial_tail(65, 64) == -math.inf


@pytest.mark.parametrize("n", [8, 64, 1000, 2000])
def test_full_agreement_is_one_pattern_in_all(n: int) -> None:
    soft = np.random.default_rng(n).uniform(0.5, 2, n)
    assert sign_test(soft, np.ones(n)) == pytest.approx(-n * LOG2)


def test_uniform_under_the_null() -> None:
    rng = np.random.default_rng(20261122)
    draws = 10_000
    p = [sign_test(rng.standard_normal(64), rng.integers(0, 2, 64)) for _ in range(draws)]
    for rate in (0.5, 0.1, 1e-2, 1e-3):
        hits = int(np.count_nonzero(np.array(p) <= math.log10(rate)))
        low, high = stats.binom.ppf([1e-4, 1 - 1e-4], draws, rate)
        assert low <= hits <= high, f"{hits} of {draws} at {rate}"


@given(SOFT, st.data())
def test_one_more_agreeing_sign_never_raises_p(bits: list[tuple[float, bool, bool]], data: st.DataObject) -> None:
    soft = np.array([size if positive else -size for size, positive, _ in bits])
    expected = np.array([bit for *_, bit in bits])
    better = expected.copy()
    i = data.draw(st.integers(0, len(soft) - 1))
    better[i] = soft[i] > 0
    assert sign_test(soft, better) <= sign_test(soft, expected)


@pytest.mark.parametrize("scale", [1e-300, 1e-6, 1e6, 1e300])
def test_scale_does_not_matter(scale: float) -> None:
    rng = np.random.default_rng(5)
    soft, expected = rng.standard_normal(64), rng.integers(0, 2, 64)
    assert sign_test(scale * soft, expected) == pytest.approx(sign_test(soft, expected), abs=1e-3)


def test_trust_in_the_right_signs_counts() -> None:
    expected = np.ones(64)
    soft = np.where(np.arange(64) < 10, -0.1, 1.0)  # ten wrong signs, hardly trusted
    assert sign_test(soft, expected) < binomial_tail(54, 64) - 5


def test_one_wild_magnitude_does_not_drown_the_rest() -> None:
    soft = np.ones(64)
    soft[0] = -1e12
    assert sign_test(soft, np.ones(64)) < -12


def test_erased_bits_say_nothing() -> None:
    soft = np.array([0.0] * 20 + [1.0] * 20)
    assert sign_test(soft, np.ones(40)) == sign_test(soft[20:], np.ones(20)) == pytest.approx(-20 * LOG2)
    assert sign_test(np.zeros(40), np.ones(40)) == 0.0
    assert sign_test([], []) == 0.0


def test_hoeffding_bounds_the_count_beyond_2000_bits() -> None:
    for matches in (0, 1000, 1001, 1100, 1500, 2001):
        bound = sign_test(np.ones(2001), np.arange(2001) < matches)
        assert binomial_tail(matches, 2001) <= bound <= 0.0
    assert bound < -400


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_soft_bits_are_finite(bad: float) -> None:
    with pytest.raises(ValueError, match="finite"):
        sign_test([1.0, bad], [1, 1])


@pytest.mark.parametrize(("soft", "bits"), [([1.0], [1, 0]), ([[1.0]], [[1]]), (1.0, 1)])
def test_soft_and_expected_bits_pair_up(soft: object, bits: object) -> None:
    with pytest.raises(ValueError, match=r"two equal \(n,\)"):
        sign_test(soft, bits)  # type: ignore[arg-type]


# ---- charges, thresholds, detections ----


@given(st.floats(-300, 0), st.integers(1, 2**300))
def test_a_charge_multiplies_and_stops_at_one(log10_p: float, hypotheses: int) -> None:
    assert charge(log10_p, 1) == log10_p
    assert charge(log10_p, hypotheses) == min(0.0, log10_p + math.log10(hypotheses))


@settings(max_examples=50)
@given(st.integers(1, 400), st.floats(1e-30, 1))
def test_threshold_is_the_least_that_holds(n: int, rate: float) -> None:
    if rate < 2.0**-n:
        with pytest.raises(SpecError, match=f"{n} bits cannot"):
            threshold(rate, n)
        return
    least = threshold(rate, n)
    assert binomial_tail(least, n) <= math.log10(rate) + 1e-12
    assert least == 0 or binomial_tail(least - 1, n) > math.log10(rate) - 1e-12


def test_threshold_examples() -> None:
    assert threshold(1.0, 64) == 0
    assert threshold(2.0**-64, 64) == 64
    assert threshold(1e-6, 64) == stats.binom.isf(1e-6, 64, 0.5) + 1
    with pytest.raises(SpecError, match="20 can"):
        threshold(1e-6, 16)


@pytest.mark.parametrize("rate", [0.0, -1.0, 1.5, math.nan])
def test_a_rate_is_a_probability(rate: float) -> None:
    with pytest.raises(SpecError, match="false-positive rate"):
        threshold(rate, 64)
    with pytest.raises(SpecError, match="false-positive rate"):
        detect([1.0], [1], false_positive_rate=rate)


def test_a_detection_counts_and_charges() -> None:
    soft = np.array([1.0] * 60 + [-1.0] * 4)
    alone = detect(soft, np.ones(64))
    charged = detect(soft, np.ones(64), hypotheses=1000)
    assert (alone.matches, alone.n_bits, alone.false_positive_rate) == (60, 64, 1e-6)
    assert alone.p_value == pytest.approx(10 ** binomial_tail(60, 64))
    assert charged.p_value == pytest.approx(1000 * alone.p_value)
    assert alone.present
    assert not detect(soft, np.ones(64), false_positive_rate=1e-15).present


def test_a_detection_never_says_more_than_one() -> None:
    chance = detect([1.0, -1.0], [0, 1], hypotheses=10**6)
    assert (chance.p_value, chance.present) == (1.0, False)
    assert detect([1.0], [0], false_positive_rate=1.0).present


def test_a_detection_is_json() -> None:
    read = json.loads(json.dumps(detect(np.ones(2000), np.ones(2000), hypotheses=2**40).to_dict()))
    assert set(read) >= {"present", "p_value", "log10_p", "matches", "n_bits", "false_positive_rate", "hypotheses"}
    assert read["p_value"] == 0.0  # below a double's range; log10_p is not
    assert read["log10_p"] == pytest.approx(-1960 * LOG2)


# ---- intervals ----


@given(st.integers(1, 10_000).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))), st.floats(0.5, 0.999))
def test_the_ends_of_the_interval_are_the_rates_that_the_count_just_speaks_against(
    counts: tuple[int, int], confidence: float
) -> None:
    """Wilson: |successes / trials - p| is z standard deviations of a rate p."""
    z = stats.norm.ppf((1 + confidence) / 2)
    rate = Rate(*counts, confidence)
    for p in rate.interval:
        assert abs(rate.value - p) == pytest.approx(z * math.sqrt(p * (1 - p) / rate.trials), abs=1e-9)
    assert 0.0 <= rate.interval[0] <= rate.value <= rate.interval[1] <= 1.0


def test_a_rate_keeps_its_counts() -> None:
    rate = Rate(3, 40)
    assert rate.value == 0.075
    assert rate.interval[0] < 0.075 < rate.interval[1]
    assert Rate(0, 0).interval == (0.0, 1.0)
    assert math.isnan(Rate(0, 0).value)


@pytest.mark.parametrize("counts", [(-1, 3), (4, 3)])
def test_counts_are_counts(counts: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="out of"):
        Rate(*counts)


# ---- several p-values, and what is shown beside the bits ----


P_VALUES = st.lists(st.floats(-45, 0), min_size=1, max_size=6)  # the product is in SciPy's range


@given(P_VALUES)
def test_together_is_fishers_method(log10_ps: list[float]) -> None:
    """-2 sum ln p is chi-squared with two degrees of freedom for each; it is 1 where all are."""
    expected = stats.chi2.logsf(-2.0 * math.log(10) * sum(log10_ps), 2 * len(log10_ps)) / math.log(10)
    assert together(log10_ps) == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert together(log10_ps[::-1]) == pytest.approx(together(log10_ps), rel=1e-12, abs=1e-12)


@given(st.floats(-300, 0))
def test_one_alone_is_itself(log10_p: float) -> None:
    assert together([log10_p]) == log10_p


def test_together_underflows_nowhere() -> None:
    assert together([-1e5, -1e5]) == pytest.approx(-2e5 + math.log10(1 + 2e5 * math.log(10)))


@given(P_VALUES, st.data())
def test_a_smaller_p_never_raises_them_together(log10_ps: list[float], data: st.DataObject) -> None:
    i = data.draw(st.integers(0, len(log10_ps) - 1))
    smaller = [p - (i == j) for j, p in enumerate(log10_ps)]
    assert together(smaller) <= together(log10_ps) + 1e-9


@pytest.mark.parametrize("count", [1, 2, 5])
def test_together_independent_p_values_are_uniform(count: int) -> None:
    uniform = np.random.default_rng(count).random((20_000, count))
    found = 10.0 ** np.array([together(row) for row in np.log10(uniform).tolist()])
    assert stats.kstest(found, "uniform").pvalue > 1e-3


def test_what_is_shown_counts_with_the_bits() -> None:
    soft = np.where(np.arange(32) < 24, 1.0, -1.0)
    for hypotheses, shown in itertools.product((1, 100), (0.0, -0.3, -9.0)):
        plain = detect(soft, np.ones(32), hypotheses=hypotheses)
        found = detect(soft, np.ones(32), hypotheses=hypotheses, shown=shown)
        assert found.log10_p == pytest.approx(together([plain.log10_p, shown]))
        assert (found.matches, found.hypotheses) == (plain.matches, hypotheses)
