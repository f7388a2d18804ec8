"""The faces and the strips of a PLY file as triangles."""

import numpy as np

from o3dmark.arrays import AnyArray, Ints
from o3dmark.errors import MeshError
from o3dmark.files.ply.header import Property
from o3dmark.files.ply.rows import Rows

_ROOM = 1 << 27  # bytes that triangles may take however small their file is
_SHARE = 8  # and times the size of the file; a triangle takes 24, and 4 or less as a corner of a long polygon


def polygons(rows: Rows, corners: Property, n_vertices: int) -> tuple[Ints, tuple[int, int]]:
    """Faces as triangles (m, 3), polygons as fans about their first corners; and the fewest and most corners of one.

    Errors: MeshError for a corner that is none of the vertices, and for a file with far more corners than it has room.
    """
    if rows.even:
        items = rows.block(corners)
        fewest = most = items.shape[1]
        _check_room(rows, len(items) * max(most - 2, 0))
        triangles = _whole(rows, items if most == 3 else items[:, _fan(most)]).reshape(-1, 3)
    else:
        from o3dmark.files.ply.ragged import fans

        places, lengths = rows.lists(corners)
        fewest, most = int(lengths.min()), int(lengths.max())
        count = int(np.maximum(lengths - 2, 0).sum(dtype=np.int64))
        _check_room(rows, count)
        triangles = np.empty((count, 3), np.int64)
        fans(_whole(rows, rows.items(corners, places, lengths)), lengths, triangles)
    _check_corners(rows, triangles, n_vertices)
    return triangles, (fewest, most)


def strips(rows: Rows, corners: Property, n_vertices: int) -> Ints:
    """Strips as triangles (m, 3), every second one turned; after a -1 another strip begins. Errors as `polygons`."""
    from o3dmark.files.ply.ragged import strips

    if rows.even:
        block = rows.block(corners)
        items, lengths = block.ravel(), np.full(len(block), block.shape[1])
    else:
        places, lengths = rows.lists(corners)
        _check_room(rows, int(lengths.sum(dtype=np.int64)))
        items = rows.items(corners, places, lengths)
    _check_room(rows, len(items))
    triangles = np.empty((len(items), 3), np.int64)
    triangles = triangles[: strips(_whole(rows, items), lengths, triangles)]
    _check_corners(rows, triangles, n_vertices)
    return triangles


def _fan(corners: int) -> Ints:
    """Which corners of a polygon its triangles have (corners - 2, 3)."""
    second = np.arange(1, max(corners - 1, 1))
    return np.column_stack([np.zeros_like(second), second, second + 1])


def _whole(rows: Rows, items: AnyArray) -> Ints:
    with np.errstate(invalid="ignore"):
        whole = items.astype(np.int64, copy=False)
    if items.dtype.kind == "f" and (whole != items).any():
        wrong = items[whole != items][0]
        raise MeshError(f"{rows.body.name}: element {rows.element.name} names vertex {wrong}, which is no whole number")
    return whole


def _check_room(rows: Rows, triangles: int) -> None:
    size = rows.body.data.size
    if 24 * triangles > _ROOM + _SHARE * size:
        raise MeshError(
            f"{rows.body.name}: element {rows.element.name} announces {triangles} triangles in {size} bytes or words:"
            " its vertices would have to meet again and again in each polygon"
        )


def _check_corners(rows: Rows, triangles: Ints, n_vertices: int) -> None:
    if len(triangles) and triangles.view(np.uint64).max() >= n_vertices:  # a negative one is large, seen so
        outside = (triangles < 0) | (triangles >= n_vertices)
        raise MeshError(
            f"{rows.body.name}: element {rows.element.name} names vertex {triangles[outside][0]},"
            f" which is none of the {n_vertices}, counted from 0"
        )
