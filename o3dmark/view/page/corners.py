"""Triangles as a graphics card wants them: a vertex has one normal, one colour and one place in a texture."""

from typing import Any, NamedTuple

import numpy as np

from o3dmark.arrays import AnyArray, Floats, Ints
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface, mesh_arrays, proper_triangles
from o3dmark.view.model import corner_normals
from o3dmark.view.texture import Texture

ALIKE = 1e-4  # normals of unit length that differ by less are one


class Corners(NamedTuple):
    """The r different corners of m triangles.

    triangles (m, 3): which corners, those of one picture after those of another. point (r,): the mesh's vertex there.
    group (r,): corners of a group share a normal, the mean over the triangles around them; that is how creases and
    smooth seams are told apart. uv (r, 2): their place in a picture, or None. counts: the triangles of each picture.
    """

    triangles: Ints
    point: Ints
    group: Ints
    uv: Floats | None
    counts: tuple[int, ...]

    @classmethod
    def of(cls, mesh: Any, surface: Surface, texture: Texture | None) -> "Corners":
        """Those of a mesh, of its surface and of the texture that it wears, if any."""
        triangles = mesh_arrays(mesh)[1]
        triangles = triangles[proper_triangles(surface.vertex_map[triangles])]
        which = np.zeros(len(triangles), np.int64) if texture is None else texture.which
        order = np.argsort(which, kind="stable")
        normals = corner_normals(surface.vertices, surface.triangles)[order].reshape(-1, 3)
        point = triangles[order].ravel()
        group = geometry.weld(np.column_stack([surface.vertex_map[point], np.round(normals / ALIKE)]))[1]
        columns: list[AnyArray] = [point, group]
        if texture is not None:
            columns += list(texture.corners[order].reshape(-1, 2).T)
        kept, corner = geometry.weld(np.column_stack(columns))
        uv = None if texture is None else texture.corners[order].reshape(-1, 2)[kept]
        counts = np.bincount(which, minlength=0 if texture is None else len(texture.pictures))
        return cls(corner.reshape(-1, 3), point[kept], group[kept], uv, tuple(map(int, counts)))

    def places(self) -> Floats:
        """The mesh's vertex and the place in the picture of each corner of each triangle (3 m, 1 or 3)."""
        columns = [self.point[:, None]] if self.uv is None else [self.point[:, None], self.uv]
        return np.hstack(columns)[self.triangles.ravel()].astype(np.float64)
