"""What a patch carries, and how it is recognised: the code, its p-value against chance, and the compiled search."""

import math

import numpy as np
import pytest
from scipy import optimize, special, stats

from o3dmark.coding.keys import Key
from o3dmark.methods.local_patches import scoring
from o3dmark.methods.local_patches.codewords import Share, _tail
from o3dmark.methods.local_patches.disk import disk_functions
from o3dmark.methods.local_patches.format import FORMATS
from o3dmark.methods.local_patches.scoring import best_angles

FORM = FORMATS["2026"]
FUNCTIONS = disk_functions(FORM)
REAL = FUNCTIONS.n_real
N_BITS = 34
SOURCE_2026 = [29, 46, 26, 11, 7, 55, 34, 9]
DITHER_2026 = [0.6159109087776223, 0.8837752123570717, 0.9002730475606273, 0.14356171752808966]


@pytest.fixture(scope="module")
def share(key: Key) -> Share:
    return Share.all_of(key, FORM, N_BITS)[0]


def coefficients(count: int, seed: int = 0, size: float = 2.0) -> np.ndarray:
    """What patches may show (p, q): complex, but real where the order is 0."""
    rng = np.random.default_rng(seed)
    found = size * (rng.standard_normal((2, count, len(FUNCTIONS.order))) * [[[1.0]], [[1j]]]).sum(axis=0)
    return np.where(FUNCTIONS.order == 0, found.real, found)


def seen_from(found: np.ndarray, angle: float) -> np.ndarray:
    """The same, as a frame shows it that is turned by the angle."""
    return found * np.exp(1j * angle * FUNCTIONS.order)


# Which coefficient carries what


@pytest.mark.parametrize("n_bits", [1, 8, 34, 39, 40, 41, 64, 79, 80, 81, 128])
def test_shares_carry_every_bit_and_as_evenly_as_they_can(n_bits: int) -> None:
    shares = FORM.shares(n_bits)
    assert len(shares) == math.ceil(n_bits / FORM.carriers)
    assert all(each.shape == (FORM.carriers,) for each in shares)
    carried = np.bincount(np.concatenate(shares), minlength=n_bits)
    assert len(carried) == n_bits
    assert carried.min() >= 1
    if n_bits <= FORM.carriers:
        assert np.ptp(carried) <= 1
    else:
        assert all(np.ptp(np.bincount(each, minlength=n_bits)[each]) == 0 for each in shares)  # none twice in a patch


@pytest.mark.parametrize("n_bits", [34, 100])
def test_every_coefficient_has_one_task(n_bits: int, key: Key) -> None:
    """Pilots first; each kind of patch has its own order and dither, and each key others."""
    shares = Share.all_of(key, FORM, n_bits)
    for kind, share in enumerate(shares):
        assert share.kind == kind
        assert np.array_equal(np.sort(share.source), np.arange(REAL))
        assert share.pilots + len(share.bit) == REAL
        assert len(share.bit) == FORM.carriers
        assert share.dither.min() >= 0.0
        assert share.dither.max() < 1.0
    again, others = Share.all_of(key, FORM, n_bits), Share.all_of(Key(bytes(32)), FORM, n_bits)
    assert all(np.array_equal(a.dither, b.dither) for a, b in zip(shares, again, strict=True))
    dithers = [share.dither for share in shares + others]
    assert len({dither.tobytes() for dither in dithers}) == len(dithers)


def test_the_streams_of_a_published_format_stay_as_they_are(key: Key) -> None:
    """Numbers of this very code, of the day when the format was made: every mark hangs on them."""
    share = Share.all_of(key, FORM, 64)[1]
    assert share.source[:8].tolist() == SOURCE_2026
    np.testing.assert_allclose(share.dither[:4], DITHER_2026, atol=1e-12)


# Values and angles


