"""Corr and BER: identities, the degenerate strings, and the interval's coverage by exact sums."""

import json
import math

import numpy as np
import pytest

from o3dmark.metrics.correlation import bit_errors, correlation

RNG = np.random.default_rng(0)
W = RNG.integers(0, 2, 64)


def flipped(bits, count):
    out = bits.copy()
    out[RNG.permutation(len(bits))[:count]] ^= 1
    return out


def test_by_hand():
    assert correlation([1, 1, 0, 0], [1, 0, 0, 0]) == pytest.approx(1 / math.sqrt(3))
    assert correlation([1, 0, 1, 0], [1, 1, 0, 0]) == 0


def test_of_equal_opposite_and_complemented_strings():
    assert correlation(W, W) == 1
    assert correlation(W, 1 - W) == -1
    read = flipped(W, 20)
    assert correlation(W, 1 - read) == pytest.approx(-correlation(W, read))
    assert correlation(read, W) == correlation(W, read)
    assert correlation(1 - W, 1 - read) == pytest.approx(correlation(W, read))


@pytest.mark.parametrize("count", [1, 10, 31, 50])
def test_is_pearson_s(count):
    read = flipped(W, count)
    assert correlation(W, read) == pytest.approx(np.corrcoef(W, read)[0, 1])


def test_of_balanced_strings_is_one_less_twice_the_error_rate():
    w = np.arange(64) % 2
    read = w.copy()
    read[[0, 2, 4, 1, 3, 5]] ^= 1
    assert correlation(w, read) == pytest.approx(1 - 2 * bit_errors(w, read).rate)


def test_of_constant_strings():
    ones, zeros, mixed = np.ones(8, int), np.zeros(8, int), np.array([1, 0] * 4)
    assert correlation(ones, ones) == correlation(zeros, zeros) == 1
    assert correlation(ones, zeros) == -1
    assert correlation(ones, mixed) == correlation(mixed, zeros) == 0


def test_counts_are_integers_and_go_into_json():
    found = bit_errors(W, flipped(W, 5))
    assert (found.n, found.errors, found.rate) == (64, 5, 5 / 64)
    assert found.low < found.rate < found.high
    assert json.loads(json.dumps(found.to_dict())) == found.to_dict()
    assert isinstance(found.errors, int)


@pytest.mark.parametrize(
    ("errors", "n", "low", "high"),
    [(0, 10, 0, 0.2775), (1, 10, 0.0179, 0.4042), (5, 10, 0.2366, 0.7634), (10, 10, 0.7225, 1)],
)
def test_wilson_s_interval_as_tabulated(errors, n, low, high):
    found = bit_errors([0] * n, [1] * errors + [0] * (n - errors))
    assert (found.low, found.high) == pytest.approx((low, high), abs=5e-5)


def test_the_interval_is_where_the_score_test_turns():
    found = bit_errors([0] * 40, [1] * 7 + [0] * 33)
    for p in (found.low, found.high):
        assert abs(found.rate - p) / math.sqrt(p * (1 - p) / 40) == pytest.approx(1.959964, abs=1e-5)


@pytest.mark.parametrize("confidence", [0.9, 0.95, 0.99])
def test_the_interval_covers_the_rate_about_as_often_as_it_says(confidence):
    n, coverage = 64, []
    intervals = [bit_errors([0] * n, [1] * e + [0] * (n - e), confidence=confidence) for e in range(n + 1)]
    for p in np.linspace(0.05, 0.95, 37):
        chance = [math.comb(n, e) * p**e * (1 - p) ** (n - e) for e in range(n + 1)]
        coverage.append(sum(c for c, i in zip(chance, intervals, strict=True) if i.low <= p <= i.high))
    assert np.mean(coverage) == pytest.approx(confidence, abs=0.02)


def test_more_bits_or_less_confidence_make_it_narrower():
    few, many = bit_errors([0] * 8, [1, 0] * 4), bit_errors([0] * 80, [1, 0] * 40)
    assert many.high - many.low < few.high - few.low
    assert bit_errors([0] * 8, [1, 0] * 4, confidence=0.5).high < few.high


@pytest.mark.parametrize("function", [correlation, bit_errors])
@pytest.mark.parametrize(
    ("embedded", "extracted"), [([], []), ([1, 0], [1]), ([[1, 0]], [[1, 0]]), ([1, 2], [1, 0]), ([1, 0], [1, np.nan])]
)
def test_what_is_no_pair_of_bit_strings_is_refused(function, embedded, extracted):
    with pytest.raises(ValueError, match="bits"):
        function(embedded, extracted)


@pytest.mark.parametrize("confidence", [0, 1, 1.5, math.nan])
def test_a_confidence_out_of_range_is_refused(confidence):
    with pytest.raises(ValueError, match="confidence"):
        bit_errors([1], [1], confidence=confidence)
