"""Reading and writing mesh files so that nothing is misread and nothing is half written.

Open3D silently drops the polygons and negative indices of OBJ files, takes OFF files of one layout only and returns the
first part of a truncated PLY. So OBJ and OFF files are parsed here (Open3D's reading of an OBJ file is taken where it
has texture coordinates and is complete), and PLY files are read by Open3D under the counts of their own header.
(MeshLab reads polygons too, but a polygon that visits a vertex twice made it corrupt its memory.) Whatever is written
appears under its name complete or not at all.
"""

import itertools
import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import open3d as o3d

from o3dmark.arrays import Floats
from o3dmark.errors import MeshError
from o3dmark.mesh.surface import PointCloud, TriangleMesh, triangle_mesh

FORMATS = (".ply", ".obj", ".off", ".stl", ".glb", ".gltf")
_PLY_SIZES = {
    **dict.fromkeys(("char", "uchar", "int8", "uint8"), 1),
    **dict.fromkeys(("short", "ushort", "int16", "uint16"), 2),
    **dict.fromkeys(("int", "uint", "float", "int32", "uint32", "float32"), 4),
    **dict.fromkeys(("double", "float64"), 8),
}
_GAP = rb"(?:\s|#[^\n]*\n)"
_OFF_HEAD = re.compile(  # a third count, of the edges, may follow on the line of the second
    _GAP + rb"*(?:ST)?(?P<colours>C)?(?P<normals>N)?OFF" + _GAP + rb"*"
    rb"(?P<vertices>\d+)" + _GAP + rb"+(?P<faces>\d+)(?:[ \t]+\d+)?(?=\s)",
    re.I,
)


def read_mesh(path: str | Path) -> TriangleMesh:
    """The triangle mesh in a file (PLY, OBJ, OFF, STL, GLB, glTF), in double precision where the file has it.

    Errors: MeshError when the file is missing, of another kind, damaged, or holds no triangle.
    """
    path = _existing(path)
    readers = {".obj": _read_obj, ".off": _read_off, ".ply": _read_ply}
    mesh = readers.get(path.suffix.lower(), _open3d_mesh)(path)
    if not mesh.has_triangles():
        what = f"{len(mesh.vertices)} vertices and no triangle" if mesh.has_vertices() else "no mesh"
        raise MeshError(f"{path.name} holds {what}")
    return mesh


def read_points(path: str | Path) -> PointCloud:
    """The point cloud in a file, with its normals if it has them. Errors: MeshError as in `read_mesh`."""
    path = _existing(path)
    if path.suffix.lower() == ".ply":
        _ply_counts(path)
    with _quiet():
        cloud = o3d.io.read_point_cloud(str(path))
    if not cloud.has_points():
        raise MeshError(f"{path.name} holds no point")
    if not np.isfinite(np.asarray(cloud.points)).all():
        raise MeshError(f"{path.name} has points whose coordinates are not finite")
    return cloud


def read_shape(path: str | Path) -> TriangleMesh | PointCloud:
    """The mesh in a file, or its points where it has no triangle. Errors: MeshError as in `read_mesh`."""
    path = _existing(path)
    if path.suffix.lower() == ".ply" and not _ply_counts(path)[1]:
        return read_points(path)
    return read_mesh(path)


def write_mesh(path: str | Path, mesh: TriangleMesh) -> None:
    """Write a mesh in the format that the name's ending says; the file is complete or not there at all.

    PLY (binary), OBJ and OFF (text) keep every bit, STL and glTF float32.
    Errors: MeshError when the folder is missing, the ending unknown or the disk full.
    """
    path = Path(path)
    if path.suffix.lower() not in FORMATS:
        raise MeshError(f"cannot write {path.name}: the ending is none of {', '.join(FORMATS)}")
    if path.suffix.lower() == ".stl" and not mesh.has_triangle_normals():
        mesh = TriangleMesh(mesh).compute_triangle_normals()
    with replacing(path) as draft, _quiet():
        if path.suffix.lower() in (".glb", ".gltf"):  # what the legacy writer makes of these, no reader takes
            written = o3d.t.io.write_triangle_mesh(str(draft), o3d.t.geometry.TriangleMesh.from_legacy(mesh))
        else:
            written = o3d.io.write_triangle_mesh(str(draft), mesh)
        if not written or not draft.exists():
            raise MeshError(f"Open3D could not write {path.name}")
        if path.suffix.lower() in (".obj", ".off"):
            _write_every_digit(draft, mesh)


