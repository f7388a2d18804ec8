"""The solid that a mesh bounds, whatever the mesh is like.

    Surface -> wound outward -> closed -> Solid

Integrals over the solid become sums over its triangles by the divergence theorem, and such sums hardly notice how the
surface is triangulated.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from o3dmark.arrays import Bools, Floats, Ints
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface
from o3dmark.solid.closing import fans, oriented


@dataclass(frozen=True, eq=False)
class Solid:
    """A closed, outward surface: vertices (n, 3), triangles (m, 3). The first ``len(movable)`` vertices are the mesh's.

    ``movable`` (n_mesh,) is True at the vertices that the fans over the holes do not touch.
    """

    vertices: Floats
    triangles: Ints
    movable: Bools

    @classmethod
    def of(cls, surface: Surface) -> "Solid":
        """The solid that ``surface`` bounds."""
        triangles = oriented(surface.vertices, surface.triangles)
        vertices, caps = fans(surface.vertices, triangles)
        movable = np.ones(len(surface.vertices), bool)
        movable[caps[caps < len(movable)]] = False
        return cls(vertices, np.concatenate([triangles, caps]), movable)

    def moved(self, vertices: Floats) -> "Solid":
        """The same solid with the mesh's vertices at ``vertices`` (n_mesh, 3). Only movable ones may have moved."""
        return Solid(np.concatenate([vertices, self.vertices[len(vertices) :]]), self.triangles, self.movable)

    @cached_property
    def area_vectors(self) -> Floats:
        return geometry.area_vectors(self.vertices, self.triangles)

    @cached_property
    def areas(self) -> Floats:
        """Triangle areas (m,)."""
        return np.asarray(np.linalg.norm(self.area_vectors, axis=1))

    @cached_property
    def area(self) -> float:
        return float(self.areas.sum())

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


def normal_rms(solid: Solid, displacement: Floats) -> float:
    """RMS distance between the surface and the surface moved by ``displacement`` (n_mesh, 3), to first order.

    The normal part of the motion, linear in each triangle, integrated exactly; fans over holes are left out.
    """
    n = len(solid.movable)
    real = (solid.triangles < n).all(axis=1)
    return geometry.normal_rms(solid.area_vectors[real], displacement[solid.triangles[real]])