def test_values_are_the_parts_of_what_is_seen_from_the_angle(share: Share) -> None:
    found, angles = coefficients(5), np.linspace(-3.0, 9.0, 5)
    for each, angle, values in zip(found, angles, share.values(found, angles), strict=True):
        turned = seen_from(each, angle)
        parts = [(z.real, z.imag) if m else (z.real,) for z, m in zip(turned, FUNCTIONS.order, strict=True)]
        np.testing.assert_allclose(values, np.concatenate(parts)[share.source])


def test_values_and_restored_are_inverse(share: Share) -> None:
    found, angles = coefficients(5), np.linspace(-3.0, 9.0, 5)
    np.testing.assert_allclose(share.restored(share.values(found, angles), angles), found, atol=1e-12)
    values = np.random.default_rng(1).standard_normal((5, REAL))
    np.testing.assert_allclose(share.values(share.restored(values, angles), angles), values, atol=1e-12)


def test_waves_and_turns_make_the_values_of_all_angles(share: Share) -> None:
    found, angles = coefficients(3), np.linspace(0.0, 6.0, 7)
    (cosine, sine), (turn, turn_sine) = share.waves(found), share.turns(angles)
    for a, angle in enumerate(angles):
        np.testing.assert_allclose(cosine * turn[a] + sine * turn_sine[a], share.values(found, np.full(3, angle)))


# Codewords


def test_codewords_are_the_nearest_of_their_bits(share: Share) -> None:
    """Pilots stand on integers from the dither on, carriers of a 1 half a period aside."""
    rng = np.random.default_rng(2)
    values, bits = 5.0 * rng.standard_normal((20, REAL)), rng.integers(0, 2, N_BITS)
    halves = np.concatenate([np.zeros(share.pilots), 0.5 * bits[share.bit]])
    codewords = share.codewords(values, bits)
    phase = codewords - share.dither - halves
    np.testing.assert_allclose(phase, np.rint(phase), atol=1e-12)
    assert np.abs(codewords - values).max() <= 0.5 + 1e-12


def test_on_codewords_everything_agrees_whatever_the_bits(share: Share) -> None:
    rng = np.random.default_rng(3)
    for bits in (np.zeros(N_BITS, int), np.ones(N_BITS, int), rng.integers(0, 2, N_BITS)):
        phase = share.codewords(5.0 * rng.standard_normal(REAL), bits) - share.dither
        off, period = share.off(phase)
        assert share.agreement(phase) == pytest.approx(share.most)
        assert np.abs(off).max() < 1e-12
        assert np.array_equal(period, np.repeat([1.0, 0.5], [share.pilots, FORM.carriers]))
        soft = share.soft(phase, N_BITS)
        np.testing.assert_allclose(soft, (2.0 * bits - 1.0) * np.bincount(share.bit, minlength=N_BITS))
    assert share.most == share.pilots + FORM.carriers / 2


def test_the_agreement_falls_with_the_distance_from_codewords(share: Share) -> None:
    phase = share.codewords(np.zeros(REAL), np.zeros(N_BITS, int)) - share.dither
    away = np.where(np.arange(REAL) < share.pilots, 1.0, 0.5)  # one whole period of either kind
    found = [float(share.agreement(phase + step * away)) for step in (0.0, 0.1, 0.25, 0.4, 0.5)]
    assert found == sorted(found, reverse=True)
    assert found[-1] == pytest.approx(-share.most)


def test_what_no_carrier_has_is_not_told(key: Key) -> None:
    share = Share.all_of(key, FORM, 100)[0]
    soft = share.soft(np.zeros(REAL), 100)
    assert np.array_equal(soft != 0.0, np.isin(np.arange(100), share.bit))


# How sure a patch is


