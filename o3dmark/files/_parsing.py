"""What the parsers of mesh files share: rows of numbers, polygons as fans, counts that a header announces."""

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import open3d as o3d

from o3dmark.arrays import Floats
from o3dmark.errors import MeshError
from o3dmark.mesh.surface import TriangleMesh, triangle_mesh

Triangle = tuple[int, int, int]


def numbers(path: Path, rows: list[list[bytes]], width: int) -> Floats:
    """The first ``width`` numbers of each row (n, width). Errors: MeshError for rows with fewer, or other words."""
    try:
        if any(len(row) < width for row in rows):
            raise ValueError
        return np.array([row[:width] for row in rows], np.float64).reshape(-1, width)
    except ValueError:
        raise MeshError(f"{path.name}: a vertex is not {width} numbers") from None


def fan(corners: Sequence[int]) -> list[Triangle]:
    """A polygon as triangles about its first corner; none for fewer than three corners."""
    return [(corners[0], b, c) for b, c in itertools.pairwise(corners[1:])]


def mesh_of(path: Path, rows: Floats, triangles: list[Triangle]) -> TriangleMesh:
    """The mesh whose vertices are the first three of each row of numbers (n, 3 or more).

    Errors: MeshError for a corner that is no vertex.
    """
    if not all(0 <= corner < len(rows) for corner in itertools.chain.from_iterable(triangles)):
        raise MeshError(f"{path.name}: a face names a vertex that is not among its {len(rows)} vertices")
    return triangle_mesh(rows[:, :3], np.array(triangles, np.int64).reshape(-1, 3))


def set_colours(mesh: TriangleMesh, colours: Floats) -> None:
    """Give a mesh vertex colours (n, 3); left out where they are not all numbers."""
    if np.isfinite(colours).all():
        mesh.vertex_colors = o3d.utility.Vector3dVector(np.ascontiguousarray(colours))


def check_size(path: Path, least: int) -> None:
    """Refuse a file too small for the counts in its header, before memory is taken for them."""
    if path.stat().st_size < least:
        raise MeshError(f"{path.name} is truncated: {path.stat().st_size} bytes, its header announces {least} or more")


def fewer(path: Path, announced: tuple[int, int], found: tuple[int, int]) -> MeshError:
    """The error for a file with fewer (vertices, faces) than its header announces."""
    return MeshError(
        f"{path.name} announces {announced[0]} vertices and {announced[1]} faces,"
        f" but {found[0]} and {found[1]} can be read: it is damaged"
    )
