"""Curves as SVG that takes its ink from the page, so that it reads on light and on dark."""

import io
import re
from collections.abc import Iterator
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure as Canvas

from o3dmark.report.content import Figure, Section
from o3dmark.report.data import Results, Row, interval, strength
from o3dmark.report.paper import both

COLOURS = ("#2f7ed8", "#d9534f", "#2e9e5b", "#c98a0b", "#9055c2", "#14a3a8", "#b0577f", "#7a8a12")
_INK = "#010203"  # stands for the page's text colour
_STYLE = {
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 10.5,
    "text.color": _INK,
    "axes.labelcolor": _INK,
    "axes.edgecolor": _INK,
    "xtick.color": _INK,
    "ytick.color": _INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "lines.linewidth": 1.8,
}


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
    strengths = [strength(condition) for condition in conditions]
    scaled = all(value is not None for value in strengths) and len(set(strengths)) > 1
    x = np.array(strengths if scaled else range(len(conditions)), np.float64)
    canvas, axes = _axes()
    for number, who in enumerate(results.contestants):
        samples = [_corrs(both(results, who, group, each)[0]) for each in conditions]
        aside = 0.0 if scaled else 0.6 * ((number + 1) / (len(results.contestants) + 1) - 0.5)
        _line(axes, x + aside, samples, who.name, number, scaled)
    theirs = [both(results, results.contestants[0], group, each)[1] for each in conditions]
    if any(value is not None for value in theirs):
        values = np.array([np.nan if value is None else value for value in theirs])
        style = {"linestyle": "--"} if scaled else {"linestyle": "none", "marker": "_", "markersize": 34}
        axes.plot(x, values, color=_INK, linewidth=1.4, label="paper", **style)
    axes.set_xticks(x, conditions, rotation=0 if sum(map(len, conditions)) < 42 else 20)
    if x[0] > x[-1]:
        axes.invert_xaxis()
    axes.set_ylim(-0.25, 1.05)
    axes.set_ylabel("Corr")
    axes.axhline(0, color=_INK, linewidth=0.6, alpha=0.5)
    return Figure(group.capitalize(), _svg(canvas, axes, f"curve {group}"))


def _line(axes: Any, x: Any, samples: list[list[float]], label: str, number: int, joined: bool) -> None:
    """One contestant: later ones are drawn thinner, so that lines that coincide are all seen."""
    colour = COLOURS[number % len(COLOURS)]
    means = np.array([np.mean(sample) if sample else np.nan for sample in samples])
    ends = np.array([interval(sample) if sample else (np.nan, np.nan) for sample in samples])
    if joined:
        axes.fill_between(x, ends[:, 0], ends[:, 1], color=colour, alpha=0.16, linewidth=0)
        width = max(1.2, 4.2 - 0.7 * number)
        axes.plot(x, means, color=colour, linewidth=width, marker="o", markersize=width + 2.4, label=label)
    else:
        axes.vlines(x, ends[:, 0], ends[:, 1], color=colour, alpha=0.35, linewidth=5)
        axes.plot(x, means, color=colour, marker="o", markersize=5, linestyle="none", label=label)


def _detection(results: Results) -> Figure:
    """The share of attacked meshes that a detector finds, for every false-positive rate that it is asked to keep."""
    canvas, axes = _axes()
    rates = np.logspace(-16, 0, 161)
    for number, who in enumerate(results.contestants):
        values = _p_values(results.attacked(who))
        if len(values):
            shares = [np.mean(values <= rate) for rate in rates]
            axes.plot(rates, shares, color=COLOURS[number % len(COLOURS)], label=who.name)
    axes.plot(rates, rates, color=_INK, linestyle=":", linewidth=1, label="chance")
    axes.set_xscale("log")
    axes.set_xticks([1e-16, 1e-12, 1e-8, 1e-4, 1], ["10⁻¹⁶", "10⁻¹²", "10⁻⁸", "10⁻⁴", "1"], minor=False)
    axes.minorticks_off()
    axes.set_ylim(-0.03, 1.05)
    axes.set_xlabel("false-positive rate asked for")
    axes.set_ylabel("share of attacked meshes detected")
    caption = "ROC over all attacks of the campaign, the hopeless ones included."
    return Figure("Marks found at a false-positive rate", _svg(canvas, axes, "roc"), caption)


def _false_positives(results: Results) -> Figure:
    """How often a wrong key gets a p-value as small: as often as the p-value says."""
    canvas, axes = _axes()
    least = 1.0
    for number, who in enumerate(results.contestants):
        values = np.sort(_p_values(results.strangers(who), "p_uncharged"))
        if len(values):
            least = min(least, 0.5 / len(values))
            shares = np.arange(1, len(values) + 1) / len(values)
            axes.step(values, shares, where="post", color=COLOURS[number % len(COLOURS)], label=who.name)
    axes.plot([1e-6, 1], [1e-6, 1], color=_INK, linestyle="--", linewidth=1, label="exact")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(least / 2, 1.2)
    axes.set_ylim(least, 1.2)
    axes.set_xlabel("p-value")
    axes.set_ylabel("share of wrong keys below it")
    caption = (
        "p-values of single readings, which a wrong key should get as often as they say: along the dashed line. The"
        " p-values reported are larger, since all the readings tried are charged."
    )
    return Figure("False positives", _svg(canvas, axes, "false positives"), caption)


def _corrs(rows: list[Row]) -> list[float]:
    return [row["corr"] for row in rows if row["corr"] is not None]


def _p_values(rows: list[Row], field: str = "p_value") -> Any:
    return np.array([row[field] for row in rows if row.get(field) is not None], np.float64)


def _axes() -> tuple[Canvas, Any]:
    with matplotlib.rc_context(_STYLE):
        canvas = Canvas(figsize=(5.6, 3.7), layout="constrained")
        return canvas, canvas.add_subplot()


def _svg(canvas: Canvas, axes: Any, name: str) -> str:
    """The figure as an element for a page: no head, no links, ink replaced by the page's."""
    with matplotlib.rc_context(_STYLE | {"svg.hashsalt": name}):
        canvas.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=9)
        file = io.StringIO()
        canvas.savefig(
            file, format="svg", transparent=True, metadata=dict.fromkeys(("Date", "Creator", "Format", "Type"))
        )
    svg = file.getvalue()
    svg = svg[svg.index("<svg") :].replace(_INK, "currentColor")
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r' xmlns(:\w+)?="[^"]*"', "", svg)
    svg = re.sub(r' width="[^"]*pt"| height="[^"]*pt"', "", svg, count=2)
    return re.sub(r"(font: [\d.]+px|font-family:) [^;\"]*", lambda found: _font(found[0]), svg).strip()


def _font(found: str) -> str:
    """The page's own font instead of matplotlib's list."""
    return f"{found.split('px')[0]}px sans-serif" if "px" in found else "font-family: sans-serif"


__all__ = ["COLOURS", "curve_sections"]
