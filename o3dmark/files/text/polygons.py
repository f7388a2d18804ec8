"""What the parsers of mesh files share: polygons as fans, vertex colours, counts that a header announces."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from o3dmark.arrays import AnyArray, Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.files.text.words import mask

if TYPE_CHECKING:
    from o3dmark.mesh.surface import TriangleMesh


def fans(counts: AnyArray, *corners: AnyArray) -> list[Ints]:
    """Polygons as triangles about their first corners; none for fewer than three corners.

    counts (f,): how many corners each polygon has. For each array of corners (c,), of all polygons one after another,
    those of the triangles (m, 3).
    """
    if (counts == 3).all():
        return [each.reshape(-1, 3).astype(np.int64) for each in corners]
    first, triangles = np.cumsum(counts, dtype=np.int64) - counts, counts - 2
    first, triangles = first[triangles > 0], triangles[triangles > 0]
    second = mask(int(counts.sum(dtype=np.int64)), np.column_stack([first + 1, first + 1 + triangles]))
    result = []
    for each in corners:
        fan = np.empty((triangles.sum(dtype=np.int64), 3), np.int64)
        fan[:, 0] = np.repeat(each[first], triangles)
        fan[:, 1] = each[second]
        fan[:, 2] = each[1:][second[:-1]]
        result.append(fan)
    return result


def check_corners(path: Path, corners: AnyArray, n_vertices: int) -> None:
    """Errors: MeshError for a corner (c,) that is no vertex."""
    if len(corners) and not (corners.min() >= 0 and corners.max() < n_vertices):
        raise MeshError(f"{path.name}: a face names a vertex that is not among its {n_vertices} vertices")


def set_colours(mesh: "TriangleMesh", colours: Floats) -> None:
    """Give a mesh vertex colours (n, 3); left out where they are not all numbers."""
    import open3d as o3d

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