@pytest.fixture(scope="module")
def chance(share: Share) -> tuple[np.ndarray, np.ndarray]:
    """What 200 000 wrong keys see: agreements, and the sign of one bit."""
    rng, agreement, sign = np.random.default_rng(20260101), [], []
    for _ in range(20):
        phase = rng.uniform(-0.5, 0.5, (10_000, REAL))
        agreement.append(share.agreement(phase))
        sign.append(-np.cos(2.0 * np.pi * phase[:, share.pilots :][:, share.bit == 3]).sum(axis=1) > 0)
    return np.concatenate(agreement), np.concatenate(sign)


def test_the_p_value_is_never_below_chance(share: Share, chance: tuple[np.ndarray, np.ndarray]) -> None:
    """Of uniform phases no more agree so well than the bound says, to what 200 000 draws can tell."""
    agreement, _ = chance
    levels = np.linspace(0.0, share.most, 2000)
    log10_p = share.log10_p(levels)
    for rate in (0.3, 0.1, 1e-2, 1e-3, 1e-4):
        hits = np.count_nonzero(agreement >= levels[log10_p <= np.log10(rate)].min())
        assert hits <= stats.binom.ppf(1 - 1e-6, len(agreement), rate)
    assert -3.0 <= share.log10_p(np.quantile(agreement, 1.0 - 1e-3)) < -2.0  # no more than a decade is given away


def test_the_p_value_is_that_of_draws_and_below_chernoffs_bound(
    share: Share, chance: tuple[np.ndarray, np.ndarray]
) -> None:
    """As far as draws go; further out by a decade or so, as tails are."""
    agreement, _ = chance
    for rate in (0.3, 0.1, 1e-2, 1e-3):
        expected = share.log10_p(np.quantile(agreement, 1.0 - rate))
        assert abs(expected - np.log10(rate)) < 4.0 / np.sqrt(rate * len(agreement)) / math.log(10)
    for level in (5.0, 12.0, 20.0, 30.0):

        def bound(slope: float, level: float = level) -> float:
            growth = share.pilots * np.log(special.i0(slope)) + FORM.carriers * np.log(special.i0(slope / 2.0))
            return float(growth - slope * level) / math.log(10)

        best = optimize.minimize_scalar(bound, bounds=(1e-3, 50.0), method="bounded").fun
        assert -1.5 < share.log10_p(np.array(level)) - best < -0.5


def test_the_p_value_of_a_few_coefficients_is_that_of_the_integral_over_them() -> None:
    """Two cosines: the share of the square of phases where their sum is as high, counted on a lattice."""
    levels, log10_p = _tail(2, 0)
    cosine = np.cos(2.0 * np.pi * (np.arange(4000) + 0.5) / 4000)
    for level in (0.5, 1.0, 1.5, 1.9):
        share = np.mean([np.count_nonzero(cosine + each >= level) for each in cosine]) / len(cosine)
        assert np.interp(level, levels, log10_p) == pytest.approx(np.log10(share), abs=0.02)


def test_the_p_value_falls_as_the_agreement_rises_and_is_1_where_there_is_none(share: Share) -> None:
    agreement = np.linspace(-share.most, share.most, 301)
    log10_p = share.log10_p(agreement)
    assert np.all(np.diff(log10_p) <= 0.0)
    assert np.array_equal(log10_p[agreement <= 0.0], np.zeros((agreement <= 0.0).sum()))
    assert share.log10_p(np.array(share.most)) < -20.0


def test_given_the_agreement_each_bit_is_a_fair_coin(share: Share, chance: tuple[np.ndarray, np.ndarray]) -> None:
    """So that patches may be chosen by it, and their bits be tested all the same."""
    agreement, sign = chance
    best = sign[np.argsort(-agreement)[:2000]]
    low, high = stats.binom.ppf([1e-6, 1 - 1e-6], len(best), 0.5)
    assert low <= np.count_nonzero(best) <= high


def test_a_wrong_key_sees_uniform_phases_of_whatever_surface() -> None:
    """By the dither: also of coefficients that are all zero."""
    phases = np.array([Share.all_of(Key(i.to_bytes(32, "big")), FORM, N_BITS)[0].dither for i in range(300)])
    assert stats.kstest(phases.ravel(), "uniform").pvalue > 1e-4
    assert np.abs(np.corrcoef(phases.T) - np.eye(REAL)).max() < 0.35  # 6 standard errors


