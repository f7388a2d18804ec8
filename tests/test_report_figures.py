"""How a report sums up and shows figures: means, intervals, differences, strengths, published figures."""

import math

import numpy as np
import pytest
from scipy.stats import binom

from fixtures.kept_folder import FIGURES
from fixtures.paths import ROOT
from o3dmark.errors import SpecError
from o3dmark.report.condition import same, strength
from o3dmark.report.content import ber_number, corr_cell, corr_number, cost_cell, number, signed, tone_of
from o3dmark.report.drawing import axes_for
from o3dmark.report.published import Published
from o3dmark.report.summary import interval, mean, share_interval


def test_the_interval_is_that_of_95_percent_where_it_is_known() -> None:
    """The mean of coin tosses, resampled, is binomial; that of many values is normal."""
    low, high = interval([0.0] * 200 + [1.0] * 200)
    known = binom.ppf([0.025, 0.975], 400, 0.5) / 400  # 0.451, 0.549; of 90 %: 0.459, 0.541
    assert np.abs(np.array([low, high]) - known).max() < 0.004
    values = np.random.default_rng(3).normal(0.3, 0.1, 900)
    half = np.subtract(*interval(values)[::-1]) / 2
    assert half / (values.std() / math.sqrt(900)) == pytest.approx(1.96, abs=0.12)  # of 90 %: 1.64


def test_the_interval_of_equal_values_is_a_point_and_always_the_same() -> None:
    assert interval([0.5]) == interval([0.5, 0.5]) == (0.5, 0.5)
    assert interval([0.0, 0.5, 1.0]) == interval([0.0, 0.5, 1.0])


@pytest.mark.parametrize(("successes", "trials"), [(0, 12), (12, 12), (36, 45), (1, 3)])
def test_the_interval_of_a_share_is_wilsons(successes: int, trials: int) -> None:
    """Its ends are the rates from which the share lies 1.96 of their own standard deviations away."""
    share, z = successes / trials, 1.959964
    for end in share_interval(successes, trials):
        assert (share - end) ** 2 == pytest.approx(z**2 * end * (1 - end) / trials, abs=1e-6)


def test_a_mean_is_of_what_is_there() -> None:
    assert mean([1.0, None, 0.0]) == 0.5
    assert mean([None]) is None


@pytest.mark.parametrize(
    ("value", "text"),
    [(1.0, "1.00"), (0.9999, "0.99"), (0.985, "0.98"), (-0.001, "0.00"), (-1.0, "−1.00"), (None, "–")],
)
def test_corr_is_never_shown_as_1_unless_it_is(value: float | None, text: str) -> None:
    assert corr_number(value) == text


@pytest.mark.parametrize(("value", "text"), [(0.0, "0.000"), (0.0001, "0.001"), (0.5, "0.500"), (None, "–")])
def test_a_bit_error_rate_is_never_shown_as_0_unless_it_is(value: float | None, text: str) -> None:
    assert ber_number(value) == text


def test_the_difference_is_that_of_the_figures_shown() -> None:
    cell = corr_cell(0.924, 0.906)
    assert (cell.text, cell.remark) == ("0.92", "published 0.91 (+0.01)")
    assert corr_cell(0.876, 0.9103).tone == "same"  # 0.88 and 0.91
    assert corr_cell(None, 0.5).text == "–"
    assert corr_cell(None, 0.5).remark == ""
    assert corr_cell(0.5).tone == cost_cell(0.5).tone == ""
    assert (number(-0.001), number(-0.5), signed(0.0)) == ("0.00", "−0.50", "+0.00")


@pytest.mark.parametrize(
    ("gain", "tone"), [(0.2, "better"), (0.02, "same"), (-0.03, "same"), (-0.1, "below"), (-0.5, "far")]
)
def test_tones(gain: float, tone: str) -> None:
    assert tone_of(gain) == tone
    assert cost_cell(0.5 - gain, 0.5).tone == tone_of(2 * gain)  # less is better, relative to 0.5


@pytest.mark.parametrize(
    ("condition", "value"),
    [("0.05%", (0.05, "%")), ("0.10 %", (0.1, "%")), ("11 bit", (11, "bit")), ("1", None), ("loop", None)],
)
def test_a_strength_is_a_number_with_a_unit(condition: str, value: tuple[float, str] | None) -> None:
    assert strength(condition) == value


def test_conditions_are_the_same_when_number_and_unit_are() -> None:
    assert same("0.10%", "0.1 %")
    assert not same("10%", "10 it")
    assert not same("1", "1.0")  # names


@pytest.mark.parametrize(
    ("conditions", "places", "scaled"),
    [
        (("11 bit", "7 bit"), (11, 7), True),
        (("0.05%", "0.50%"), (0.05, 0.5), True),
        (("loop", "midpoint", "sqrt3"), (0, 1, 2), False),
        (("5 it", "loop"), (0, 1), False),
        (("5 it", "10%"), (0, 1), False),
    ],
)
def test_conditions_stand_by_their_strength_with_the_strongest_on_the_right(
    conditions: tuple[str, ...], places: tuple[float, ...], scaled: bool
) -> None:
    _, axes, x, by_strength = axes_for(conditions)
    assert (tuple(x), by_strength) == (places, scaled)
    shown = axes.transData.transform(np.stack([x, 0 * x], axis=1))[:, 0]
    assert (np.diff(shown) > 0).all()


def test_published_figures_are_found_by_table_condition_and_model_alone() -> None:
    figures = Published.read(FIGURES, {"hamidi": "Hamidi 2019"})
    assert figures.method == "hamidi"
    assert figures.value("noise", "0.1%", "Bimba") == 0.92
    assert figures.value("noise comparison", "0.50%", "Bunny", method="cho2007") == 0.66
    for table, condition, model in (("hiss", "0.1%", "Bimba"), ("noise", "0.2%", "Bimba"), ("noise", "0.1%", "Vase")):
        assert figures.value(table, condition, model) is None
    assert figures.mean_of("noise", "0.5%", ["Bimba", "Vase", "Horse"]) == pytest.approx((0.79 + 0.72) / 2)
    assert figures.mean_of("noise", "0.5%", ["Horse"]) is None
    assert (figures.name("hamidi"), figures.name("cho2007")) == ("Hamidi 2019", "cho2007")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("\n", "first line"),
        ("a,b\n", "first line"),
        (FIGURES + "noise,x,corr\n", "line 17"),
        (FIGURES + "a,b,c,d,e,much\n", "line 17"),
    ],
)
def test_published_figures_that_are_none_are_refused(text: str, reason: str) -> None:
    with pytest.raises(SpecError, match=reason):
        Published.read(text, {})


def test_no_text_is_no_figures() -> None:
    assert Published.read("", {}).figures == ()


def test_the_papers_figures_are_complete() -> None:
    figures = Published.read((ROOT / "o3dmark" / "campaign" / "specs" / "hamidi2019.csv").read_text(), {})
    tables = {each.table for each in figures.figures}
    assert {"noise", "smoothing", "reordering", "quantization", "similarity", "subdivision", "cropping"} <= tables
    assert len(figures.models("noise")) == 6
    assert figures.mean_of("noise", "0.50%", figures.models("noise")) == pytest.approx(
        (0.83 + 0.72 + 0.74 + 0.76 + 0.74 + 0.79) / 6
    )
    assert all(0 < each.value <= 6 for each in figures.figures)
