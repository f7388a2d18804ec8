"""Attacks that put something else into the file: a second copy, things inside, beside, far away, underneath.

The surface itself stays as it is. What is added is grey where there are colours; texture coordinates are dropped.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from o3dmark.arrays import Floats, Ints
from o3dmark.attacks import ATTACKS, Attack, _meshlab
from o3dmark.attacks._carry import checked_arrays, colours_of, copied, made
from o3dmark.attacks.geometry import random_direction, random_rotation
from o3dmark.mesh import geometry
from o3dmark.mesh.rays import scene_of
from o3dmark.mesh.surface import Surface, mesh_arrays
from o3dmark.registry import option

if TYPE_CHECKING:
    from o3dmark.mesh.surface import TriangleMesh

Arrays = tuple[Floats, Ints]


@ATTACKS.register("twice")
@dataclass(frozen=True)
class Twice(Attack):
    """The mesh and a copy of it at the same place, every coordinate of the copy moved by U(-jitter, jitter).

    Source: defined here; a paste too many in a modelling program.
    """

    jitter: float = option(1e-6, "largest motion of a coordinate, over the bounding box's diagonal; 0: exactly twice")

    def __post_init__(self) -> None:
        if self.jitter < 0:
            raise ValueError(f"jitter should be 0 or more, not {self.jitter}")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, triangles = checked_arrays(mesh)
        moved = vertices + self.jitter * geometry.diagonal(vertices) * rng.uniform(-1.0, 1.0, vertices.shape)
        return _with(mesh, [(moved, triangles)], colours_of(mesh))


@ATTACKS.register("inside")
@dataclass(frozen=True)
class Inside(Attack):
    """Something within the surface, where nobody looks.

    ball     a ball of radius size/2 diagonals, as deep inside as there is room
    shell    the surface itself, ``size`` times as large about its centre

    Source: defined here; hollow prints have a shell, and hiding a ball in a model is easy.
    """

    kind: Literal["ball", "shell"] = option("ball", "what is put inside")
    size: float = option(0.03, "diameter of the ball over the diagonal, or of the shell over the surface; 0: nothing")

    def __post_init__(self) -> None:
        if not 0 <= self.size < 1:
            raise ValueError(f"size should be in [0, 1), not {self.size}")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, triangles = checked_arrays(mesh)
        if not self.size:
            return copied(mesh)
        if self.kind == "shell":
            centre = geometry.area_centroid(vertices, triangles)
            return _with(mesh, [(centre + self.size * (vertices - centre), triangles)])
        ball, corners = _ball()
        return _with(
            mesh, [(_deepest(vertices, triangles, rng) + self.size / 2.0 * geometry.diagonal(vertices) * ball, corners)]
        )


@ATTACKS.register("speck")
@dataclass(frozen=True)
class Speck(Attack):
    """A tetrahedron so small and so far away that nobody sees it, in a random direction.

    Source: defined here; a stray triangle that a modelling program left far from the object.
    """

    size: float = option(1e-3, "size of the speck, over the bounding box's diagonal")
    distance: float = option(100.0, "from the centre of the box, over its diagonal")

    def __post_init__(self) -> None:
        if not (0 < self.size < 1 and 0 <= self.distance < 1e9):
            raise ValueError("wants size in 0 .. 1 and distance in 0 .. 1e9")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, _ = checked_arrays(mesh)
        corners = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
        place = _centre(vertices) + geometry.diagonal(vertices) * (
            self.distance * random_direction(rng) + self.size / 3.0 * corners
        )
        return _with(mesh, [(place, np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]))])


@ATTACKS.register("dust")
@dataclass(frozen=True)
class Dust(Attack):
    """Small balls all around the surface, up to twice as far as its box reaches.

    Source: defined here; floating pieces that scanners and splats leave.
    """

    count: int = option(300, "number of balls; 0: none")
    size: float = option(0.01, "diameter of a ball, over the bounding box's diagonal")

    def __post_init__(self) -> None:
        if self.count < 0 or not 0 < self.size < 1:
            raise ValueError("wants count >= 0 and size in 0 .. 1")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, _ = checked_arrays(mesh)
        if not self.count:
            return copied(mesh)
        ball, corners = _ball(5)
        diagonal = geometry.diagonal(vertices)
        away = rng.uniform(0.55, 1.1, self.count)
        centres = _centre(vertices) + diagonal * away[:, None] * geometry.unit(rng.standard_normal((self.count, 3)))
        return _with(mesh, [(centre + self.size / 2.0 * diagonal * ball, corners) for centre in centres])


@ATTACKS.register("scene")
@dataclass(frozen=True)
class Scene(Attack):
    """Other objects around the mesh: primitives of Open3D, turned at random, none touching another's ball.

    Their diagonals are U(smallest, largest) of the mesh's. Source: defined here; a scene exported as one mesh.
    """

    objects: int = option(9, "number of other objects; 0: none")
    smallest: float = option(0.5, "smallest diagonal, over the mesh's")
    largest: float = option(1.5, "largest diagonal, over the mesh's")

    def __post_init__(self) -> None:
        if self.objects < 0 or not 0 < self.smallest <= self.largest < 1e6:
            raise ValueError("wants objects >= 0 and 0 < smallest <= largest")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, _ = checked_arrays(mesh)
        if not self.objects:
            return copied(mesh)
        diagonal, others = geometry.diagonal(vertices), list[Arrays]()
        for number, place in enumerate(_grid(self.objects + 1)[1:]):
            other, triangles = mesh_arrays(primitive(("torus", "sphere", "box", "cone")[number % 4]))
            size = rng.uniform(self.smallest, self.largest) * diagonal / geometry.diagonal(other)
            turned = (other - _centre(other)) @ random_rotation(rng, np.pi).T
            others.append((_centre(vertices) + 1.1 * self.largest * diagonal * place + size * turned, triangles))
        return _with(mesh, others)


@ATTACKS.register("plate")
@dataclass(frozen=True)
class Plate(Attack):
    """The mesh several times, side by side, each turned about the vertical, as they are printed.

    base     with a plate under each: a box of its own, that the object stands on
    Source: defined here; how slicers arrange what they are to print.
    """

    copies: int = option(4, "how many there are; 1: the mesh alone")
    base: bool = option(False, "with a base under each")

    def __post_init__(self) -> None:
        if self.copies < 1:
            raise ValueError(f"copies should be 1 or more, not {self.copies}")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, triangles = checked_arrays(mesh)
        if self.copies == 1 and not self.base:
            return copied(mesh)
        diagonal, centre, others = geometry.diagonal(vertices), _centre(vertices), list[Arrays]()
        for number, place in enumerate(_grid(self.copies)):
            angle = rng.uniform(0.0, 2.0 * np.pi) if number else 0.0
            turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0, 0, 1.0]])
            here = centre + 1.1 * diagonal * place + (vertices - centre) @ turn.T
            others += [(here, triangles)] if number else []
            others += [_base(here)] if self.base else []
        return _with(mesh, others)


@ATTACKS.register("pedestal")
@dataclass(frozen=True)
class Pedestal(Attack):
    """A plate under the object, fused with it: the surface of both together, by exact boolean union.

    It acts on the welded surface, which has to be closed. Source: defined here; a figure made ready to print.
    """

    depth: float = option(0.06, "how deep the object stands in the plate, over its height; 0 to 0.9; 0: none")

    def __post_init__(self) -> None:
        if not 0 <= self.depth <= 0.9:
            raise ValueError(f"depth should be 0 to 0.9, not {self.depth}")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:  # noqa: ARG002
        surface = Surface.of(mesh)
        if not self.depth:
            return copied(mesh)
        plate, corners = _base(surface.vertices, self.depth * np.ptp(surface.vertices[:, 2]))
        return made(mesh, *_meshlab.union(surface.vertices, surface.triangles, plate, corners))


def primitive(name: str) -> "TriangleMesh":
    """One of Open3D's primitives, in some hundred to some thousand triangles."""
    import open3d as o3d

    makers = {
        "torus": lambda: o3d.geometry.TriangleMesh.create_torus(1.0, 0.4, 60, 30),
        "sphere": lambda: o3d.geometry.TriangleMesh.create_sphere(1.0, 30),
        "box": lambda: o3d.geometry.TriangleMesh.create_box().subdivide_midpoint(4),
        "cone": lambda: o3d.geometry.TriangleMesh.create_cone(1.0, 2.0, 40, 10),
    }
    return makers[name]()


