"""What Open3D reads and writes itself, without its own warnings: what matters of them is raised."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import open3d as o3d

from o3dmark.errors import MeshError
from o3dmark.mesh.surface import PointCloud, TriangleMesh

_FLOAT32 = 1e-6  # relative: two of its steps, and more is another vertex


def read(path: Path) -> TriangleMesh:
    """The mesh in a file, or an empty one where Open3D finds none."""
    with _quiet():
        return o3d.io.read_triangle_mesh(str(path))


def read_points(path: Path) -> PointCloud:
    """The point cloud in a file, or an empty one where Open3D finds none."""
    with _quiet():
        return o3d.io.read_point_cloud(str(path))


def dressed(path: Path, exact: TriangleMesh) -> TriangleMesh | None:
    """Open3D's reading of a file, with its textures, at the exact positions; None if it has lost or merged a part.

    Open3D reads float32, and repeats a vertex for each texture coordinate that it has.
    """
    mesh = read(path)
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


def write(path: Path, mesh: TriangleMesh) -> None:
    """Write a mesh in the format that the name's ending says. Errors: MeshError when Open3D does not manage it."""
    if path.suffix.lower() == ".stl" and not mesh.has_triangle_normals():
        mesh = TriangleMesh(mesh).compute_triangle_normals()
    with _quiet():
        if path.suffix.lower() in (".glb", ".gltf"):  # what the legacy writer makes of these, no reader takes
            written = o3d.t.io.write_triangle_mesh(str(path), o3d.t.geometry.TriangleMesh.from_legacy(mesh))
        else:
            written = o3d.io.write_triangle_mesh(str(path), mesh)
    _check(written, path)


def write_points(path: Path, cloud: PointCloud) -> None:
    """Write a point cloud. Errors: as `write`."""
    with _quiet():
        written = o3d.io.write_point_cloud(str(path), cloud)
    _check(written, path)


def _without_empty_textures(mesh: TriangleMesh) -> TriangleMesh:
    """Open3D gives every material of an OBJ file a texture, if only an empty one, and next to such it writes none."""
    full = [number for number, texture in enumerate(mesh.textures) if not texture.is_empty()]
    used = np.asarray(mesh.triangle_material_ids)
    if full and np.isin(used, full).all():
        mesh.textures = [mesh.textures[number] for number in full]
        mesh.triangle_material_ids = o3d.utility.IntVector(np.searchsorted(full, used).astype(np.int32))
    return mesh


@contextmanager
def _quiet() -> Iterator[None]:
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        yield


def _check(written: bool, path: Path) -> None:
    if not written or not path.exists():
        raise MeshError(f"Open3D could not write {path.name}")
