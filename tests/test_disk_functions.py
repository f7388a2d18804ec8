"""Functions on the unit disk: what they do not see, against moments and Rayleigh quotients worked out directly."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import special

from o3dmark.methods.local_patches import disk
from o3dmark.methods.local_patches.disk import DiskFunctions, disk_functions
from o3dmark.methods.local_patches.format import FORMATS, smooth_end

FORM = FORMATS["2026"]
MORE = replace(FORM, n_real=2 * FORM.n_real)
ORDER_2026 = [0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4, 5, 5, 5, 6, 6, 6, 7, 7, 8, 8, 9, 9, 10, 11, 12]
WAVE_NUMBER_2026 = [
    7.8388688,
    11.4327729,
    14.8579132,
    9.0599756,
    12.7474537,
    16.2279965,
    7.8355241,
    11.4273767,
    14.8506121,
    9.0530831,
    12.7367515,
    16.2137128,
    7.8186168,
    11.3953746,
    14.7999532,
    9.0428944,
    12.7174166,
    16.185506,
    10.2380534,
    13.9972575,
    17.5163974,
    11.4313069,
    15.2825573,
    12.5988324,
    16.5257738,
    13.7746836,
    17.7914232,
    14.9232529,
    16.0905077,
    17.2248595,
]
HALF_WAY_2026 = [
    -1.3362766,
    0.2022207,
    1.4222035,
    -0.5271683,
    -1.1732445,
    1.5032205,
    1.7053765,
    -0.9573388,
    -1.0832054,
    1.9177916,
    -0.0913065,
    -1.4339179,
    1.0253863,
    1.7194212,
    0.2494476,
    0.820003,
    1.7889002,
    0.8412216,
    0.6455179,
    1.7120027,
    1.3469533,
    0.4911497,
    1.5893215,
    0.3702687,
    1.4025473,
    0.276397,
    1.2208958,
    0.1962447,
    0.1621811,
    0.1070894,
]  # at r = 1 / 2


@pytest.fixture(scope="module")
def functions() -> DiskFunctions:
    return disk_functions(FORM)


@pytest.fixture(scope="module")
def more() -> DiskFunctions:
    return disk_functions(MORE)


@pytest.fixture(scope="module")
def r(functions: DiskFunctions) -> np.ndarray:
    return np.linspace(0.0, 1.0, functions.table.shape[1])


def integral(values: np.ndarray, r: np.ndarray) -> np.ndarray:
    """Of values (..., s) times r dr over 0 .. 1, by Simpson's rule."""
    weights = np.where(np.arange(len(r)) % 2, 4.0, 2.0) / (3.0 * (len(r) - 1))
    weights[[0, -1]] /= 2.0
    return values @ (weights * r)