def _with(mesh: Any, others: Sequence[Arrays], colours: Floats | None = None) -> "TriangleMesh":
    """The mesh and others in one; these grey, unless they have ``colours``."""
    vertices, triangles = mesh_arrays(mesh)
    start = np.cumsum([len(vertices), *(len(other) for other, _ in others)])[:-1]
    together = np.concatenate([vertices, *(other for other, _ in others)])
    corners = np.concatenate([triangles, *(t + first for (_, t), first in zip(others, start, strict=True))])
    mine = colours_of(mesh)
    if mine is not None:
        rest = np.full((len(together) - len(vertices), 3), 0.5) if colours is None else colours
        mine = np.concatenate([mine, rest])
    return made(mesh, together, corners, mine)


def _base(vertices: Floats, depth: float = 0.0) -> Arrays:
    """A box a little wider than the object, that its lowest vertex stands on, or ``depth`` below its top."""
    import open3d as o3d

    low, high = vertices.min(axis=0), vertices.max(axis=0)
    margin, thickness = 0.1 * (high - low).max(), 0.05 * (high - low).max()
    box, triangles = mesh_arrays(o3d.geometry.TriangleMesh.create_box().subdivide_midpoint(3))
    size = np.array([*(high - low)[:2] + 2.0 * margin, thickness + depth])
    return np.array([*low[:2] - margin, low[2] - thickness]) + box * size, triangles


def _grid(count: int) -> Floats:
    """So many places (count, 3) in the plane, one apart, around the first."""
    side = int(np.ceil(np.sqrt(count)))
    places = np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), axis=-1).reshape(-1, 2)[:count]
    return np.asarray(np.pad(places, ((0, 0), (0, 1))), np.float64)


def _ball(resolution: int = 10) -> Arrays:
    import open3d as o3d

    return mesh_arrays(o3d.geometry.TriangleMesh.create_sphere(1.0, resolution))


def _centre(vertices: Floats) -> Floats:
    return np.asarray((vertices.min(axis=0) + vertices.max(axis=0)) / 2.0)


def _deepest(vertices: Floats, triangles: Ints, rng: np.random.Generator) -> Floats:
    """Of points drawn in the box the one furthest inside (3,)."""
    import open3d as o3d

    centre, diagonal = _centre(vertices), geometry.diagonal(vertices)
    scene = scene_of((vertices - centre) / diagonal, triangles)
    reach = np.ptp(vertices, axis=0) / diagonal / 2.0
    points = np.asarray(rng.uniform(-reach, reach, (4000, 3)), np.float32)
    depth = scene.compute_signed_distance(o3d.core.Tensor(points), nsamples=3).numpy()
    return np.asarray(centre + diagonal * points[np.argmin(depth)], np.float64)
