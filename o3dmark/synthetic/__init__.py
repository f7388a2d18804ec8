"""Procedural test shapes: stand-ins for the meshes of the papers, and simple solids.

Shape.build      -> mesh

Every shape is a registered frozen dataclass: "cat:vertices=4000,seed=2". The sculptures are implicit solids, posed and
given relief by a seeded generator: closed, manifold, of one piece, irregularly meshed and without any symmetry. The same
options make the same mesh, bit for bit under the same library versions.
"""

import abc
import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from o3dmark.errors import MeshError
from o3dmark.registry import Registry, option
from o3dmark.synthetic.field import Field
from o3dmark.synthetic.isosurface import remesh

if TYPE_CHECKING:
    from o3dmark.mesh.surface import TriangleMesh

SHAPES: "Registry[Shape]" = Registry("shape", __name__)

_POSES = 8  # drawn one after another, until limbs neither touch nor come apart; most need one


@dataclass(frozen=True)
class Shape(abc.ABC):
    """Something that can be built. Options are the fields."""

    name: ClassVar[str] = ""

    @abc.abstractmethod
    def build(self) -> "TriangleMesh":
        """A new Open3D mesh, y upward, about two units in size, triangles wound outward."""


@dataclass(frozen=True)
class Sculpture(Shape):
    """A closed mesh of an implicit solid. Each seed makes another individual: pose, proportions and relief."""

    vertices: int = option(8000, "how many vertices")
    seed: int = option(0, "which individual of the kind")

    genus: ClassVar[int] = 0
    detail: ClassVar[int] = 30000  # vertices of the mesh before decimation, at least: what the thinnest part needs

    def __post_init__(self) -> None:
        if self.vertices < 100 or self.seed < 0:
            raise ValueError("vertices must be at least 100, seed at least 0")

    def build(self) -> "TriangleMesh":
        """The individual's mesh. Errors: MeshError when no manifold mesh with so few vertices was found."""
        return self.sculpted()[0]

    def sculpted(self) -> "tuple[TriangleMesh, Field]":
        """The individual's mesh, and the implicit solid that it is of. Errors: as in `build`."""
        rng = np.random.default_rng(self.seed)
        for _ in range(_POSES):
            field = self.solid(rng)
            mesh = remesh(field, self.vertices, self.genus, self.detail, rng)
            if mesh is not None:
                return mesh, field
        raise MeshError(f"no manifold {self.name} with {self.vertices} vertices was found; ask for more")

    @abc.abstractmethod
    def solid(self, rng: np.random.Generator) -> Field:
        """The individual as an implicit solid inside the cube [-1.5, 1.5]^3."""


def make(spec: str | dict[str, Any] | Shape, seed: int | None = None) -> "TriangleMesh":
    """Build a shape from its spec; ``seed``, if given, replaces the spec's own (primitives have none and ignore it)."""
    shape = SHAPES.make(spec)
    if seed is not None and isinstance(shape, Sculpture):
        shape = dataclasses.replace(shape, seed=seed)
    return shape.build()


if TYPE_CHECKING:  # every registered class can be imported from here; a test says so
    from o3dmark.synthetic.animals import Ant as Ant
    from o3dmark.synthetic.animals import Bunny as Bunny
    from o3dmark.synthetic.animals import Cat as Cat
    from o3dmark.synthetic.animals import Horse as Horse
    from o3dmark.synthetic.heads import Bimba as Bimba
    from o3dmark.synthetic.heads import Venus as Venus
    from o3dmark.synthetic.primitives import Cube as Cube
    from o3dmark.synthetic.primitives import Cylinder as Cylinder
    from o3dmark.synthetic.primitives import Plane as Plane
    from o3dmark.synthetic.primitives import Sphere as Sphere
    from o3dmark.synthetic.primitives import Tetrahedron as Tetrahedron
    from o3dmark.synthetic.primitives import Torus as Torus
    from o3dmark.synthetic.primitives import TwoSpheres as TwoSpheres
    from o3dmark.synthetic.products import Bracket as Bracket
    from o3dmark.synthetic.products import Car as Car
    from o3dmark.synthetic.semi_regular import SemiRegular as SemiRegular
    from o3dmark.synthetic.vessels import Cup as Cup
    from o3dmark.synthetic.vessels import Flower as Flower
    from o3dmark.synthetic.vessels import Vase as Vase


def __getattr__(name: str) -> Any:
    """A registered class by its own name: `from o3dmark.synthetic import Vase`."""
    return SHAPES.class_called(name)


__all__ = ["SHAPES", "Sculpture", "Shape", "make"]
