"""OFF, parsed here: Open3D takes files of one layout only, and writes six digits."""

import re
from pathlib import Path

import numpy as np
import open3d as o3d

from o3dmark.errors import MeshError
from o3dmark.files import _open3d
from o3dmark.files._parsing import Triangle, check_size, fan, fewer, mesh_of, numbers, set_colours
from o3dmark.mesh.surface import TriangleMesh

_GAP = rb"(?:\s|#[^\n]*\n)"
_HEAD = re.compile(  # a third count, of the edges, may follow on the line of the second
    _GAP + rb"*(?:ST)?(?P<colours>C)?(?P<normals>N)?OFF" + _GAP + rb"*"
    rb"(?P<vertices>\d+)" + _GAP + rb"+(?P<faces>\d+)(?:[ \t]+\d+)?(?=\s)",
    re.I,
)


def read(path: Path) -> TriangleMesh:
    """Vertices, their normals and colours, and faces of an OFF file, polygons as fans; no texture coordinates.

    Colours have three or four components, in 0 .. 1 or, if any is larger, in 0 .. 255.
    Errors: MeshError for another kind of file, or a damaged one.
    """
    content = path.read_bytes()
    head = _HEAD.match(content)
    if head is None:
        raise MeshError(f"{path.name} does not begin like an OFF file")
    n, m = int(head["vertices"]), int(head["faces"])
    check_size(path, 6 * n + 2 * m)
    rows = [row for line in content[head.end() :].splitlines() if (row := line.split(b"#", 1)[0].split())]
    if len(rows) < n + m:
        raise fewer(path, (n, m), (min(len(rows), n), max(len(rows) - n, 0)))
    triangles = [triangle for row in rows[n : n + m] for triangle in _face(path, row)]
    first_colour = 3 if head["normals"] is None else 6
    columns = numbers(path, rows[:n], first_colour if head["colours"] is None else first_colour + 3)
    mesh = mesh_of(path, columns, triangles)
    if head["normals"] is not None:
        mesh.vertex_normals = o3d.utility.Vector3dVector(columns[:, 3:6])
    if head["colours"] is not None:
        colours = columns[:, first_colour:]
        set_colours(mesh, colours / (255.0 if colours.max(initial=0.0) > 1.0 else 1.0))
    return mesh


def write(path: Path, mesh: TriangleMesh) -> None:
    """Write an OFF file as Open3D does, its positions with every digit."""
    _open3d.write(path, mesh)
    lines = path.read_text().splitlines()
    for row, position in enumerate(np.asarray(mesh.vertices).tolist(), start=2):
        lines[row] = " ".join([*map(repr, position), *lines[row].split()[3:]])
    path.write_text("\n".join([*lines, ""]))


def _face(path: Path, row: list[bytes]) -> list[Triangle]:
    try:
        corners = [int(word) for word in row[1 : 1 + int(row[0])]]
        if len(corners) != int(row[0]):
            raise ValueError
    except ValueError:
        raise MeshError(f"{path.name}: a face is not a number of corners and as many vertices") from None
    return fan(corners)
