"""What a report consists of, whatever it is written in: sections of tables, figures and pictures."""

from dataclasses import dataclass, replace
from typing import Literal

Tone = Literal["", "better", "same", "below", "far"]
_WIDE = 14  # columns that fit on a page
_NEAR, _FAR = 0.03, 0.15  # differences of Corr, or relative ones where less is better
TONES: dict[Tone, str] = {
    "better": "better than published",
    "same": f"the same within {_NEAR:g}",
    "below": f"up to {_FAR:g} below",
    "far": "further below",
}


@dataclass(frozen=True)
class Cell:
    """A figure, a remark in small print beside it, and how it compares with a published one (the colour)."""

    text: str
    remark: str = ""
    tone: Tone = ""


@dataclass(frozen=True)
class Table:
    """Rows of cells under a head; the first cell of a row names it.

    ``folded``: shown on demand, where that can be. ``prose``: the cells are words to read, not figures to compare.
    """

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    caption: str = ""
    folded: bool = False
    prose: bool = False


@dataclass(frozen=True)
class Figure:
    """A drawing, as SVG without a head of its own."""

    title: str
    svg: str
    caption: str = ""


@dataclass(frozen=True)
class Picture:
    """A photograph-like image, as JPEG."""

    title: str
    jpeg: bytes
    caption: str = ""


Block = Table | Figure | Picture


def fitting(table: Table) -> Table:
    """A table with a column for each mesh; where they are too many for a page, with a line for each."""
    if len(table.head) <= _WIDE:
        return table
    columns = zip(*table.rows, strict=True)
    names, *others = ([cell.text for cell in next(columns)], *columns)
    rows = tuple((Cell(name), *cells) for name, cells in zip(table.head[1:], others, strict=True))
    return replace(table, head=(table.head[0], *names), rows=rows)


@dataclass(frozen=True)
class Section:
    """A heading, what one should know before looking, and the blocks."""

    title: str
    intro: str
    blocks: tuple[Block, ...] = ()


def number(value: float | None, digits: int = 2) -> str:
    """A figure as the tables show it; a dash where there is none."""
    if value is None:
        return "–"
    text = f"{value:.{digits}f}"
    return text.replace("-", "−") if float(text) else f"{0:.{digits}f}"


def corr_number(value: float | None) -> str:
    """Corr with two digits, and never 1.00 for anything less."""
    return number(value if value is None or value >= 1 else min(value, 0.99))


def ber_number(value: float | None) -> str:
    """A bit error rate with three digits, and never 0.000 for anything more."""
    return number(value if not value else max(value, 0.001), 3)


def signed(value: float, digits: int = 2) -> str:
    """A difference with its sign."""
    text = number(value, digits)
    return text if text.startswith("−") else f"+{text}"


def corr_cell(ours: float | None, theirs: float | None = None) -> Cell:
    """Our Corr; where there is a published one, that and the difference as a remark, and the colour."""
    return _compared(ours, theirs, corr_number(ours), low=False)


def cost_cell(ours: float | None, theirs: float | None = None) -> Cell:
    """Likewise a figure of which less is better; the colour is of the relative difference."""
    return _compared(ours, theirs, number(ours), low=True)


def _compared(ours: float | None, theirs: float | None, text: str, *, low: bool) -> Cell:
    if ours is None or theirs is None:
        return Cell(text)
    gap = float(text.replace("−", "-")) - round(theirs, 2)  # the difference of the figures that are shown
    gain = (theirs - ours) / abs(theirs or 1.0) if low else round(gap, 2)
    return Cell(text, f"published {number(theirs)} ({signed(gap)})", tone_of(gain))


def tone_of(gain: float) -> Tone:
    """The colour of a gain (of Corr, or relative)."""
    if gain > _NEAR:
        return "better"
    return "same" if gain >= -_NEAR else "below" if gain >= -_FAR else "far"
