"""OBJ, parsed here: Open3D silently drops polygons and negative indices, reads float32 and writes six digits.

Open3D's reading is taken where a file has texture coordinates and nothing of it is lost.
"""

from pathlib import Path

import numpy as np
import open3d as o3d

from o3dmark.errors import MeshError
from o3dmark.files import _open3d
from o3dmark.files._parsing import Triangle, fan, mesh_of, numbers, set_colours
from o3dmark.mesh.surface import TriangleMesh

_FLOAT32 = 1e-6  # relative: two of its steps, and more is another vertex


def read(path: Path) -> TriangleMesh:
    """Vertices, vertex colours and faces of an OBJ file, polygons as fans; Open3D's reading if that has textures.

    Errors: MeshError for a file without vertices, or a damaged one.
    """
    positions: list[list[bytes]] = []
    triangles: list[Triangle] = []
    textured = False
    for number, line in enumerate(path.read_bytes().replace(b"\\\n", b" ").splitlines(), start=1):
        match line.split():
            case [b"v", *words]:
                positions.append(words[:6])
            case [b"f", *words]:
                triangles += fan(_corners(path, number, words, len(positions)))
            case [b"vt", *_]:
                textured = True
    if not positions:
        raise MeshError(f"{path.name} holds no mesh")
    coloured = any(len(row) == 6 for row in positions)
    columns = numbers(path, positions, 6 if coloured else 3)
    mesh = mesh_of(path, columns, triangles)
    if textured and (dressed := _textured(path, mesh)) is not None:
        return dressed
    if coloured:
        set_colours(mesh, columns[:, 3:])
    return mesh


def write(path: Path, mesh: TriangleMesh) -> None:
    """Write an OBJ file, with its materials and textures, as Open3D does, its positions with every digit."""
    _open3d.write(path, mesh)
    lines = path.read_text().splitlines()
    rows = [row for row, line in enumerate(lines) if line.startswith("v ")]
    for row, position in zip(rows, np.asarray(mesh.vertices).tolist(), strict=True):
        lines[row] = " ".join(["v", *map(repr, position), *lines[row].split()[4:]])
    path.write_text("\n".join([*lines, ""]))


def _corners(path: Path, number: int, words: list[bytes], n_vertices: int) -> list[int]:
    """The vertices of a face on line ``number``, from 0; negative ones count back from the ``n_vertices`` before it."""
    try:
        corners = [int(word.split(b"/", 1)[0]) for word in words]
        if 0 in corners:  # OBJ counts from 1
            raise ValueError
    except ValueError:
        raise MeshError(f"{path.name}, line {number}: a face has a corner that is no vertex number") from None
    return [corner - 1 if corner > 0 else n_vertices + corner for corner in corners]


def _textured(path: Path, exact: TriangleMesh) -> TriangleMesh | None:
    """Open3D's reading of an OBJ file, with its textures, at the exact positions; None if it has lost or merged a part.

    Open3D reads float32, and repeats a vertex for each texture coordinate that it has.
    """
    mesh = _open3d.read(path)
    corners, wanted = np.asarray(mesh.triangles), np.asarray(exact.vertices)[np.asarray(exact.triangles)]
    if len(corners) != len(wanted):
        return None
    positions = np.array(mesh.vertices)
    if np.allclose(positions[corners], wanted, rtol=0.0, atol=_FLOAT32 * np.abs(wanted).max()):  # else in another order
        positions[corners] = wanted
        if not np.array_equal(positions[corners], wanted):
            return None
        mesh.vertices = o3d.utility.Vector3dVector(positions)
    return _without_empty_textures(mesh)


def _without_empty_textures(mesh: TriangleMesh) -> TriangleMesh:
    """Open3D gives every material of an OBJ file a texture, if only an empty one, and next to such it writes none."""
    full = [number for number, texture in enumerate(mesh.textures) if not texture.is_empty()]
    used = np.asarray(mesh.triangle_material_ids)
    if full and np.isin(used, full).all():
        mesh.textures = [mesh.textures[number] for number in full]
        mesh.triangle_material_ids = o3d.utility.IntVector(np.searchsorted(full, used).astype(np.int32))
    return mesh
