"""The picture of what shows of a mark: docs/motion.png.

    python scripts/explain_motion.py OUT.png

A machine part, a smooth body, a bust and a textured asset, each as it is, moved as little as possible, and so that it
does not show: as clay, varnished, as mirrors under light tubes, and with the texture on.
"""

import hashlib
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import open3d as o3d

from o3dmark import METHODS, METRICS, PROFILES, SHAPES, Key
from o3dmark.view import Panel, save_png, sheet
from o3dmark.view.render import Image, Look

KEY = Key(hashlib.sha256(b"explain").digest())
MARKS = {
    "moved as little as possible": "shape-spectrum:motion=least",
    "moved so that it does not show": "shape-spectrum",
}
LOOKS: dict[str, tuple[Look, ...]] = {
    "bracket": ("clay", "zebra"),
    "car": ("gloss", "zebra"),
    "bimba": ("clay",),
    "vase:vertices=9000": ("texture",),
}
COURSES, BRICKS = 14, 9  # of the wall that the vase wears: bricks one above the other, and around


def main(out: Path) -> None:
    panels = [panel for shape in LOOKS for panel in rows_of(shape)]
    save_png(out, sheet(panels, columns=3, width=920))


def rows_of(shape: str) -> list[Panel]:
    """Three panels for each look of a shape: as it is, and moved in both ways."""
    cover = SHAPES.make(shape).build()
    if "texture" in LOOKS[shape]:
        dress(cover)
    meshes = [(shape.partition(":")[0], f"{len(cover.vertices):,} vertices", cover)]
    for title, spec in MARKS.items():
        marked = replace(PROFILES["robust-2026"], method=METHODS.make(spec)).embed(cover, "mine", KEY)
        msdm, jnd, planes = (METRICS.make(name)(cover, marked) for name in ("msdm", "jnd", "planes"))
        tilt = f", planes tilt by {planes:.1f} degrees" * bool(planes)
        meshes.append((title, f"MSDM {msdm:.2f}, {jnd:.2f} just noticeable differences{tilt}", marked))
    return [
        Panel(title, mesh, caption, frame=cover, look=look) for look in LOOKS[shape] for title, caption, mesh in meshes
    ]


def dress(mesh: o3d.geometry.TriangleMesh) -> None:
    """Wrap a wall of bricks around the y axis of a mesh."""
    x, y, z = np.asarray(mesh.vertices).T
    around = (np.arctan2(z, x) / (2.0 * np.pi))[np.asarray(mesh.triangles)]
    around += around.max(axis=1, keepdims=True) - around > 0.5  # triangles across the seam: the picture is repeated
    height = ((y - y.min()) / np.ptp(y))[np.asarray(mesh.triangles)]
    mesh.triangle_uvs = o3d.utility.Vector2dVector(np.stack([around, height], axis=2).reshape(-1, 2))
    mesh.textures = [o3d.geometry.Image(bricks())]
    mesh.triangle_material_ids = o3d.utility.IntVector(np.zeros(len(mesh.triangles), np.int32))


def bricks(size: int = 1024) -> Image:
    """A wall (size, size, 3): courses of bricks of many reds between pale mortar, with some grain."""
    rng, place = np.random.default_rng(0), (np.arange(size) + 0.5) / size
    row, column = COURSES * place[:, None], BRICKS * place[None, :]
    column = column + 0.5 * (np.floor(row) % 2)
    row = np.broadcast_to(row, column.shape)
    tone = rng.uniform(-1.0, 1.0, (COURSES, BRICKS))[np.floor(row).astype(int), np.floor(column).astype(int) % BRICKS]
    to_edge = np.minimum(0.5 - np.abs(row % 1.0 - 0.5), 2.0 * (0.5 - np.abs(column % 1.0 - 0.5)))
    mortar = np.clip((0.10 - to_edge) / 0.03, 0.0, 1.0)[..., None]
    red = np.array([0.62, 0.27, 0.20]) * (1.0 + 0.16 * tone[..., None])
    wall = red + mortar * (np.array([0.78, 0.74, 0.68]) - red)
    return np.asarray(255 * np.clip(wall + 0.01 * rng.standard_normal((size, size, 1)), 0.0, 1.0), np.uint8)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
