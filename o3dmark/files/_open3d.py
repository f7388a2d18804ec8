"""What Open3D reads and writes itself, without its own warnings: what matters of them is raised."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from o3dmark.errors import MeshError

if TYPE_CHECKING:
    from o3dmark.mesh.surface import PointCloud, TriangleMesh


def read(path: Path) -> "TriangleMesh":
    """The mesh in a file, or an empty one where Open3D finds none."""
    import open3d as o3d

    with _quiet():
        return o3d.io.read_triangle_mesh(str(path))


def read_points(path: Path) -> "PointCloud":
    """The point cloud in a file, or an empty one where Open3D finds none."""
    import open3d as o3d

    with _quiet():
        return o3d.io.read_point_cloud(str(path))


def write(path: Path, mesh: "TriangleMesh") -> None:
    """Write a mesh in the format that the name's ending says. Errors: MeshError when Open3D does not manage it."""
    import open3d as o3d

    if path.suffix.lower() == ".stl" and not mesh.has_triangle_normals():
        mesh = o3d.geometry.TriangleMesh(mesh).compute_triangle_normals()
    with _quiet():
        if path.suffix.lower() in (".glb", ".gltf"):  # what the legacy writer makes of these, no reader takes
            written = o3d.t.io.write_triangle_mesh(str(path), o3d.t.geometry.TriangleMesh.from_legacy(mesh))
        else:
            written = o3d.io.write_triangle_mesh(str(path), mesh)
    _check(written, path)


def write_points(path: Path, cloud: "PointCloud") -> None:
    """Write a point cloud. Errors: as `write`."""
    import open3d as o3d

    with _quiet():
        written = o3d.io.write_point_cloud(str(path), cloud)
    _check(written, path)


@contextmanager
def _quiet() -> Iterator[None]:
    import open3d as o3d

    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        yield


def _check(written: bool, path: Path) -> None:
    if not written or not path.exists():
        raise MeshError(f"Open3D could not write {path.name}")
