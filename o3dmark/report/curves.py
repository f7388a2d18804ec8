"""Curves over the strength of attacks, and of p-values."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from o3dmark.report.content import Figure, Section
from o3dmark.report.data import Results, Row
from o3dmark.report.drawing import INK, axes_for, colour, corr_axis, corrs, line, svg
from o3dmark.report.paper import both


def curve_sections(results: Results) -> Iterator[Section]:
    """Robustness against strength, then what p-values say of genuine and of wrong keys."""
    groups = [group for group, conditions in results.groups.items() if len(conditions) > 1]
    figures = tuple(_robustness(results, group) for group in groups)
    intro = (
        "Mean Corr over meshes and seeds; the shades are 95 % bootstrap intervals of that mean. The dashed line is the"
        " mean of the paper's own figures for the same models. Where lines coincide, the later ones are the thinner."
    )
    yield Section("Robustness curves", intro, figures)
    figures = (
        _detection(results),
        *((_false_positives(results),) if any(map(results.strangers, results.contestants)) else ()),
    )
    intro = (
        "The p-value of a reading tests whether the known bits are there; a detector compares it with the"
        " false-positive rate that is wanted."
    )
    yield Section("Detection", intro, figures)


def _robustness(results: Results, group: str) -> Figure:
    conditions = results.groups[group]
    canvas, axes, x, scaled = axes_for(conditions)
    for number, who in enumerate(results.contestants):
        samples = [corrs(both(results, who, group, each)[0]) for each in conditions]
        aside = 0.0 if scaled else 0.6 * ((number + 1) / (len(results.contestants) + 1) - 0.5)
        line(axes, x + aside, samples, who.name, number, scaled)
    theirs = [both(results, results.contestants[0], group, each)[1] for each in conditions]
    if any(value is not None for value in theirs):
        values = np.array([np.nan if value is None else value for value in theirs])
        style = {"linestyle": "--"} if scaled else {"linestyle": "none", "marker": "_", "markersize": 34}
        axes.plot(x, values, color=INK, linewidth=1.4, label="paper", **style)
    corr_axis(axes)
    return Figure(group.capitalize(), svg(canvas, axes, f"curve {group}"))


def _detection(results: Results) -> Figure:
    """The share of attacked meshes that a detector finds, for every false-positive rate that it is asked to keep."""
    canvas, axes, _, _ = axes_for()
    rates = np.logspace(-16, 0, 161)
    for number, who in enumerate(results.contestants):
        values = _p_values(results.attacked(who))
        if len(values):
            shares = [np.mean(values <= rate) for rate in rates]
            axes.plot(rates, shares, color=colour(number), label=who.name)
    axes.plot(rates, rates, color=INK, linestyle=":", linewidth=1, label="chance")
    axes.set_xscale("log")
    axes.set_xticks([1e-16, 1e-12, 1e-8, 1e-4, 1], ["10⁻¹⁶", "10⁻¹²", "10⁻⁸", "10⁻⁴", "1"], minor=False)
    axes.minorticks_off()
    axes.set_ylim(-0.03, 1.05)
    axes.set_xlabel("false-positive rate asked for")
    axes.set_ylabel("share of attacked meshes detected")
    caption = "ROC over all attacks of the campaign, the hopeless ones included."
    return Figure("Marks found at a false-positive rate", svg(canvas, axes, "roc"), caption)


def _false_positives(results: Results) -> Figure:
    """How often a wrong key gets a p-value as small: as often as the p-value says."""
    canvas, axes, _, _ = axes_for()
    least = 1.0
    for number, who in enumerate(results.contestants):
        values = np.sort(_p_values(results.strangers(who), "p_uncharged"))
        if len(values):
            least = min(least, 0.5 / len(values))
            shares = np.arange(1, len(values) + 1) / len(values)
            axes.step(values, shares, where="post", color=colour(number), label=who.name)
    axes.plot([1e-6, 1], [1e-6, 1], color=INK, linestyle="--", linewidth=1, label="exact")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(least / 2, 1.2)
    axes.set_ylim(least, 1.2)
    axes.tick_params(which="minor", labelbottom=False, labelleft=False)
    axes.set_xlabel("p-value")
    axes.set_ylabel("share of wrong keys below it")
    caption = (
        "p-values of single readings, which a wrong key should get as often as they say: along the dashed line. The"
        " p-values reported are larger, since all the readings tried are charged."
    )
    return Figure("False positives", svg(canvas, axes, "false positives"), caption)


def _p_values(rows: list[Row], field: str = "p_value") -> Any:
    return np.array([row[field] for row in rows if row.get(field) is not None], np.float64)
