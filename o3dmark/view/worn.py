"""What a mesh wears: its pictures, or else the colours of its vertices or points."""

from typing import Any, NamedTuple

import numpy as np
import open3d as o3d

from o3dmark.arrays import Floats, Ints
from o3dmark.mesh.surface import Surface, is_cloud, legacy_mesh, proper_triangles
from o3dmark.view.model import TRIANGLES_A_POINT, Shape
from o3dmark.view.texture import Texture


class VertexColours(NamedTuple):
    """A colour (m, 3, 3) of 0 to 1, sRGB, at each corner of each triangle that is drawn."""

    corners: Floats

    @classmethod
    def of(cls, mesh: Any, shape: Shape) -> "VertexColours | None":
        """Those of a mesh for the triangles of its surface, or of a cloud for those of its discs; None without any."""
        colours = vertex_colours(mesh)
        if colours is None:
            return None
        if not isinstance(shape, Surface):
            return cls(np.repeat(colours, TRIANGLES_A_POINT, axis=0)[:, None].repeat(3, axis=1))
        triangles = np.asarray(legacy_mesh(mesh).triangles)
        return cls(colours[triangles[proper_triangles(shape.vertex_map[triangles])]])

    def at(self, triangle: Ints, weights: Floats) -> Floats:
        """The colours (k, 3) at points of triangles (k,), by the weights of their corners (k, 3)."""
        return np.einsum("kc,kcj->kj", weights, self.corners[triangle])


def worn(mesh: Any, shape: Shape) -> Texture | VertexColours | None:
    """What colours the surface or cloud ``shape`` of a mesh, if anything. Errors: MeshError for a broken texture."""
    if isinstance(shape, Surface) and has_texture(mesh):
        return Texture.of(mesh, shape)
    return VertexColours.of(mesh, shape)


def has_texture(mesh: Any) -> bool:
    """Whether a mesh wears pictures, and says where."""
    if isinstance(mesh, Surface) or is_cloud(mesh):
        return False
    legacy = legacy_mesh(mesh)
    return bool(legacy.has_textures() and legacy.has_triangle_uvs())


def vertex_colours(mesh: Any) -> Floats | None:
    """The colours (n, 3) of the vertices of a mesh or the points of a cloud, 0 to 1, if it has any."""
    if isinstance(mesh, Surface):
        return None
    if isinstance(mesh, o3d.t.geometry.PointCloud):
        mesh = mesh.to_legacy()
    if is_cloud(mesh):
        return np.asarray(mesh.colors) if mesh.has_colors() else None
    legacy = legacy_mesh(mesh)
    return np.asarray(legacy.vertex_colors) if legacy.has_vertex_colors() else None