def write_shape(path: str | Path, shape: TriangleMesh | PointCloud) -> None:
    """Write a mesh as `write_mesh` does, or a point cloud as binary PLY. Errors as there."""
    if not isinstance(shape, o3d.geometry.PointCloud):
        write_mesh(path, shape)
        return
    if Path(path).suffix.lower() != ".ply":
        raise MeshError(f"cannot write {Path(path).name}: a point cloud is written as .ply")
    with replacing(path) as draft, _quiet():
        if not o3d.io.write_point_cloud(str(draft), shape):
            raise MeshError(f"Open3D could not write {Path(path).name}")


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary path of the same name that takes the place of ``path`` when the block ends well, and else is removed.

    Other files that the block writes beside it (materials, textures) come along. Errors: MeshError without the folder.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise MeshError(f"there is no folder {str(path.parent)!r} to write {path.name} in")
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".o3dmark-") as folder:
        draft = Path(folder) / path.name
        yield draft
        for part in sorted(Path(folder).iterdir(), key=lambda part: part == draft):  # the file itself last
            os.replace(part, path.parent / part.name)


def _existing(path: str | Path) -> Path:
    path = Path(path)
    if not path.is_file():
        raise MeshError(f"no file at {str(path)!r}")
    if path.suffix.lower() not in FORMATS:
        raise MeshError(f"{path.name}: the ending is none of {', '.join(FORMATS)}")
    if not path.stat().st_size:
        raise MeshError(f"{path.name} is empty")
    return path


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep Open3D from printing its own warnings: what matters of them is raised."""
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        yield


def _open3d_mesh(path: Path) -> TriangleMesh:
    with _quiet():
        return o3d.io.read_triangle_mesh(str(path))


def _read_ply(path: Path) -> TriangleMesh:
    vertices, faces = _ply_counts(path)
    mesh = _open3d_mesh(path)
    if len(mesh.vertices) < vertices or len(mesh.triangles) < faces:  # more triangles than faces: polygons
        raise _fewer(path, (vertices, faces), (len(mesh.vertices), len(mesh.triangles)))
    return mesh


def _read_off(path: Path) -> TriangleMesh:
    """Vertices, their normals and colours, and faces of an OFF file, polygons as fans; no texture coordinates.

    Colours have three or four components, in 0 .. 1 or, if any is larger, in 0 .. 255.
    """
    content = path.read_bytes()
    head = _OFF_HEAD.match(content)
    if head is None:
        raise MeshError(f"{path.name} does not begin like an OFF file")
    n, m = int(head["vertices"]), int(head["faces"])
    _enough(path, 6 * n + 2 * m)
    rows = [row for line in content[head.end() :].splitlines() if (row := line.split(b"#", 1)[0].split())]
    if len(rows) < n + m:
        raise _fewer(path, (n, m), (min(len(rows), n), max(len(rows) - n, 0)))
    triangles: list[tuple[int, int, int]] = []
    for row in rows[n : n + m]:
        try:
            corners = [int(word) for word in row[1 : 1 + int(row[0])]]
            if len(corners) != int(row[0]):
                raise ValueError
        except ValueError:
            raise MeshError(f"{path.name}: a face is not a number of corners and as many vertices") from None
        triangles += [(corners[0], b, c) for b, c in itertools.pairwise(corners[1:])]
    place = 3 if head["normals"] is None else 6
    numbers = _numbers(path, rows[:n], place if head["colours"] is None else place + 3)
    mesh = _mesh_of(path, numbers, triangles)
    if head["normals"] is not None:
        mesh.vertex_normals = o3d.utility.Vector3dVector(numbers[:, 3:6])
    if head["colours"] is not None:
        _colour(mesh, numbers[:, place:] / (255.0 if numbers[:, place:].max(initial=0.0) > 1.0 else 1.0))
    return mesh


def _read_obj(path: Path) -> TriangleMesh:
    """Vertices, vertex colours and faces of an OBJ file, polygons as fans; Open3D's reading if that has textures."""
    positions: list[list[bytes]] = []
    triangles: list[tuple[int, int, int]] = []
    textured = False
    for number, line in enumerate(path.read_bytes().replace(b"\\\n", b" ").splitlines(), start=1):
        words = line.split()
        if not words:
            continue
        if words[0] == b"v":
            positions.append(words[1:7])
        elif words[0] == b"f":
            try:
                corners = [int(word.split(b"/", 1)[0]) for word in words[1:]]
                if 0 in corners:  # OBJ counts from 1
                    raise ValueError
            except ValueError:
                raise MeshError(f"{path.name}, line {number}: a face has a corner that is no vertex number") from None
            corners = [corner - 1 if corner > 0 else len(positions) + corner for corner in corners]
            triangles += [(corners[0], b, c) for b, c in itertools.pairwise(corners[1:])]
        elif words[0] == b"vt":
            textured = True
    if not positions:
        raise MeshError(f"{path.name} holds no mesh")
    coloured = any(len(row) == 6 for row in positions)
    numbers = _numbers(path, positions, 6 if coloured else 3)
    mesh = _mesh_of(path, numbers, triangles)
    if textured and (dressed := _textured(path, mesh)) is not None:
        return dressed
    if coloured:
        _colour(mesh, numbers[:, 3:])
    return mesh


