"""Sculptures as semi-regular meshes: a coarse mesh of one, each triangle cut into four again and again, on the solid."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, cast

import numpy as np

from o3dmark.mesh import geometry
from o3dmark.mesh.surface import mesh_arrays, triangle_mesh
from o3dmark.registry import option
from o3dmark.synthetic import SHAPES, Sculpture, Shape
from o3dmark.synthetic.isosurface import project

if TYPE_CHECKING:
    from o3dmark.mesh.surface import TriangleMesh

_REACH = 0.25  # of an edge: how far a new vertex may be from the solid


@SHAPES.register("semi_regular")
@dataclass(frozen=True)
class SemiRegular(Shape):
    """A sculpture with subdivision connectivity; every vertex that a subdivision adds is brought onto the solid."""

    of: Literal["bimba", "bunny", "venus", "horse", "cat", "cup", "vase"] = option("bimba", "which sculpture")
    coarse: int = option(300, "vertices of the coarse mesh")
    levels: int = option(3, "subdivisions; each makes four times as many triangles")
    seed: int = option(0, "which individual of the kind")

    def __post_init__(self) -> None:
        if self.coarse < 100 or not 1 <= self.levels <= 8 or self.seed < 0:
            raise ValueError("coarse must be at least 100, levels 1 to 8, seed at least 0")

    def build(self) -> "TriangleMesh":
        """The individual's mesh. Errors: MeshError when no manifold mesh with so few vertices was found."""
        base = cast(Sculpture, SHAPES.make({"name": self.of, "vertices": self.coarse, "seed": self.seed}))
        mesh, field = base.sculpted()
        for _ in range(self.levels):
            kept = len(mesh.vertices)
            vertices, triangles = mesh_arrays(mesh.subdivide_midpoint(1))
            ends = vertices[geometry.edges(triangles)]
            reach = _REACH * float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).mean())
            normals = geometry.unit(geometry.vertex_area_vectors(vertices, triangles))
            vertices[kept:] = project(field, vertices[kept:], normals[kept:], reach)
            mesh = triangle_mesh(vertices, triangles)
        return mesh
