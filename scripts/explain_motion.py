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

KEY = Key(hashlib.sha256(b"explain").digest())
MARKS = {
    "moved as little as possible": "shape-spectrum:motion=least",
    "moved so that it does not show": "shape-spectrum",
}
PICTURES = (("bracket", "clay"), ("bracket", "zebra"), ("car", "zebra"), ("bimba", "clay"))


def main(out: Path) -> None:
    panels = list[Panel]()
    for shape, look in PICTURES:
        cover = SHAPES.make(shape).build()
        panels.append(Panel(shape, cover, f"{len(cover.vertices):,} vertices", look=look))
        for title, spec in MARKS.items():
            marked = replace(PROFILES["robust-2026"], method=METHODS.make(spec)).embed(cover, "mine", KEY)
            msdm, planes = (METRICS.make(name)(cover, marked) for name in ("msdm", "planes"))
            caption = f"MSDM {msdm:.2f}" + f", planes tilt by {planes:.1f} degrees" * bool(planes)
            panels.append(Panel(title, marked, caption, frame=cover, look=look))
    save_png(out, sheet(panels, columns=3, width=1500))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