def on_the_disk(functions: DiskFunctions, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """f(r, theta) = G(r) exp(-i m theta) at points (q,), from the table: (f, q)."""
    r, theta = np.hypot(x, y), np.arctan2(y, x)
    radial = np.array([np.interp(r, np.linspace(0.0, 1.0, len(row)), row, right=0.0) for row in functions.table])
    return radial * np.exp(-1j * functions.order[:, None] * theta)


# What they do not see


def test_each_is_orthogonal_to_the_powers_of_its_order_up_to_the_degree(
    functions: DiskFunctions, r: np.ndarray
) -> None:
    for m, row in zip(functions.order.tolist(), functions.table, strict=True):
        for power in range(m, FORM.degree + 1, 2):
            assert abs(integral(row * r**power, r)) < 1e-6, (m, power)


def test_a_cubic_height_has_no_coefficient_and_one_of_the_fourth_degree_has(functions: DiskFunctions) -> None:
    """Integrals over the square about the disk, of x^i y^j f, by the midpoint rule."""
    side = (np.arange(300) + 0.5) / 150.0 - 1.0
    x, y = (each.ravel() for each in np.meshgrid(side, side))
    f = on_the_disk(functions, x, y) / 150.0**2
    powers = [(i, j) for i in range(5) for j in range(5 - i)]
    found = {power: np.abs(f @ (x ** power[0] * y ** power[1])).max() for power in powers}
    assert max(size for power, size in found.items() if sum(power) <= FORM.degree) < 1e-5
    assert min(size for power, size in found.items() if sum(power) > FORM.degree) > 1e-2


def test_without_a_degree_to_leave_out_an_offset_would_be_seen(functions: DiskFunctions) -> None:
    """The moments above are zero for a reason: the same functions without it have them."""
    zeros = special.jn_zeros(0, 5)
    nodes = np.linspace(0.0, 1.0, 2049)
    values, _ = disk._tapered(FORM.rim, 0, zeros, nodes)
    assert np.abs(integral(values, nodes)).max() > 1e-2


# What they are


def test_they_are_orthogonal_and_their_square_integral_is_pi(functions: DiskFunctions, r: np.ndarray) -> None:
    """Of different orders by the angle; of one order by the radial parts."""
    for m in np.unique(functions.order):
        radial = functions.table[functions.order == m]
        gram = 2.0 * np.pi * np.array([[integral(one * other, r) for one in radial] for other in radial])
        np.testing.assert_allclose(gram, np.pi * np.eye(len(radial)), atol=1e-4)


def test_they_are_zero_with_their_slope_at_the_rim(functions: DiskFunctions) -> None:
    step = 1.0 / (functions.table.shape[1] - 1)
    assert np.abs(functions.table[:, -1]).max() < 1e-12
    assert np.abs(functions.table[:, -2]).max() < 1e3 * step**2
    steepest = np.abs(np.diff(functions.table, axis=1)).max() / step
    assert np.abs(functions.table[:, -2]).max() / step < 0.02 * steepest


def test_they_have_a_value_in_the_middle_only_where_they_do_not_turn(functions: DiskFunctions) -> None:
    middle = np.abs(functions.table[:, 0])
    assert middle[functions.order > 0].max() < 1e-12
    assert middle[functions.order == 0].min() > 0.1


def test_the_wave_number_is_the_root_of_energy_over_square(functions: DiskFunctions, r: np.ndarray) -> None:
    """The Dirichlet energy by differences of the table: of G'^2 + (m G / r)^2."""
    middle, step = 0.5 * (r[1:] + r[:-1]), r[1] - r[0]
    for m, wave_number, row in zip(functions.order, functions.wave_number, functions.table, strict=True):
        value, slope = 0.5 * (row[1:] + row[:-1]), np.diff(row) / step
        energy = np.sum((slope**2 + (m * value / middle) ** 2) * middle) * step
        assert np.sqrt(energy / (np.sum(value**2 * middle) * step)) == pytest.approx(wave_number, rel=1e-3)


def test_no_function_that_is_left_out_is_calmer_than_one_that_is_kept(
    functions: DiskFunctions, more: DiskFunctions
) -> None:
    """Of all orders, the kept ones are the first; and no order beyond those looked at comes near."""
    kept = set(zip(functions.order.tolist(), np.round(functions.wave_number, 6).tolist(), strict=True))
    every = set(zip(more.order.tolist(), np.round(more.wave_number, 6).tolist(), strict=True))
    assert kept < every
    assert min(wave for _, wave in every - kept) >= max(wave for _, wave in kept)
    assert functions.order.max() < disk._HIGHEST_ORDER - 1


def test_there_are_as_many_real_coefficients_as_the_format_wants_or_one_more(
    functions: DiskFunctions, more: DiskFunctions
) -> None:
    for found, wanted in ((functions, FORM.n_real), (more, MORE.n_real)):
        assert found.n_real in (wanted, wanted + 1)
        assert found.n_real == (found.order == 0).sum() + 2 * (found.order > 0).sum()
    assert functions.table.shape == (len(functions.order), len(functions.by_radius))


def test_orders_ascend_and_wave_numbers_within_each(functions: DiskFunctions) -> None:
    """The compiled loops count on it."""
    assert np.array_equal(np.lexsort((functions.wave_number, functions.order)), np.arange(len(functions.order)))


def test_the_first_high_lobe_is_positive(functions: DiskFunctions) -> None:
    """An eigenvector has no sign of its own; marks of another machine have the same."""
    for row in functions.table:
        assert row[np.argmax(np.abs(row) > 0.5 * np.abs(row).max())] > 0


def test_the_functions_of_a_published_format_stay_as_they_are(functions: DiskFunctions) -> None:
    """Numbers of this very code, of the day when the format was made: every mark hangs on them."""
    assert functions.order.tolist() == ORDER_2026
    np.testing.assert_allclose(functions.wave_number, WAVE_NUMBER_2026, rtol=1e-6)
    np.testing.assert_allclose(functions.table[:, 1024], HALF_WAY_2026, atol=1e-6)


def test_the_end_is_smooth() -> None:
    """1 before it starts, 0 at 1, and its derivative the slope of differences."""
    x = np.linspace(0.0, 1.2, 1001)
    value, slope = smooth_end(x, 0.75)
    assert np.array_equal(value[x <= 0.75], np.ones((x <= 0.75).sum()))
    assert np.abs(value[x >= 1.0]).max() == 0.0
    assert np.abs(slope[(x <= 0.75) | (x >= 1.0)]).max() < 1e-12
    ahead, back = (smooth_end(x + step, 0.75)[0] for step in (1e-6, -1e-6))
    np.testing.assert_allclose(slope, (ahead - back) / 2e-6, atol=1e-3)
