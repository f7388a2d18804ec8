"""The scalar Costa scheme's guarantees, on any values; and that the coherence test never promises too much."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from o3dmark.coding.scs import ScalarCosta, coherence, coherence_log10p

VALUES = st.floats(-100.0, 100.0)
STEPS = st.floats(1e-3, 10.0)
GAMMAS = st.floats(0.01, 1.0)
DITHERS = st.floats(0.0, 1.0, exclude_max=True)
BITS = st.integers(0, 1)
ROUNDING = 1e-10  # values reach 1e5 steps, doubles have 16 digits

any_value = settings(max_examples=200, deadline=None)


@any_value
@given(VALUES, STEPS, DITHERS, BITS)
def test_codeword_is_the_nearest_of_its_comb(value, step, dither, bit):
    codeword = ScalarCosta(step).codeword(value, bit, dither)
    comb = (np.floor(value / step - dither - bit / 2) + np.arange(-1, 3) + bit / 2 + dither) * step
    assert abs(codeword - value) == pytest.approx(np.abs(comb - value).min(), abs=ROUNDING)
    assert np.abs(comb - codeword).min() < ROUNDING


@any_value
@given(VALUES, STEPS, DITHERS, BITS)
def test_codeword_of_a_codeword_is_itself(value, step, dither, bit):
    scheme = ScalarCosta(step)
    codeword = scheme.codeword(value, bit, dither)
    assert scheme.codeword(codeword, bit, dither) == pytest.approx(codeword, abs=ROUNDING)


@any_value
@given(VALUES, STEPS, DITHERS)
def test_combs_interleave_at_half_a_step(value, step, dither):
    scheme = ScalarCosta(step)
    zero, one = (scheme.codeword(value, bit, dither) for bit in (0, 1))
    assert abs(zero - one) == pytest.approx(step / 2, abs=ROUNDING)


@any_value
@given(VALUES, STEPS, GAMMAS, DITHERS, BITS)
def test_embedding_moves_by_half_a_step_times_gamma_at_most(value, step, gamma, dither, bit):
    moved = ScalarCosta(step, gamma).embed(value, bit, dither) - value
    assert abs(moved) <= gamma * step / 2 + ROUNDING


@any_value
@given(VALUES, STEPS, GAMMAS, DITHERS, BITS)
def test_what_is_left_to_the_codeword(value, step, gamma, dither, bit):
    scheme = ScalarCosta(step, gamma)
    marked = scheme.embed(value, bit, dither)
    codeword = scheme.codeword(value, bit, dither)
    assert abs(codeword - marked) <= (1 - gamma) * step / 2 + ROUNDING
    assert codeword - marked == pytest.approx((1 - gamma) * (codeword - value), abs=ROUNDING)


@any_value
@given(VALUES, STEPS, DITHERS, BITS, st.floats(-0.2499, 0.2499))
def test_a_disturbance_below_a_quarter_step_is_survived(value, step, dither, bit, noise):
    scheme = ScalarCosta(step)
    marked = scheme.embed(value, bit, dither) + noise * step
    assert scheme.decide(marked, dither) == bit


@any_value
@given(VALUES, STEPS, DITHERS, BITS, st.floats(0.2501, 0.7499))
def test_a_larger_one_is_not(value, step, dither, bit, noise):
    scheme = ScalarCosta(step)
    assert scheme.decide(scheme.embed(value, bit, dither) + noise * step, dither) == 1 - bit


@any_value
@given(VALUES, STEPS, st.floats(0.51, 1.0), DITHERS, BITS)
def test_above_half_way_every_value_is_read_right(value, step, gamma, dither, bit):
    scheme = ScalarCosta(step, gamma)
    assert scheme.decide(scheme.embed(value, bit, dither), dither) == bit


def test_at_half_way_some_values_reach_the_boundary():
    scheme = ScalarCosta(1.0, 0.5)
    marked = scheme.embed(np.linspace(-0.5, 0.5, 101), 0, 0.0)
    assert np.abs(scheme.soft(marked, 0.0)).min() < 1e-12


@any_value
@given(VALUES, STEPS, GAMMAS, DITHERS, BITS)
def test_period_and_shift(value, step, gamma, dither, bit):
    """A step more moves the codeword along; so does a shift of value and dither together; half a step turns a bit."""
    scheme = ScalarCosta(step, gamma)
    soft, codeword = scheme.soft(value, dither), scheme.codeword(value, bit, dither)
    tolerance = 2 * np.pi / step * ROUNDING
    assert scheme.soft(value + step, dither) == pytest.approx(soft, abs=tolerance)
    assert scheme.soft(value + step / 2, dither) == pytest.approx(-soft, abs=tolerance)
    assert scheme.soft(value + 0.3, dither + 0.3 / step) == pytest.approx(soft, abs=tolerance)
    if abs(abs(codeword - value) - step / 2) > 1e-6 * step:  # not half way between two codewords
        assert scheme.codeword(value + step, bit, dither) == pytest.approx(codeword + step, abs=ROUNDING)
        assert scheme.embed(value + 0.3, bit, dither + 0.3 / step) == pytest.approx(
            scheme.embed(value, bit, dither) + 0.3, abs=ROUNDING
        )


@any_value
@given(VALUES, STEPS, DITHERS)
def test_the_sign_of_soft_is_the_nearer_comb(value, step, dither):
    scheme = ScalarCosta(step)
    zero, one = (abs(scheme.codeword(value, bit, dither) - value) for bit in (0, 1))
    soft = float(scheme.soft(value, dither))
    assert -1 <= soft <= 1
    assert scheme.decide(value, dither) == (soft > 0)
    if abs(zero - one) > 1e-6 * step:
        assert (soft > 0) == (one < zero)


def test_soft_values_by_hand():
    values = 0.1 + np.array([0.0, 0.25, 0.5, 0.75, 1.0])
    np.testing.assert_allclose(ScalarCosta(1.0).soft(values, 0.1), [-1, 0, 1, 0, -1], atol=1e-15)
    np.testing.assert_allclose(ScalarCosta(1.0).phase(values, 0.1), [0, 0.25, 0.5, 0.75, 1], atol=1e-15)
    np.testing.assert_allclose(ScalarCosta(4.0).soft(4.0 * values, 0.1), [-1, 0, 1, 0, -1], atol=1e-15)


def test_arrays_are_broadcast_and_stay_as_they_are():
    values, bits = np.linspace(0, 1, 12).reshape(3, 4), np.array([0, 1, 1, 0], np.uint8)
    for array in (values, bits):
        array.setflags(write=False)
    scheme = ScalarCosta(0.1, 0.8)
    marked = scheme.embed(values, bits, 0.03)
    assert marked.shape == scheme.codeword(values, bits, 0.03).shape == (3, 4)
    np.testing.assert_array_equal(scheme.decide(marked, 0.03), np.broadcast_to(bits, (3, 4)))
    assert scheme.decide(marked, 0.03).dtype == np.uint8


@pytest.mark.parametrize("step", [0.0, -1.0, np.nan, np.inf])
def test_impossible_steps_are_refused(step):
    with pytest.raises(ValueError, match=f"step.*{step}"):
        ScalarCosta(step)


@pytest.mark.parametrize("gamma", [0.0, -0.5, 1.01, np.nan])
def test_impossible_gammas_are_refused(gamma):
    with pytest.raises(ValueError, match=f"gamma.*{gamma}"):
        ScalarCosta(1.0, gamma)


# Coherence


def test_coherence_is_one_on_codewords_of_either_bit_and_minus_one_between_them():
    np.testing.assert_allclose(coherence(np.array([[0.0, 0.5, 3.0], [0.25, 0.75, -0.25]])), [1, -1])
    assert abs(coherence(np.random.default_rng(0).random(10_000))) < 0.03


WEIGHTS = {
    "one": np.ones(1),
    "equal": np.ones(16),
    "uneven": np.geomspace(1, 1000, 12),
    "one among many": np.concatenate([[1e6], np.ones(20)]),
    "some zero": np.concatenate([np.zeros(4), np.ones(4)]),
}


@pytest.mark.parametrize("weights", WEIGHTS.values(), ids=WEIGHTS)
def test_p_value_is_valid(weights):
    """P(p <= a) <= a when every angle is uniform, to four deviations of the count."""
    draws = 3000
    angles = np.random.default_rng(0).uniform(0, 2 * np.pi, (draws, len(weights)))
    log_p = coherence_log10p(weights * np.exp(1j * angles))
    assert log_p.shape == (draws,)
    for a in (0.5, 0.1, 0.01):
        assert np.count_nonzero(log_p <= np.log10(a)) <= draws * a + 4 * np.sqrt(draws * a)


def test_p_value_is_not_idle():
    """It is a bound, but within a factor of ten where it matters."""
    angles = np.random.default_rng(0).uniform(0, 2 * np.pi, (3000, 16))
    log_p = coherence_log10p(np.exp(1j * angles))
    assert np.quantile(log_p, 0.01) < -1.0
    assert np.quantile(log_p, 0.1) < -0.3


def test_one_vector_against_the_exact_probability():
    """For one angle P(cos(2 x) >= c) = arccos(c) / pi; the bound lies above, falls with c, and is 1 for c <= 0."""
    c = np.linspace(-1, 1, 41)
    p = 10 ** coherence_log10p(np.exp(0.5j * np.arccos(c))[:, None])
    assert (p >= np.arccos(c) / np.pi - 1e-12).all()
    np.testing.assert_allclose(p[c <= 0], 1.0, atol=1e-3)
    assert (np.diff(p[c >= 0.1]) < 0).all()


@pytest.mark.parametrize("k", [4, 16, 64])
def test_aligned_vectors_are_unlikely_and_crossed_ones_are_not(k):
    rng = np.random.default_rng(0)
    signs = rng.choice([-1.0, 1.0], k)
    assert coherence_log10p(signs * rng.uniform(0.5, 1, k) * np.exp(0.1j * rng.normal(size=k))) < -0.8 * k
    assert coherence_log10p(1j * signs) == 0.0


def test_bits_scale_and_order_do_not_matter():
    rng = np.random.default_rng(0)
    vectors = rng.normal(size=(5, 12)) + 0.3j * rng.normal(size=(5, 12))
    log_p = coherence_log10p(vectors)
    assert (log_p < -0.5).all()
    for same in (-vectors, vectors * rng.choice([-1.0, 1.0], 12), vectors.conj(), 1e-6 * vectors, 1e6 * vectors):
        np.testing.assert_allclose(coherence_log10p(same), log_p, rtol=1e-9)
    np.testing.assert_allclose(coherence_log10p(vectors[:, ::-1]), log_p, rtol=1e-9)
    np.testing.assert_allclose([coherence_log10p(row) for row in vectors], log_p, rtol=1e-12)


def test_no_vectors_say_nothing():
    assert coherence_log10p(np.zeros(8, complex)) == 0.0
