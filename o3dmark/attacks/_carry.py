"""What happens to attributes in an attack: what a mesh has besides positions is kept, picked or looked up again.

Attacks act on a mesh as it is stored, seams and unused vertices included. Geometry attacks keep every attribute
(normals, where there are any, are computed anew); attacks that pick elements carry the picked elements' attributes;
attacks that make a new surface look colours up at the nearest old vertex and drop texture coordinates.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from o3dmark.arrays import Floats, Ints
from o3dmark.mesh.surface import Surface, mesh_arrays, triangle_mesh, with_vertices

if TYPE_CHECKING:
    from o3dmark.mesh.surface import TriangleMesh


def checked_arrays(mesh: Any) -> tuple[Floats, Ints]:
    """`mesh_arrays` of a mesh that has a surface; MeshError, as in `Surface.of`, for one that has none."""
    Surface.of(mesh)
    return mesh_arrays(mesh)


def copied(mesh: Any) -> Any:
    """An equal mesh that shares nothing with ``mesh``."""
    import open3d as o3d

    return mesh.clone() if isinstance(mesh, o3d.t.geometry.TriangleMesh) else o3d.geometry.TriangleMesh(mesh)


def moved(mesh: Any, vertices: Floats) -> Any:
    """A copy of ``mesh`` with each of its stored vertices elsewhere (N, 3) and all its attributes."""
    before, triangles = mesh_arrays(mesh)
    return with_vertices(mesh, Surface(before, triangles, np.arange(len(before))), vertices)


def picked(mesh: Any, vertices: Ints, triangles: Ints, source: Ints) -> "TriangleMesh":
    """A mesh made of elements of ``mesh``, with their attributes.

    vertices (n,): the old index of each new vertex; triangles (m, 3): new corners, in new indices and the old cyclic
    order or any other; source (m,): the old index of each new triangle. A tensor mesh comes back as a legacy one.
    """
    import open3d as o3d

    old = legacy(mesh)
    new = triangle_mesh(np.asarray(old.vertices)[vertices], triangles)
    if old.has_vertex_colors():
        new.vertex_colors = _vectors(np.asarray(old.vertex_colors)[vertices])
    if old.has_vertex_normals():
        new.vertex_normals = _vectors(np.asarray(old.vertex_normals)[vertices])
    if old.has_triangle_normals():
        new.triangle_normals = _vectors(np.asarray(old.triangle_normals)[source])
    if old.has_triangle_uvs():
        new.triangle_uvs = _picked_uvs(old, vertices[triangles], source)
    if old.has_triangle_material_ids():
        new.triangle_material_ids = o3d.utility.IntVector(np.asarray(old.triangle_material_ids)[source])
    new.textures = old.textures
    return new


def kept(mesh: Any, keep: NDArray[np.bool_]) -> "TriangleMesh":
    """The part of ``mesh`` whose triangles are marked in ``keep`` (m,), without the vertices that none of them uses."""
    _, triangles = mesh_arrays(mesh)
    vertices, corners = np.unique(triangles[keep], return_inverse=True)
    return picked(mesh, vertices, corners.reshape(-1, 3), np.flatnonzero(keep))


def made(mesh: Any, vertices: Floats, triangles: Ints, colours: Floats | None = None) -> "TriangleMesh":
    """A new surface in the place of ``mesh``: vertices (n, 3), triangles (m, 3).

    It is coloured by ``colours`` (n, 3) or, without them, by the nearest vertex of ``mesh``, if that has colours.
    """
    old, new = legacy(mesh), triangle_mesh(vertices, triangles)
    if old.has_vertex_colors():
        if colours is None:
            _, nearest = KDTree(np.asarray(old.vertices)).query(vertices)
            colours = np.asarray(old.vertex_colors)[nearest]
        new.vertex_colors = _vectors(np.clip(colours, 0.0, 1.0))
    if old.has_vertex_normals():
        new.compute_vertex_normals()
    return new


def colours_of(mesh: Any) -> Floats | None:
    """Vertex colours (N, 3) in 0 .. 1, or None."""
    old = legacy(mesh)
    return np.array(old.vertex_colors, np.float64) if old.has_vertex_colors() else None


def legacy(mesh: Any) -> "TriangleMesh":
    """The mesh as a legacy TriangleMesh: itself, or a tensor mesh converted."""
    import open3d as o3d

    return mesh.to_legacy() if isinstance(mesh, o3d.t.geometry.TriangleMesh) else mesh


def _vectors(rows: Floats) -> Any:
    import open3d as o3d

    return o3d.utility.Vector3dVector(np.array(rows, np.float64, order="C"))


def _picked_uvs(old: "TriangleMesh", corners: Ints, source: Ints) -> Any:
    """Texture coordinates follow their corner of the source triangle, wherever that corner stands now."""
    import open3d as o3d

    uvs = np.asarray(old.triangle_uvs).reshape(-1, 3, 2)[source]
    place = np.argmax(np.asarray(old.triangles)[source][:, None, :] == corners[:, :, None], axis=2)
    return o3d.utility.Vector2dVector(np.take_along_axis(uvs, place[:, :, None], axis=1).reshape(-1, 2))
