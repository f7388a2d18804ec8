"""Reading and writing mesh files so that nothing is misread, nothing is lost, and nothing of anybody's is overwritten.

asset        somebody's file: what is in it, and the same file with other positions
gltf, obj, ply, stl, off, threemf, usd    one file a format
references   what a file refers to, never out of its folder
writing      files that appear complete or not at all, under names that were free
convert      another format than the file's own
_open3d      meshes in memory, and point clouds
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from o3dmark.errors import MeshError
from o3dmark.files import _open3d, obj, off
from o3dmark.files.asset import KINDS, STAYS, Asset, Part
from o3dmark.files.conversion import TARGETS, convert
from o3dmark.files.gltf import Gltf
from o3dmark.files.obj import Obj
from o3dmark.files.off import Off
from o3dmark.files.ply import Ply
from o3dmark.files.references import Source
from o3dmark.files.stl import Stl
from o3dmark.files.threemf import ThreeMf
from o3dmark.files.usd import Usd
from o3dmark.files.writing import Destination, check_free, destination, replacing
from o3dmark.mesh.surface import is_cloud, legacy_cloud, legacy_mesh

if TYPE_CHECKING:
    from o3dmark.mesh.surface import PointCloud, TriangleMesh

ASSETS: dict[str, type[Asset]] = {
    ".ply": Ply,
    ".obj": Obj,
    ".off": Off,
    ".stl": Stl,
    ".glb": Gltf,
    ".gltf": Gltf,
    ".3mf": ThreeMf,
    ".usd": Usd,
    ".usda": Usd,
    ".usdc": Usd,
    ".usdz": Usd,
}
FORMATS = (".ply", ".obj", ".off", ".stl", ".glb", ".gltf")  # that meshes in memory are written in
CLOUDS = (".ply", ".pcd", ".xyz", ".xyzn", ".xyzrgb", ".pts")
_WRITERS = {".obj": obj.write, ".off": off.write}


def open_asset(source: str | Path | Source) -> Asset:
    """Somebody's file, as it is, ready to be written again with other positions.

    Errors: MeshError when the file is missing, of another kind, or damaged.
    """
    source = source if isinstance(source, Source) else Source(Path(source))
    source.check_there()
    suffix = source.path.suffix.lower()
    if suffix not in ASSETS:
        raise MeshError(f"{source.name}: the ending is none of {', '.join(ASSETS)}")
    return ASSETS[suffix](source)


def read_mesh(path: str | Path) -> "TriangleMesh":
    """The triangle mesh in a file, all its parts at their places, in double precision where the file has it.

    Errors: MeshError when the file is missing, of another kind, damaged, or holds no triangle.
    """
    return whole_mesh(open_asset(path))


def whole_mesh(asset: Asset) -> "TriangleMesh":
    """The triangle mesh of an asset, all its parts at their places. Errors: MeshError for one without a triangle."""
    mesh = asset.mesh()
    if not mesh.has_triangles():
        raise _without_triangles(asset, mesh)
    return mesh


def read_points(path: str | Path) -> "PointCloud":
    """The point cloud in a file, with its normals if it has them. Errors: MeshError as in `read_mesh`."""
    path = Path(path)
    Source(path).check_there()
    if path.suffix.lower() not in (*CLOUDS, *ASSETS):
        raise MeshError(f"{path.name}: the ending is none of {', '.join(CLOUDS)}")
    cloud = Ply(Source(path)).points() if path.suffix.lower() == ".ply" else _open3d.read_points(path)
    if not cloud.has_points():
        raise MeshError(f"{path.name} holds no point")
    if not np.isfinite(np.asarray(cloud.points)).all():
        raise MeshError(f"{path.name} has points whose coordinates are not finite")
    return cloud


def open_shape(path: str | Path) -> "Asset | PointCloud":
    """A file as an asset, or its points where it has no triangle. Errors: MeshError as in `read_mesh`."""
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix in CLOUDS and suffix not in ASSETS:
        return read_points(path)
    asset = open_asset(path)
    if any(len(part.triangles) for part in asset.parts):
        return asset
    if suffix in CLOUDS:
        return read_points(path)
    raise _without_triangles(asset, asset.mesh())


def read_shape(path: str | Path) -> "TriangleMesh | PointCloud":
    """The mesh in a file, or its points where it has no triangle. Errors: MeshError as in `read_mesh`."""
    shape = open_shape(path)
    return shape.mesh() if isinstance(shape, Asset) else shape


def _without_triangles(asset: Asset, mesh: "TriangleMesh") -> MeshError:
    what = f"{len(mesh.vertices)} vertices and no triangle" if mesh.has_vertices() else "no mesh"
    return MeshError(f"{asset.name} holds {what}")


def write_mesh(path: str | Path, mesh: object) -> None:
    """Write an Open3D mesh, legacy or tensor, in the format that the name's ending says; complete or not at all.

    PLY (binary), OBJ and OFF (text) keep every bit, STL and glTF float32.
    Errors: MeshError when the folder is missing, the ending unknown or the disk full.
    """
    path = Path(path)
    if path.suffix.lower() not in FORMATS:
        raise MeshError(f"cannot write {path.name}: the ending is none of {', '.join(FORMATS)}")
    with replacing(path) as draft:
        _WRITERS.get(path.suffix.lower(), _open3d.write)(draft, legacy_mesh(mesh))


def write_shape(path: str | Path, shape: object) -> None:
    """Write a mesh as `write_mesh` does, or a point cloud as binary PLY. Errors as there."""
    if not is_cloud(shape):
        write_mesh(path, shape)
        return
    if Path(path).suffix.lower() != ".ply":
        raise MeshError(f"cannot write {Path(path).name}: a point cloud is written as .ply")
    with replacing(path) as draft:
        _open3d.write_points(draft, legacy_cloud(shape))


__all__ = [
    "ASSETS",
    "CLOUDS",
    "FORMATS",
    "KINDS",
    "STAYS",
    "TARGETS",
    "Asset",
    "Destination",
    "Part",
    "Source",
    "check_free",
    "convert",
    "destination",
    "open_asset",
    "open_shape",
    "read_mesh",
    "read_points",
    "read_shape",
    "replacing",
    "whole_mesh",
    "write_mesh",
    "write_shape",
]
