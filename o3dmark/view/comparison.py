"""The two sheets that explain a mark: what it changed, and what an attack left of the marked mesh."""

from collections.abc import Sequence
from typing import Any

from numpy.typing import ArrayLike

from o3dmark.mesh import geometry
from o3dmark.mesh.surface import mesh_arrays
from o3dmark.view.camera import Camera
from o3dmark.view.colours import SALIENCY, checked_scalars
from o3dmark.view.displacement import DISPLACEMENT, Displacement, distance_from, from_zero
from o3dmark.view.model import n_vertices, positions, shape_of
from o3dmark.view.render import Image
from o3dmark.view.sheet import Panel, sheet
from o3dmark.view.side import best_side


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
    camera: Camera | None = None,
    width: int = 1600,
) -> Image:
    """Original, marked, saliency, both as mirrors, displacement and attacked, side by side: (h, width, 3).

    saliency: one number a vertex of the cover; its panel is left out without. The displacement panel is coloured by the
    displacement's length and drawn at cover + ``exaggeration`` * (marked - cover), by default as much as makes it
    visible; its caption says how much. These share one camera, fitted to the cover, by default on the side that shows
    most of the displacement; textures and colours of vertices are shown. The attacked mesh is drawn in the
    pose and size that the attack left, fitted by itself. attack: what was done, a caption. notes: lines of text.
    Errors: MeshError when cover and marked differ in vertex count or a mesh cannot be drawn.
    """
    displacement = Displacement.of(cover, marked)
    lengths, factor = displacement.lengths, displacement.factor if exaggeration is None else exaggeration
    original = shape_of(cover)
    panels = [
        Panel("Original", cover, _counts(cover), look="worn"),
        Panel(
            "Marked",
            marked,
            f"no vertex moved by more than {lengths.max():.2g} % of the diagonal",
            frame=original,
            look="worn",
        ),
    ]
    others = [
        Panel(
            "Displacement",
            displacement.exaggerated(factor),
            f"drawn {factor:g} times as large as it is" if lengths.any() else "none",
            lengths,
            DISPLACEMENT,
            from_zero(lengths),
            "plasma",
            original,
        ),
        Panel("Attacked", attacked, attack or _counts(attacked), look="worn"),
    ]
    if saliency is not None:
        values = checked_scalars(saliency, len(lengths))
        others.insert(0, Panel("Saliency", original, "where the eye is drawn to", values, SALIENCY))
    mirrors = [
        Panel("Original, as a mirror", original, "under light tubes", look="zebra"),
        Panel("Marked, as a mirror", marked, "stripes would wave where the mark shows", frame=original, look="zebra"),
    ]
    panels += [others[0], *mirrors, *others[1:]]  # the mirrors stand under what they are of
    camera = camera or best_side(original, lengths)
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
    camera: Camera | None = None,
    width: int = 1600,
) -> Image:
    """Marked, attacked and the distance between them, side by side: (h, width, 3). ``names`` of the two, as shown.

    distances: for each vertex of the attacked mesh, in the meshes' unit; the bar shows them over the marked mesh's
    bounding-box diagonal. All share one camera, by default on the side that shows most, fitted to the marked mesh: so
    bring an attacked mesh that was moved back first. Textures and colours of vertices are shown.
    Errors: MeshError when the distances do not fit or a mesh cannot be drawn.
    """
    before, after = shape_of(marked), shape_of(attacked)
    lengths = checked_scalars(distances, n_vertices(after)) / (geometry.diagonal(positions(before)) / 100.0)
    panels = [
        Panel(names[0], marked, _counts(marked), look="worn"),
        Panel(names[1], attacked, attack or _counts(attacked), frame=before, look="worn"),
        Panel("Distance", after, "", lengths, distance_from(names[0]), from_zero(lengths), "plasma", before),
    ]
    return sheet(panels, title=title, notes=notes, camera=camera or best_side(marked), width=width)


def _counts(mesh: Any) -> str:
    vertices, triangles = mesh_arrays(mesh)
    return f"{len(vertices):,} vertices, {len(triangles):,} triangles"
