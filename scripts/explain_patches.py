"""The picture that explains local-patches: docs/patches.png.

    python scripts/explain_patches.py OUT.png

The patches that a marked bust carries, coloured by how far they are seen; those found in a fragment of it in another
pose, as `o3dmark view --key` shows them; and the motion that wrote one of them, fifty times as large.
"""

import hashlib
import sys
from pathlib import Path

import numpy as np
import open3d as o3d

from o3dmark import SHAPES, Key, Watermark, attack_all
from o3dmark.arrays import Floats
from o3dmark.mesh.surface import Surface, triangle_mesh
from o3dmark.mesh.welding import mended
from o3dmark.methods.local_patches.disk import disk_functions
from o3dmark.methods.local_patches.format import FORMATS
from o3dmark.methods.local_patches.measuring import Patches, Sampled, held
from o3dmark.methods.local_patches.method import LocalPatches
from o3dmark.methods.local_patches.places import Marked
from o3dmark.view import Panel, patches_panel, save_png, sheet
from o3dmark.view.camera import THREE_QUARTER

KEY = Key(hashlib.sha256(b"explain").digest())
MESSAGE = "mine"
METHOD = LocalPatches()
FORM = FORMATS[METHOD.format]
ATTACK, SEED = ("crop:share=0.65,largest=true", "similarity:smallest=1,largest=1"), 10
TIMES = 50  # the motion in the last panel is so much larger
AROUND = 1.15  # radii about a centre that are shown there


def main(out: Path) -> None:
    watermark = Watermark(method=METHOD)
    cover = mended(Surface.of(SHAPES.make("bimba:vertices=60000").build()))
    done = METHOD.marked(cover, watermark.code.encode(MESSAGE, watermark.n_bits, KEY), KEY)
    marked = cover.moved(done.vertices)
    radius = FORM.nearest_rung(METHOD.radius * np.sqrt(cover.area))
    about = patches_about(marked, done, radius)
    fragment = attack_all(mesh_of(marked), ATTACK, SEED)
    reading = watermark.extract(fragment, KEY)
    seen = np.zeros(len(cover.vertices))
    for place, patch in zip(done.places, about, strict=True):
        seen[held(marked.vertices, patch)] = place.jnd
    panels = [
        Panel(
            f"{len(done.places)} patches, each of which tells the message",
            mesh_of(marked),
            f"radius {radius / cover.diagonal:.3f} of the diagonal; between them nothing moved",
            seen,
            "just noticeable differences",
            (0.0, 1.0),
            "OrRd",
        ),
        patches_panel(
            f"{len(fragment.vertices) / len(cover.vertices):.0%} of it, turned: {reading.message!r}",
            fragment,
            reading.extraction.patches,
            f"p-value {reading.p_value:.0e}",
        ),
        one_patch(cover, done.vertices, min(about, key=lambda patch: len(held(marked.vertices, patch)))),
    ]
    save_png(out, sheet(panels, columns=3, width=1500))


def patches_about(marked: Surface, done: Marked, radius: float) -> list[Patches]:
    """The patches that were written, where a reader sees them."""
    centres = np.array([place.vertex for place in done.places])
    sampled = Sampled(FORM, marked, radius)
    patches = sampled.patches(marked.vertices[centres], marked.normals[centres])
    return [patches.among(np.array([i])) for i in range(len(centres))]


def one_patch(cover: Surface, vertices: Floats, patch: Patches) -> Panel:
    """A patch seen along its axis, with the motion that wrote it."""
    wide = patch._replace(radius=AROUND * patch.radius)
    inside = np.zeros(len(cover.vertices), bool)
    inside[held(cover.vertices, wide)] = True
    motion = vertices - cover.vertices
    outward = np.einsum("nd,nd->n", motion, cover.normals) / patch.radius
    turned = (cover.vertices + TIMES * motion - patch.centre) @ patch.frames()[0].T @ THREE_QUARTER.axes
    number, rows = np.unique(cover.triangles[inside[cover.triangles].all(axis=1)], return_inverse=True)
    mesh = mesh_of(Surface(turned[number], rows.reshape(-1, 3), np.arange(len(number))))
    reach = float(np.abs(outward[number]).max())
    return Panel(
        f"one patch along its axis, its motion {TIMES} times",
        mesh,
        f"the cheapest that takes {disk_functions(FORM).n_real} coefficients near their codewords",
        outward[number],
        "outward, over the radius",
        (-reach, reach),
        "coolwarm",
    )


def mesh_of(surface: Surface) -> o3d.geometry.TriangleMesh:
    return triangle_mesh(surface.vertices, surface.triangles)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]))
