"""Curves over the strength of attacks, and of p-values."""

from collections.abc import Iterator

import numpy as np

from o3dmark.arrays import Floats
from o3dmark.campaign.row import WRONG_KEY, Row
from o3dmark.report.content import Figure, Section
from o3dmark.report.data import Results
from o3dmark.report.drawing import INK, axes_for, colour, corr_axis, corrs, legend_name, line, svg

_LEAST = -16.0  # log10 of the smallest false-positive rate drawn


def curve_sections(results: Results) -> Iterator[Section]:
    """Robustness against strength, then what p-values say of marked meshes and of wrong keys."""
    groups = [group for group, conditions in results.groups.items() if len(conditions) > 1]
    intro = (
        "Mean Corr over meshes and seeds; the shades are 95 % bootstrap intervals of that mean. Where lines coincide,"
        " the later ones are the thinner."
    )
    if results.compared:
        intro += (
            " The dashed line is the published mean; where it stands, ours are over the same meshes, those that have a"
            " published figure of their name."
        )
    if groups:
        yield Section("Robustness curves", intro, tuple(_robustness(results, group) for group in groups))
    intro = (
        "The p-value of a reading tests whether the known bits are there; a detector compares it with the"
        " false-positive rate that is wanted."
    )
    if figures := [*_detection(results), *_false_positives(results)]:
        yield Section("Detection", intro, tuple(figures))


def _robustness(results: Results, group: str) -> Figure:
    conditions = results.groups[group]
    canvas, axes, x, scaled = axes_for(conditions)
    for number, who in enumerate(results.entries):
        samples = [corrs(_rows(results, number, group, each)) for each in conditions]
        aside = 0.0 if scaled else 0.6 * ((number + 1) / (len(results.entries) + 1) - 0.5)
        line(axes, x + aside, samples, who.name, number, scaled)
    theirs = [results.published.mean_of(group, each, results.meshes) for each in conditions]
    if any(value is not None for value in theirs):
        values = np.array([np.nan if value is None else value for value in theirs])
        style = {"linestyle": "--"} if scaled else {"linestyle": "none", "marker": "_", "markersize": 34}
        axes.plot(x, values, color=INK, linewidth=1.4, label="published", **style)
    corr_axis(axes)
    return Figure(group.capitalize(), svg(canvas, axes, f"curve {group}"))


def _rows(results: Results, number: int, group: str, condition: str) -> list[Row]:
    """A entry's readings, over the meshes of the published mean where there is one."""
    who = results.entries[number]
    if (group, condition) in results.compared:
        return results.beside(who, group, condition)[0]
    return results.of(who, group, condition)


def _detection(results: Results) -> Iterator[Figure]:
    """The share of attacked meshes that a detector finds, for every false-positive rate that it is asked to keep."""
    if not any(map(results.attacked, results.entries)):
        return
    canvas, axes, _, _ = axes_for()
    rates = np.linspace(_LEAST, 0, 161)
    for number, who in enumerate(results.entries):
        values = _logs([row.log10_p for row in results.attacked(who)])
        if len(values):
            shares = [np.mean(values <= rate) for rate in rates]
            axes.plot(10.0**rates, shares, color=colour(number), label=legend_name(who.name))
    axes.plot(10.0**rates, 10.0**rates, color=INK, linestyle=":", linewidth=1, label="chance")
    axes.set_xscale("log")
    axes.set_xticks([1e-16, 1e-12, 1e-8, 1e-4, 1], ["10⁻¹⁶", "10⁻¹²", "10⁻⁸", "10⁻⁴", "1"], minor=False)
    axes.minorticks_off()
    axes.set_ylim(-0.03, 1.05)
    axes.set_xlabel("false-positive rate asked for")
    axes.set_ylabel("share of attacked meshes detected")
    caption = (
        "ROC over all attacks of the campaign, the hopeless ones included: the share of readings whose p-value, every"
        " hypothesis charged, is at most the rate."
    )
    yield Figure("Marks found at a false-positive rate", svg(canvas, axes, "roc"), caption)


def _false_positives(results: Results) -> Iterator[Figure]:
    """How often a wrong key gets a p-value as small: as often as the p-value says."""
    canvas, axes, _, _ = axes_for()
    least = 1.0
    for number, who in enumerate(results.entries):
        values = 10.0 ** np.sort(_logs([row.log10_p_uncharged for row in results.controls(who, WRONG_KEY)]))
        if len(values):
            least = min(least, 0.5 / len(values))
            shares = np.arange(1, len(values) + 1) / len(values)
            axes.step(values, shares, where="post", color=colour(number), label=legend_name(who.name))
    if least == 1.0:
        return
    axes.plot([1e-6, 1], [1e-6, 1], color=INK, linestyle="--", linewidth=1, label="exact")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(least / 2, 1.2)
    axes.set_ylim(least, 1.2)
    axes.tick_params(which="minor", labelbottom=False, labelleft=False)
    axes.set_xlabel("p-value")
    axes.set_ylabel("share of wrong keys at or below it")
    caption = (
        "p-values of single readings, which a wrong key should get as often as they say: along the dashed line. The"
        " p-values reported are larger, since all the readings tried are charged."
    )
    yield Figure("False positives", svg(canvas, axes, "false positives"), caption)


def _logs(values: list[float | None]) -> Floats:
    return np.array([value for value in values if value is not None], np.float64)
