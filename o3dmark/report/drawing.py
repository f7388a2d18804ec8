"""Axes, lines and SVG that takes its ink from the page, so that it reads on light and on dark."""

import io
import re
import warnings
from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure as Canvas

from o3dmark.arrays import Floats
from o3dmark.campaign.row import Row
from o3dmark.report.condition import strength
from o3dmark.report.summary import interval

# Told apart by people who see no red or no green, too, on white and on near black; the markers help where lines cross.
COLOURS = ("#1f80c9", "#d55e00", "#00a078", "#dd9a00", "#c673a0", "#4db3e6", "#8f7448", "#8a8a92")
MARKERS = "os^DvPX*"
INK = "#010203"  # stands for the page's text colour
_STYLE = {
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 10.5,
    "text.parse_math": False,  # names are text, whatever dollars they hold
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "lines.linewidth": 1.8,
}
_WIDTH = 40  # characters that fit below the x axis


def axes_for(conditions: Sequence[str] = ()) -> tuple[Canvas, Any, Floats, bool]:
    """A canvas, its axes, where the conditions stand on the x axis (k,), and whether that is by their strengths.

    Strong attacks are on the right. Without strengths in one unit, conditions stand side by side.
    """
    with matplotlib.rc_context(_STYLE):
        canvas = Canvas(figsize=(5.2, 4.1), layout="constrained")
        axes = canvas.add_subplot()
    strengths = [found for condition in conditions if (found := strength(condition))]
    one_unit = len(strengths) == len(conditions) and len({unit for _, unit in strengths}) == 1
    scaled = one_unit and len(set(strengths)) > 1
    x = np.array([value for value, _ in strengths] if scaled else range(len(conditions)), np.float64)
    if conditions:
        room = _WIDTH * np.diff(np.sort(x)).min(initial=np.inf) / (np.ptp(x) or 1.0)
        crowded = room < max(map(len, conditions)) + 2
        slant = {"rotation": 30, "ha": "right", "rotation_mode": "anchor"} if crowded else {}
        with matplotlib.rc_context(_STYLE):
            axes.set_xticks(x, conditions, **slant)
        if x[0] > x[-1]:
            axes.invert_xaxis()
    return canvas, axes, x, scaled


def corr_axis(axes: Any) -> None:
    """The y axis of all curves of Corr: the same in every figure, so that figures can be compared."""
    axes.set_ylim(-0.25, 1.05)
    axes.set_ylabel("Corr")
    axes.axhline(0, color=INK, linewidth=0.6, alpha=0.5)


def colour(number: int) -> str:
    """The colour of the entry with this number."""
    return COLOURS[number % len(COLOURS)]


def legend_name(name: str) -> str:
    """A name as a label: matplotlib leaves out of the legend what begins with an underscore."""
    return f" {name}" if name.startswith("_") else name


def line(axes: Any, x: Any, samples: list[list[float]], label: str, number: int, joined: bool) -> None:
    """Means and 95 % intervals of one entry; later ones are thinner, so that lines that coincide are all seen."""
    shade, marker = colour(number), MARKERS[number % len(MARKERS)]
    means = np.array([np.mean(sample) if sample else np.nan for sample in samples])
    ends = np.array([interval(sample) if sample else (np.nan, np.nan) for sample in samples])
    if joined:
        axes.fill_between(x, ends[:, 0], ends[:, 1], color=shade, alpha=0.14, linewidth=0)
        width = max(1.2, 4.2 - 0.7 * number)
        axes.plot(
            x, means, color=shade, linewidth=width, marker=marker, markersize=width + 3.4, label=legend_name(label)
        )
    else:
        axes.vlines(x, ends[:, 0], ends[:, 1], color=shade, alpha=0.35, linewidth=5)
        axes.plot(x, means, color=shade, marker=marker, markersize=6, linestyle="none", label=legend_name(label))


def corrs(rows: list[Row]) -> list[float]:
    """The Corr of those rows that have one."""
    return [row.corr for row in rows if row.corr is not None]


def svg(canvas: Canvas, axes: Any, name: str) -> str:
    """The figure as an element for a page: no head, no links, ink replaced by the page's."""
    with matplotlib.rc_context(_STYLE | {"svg.hashsalt": name}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # the page's font draws the text, not matplotlib's
        canvas.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=10)
        file = io.StringIO()
        canvas.savefig(
            file, format="svg", transparent=True, metadata=dict.fromkeys(("Date", "Creator", "Format", "Type"))
        )
    text = file.getvalue()
    text = text[text.index("<svg") :].replace(INK, "currentColor")
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r' xmlns(:\w+)?="[^"]*"', "", text)
    text = re.sub(r' width="[^"]*pt"| height="[^"]*pt"', "", text, count=2)
    return re.sub(r"(font: [\d.]+px|font-family:) [^;\"]*", lambda found: _font(found[0]), text).strip()


def _font(found: str) -> str:
    """The page's own font instead of matplotlib's list."""
    return f"{found.split('px')[0]}px sans-serif" if "px" in found else "font-family: sans-serif"
