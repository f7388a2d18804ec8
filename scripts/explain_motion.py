"""The picture of what shows of a mark: docs/motion.png.

    python scripts/explain_motion.py OUT.png

A machine part, a smooth body and a bust, each as it is, moved as little as possible, and so that it does not show:
as mirrors under light tubes, the machine part also as clay.
"""

import hashlib
import sys
from dataclasses import replace
from pathlib import Path

from o3dmark import METHODS, METRICS, PROFILES, SHAPES, Key
from o3dmark.view import Panel, save_png, sheet
from o3dmark.view.render import Look

KEY = Key(hashlib.sha256(b"explain").digest())
MARKS = {
    "moved as little as possible": "shape-spectrum:motion=least",
    "moved so that it does not show": "shape-spectrum",
}
LOOKS: dict[str, tuple[Look, ...]] = {"bracket": ("clay", "zebra"), "car": ("zebra",), "bimba": ("clay",)}


def main(out: Path) -> None:
    panels = [panel for shape in LOOKS for panel in rows_of(shape)]
    save_png(out, sheet(panels, columns=3, width=1500))


def rows_of(shape: str) -> list[Panel]:
    """Three panels for each look of a shape: as it is, and moved in both ways."""
    cover = SHAPES.make(shape).build()
    meshes = [(shape, f"{len(cover.vertices):,} vertices", cover)]
    for title, spec in MARKS.items():
        marked = replace(PROFILES["robust-2026"], method=METHODS.make(spec)).embed(cover, "mine", KEY)
        msdm, planes = (METRICS.make(name)(cover, marked) for name in ("msdm", "planes"))
        meshes.append((title, f"MSDM {msdm:.2f}" + f", planes tilt by {planes:.1f} degrees" * bool(planes), marked))
    return [
        Panel(title, mesh, caption, frame=cover, look=look) for look in LOOKS[shape] for title, caption, mesh in meshes
    ]


if __name__ == "__main__":
    main(Path(sys.argv[1]))
