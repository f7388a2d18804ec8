"""The two sheets that explain a mark: what it changed, and what an attack left of the marked mesh."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from o3dmark.arrays import Floats
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import mesh_arrays, triangle_mesh
from o3dmark.view.camera import THREE_QUARTER, Camera
from o3dmark.view.colours import checked_scalars, colour_limits
from o3dmark.view.model import n_vertices, positions, shape_of
from o3dmark.view.render import Image
from o3dmark.view.sheet import Panel, sheet

VISIBLE = 0.01  # over the diagonal: length of an exaggerated displacement that one sees
ROUNDING = 1e-9  # over the diagonal: what moved less did not move
PER_MILLE = "10⁻³ of the bounding-box diagonal"


def comparison_sheet(
    cover: Any,
    marked: Any,
    attacked: Any,
    *,
    saliency: ArrayLike | None = None,
    title: str = "",
    attack: str = "",
    notes: Sequence[str] = (),
    exaggeration: float | None = None,
    camera: Camera = THREE_QUARTER,
    width: int = 1600,
) -> Image:
    """Original, marked, saliency, both as mirrors, displacement and attacked, side by side: (h, width, 3).

    saliency: one number a vertex of the cover; its panel is left out without. The displacement panel is coloured by the
    displacement's length and drawn at cover + ``exaggeration`` * (marked - cover), by default as much as makes it
    visible; its caption says how much. These share one camera, fitted to the cover. The attacked mesh is drawn in the
    pose and size that the attack left, fitted by itself. attack: what was done, a caption. notes: lines of text.
    Errors: MeshError when cover and marked differ in vertex count or a mesh cannot be drawn.
    """
    lengths, factor, exaggerated = _displacement(cover, marked, exaggeration)
    original = shape_of(cover)
    panels = [
        Panel("Original", original, _counts(cover)),
        Panel(
            "Marked", marked, f"no vertex moved by more than {lengths.max():.2g} · 10⁻³ of the diagonal", frame=original
        ),
    ]
    others = [
        Panel(
            "Displacement",
            exaggerated,
            f"drawn {factor:g} times as large as it is" if lengths.any() else "none",
            lengths,
            f"length, {PER_MILLE}",
            _from_zero(lengths),
            "plasma",
            original,
        ),
        Panel("Attacked", attacked, attack or _counts(attacked)),
    ]
    if saliency is not None:
        values = checked_scalars(saliency, len(lengths))
        others.insert(0, Panel("Saliency", original, "where the eye is drawn to", values, "mesh saliency"))
    mirrors = [
        Panel("Original, as a mirror", original, "under light tubes", look="zebra"),
        Panel("Marked, as a mirror", marked, "stripes would wave where the mark shows", frame=original, look="zebra"),
    ]
    panels += [others[0], *mirrors, *others[1:]]  # the mirrors stand under what they are of
    return sheet(panels, title=title, notes=notes, columns=3, camera=camera, width=width)


def distance_sheet(
    marked: Any,
    attacked: Any,
    distances: ArrayLike,
    *,
    title: str = "",
    attack: str = "",
    notes: Sequence[str] = (),
    names: tuple[str, str] = ("Marked", "Attacked"),
    camera: Camera = THREE_QUARTER,
    width: int = 1600,
) -> Image:
    """Marked, attacked and the distance between them, side by side: (h, width, 3). ``names`` of the two, as shown.

    distances: for each vertex of the attacked mesh, in the meshes' unit; the bar shows them over the marked mesh's
    bounding-box diagonal. All share one camera, fitted to the marked mesh, so bring an attacked mesh that was moved
    back first. Errors: MeshError when the distances do not fit or a mesh cannot be drawn.
    """
    before, after = shape_of(marked), shape_of(attacked)
    lengths = checked_scalars(distances, n_vertices(after)) / (geometry.diagonal(positions(before)) * 1e-3)
    panels = [
        Panel(names[0], before, _counts(marked)),
        Panel(names[1], after, attack or _counts(attacked), frame=before),
        Panel("Distance", after, "", lengths, f"distance, {PER_MILLE}", _from_zero(lengths), "plasma", before),
    ]
    return sheet(panels, title=title, notes=notes, camera=camera, width=width)


def _displacement(cover: Any, marked: Any, exaggeration: float | None) -> tuple[Floats, float, Any]:
    """Length of each vertex's displacement (n,) in 10^-3 of the diagonal, the factor, and the cover moved so much."""
    (before, triangles), (after, _) = mesh_arrays(cover), mesh_arrays(marked)
    if before.shape != after.shape:
        raise MeshError(
            f"{len(before)} vertices in the cover and {len(after)} in the marked mesh: a displacement needs as many"
            " in both; distance_sheet compares other meshes"
        )
    lengths = np.linalg.norm(after - before, axis=1) / geometry.diagonal(positions(shape_of(cover)))
    moved = lengths[lengths > ROUNDING]
    if exaggeration is None:
        exaggeration = _round_factor(VISIBLE / float(np.percentile(moved, 98))) if len(moved) else 1.0
    return lengths * 1e3, exaggeration, triangle_mesh(before + exaggeration * (after - before), triangles)


def _from_zero(lengths: Floats) -> tuple[float, float]:
    """Colour limits for lengths: from zero to where their long tail begins."""
    return 0.0, colour_limits(np.append(lengths, 0.0))[1]


def _round_factor(factor: float) -> float:
    """The greatest of 1, 2, 5, 10, 20, ... that is not above ``factor``; 1 at least."""
    factor = max(factor, 1.0) * (1 + 1e-9)  # 99.999... is 100
    power = 10.0 ** np.floor(np.log10(factor))
    return float(power * max(step for step in (1, 2, 5) if step * power <= factor))


def _counts(mesh: Any) -> str:
    vertices, triangles = mesh_arrays(mesh)
    return f"{len(vertices):,} vertices, {len(triangles):,} triangles"
