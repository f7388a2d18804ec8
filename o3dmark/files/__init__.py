"""Reading and writing mesh files so that nothing is misread and nothing is half written.

ply, obj, off    one file a format that Open3D reads badly: it drops polygons and negative indices, takes OFF files of
                 one layout only, and returns the first part of a truncated PLY
_open3d          the rest: STL, GLB and glTF, and point clouds
writing          files that appear complete or not at all

MeshLab reads polygons too, but a polygon that visits a vertex twice made it corrupt its memory.
"""

from pathlib import Path

import numpy as np

from o3dmark.errors import MeshError
from o3dmark.files import _open3d, obj, off, ply
from o3dmark.files.writing import replacing
from o3dmark.mesh.surface import PointCloud, TriangleMesh

FORMATS = (".ply", ".obj", ".off", ".stl", ".glb", ".gltf")
_READERS = {".obj": obj.read, ".off": off.read, ".ply": ply.read}
_WRITERS = {".obj": obj.write, ".off": off.write}


def read_mesh(path: str | Path) -> TriangleMesh:
    """The triangle mesh in a file (PLY, OBJ, OFF, STL, GLB, glTF), in double precision where the file has it.

    Errors: MeshError when the file is missing, of another kind, damaged, or holds no triangle.
    """
    path = _existing(path)
    mesh = _READERS.get(path.suffix.lower(), _open3d.read)(path)
    if not mesh.has_triangles():
        what = f"{len(mesh.vertices)} vertices and no triangle" if mesh.has_vertices() else "no mesh"
        raise MeshError(f"{path.name} holds {what}")
    return mesh


def read_points(path: str | Path) -> PointCloud:
    """The point cloud in a file, with its normals if it has them. Errors: MeshError as in `read_mesh`."""
    path = _existing(path)
    if path.suffix.lower() == ".ply":
        ply.counts(path)
    cloud = _open3d.read_points(path)
    if not cloud.has_points():
        raise MeshError(f"{path.name} holds no point")
    if not np.isfinite(np.asarray(cloud.points)).all():
        raise MeshError(f"{path.name} has points whose coordinates are not finite")
    return cloud


def read_shape(path: str | Path) -> TriangleMesh | PointCloud:
    """The mesh in a file, or its points where it has no triangle. Errors: MeshError as in `read_mesh`."""
    path = _existing(path)
    if path.suffix.lower() == ".ply" and not ply.counts(path)[1]:
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
    with replacing(path) as draft:
        _WRITERS.get(path.suffix.lower(), _open3d.write)(draft, mesh)


def write_shape(path: str | Path, shape: TriangleMesh | PointCloud) -> None:
    """Write a mesh as `write_mesh` does, or a point cloud as binary PLY. Errors as there."""
    if not isinstance(shape, PointCloud):  # type: ignore[misc]
        write_mesh(path, shape)
        return
    if Path(path).suffix.lower() != ".ply":
        raise MeshError(f"cannot write {Path(path).name}: a point cloud is written as .ply")
    with replacing(path) as draft:
        _open3d.write_points(draft, shape)


def _existing(path: str | Path) -> Path:
    """The path of a file that is there, not empty, and of a known ending. Errors: MeshError."""
    path = Path(path)
    if not path.is_file():
        raise MeshError(f"no file at {str(path)!r}")
    if path.suffix.lower() not in FORMATS:
        raise MeshError(f"{path.name}: the ending is none of {', '.join(FORMATS)}")
    if not path.stat().st_size:
        raise MeshError(f"{path.name} is empty")
    return path


__all__ = ["FORMATS", "read_mesh", "read_points", "read_shape", "replacing", "write_mesh", "write_shape"]
