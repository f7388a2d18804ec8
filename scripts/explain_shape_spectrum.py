"""The one picture that explains shape-spectrum: docs/shape_spectrum.png.

    python scripts/explain_shape_spectrum.py OUT.png [MESH]

Above: one of the key's functions on the surface, the motion that writes 64 bits, and the mesh after an attack that
leaves no vertex in place. Below: the 64 numbers that the reader measures, in periods of their combs of codewords,
before marking, after it, and after the attack.
"""

import hashlib
import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from o3dmark import METHODS, SHAPES, Key, attack_all, read_mesh
from o3dmark.mesh.surface import Surface
from o3dmark.methods.shape_spectrum.method import ShapeSpectrum
from o3dmark.view import Image, Panel, save_png, sheet

ATTACK = ("remesh:edge=0.015", "noise:amplitude=0.003", "similarity")
KEY = Key(hashlib.sha256(b"explain").digest())
BITS = np.random.default_rng(0).integers(0, 2, 64)
ROWS = (("cover", "#9a948c"), ("marked", "#1f6fb2"), ("remeshed, noise,\nturned, scaled", "#d1495b"))


def main(out: Path, path: Path | None) -> None:
    cover = read_mesh(path) if path else SHAPES.make("bimba").build()
    method = METHODS.make("shape-spectrum")
    assert isinstance(method, ShapeSpectrum)
    marked = method.embed(cover, BITS, KEY)
    attacked = attack_all(marked, ATTACK, 1)
    pictures = sheet(panels(method, cover, marked, attacked), columns=3, width=1500)
    read = method.extract(marked, len(BITS), KEY)
    assert read.step is not None
    plot = combs([periods(method, mesh, read.step) for mesh in (cover, marked, attacked)], width=pictures.shape[1])
    save_png(out, np.concatenate([pictures, plot]))


def panels(method: ShapeSpectrum, cover: object, marked: object, attacked: object) -> list[Panel]:
    here = method.cover(Surface.of(cover), KEY, len(BITS))
    seen = here.frame.points(here.surface.vertices)
    function = here.projections.functions(seen)[0]
    diagonal = here.surface.diagonal
    motion = np.einsum("nd,nd->n", Surface.of(marked).vertices - here.surface.vertices, here.normals) / diagonal
    reach = float(np.abs(motion).max())
    return [
        Panel("one of the key's 64 functions", cover, "a random mix of low waves", function, "", (-3, 3), "coolwarm"),
        Panel(
            "the least motion that writes 64 bits",
            cover,
            f"RMS {np.sqrt(np.mean(motion**2)):.1e} of the diagonal",
            motion,
            "outward, of the diagonal",
            (-reach, reach),
            "coolwarm",
        ),
        Panel("no vertex is where it was", attacked, "; ".join(ATTACK)),
    ]


def periods(method: ShapeSpectrum, mesh: object, step: float) -> np.ndarray:
    """The 64 values of a mesh, in periods of their combs, as the reader first sees them."""
    sights, _ = next(iter(method.observe(mesh)))
    projections = method.projections(KEY, len(BITS))
    view = next(sights[0].measurements(projections))
    return (view.values / step - projections.dither) % 1.0


def combs(values: list[np.ndarray], width: int) -> Image:
    figure = Figure(figsize=(width / 100, 3.2), dpi=100)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0.13, 0.2, 0.85, 0.68))
    for row, ((label, colour), u) in enumerate(zip(ROWS, values, strict=True)):
        shifted = (u + 0.25) % 1.0 - 0.25
        for bit, marker in ((0, "o"), (1, "^")):
            axes.plot(shifted[bit == BITS], np.full((bit == BITS).sum(), -row), marker, color=colour, alpha=0.6, ms=8)
        axes.text(-0.27, -row, label, ha="right", va="center", color=colour, fontsize=12)
    for place, bit in ((0.0, 0), (0.5, 1)):
        axes.axvline(place, color="#26231f", lw=1, zorder=0)
        axes.text(place, 0.55, f"bit {bit}", ha="center", fontsize=12)
    for place in (-0.25, 0.25, 0.75):
        axes.axvline(place, color="#c9c4bc", lw=1, ls="--", zorder=0)
    axes.set(
        xlim=(-0.25, 0.75),
        ylim=(-2.6, 0.5),
        yticks=[],
        xlabel="value, in steps, modulo one (dashed: the border between the bits)",
    )
    axes.spines[["left", "right", "top"]].set_visible(False)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[:, :, :3].copy()


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)
