"""Sheets of pictures with titles, captions and colour bars, to explain a mark and an attack.

matplotlib draws text and bars without its global state (no pyplot); pictures are put in pixel by pixel.
"""

import textwrap
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from o3dmark.arrays import Floats
from o3dmark.mesh.patch import Patch
from o3dmark.view.camera import THREE_QUARTER, Camera
from o3dmark.view.colours import beyond, colour_limits
from o3dmark.view.render import Image, Look, render

CELL, PICTURE = 500, 375  # width and height of a picture in units of the layout; all its lengths are in these
HEAD, FOOT = 62, 74  # heights above a picture, for title and caption, and below it, for the colour bar, if any has one
TITLE, GAP = 56, 24  # height of the sheet's own title; space between panels and at the edges
DPI = 100
INK, GREY = "#26231f", "#77716a"
CAPTION_LENGTH, NOTE_LENGTH = 66, 46  # characters that a line has room for


@dataclass(frozen=True, eq=False)
class Panel:
    """One picture of a sheet: a mesh under a title; with ``scalars``, a colour bar whose quantity ``bar`` names.

    scalars, limits, colormap, frame, look and patches are as in `render`; camera, if any, is instead of the sheet's.
    """

    title: str
    mesh: Any
    caption: str = ""
    scalars: Floats | None = None
    bar: str = ""
    limits: tuple[float, float] | None = None
    colormap: str = "viridis"
    frame: Any = None
    look: Look = "clay"
    camera: Camera | None = None
    patches: tuple[Patch, ...] = ()


def render_scalars(
    mesh: Any,
    scalars: ArrayLike,
    label: str,
    *,
    title: str = "",
    limits: tuple[float, float] | None = None,
    colormap: str = "viridis",
    camera: Camera = THREE_QUARTER,
    width: int = 800,
) -> Image:
    """A picture (h, width, 3) of a quantity on a mesh with its colour bar; ``label`` names quantity and unit."""
    values = np.array(scalars, np.float64)
    panel = Panel(title, mesh, "", values, label, limits, colormap)
    return sheet([panel], columns=1, camera=camera, width=width)


def sheet(
    panels: Sequence[Panel],
    *,
    title: str = "",
    notes: Sequence[str] = (),
    columns: int = 3,
    camera: Camera = THREE_QUARTER,
    width: int = 1600,
) -> Image:
    """Panels in rows of ``columns``, left to right, then the notes in a panel of their own: (h, width, 3).

    The height follows from the rows; text and bars keep their size relative to ``width``, in pixels.
    """
    from matplotlib.figure import Figure  # here, not above: half a second that `import o3dmark.view` need not wait

    n_rows = -(-(len(panels) + bool(notes)) // columns)
    unit = width / (columns * (CELL + GAP) + GAP)  # pixels
    top = TITLE * bool(title)
    row = HEAD + PICTURE + FOOT * any(panel.scalars is not None for panel in panels)
    height = round(unit * (top + n_rows * row + GAP))
    figure = Figure(figsize=((width + 0.01) / DPI, (height + 0.01) / DPI), dpi=DPI, facecolor="white")
    canvas = _Canvas(figure, unit, width, height)
    canvas.text(GAP, TITLE / 2 + GAP / 2, title, 22, INK, "bold")
    for place, panel in enumerate(panels):
        canvas.panel(panel, *_corner(place, columns, top, row), camera)
    x, y = _corner(len(panels), columns, top, row)
    lines = [part for note in notes for part in textwrap.wrap(note, NOTE_LENGTH) or [""]]
    for number, line in enumerate(lines):
        canvas.text(x + GAP, y + HEAD + PICTURE / 2 + 28 * (number - (len(lines) - 1) / 2), line, 16, INK)
    return canvas.pixels()


def _corner(place: int, columns: int, top: float, row: float) -> tuple[float, float]:
    """Left and top of the panel at a place, in rows so high."""
    number, column = divmod(place, columns)
    return GAP + column * (CELL + GAP), top + number * row


@dataclass(frozen=True, eq=False)
class _Canvas:
    """A matplotlib figure in whose layout x runs right and y down, in units of so many pixels."""

    figure: Any
    unit: float
    width: int
    height: int

    def text(self, x: float, y: float, text: str, size: float, colour: str, weight: str = "normal") -> None:
        """Text that begins at x and is centred at y; ``size`` in units."""
        self.figure.text(
            x * self.unit / self.width,
            1 - y * self.unit / self.height,
            text,
            size=size * self.unit * 72 / DPI,
            color=colour,
            weight=weight,
            va="center",
            parse_math=False,
        )

    def panel(self, panel: Panel, x: float, y: float, camera: Camera) -> None:
        """A panel whose left and top are x, y."""
        self.text(x, y + 24, panel.title, 18, INK, "bold")
        caption = panel.caption if len(panel.caption) <= CAPTION_LENGTH else panel.caption[: CAPTION_LENGTH - 1] + "…"
        self.text(x, y + 47, caption, 14, GREY)
        limits = panel.limits
        if panel.scalars is not None and limits is None:
            limits = colour_limits(panel.scalars)
        image = render(
            panel.mesh,
            panel.scalars,
            camera=panel.camera or camera,
            size=(round(CELL * self.unit), round(PICTURE * self.unit)),
            limits=limits,
            colormap=panel.colormap,
            frame=panel.frame,
            look=panel.look,
            patches=panel.patches,
        )
        bottom = self.height - round((y + HEAD) * self.unit) - len(image)
        self.figure.figimage(image, round(x * self.unit), bottom, origin="upper")
        if panel.scalars is not None and limits is not None:
            self.bar(panel, limits, x + CELL / 6, y + HEAD + PICTURE + 10)

    def bar(self, panel: Panel, limits: tuple[float, float], x: float, y: float) -> None:
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize
        from matplotlib.ticker import MaxNLocator

        u, points = self.unit, self.unit * 72 / DPI
        box = (x * u / self.width, 1 - (y + 11) * u / self.height, CELL * 2 / 3 * u / self.width, 11 * u / self.height)
        axes = self.figure.add_axes(box)
        extend = beyond(np.asarray(panel.scalars), limits)
        shown = ScalarMappable(Normalize(*limits), panel.colormap)
        bar = self.figure.colorbar(shown, cax=axes, orientation="horizontal", extend=extend, ticks=MaxNLocator(5))
        bar.formatter.set_powerlimits((-3, 4))
        bar.formatter.set_useMathText(True)
        bar.outline.set_visible(False)
        axes.tick_params(color=GREY, labelcolor=INK, labelsize=12 * points, length=4 * points, pad=2 * points)
        axes.xaxis.get_offset_text().set_size(12 * points)
        axes.set_xlabel(panel.bar, size=13 * points, color=INK, labelpad=2 * points, parse_math=False)

    def pixels(self) -> Image:
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        canvas = FigureCanvasAgg(self.figure)
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Glyph .* missing")  # a message in a script that the font lacks
            canvas.draw()
        return np.array(canvas.buffer_rgba())[:, :, :3].copy()
