"""Copies: codewords by name, and whose it is that was read. An innocent's codeword is chance, whatever was read."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from o3dmark.coding.detection import charge, sign_test
from o3dmark.coding.identities import codeword, codewords, nearest
from o3dmark.coding.keys import Key

KEY, OTHER = Key(bytes(range(32))), Key(bytes(range(1, 33)))
NAMES = [f"buyer {number}" for number in range(1000)]
WORDS = codewords(KEY, NAMES, 64)
SIGNS = 2.0 * WORDS - 1.0


def test_golden_codewords() -> None:
    """Made by this program on 2026-11-26. If this fails, copies given away before can no longer be traced."""

    def packed(name: str, n_bits: int) -> str:
        return np.packbits(codeword(KEY, name, n_bits)).tobytes().hex()

    assert packed("b3", 64) == "ef7167ca5d5c074f"
    assert packed("Zoë, 7\n", 128) == "8d4148270ee59166885e2143d3fa434c"


def test_a_key_and_a_name_have_one_codeword() -> None:
    assert np.array_equal(codewords(KEY, ["a", "b"], 64), [codeword(KEY, "a", 64), codeword(KEY, "b", 64)])
    assert codewords(KEY, [], 64).shape == (0, 64)
    differing = [(codeword(KEY, name, 64) != codeword(OTHER, name, 64)).sum() for name in NAMES[:100]]
    assert abs(np.mean(differing) - 32) < 2


def test_codewords_are_fair_and_independent() -> None:
    """Any two, and any sum of three with any fourth, differ in half of their bits; the p-value needs no more."""
    differing = (WORDS[:, None] != WORDS[None]).sum(axis=2)[np.triu_indices(len(WORDS), 1)]
    assert (
        stats.kstest(differing + np.random.default_rng(0).random(len(differing)) - 0.5, "norm", (32, 4)).statistic
        < 0.01
    )
    sums = WORDS[0:900:3] ^ WORDS[1:900:3] ^ WORDS[2:900:3]
    nearest_word = (sums[:, None] != WORDS[None]).sum(axis=2)
    assert nearest_word.min() > 6  # of 300 000 pairs


@given(index=st.integers(0, 999), noise=st.floats(0, 0.8), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_the_copy_that_was_read_is_named(index: int, noise: float, seed: int) -> None:
    soft = SIGNS[index] + noise * np.random.default_rng(seed).standard_normal(64)
    first, second, *_ = nearest(soft[None], WORDS, 1000)
    assert first.index == index
    assert first.log10_p == pytest.approx(charge(sign_test(soft, WORDS[index]), 1000))
    assert first.matches == np.count_nonzero((soft > 0) == WORDS[index])
    assert first.log10_p < -6 < second.log10_p


def test_of_several_readings_each_candidate_has_its_own() -> None:
    readings = np.array([SIGNS[5], SIGNS[7], np.zeros(64)])
    found = nearest(readings, WORDS, 3000)
    assert {found[0].index, found[1].index} == {5, 7}
    assert found[0].log10_p == found[1].log10_p == pytest.approx(np.log10(3000) - 64 * np.log10(2))


def test_blocks_make_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    readings = np.random.default_rng(3).standard_normal((50, 64))
    whole = nearest(readings, WORDS, 1)
    monkeypatch.setattr("o3dmark.coding.identities._BLOCK", 700)
    assert nearest(readings, WORDS, 1) == whole


def test_nobody_is_named_of_nobody_or_by_silence() -> None:
    assert nearest(np.ones((1, 64)), WORDS[:0], 1) == []
    assert {candidate.log10_p for candidate in nearest(np.zeros((2, 64)), WORDS, 1)} == {0.0}


def test_an_innocent_is_accused_as_rarely_as_said() -> None:
    """A copy whose buyer is not in the ledger, read well or badly, 2 000 times beside 1 000 others.

    The least p-value of all, charged for all, is at or below 0.1 in a tenth of the readings at most, and so on.
    """
    rng = np.random.default_rng(4)
    strangers = codewords(KEY, [f"stranger {number}" for number in range(2000)], 64)
    soft = (2.0 * strangers - 1.0) + rng.choice([0.0, 0.5, 2.0], (2000, 1)) * rng.standard_normal((2000, 64))
    least = np.array([nearest(row[None], WORDS, 1000)[0].log10_p for row in soft])
    for level, at_most in ((-1, 260), (-2, 40), (-3, 9)):  # 200, 20 and 2 may be expected
        assert np.count_nonzero(least <= level) <= at_most
    assert np.count_nonzero(least <= -1) > 50