def _write_every_digit(path: Path, mesh: TriangleMesh) -> None:
    """Put the positions into an OBJ or OFF file anew: Open3D's six digits move a mesh in a surveyor's metres about."""
    lines = path.read_text().splitlines()
    if path.suffix.lower() == ".obj":
        rows, place = [row for row, line in enumerate(lines) if line.startswith("v ")], 1
    else:
        rows, place = list(range(2, 2 + len(mesh.vertices))), 0
    for row, position in zip(rows, np.asarray(mesh.vertices).tolist(), strict=True):
        words = lines[row].split()
        words[place : place + 3] = map(repr, position)
        lines[row] = " ".join(words)
    path.write_text("\n".join([*lines, ""]))


def _textured(path: Path, exact: TriangleMesh) -> TriangleMesh | None:
    """Open3D's reading of an OBJ file, with its textures, at the exact positions; None if it has lost or merged a part.

    Open3D reads float32, and repeats a vertex for each texture coordinate that it has.
    """
    mesh = _open3d_mesh(path)
    corners, wanted = np.asarray(mesh.triangles), np.asarray(exact.vertices)[np.asarray(exact.triangles)]
    if len(corners) != len(wanted):
        return None
    positions = np.array(mesh.vertices)
    if np.allclose(positions[corners], wanted, rtol=0.0, atol=1e-6 * np.abs(wanted).max()):  # else in another order
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


def _numbers(path: Path, rows: list[list[bytes]], width: int) -> Floats:
    """The first ``width`` numbers of each row (n, width)."""
    try:
        if any(len(row) < width for row in rows):
            raise ValueError
        return np.array([row[:width] for row in rows], np.float64).reshape(-1, width)
    except ValueError:
        raise MeshError(f"{path.name}: a vertex is not {width} numbers") from None


def _mesh_of(path: Path, numbers: Floats, triangles: list[tuple[int, int, int]]) -> TriangleMesh:
    """The mesh whose vertices are the first three of each row of numbers (n, 3 or more)."""
    if not all(0 <= corner < len(numbers) for corner in itertools.chain.from_iterable(triangles)):
        raise MeshError(f"{path.name}: a face names a vertex that is not among its {len(numbers)} vertices")
    return triangle_mesh(numbers[:, :3], np.array(triangles, np.int64).reshape(-1, 3))


def _colour(mesh: TriangleMesh, colours: Floats) -> None:
    if np.isfinite(colours).all():
        mesh.vertex_colors = o3d.utility.Vector3dVector(np.ascontiguousarray(colours))


def _fewer(path: Path, announced: tuple[int, int], found: tuple[int, int]) -> MeshError:
    return MeshError(
        f"{path.name} announces {announced[0]} vertices and {announced[1]} faces,"
        f" but {found[0]} and {found[1]} can be read: it is damaged"
    )


def _ply_counts(path: Path) -> tuple[int, int]:
    """(vertices, faces) as the header of a PLY file says, once the file is large enough for them."""
    with path.open("rb") as file:
        start = file.read(65536)
    head, found, _ = start.partition(b"end_header")
    if not start.startswith(b"ply") or not found:
        raise MeshError(f"{path.name} does not begin like a PLY file")
    counts, least, element = {"vertex": 0, "face": 0}, len(head) + len(b"end_header"), ""
    sizes = _PLY_SIZES if b"format ascii" not in head else dict.fromkeys(_PLY_SIZES, 2)  # a digit and a space
    for line in head.decode("ascii", "replace").splitlines():
        match line.split():
            case ["element", element, count]:
                counts[element] = int(count) if count.isdigit() else 0
            case ["property", "list", count_type, item_type, name]:
                corners = 3 if name.startswith("vertex_ind") else 0  # other lists may be empty
                least += counts[element] * (sizes.get(count_type, 1) + corners * sizes.get(item_type, 1))
            case ["property", kind, _]:
                least += counts[element] * sizes.get(kind, 1)
    _enough(path, least)
    return counts["vertex"], counts["face"]


def _enough(path: Path, least: int) -> None:
    """Refuse a file too small for the counts in its header, before memory is taken for them."""
    if path.stat().st_size < least:
        raise MeshError(f"{path.name} is truncated: {path.stat().st_size} bytes, its header announces {least} or more")
