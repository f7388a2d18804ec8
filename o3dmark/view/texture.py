"""The pictures that a mesh wears: what colour each hit of a ray has."""

from typing import Any, NamedTuple

import numpy as np

from o3dmark.arrays import Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.mesh.surface import Surface, legacy_mesh, proper_triangles


class Texture(NamedTuple):
    """Pictures (h, w, 3) of 0 to 1, sRGB; which of them each triangle wears (m,), and where: its corners (m, 3, 2).

    u runs along the rows of a picture and v from its first row to its last, as Open3D turns pictures that it reads.
    Beyond 0 .. 1 the picture is repeated.
    """

    pictures: list[Floats]
    which: Ints
    corners: Floats

    @classmethod
    def of(cls, mesh: Any, surface: Surface) -> "Texture":
        """That of a mesh, for the triangles of its surface. Errors: MeshError where it wears none."""
        legacy = legacy_mesh(mesh)
        if not legacy.has_textures() or not legacy.has_triangle_uvs():
            raise MeshError("the mesh has no texture to draw, or does not say where on it")
        kept = proper_triangles(surface.vertex_map[np.asarray(legacy.triangles)])
        which = np.zeros(len(kept), np.int64)
        if legacy.has_triangle_material_ids():
            which = np.asarray(legacy.triangle_material_ids).astype(np.int64)
        pictures = [np.atleast_3d(np.asarray(each, np.float64))[:, :, :3] / 255 for each in legacy.textures]
        if which.min() < 0 or which.max() >= len(pictures) or not all(each.size for each in pictures):
            raise MeshError(f"the mesh wears {which.max() + 1} pictures and has {len(pictures)}")
        return cls(pictures, which[kept], np.asarray(legacy.triangle_uvs).reshape(-1, 3, 2)[kept])

    def at(self, triangle: Ints, weights: Floats) -> Floats:
        """The colours (k, 3) at points of triangles (k,), by the weights of their corners (k, 3)."""
        u, v = np.einsum("kc,kcj->jk", weights, self.corners[triangle])
        colours = np.zeros((len(triangle), 3))
        for number, picture in enumerate(self.pictures):
            here = self.which[triangle] == number
            height, width = picture.shape[:2]
            column, row = u[here] * width - 0.5, v[here] * height - 0.5
            left, top = np.floor(column).astype(int), np.floor(row).astype(int)
            for down in (0, 1):
                for right in (0, 1):
                    share = np.abs(1 - right - (column - left)) * np.abs(1 - down - (row - top))
                    colours[here] += share[:, None] * picture[(top + down) % height, (left + right) % width]
        return colours