# The best angle


def slowly(share: Share, found: np.ndarray, strength: float, n_angles: int) -> tuple[np.ndarray, np.ndarray]:
    """The agreements (p, a) from each angle, and those of the pilots alone."""
    phases = np.array([share.values(found, np.full(len(found), angle)) for angle in turns(n_angles)])
    phases = (phases / strength - share.dither).transpose(1, 0, 2)
    return share.agreement(phases), np.cos(2.0 * np.pi * phases[:, :, : share.pilots]).sum(axis=2)


def turns(count: int) -> np.ndarray:
    return 2.0 * np.pi / count * np.arange(count)


def test_the_best_angle_is_the_best_of_all(share: Share) -> None:
    """Of those whose pilots promise something; to what single precision and a polynomial's cosine are worth."""
    found, strength = 0.004 * coefficients(300), 0.004
    scores = best_angles(share, found, strength, 64)
    every, pilots = slowly(share, found, strength, 64)
    promising = pilots > scoring._PROMISING * np.sqrt(share.pilots)
    best = np.where(promising, every, -np.inf).max(axis=1)
    clear = np.abs(pilots - scoring._PROMISING * np.sqrt(share.pilots)).min(axis=1) > 0.01
    assert clear.sum() > 200
    assert np.array_equal(np.isfinite(scores.agreement[clear]), np.isfinite(best[clear]))
    seen = clear & np.isfinite(best)
    np.testing.assert_allclose(scores.agreement[seen], best[seen], atol=0.02)
    at = np.rint(scores.angle / (2.0 * np.pi) * 64).astype(int)
    np.testing.assert_allclose(every[np.arange(300), at][seen], best[seen], atol=0.02)
    assert seen.any()


@pytest.mark.parametrize("number", [0, 7, 41, 63])
def test_a_patch_is_found_at_its_angle(number: int, share: Share) -> None:
    bits, angle = np.random.default_rng(4).integers(0, 2, N_BITS), turns(64)[[number]]
    values = share.codewords(3.0 * np.random.default_rng(number).standard_normal((1, REAL)), bits)
    found = np.concatenate([coefficients(70), 0.006 * share.restored(values, angle)])
    scores = best_angles(share, found, 0.006, 64)
    assert scores.agreement.argmax() == 70
    assert scores.agreement[70] == pytest.approx(share.most, abs=0.02)
    assert scores.angle[70] == pytest.approx(angle[0])


def test_without_places_there_are_no_scores(share: Share) -> None:
    scores = best_angles(share, coefficients(0), 0.006, 64)
    assert scores.agreement.shape == scores.angle.shape == (0,)


# The ladder of radii


def test_rungs_are_all_powers_of_the_ratio_within_the_limits() -> None:
    rungs = FORM.rungs(0.05, 3.0)
    powers = np.log(rungs) / np.log(FORM.ratio)
    np.testing.assert_allclose(np.diff(powers), 1.0)
    np.testing.assert_allclose(powers, np.rint(powers), atol=1e-9)
    assert rungs[0] / FORM.ratio < 0.05 <= rungs[0]
    assert rungs[-1] <= 3.0 < rungs[-1] * FORM.ratio
    assert FORM.rungs(1.1, 1.2) == []


@pytest.mark.parametrize("radius", [1e-3, 0.3, 1.0, 1.19, 77.0])
def test_no_rung_is_nearer_than_the_nearest(radius: float) -> None:
    nearest = FORM.nearest_rung(radius)
    assert any(nearest == pytest.approx(rung) for rung in FORM.rungs(0.5 * radius, 2.0 * radius))
    assert abs(np.log(nearest / radius)) <= 0.5 * np.log(FORM.ratio) + 1e-12
