"""Scripted visualization without a display: saliency, where a mark moved the surface, a sheet, a turntable.

    python examples/pictures.py [MESH] [--out OUT]

Writes saliency.png, displacement.png, sheet.png and turntable.gif.
"""

import argparse
from pathlib import Path

import numpy as np
from PIL import Image

import o3dmark
from o3dmark import view

TURNS = 24  # pictures of the turntable


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("mesh", type=Path, nargs="?")
    parser.add_argument("--out", type=Path, default=Path())
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    cover = o3dmark.SHAPES.make("bimba").build() if options.mesh is None else o3dmark.read_mesh(options.mesh)
    key = o3dmark.Key.generate()
    marked = o3dmark.Watermark().embed(cover, "mine", key)
    attacked = o3dmark.attack_all(marked, "crop:share=0.3", 1)

    view.save_png(options.out / "saliency.png", view.render_scalars(cover, o3dmark.Saliency()(cover), view.SALIENCY))
    moved = view.Displacement.of(cover, marked)
    view.save_png(options.out / "displacement.png", view.render_scalars(marked, moved.lengths, view.DISPLACEMENT))
    view.save_png(options.out / "sheet.png", view.comparison_sheet(cover, marked, attacked))

    angles = 360 * np.arange(TURNS) / TURNS
    pictures = [Image.fromarray(view.render(marked, camera=view.Camera(azimuth=angle))) for angle in angles]
    pictures[0].save(options.out / "turntable.gif", save_all=True, append_images=pictures[1:], duration=80, loop=0)


if __name__ == "__main__":
    main()
