"""The solid that a mesh bounds, whatever the mesh is like.

    Surface -> wound outward -> closed -> Solid

Integrals over the solid become sums over its triangles by the divergence theorem, and such sums hardly notice how the
surface is triangulated.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from o3dmark.arrays import Bools, Floats, Ints
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Facets, Surface
from o3dmark.solid.closing import fans, oriented


@dataclass(frozen=True, eq=False)
class Solid(Facets):
    """A closed, outward surface: vertices (n, 3), triangles (m, 3). The first ``len(movable)`` vertices are the mesh's.

    ``movable`` (n_mesh,) is True at the vertices that the fans over the holes do not touch.
    """

    vertices: Floats
    triangles: Ints
    movable: Bools

    @classmethod
    def of(cls, surface: Surface) -> "Solid":
        """The solid that ``surface`` bounds; of one taken as wound, the sum of its triangles, its volume above zero."""
        if surface.as_wound:
            inward = geometry.volume(surface.vertices - surface.centroid, surface.triangles) < 0.0
            triangles = surface.triangles[:, ::-1] if inward else surface.triangles
            return cls(surface.vertices, triangles, np.ones(len(surface.vertices), bool))
        triangles = oriented(surface.vertices, surface.triangles)
        vertices, caps = fans(surface.vertices, triangles)
        movable = np.ones(len(surface.vertices), bool)
        movable[caps[caps < len(movable)]] = False
        return cls(vertices, np.concatenate([triangles, caps]), movable)

    def moved(self, vertices: Floats) -> "Solid":
        """The same solid with the mesh's vertices at ``vertices`` (n_mesh, 3). Only movable ones may have moved."""
        return Solid(np.concatenate([vertices, self.vertices[len(vertices) :]]), self.triangles, self.movable)

    @cached_property
    def vertex_area_vectors(self) -> Floats:
        """A third of the area vectors around each vertex of the mesh (n_mesh, 3)."""
        return self._at_vertices(self.area_vectors)

    @cached_property
    def vertex_areas(self) -> Floats:
        """A third of the area around each vertex of the mesh (n_mesh,)."""
        return self._at_vertices(self.areas)

    def _at_vertices(self, values: Floats) -> Floats:
        sums = geometry.sum_at_vertices(values, self.triangles, len(self.vertices))
        return sums[: len(self.movable)] / 3.0


def normal_square(solid: Solid, directions: sp.csr_array) -> sp.csr_array:
    """The form P (d, d) of motions made up of ``directions`` (3 n_mesh, d), row 3 v + i for axis i of vertex v.

    x' P x is a mean square: that of `geometry.normal_rms`, over the surface without fans.
    """
    real = (solid.triangles < len(solid.movable)).all(axis=1)
    triangles, size = solid.triangles[real], solid.areas[real]
    face = geometry.unit(solid.area_vectors[real])
    ways = np.repeat(face, 3, axis=0)[:, None]  # of each corner, along the triangle's normal
    speed = geometry.motions_along(triangles.reshape(-1, 1), ways, len(solid.movable)) @ directions
    hats = (1.0 + np.eye(3)) / 12.0  # the mean over a triangle of the product of two corners' hat functions
    return speed.T @ (sp.kron(sp.diags_array(size / size.sum()), hats, format="csr") @ speed)
