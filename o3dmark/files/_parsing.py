"""What the parsers of mesh files share: polygons as fans, vertex colours, counts that a header announces."""

from pathlib import Path

import numpy as np
import open3d as o3d

from o3dmark.arrays import AnyArray, Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.mesh.surface import TriangleMesh


def fans(counts: Ints, *corners: AnyArray) -> list[Ints]:
    """Polygons as triangles about their first corners; none for fewer than three corners.

    counts (f,): how many corners each polygon has. For each array of corners (c,), of all polygons one after another,
    those of the triangles (m, 3).
    """
    if (counts == 3).all():
        return [each.reshape(-1, 3).astype(np.int64) for each in corners]
    first, triangles = np.cumsum(counts) - counts, np.maximum(counts - 2, 0)
    second = ranges(first + 1, triangles)
    first = np.repeat(first, triangles)
    return [np.column_stack([each[first], each[second], each[second + 1]]).astype(np.int64) for each in corners]


def ranges(starts: Ints, counts: Ints) -> Ints:
    """The numbers start, start + 1, ..., start + count - 1 for each of starts and counts (k,), one after another."""
    return np.repeat(starts - np.cumsum(counts) + counts, counts) + np.arange(counts.sum())


def check_corners(path: Path, corners: AnyArray, n_vertices: int) -> None:
    """Errors: MeshError for a corner (c,) that is no vertex."""
    if len(corners) and not (corners.min() >= 0 and corners.max() < n_vertices):
        raise MeshError(f"{path.name}: a face names a vertex that is not among its {n_vertices} vertices")


def set_colours(mesh: TriangleMesh, colours: Floats) -> None:
    """Give a mesh vertex colours (n, 3); left out where they are not all numbers."""
    if np.isfinite(colours).all():
        mesh.vertex_colors = o3d.utility.Vector3dVector(np.ascontiguousarray(colours))


def check_size(path: Path, least: int, size: int | None = None) -> None:
    """Refuse a file too small for the counts in its header, before memory is taken for them.

    ``size``: in bytes, by default of the file at ``path``.
    """
    size = path.stat().st_size if size is None else size
    if size < least:
        raise MeshError(f"{path.name} is truncated: {size} bytes, its header announces {least} or more")


def fewer(path: Path, announced: tuple[int, int], found: tuple[int, int]) -> MeshError:
    """The error for a file with fewer (vertices, faces) than its header announces."""
    return MeshError(
        f"{path.name} announces {announced[0]} vertices and {announced[1]} faces,"
        f" but {found[0]} and {found[1]} can be read: it is damaged"
    )
