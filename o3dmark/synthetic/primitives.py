"""Simple solids, regularly meshed: fixtures whose area, volume, genus and symmetry are known."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from o3dmark.arrays import Floats, Ints
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import triangle_mesh
from o3dmark.registry import option
from o3dmark.synthetic import SHAPES, Shape

if TYPE_CHECKING:
    from o3dmark.mesh.surface import TriangleMesh

_SQUARE = (
    np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]),
    np.array([[0, 1, 2], [0, 2, 3]]),
)
_TETRAHEDRON = (
    np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]]) / 3**0.5,
    np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]),
)


@dataclass(frozen=True)
class Primitive(Shape):
    """A solid with as many vertices as its regular mesh allows near the number asked for."""

    vertices: int = option(2500, "about how many vertices")

    def __post_init__(self) -> None:
        if self.vertices < 4:
            raise ValueError("vertices must be at least 4")


@SHAPES.register("cube")
@dataclass(frozen=True)
class Cube(Primitive):
    """The cube [-1, 1]^3, each face a grid of squares cut in two."""

    def build(self) -> "TriangleMesh":
        corners = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
        quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
        faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
        return triangle_mesh(*_divided(corners, faces, self.vertices))


@SHAPES.register("sphere")
@dataclass(frozen=True)
class Sphere(Primitive):
    """The unit sphere: an icosahedron whose faces are divided, 10 f^2 + 2 vertices."""

    def build(self) -> "TriangleMesh":
        return triangle_mesh(*unit_sphere(self.vertices))


@SHAPES.register("tetrahedron")
@dataclass(frozen=True)
class Tetrahedron(Primitive):
    """The regular tetrahedron inscribed in the unit sphere, its faces divided."""

    vertices: int = option(4, "about how many vertices")

    def build(self) -> "TriangleMesh":
        return triangle_mesh(*_divided(*_TETRAHEDRON, self.vertices))


@SHAPES.register("plane")
@dataclass(frozen=True)
class Plane(Primitive):
    """The square [-1, 1]^2 at z = 0, seen from +z: an open grid."""

    def build(self) -> "TriangleMesh":
        frequency = max(1, round(self.vertices**0.5 - 1))
        return triangle_mesh(*_subdivided(*_SQUARE, frequency))


@SHAPES.register("torus")
@dataclass(frozen=True)
class Torus(Primitive):
    """A ring about the y axis: genus 1."""

    radius: float = option(0.7, "from the axis to the middle of the ring")
    thickness: float = option(0.3, "radius of the ring itself")

    def build(self) -> "TriangleMesh":
        around = max(3, round((self.vertices * self.radius / self.thickness) ** 0.5))
        across = max(3, round(self.vertices / around))
        u, v = np.meshgrid(_turn(around), _turn(across), indexing="ij")
        reach = self.radius + self.thickness * np.cos(v)
        points = np.stack([reach * np.cos(u), -self.thickness * np.sin(v), reach * np.sin(u)], axis=-1)
        return triangle_mesh(points.reshape(-1, 3), _wrapped(around, across, True))


@SHAPES.register("cylinder")
@dataclass(frozen=True)
class Cylinder(Primitive):
    """The closed cylinder of radius 0.5 and height 2 about the y axis, its lids fans."""

    def build(self) -> "TriangleMesh":
        around = max(3, round((1.6 * self.vertices) ** 0.5))
        rings = max(2, round((self.vertices - 2) / around))
        y, angle = np.meshgrid(np.linspace(-1.0, 1.0, rings), _turn(around), indexing="ij")
        wall = np.stack([0.5 * np.cos(angle), y, 0.5 * np.sin(angle)], axis=-1).reshape(-1, 3)
        low, high = len(wall), len(wall) + 1
        i = np.arange(around)
        j = (i + 1) % around
        top = around * (rings - 1)
        lids = [np.stack([0 * i + low, i, j], axis=1), np.stack([0 * i + high, top + j, top + i], axis=1)]
        points = np.concatenate([wall, [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]]])
        return triangle_mesh(points, np.concatenate([_wrapped(rings, around, False), *lids]))


@SHAPES.register("two_spheres")
@dataclass(frozen=True)
class TwoSpheres(Primitive):
    """A ball of radius 1 and, apart from it, one of radius 0.6: two components."""

    def build(self) -> "TriangleMesh":
        large, faces = unit_sphere(self.vertices // 2)
        points = np.concatenate([large, 0.6 * large + [2.0, 0.3, -0.2]])
        return triangle_mesh(points, np.concatenate([faces, faces + len(large)]))


def unit_sphere(n_vertices: int) -> tuple[Floats, Ints]:
    """Vertices (n, 3) and triangles (m, 3) of an icosahedron, divided and blown up, of about so many vertices."""
    golden = (1.0 + 5.0**0.5) / 2.0
    corners = np.array([[0.0, s, t * golden] for s in (-1, 1) for t in (-1, 1)])
    corners = np.concatenate([np.roll(corners, shift, axis=1) for shift in range(3)])
    near = np.linalg.norm(corners[:, None] - corners, axis=2) < 2.1
    faces = [
        [a, b, c] for a in range(12) for b in range(a) for c in range(b) if near[a, b] and near[b, c] and near[a, c]
    ]
    outward = [face if np.linalg.det(corners[face]) > 0 else face[::-1] for face in faces]
    vertices, triangles = _divided(corners, np.array(outward), n_vertices)
    return geometry.unit(vertices), triangles


def _divided(corners: Floats, faces: Ints, n_vertices: int) -> tuple[Floats, Ints]:
    """A closed solid of F faces divided so that F f^2 / 2 + 2 is near ``n_vertices``."""
    return _subdivided(corners, faces, max(1, round((2.0 * (n_vertices - 2) / len(faces)) ** 0.5)))


def _subdivided(corners: Floats, faces: Ints, frequency: int) -> tuple[Floats, Ints]:
    """Each triangle cut into frequency^2, vertices on shared edges merged."""
    rows = np.array([[i, j] for i in range(frequency + 1) for j in range(frequency + 1 - i)])
    place = {(i, j): n for n, (i, j) in enumerate(rows.tolist())}
    small = [[place[i, j], place[i + 1, j], place[i, j + 1]] for i, j in place if i + j < frequency]
    small += [[place[i + 1, j], place[i + 1, j + 1], place[i, j + 1]] for i, j in place if i + j < frequency - 1]
    weights = np.stack([frequency - rows.sum(axis=1), rows[:, 0], rows[:, 1]], axis=1) / frequency
    points = (weights @ corners[faces]).reshape(-1, 3)
    triangles = (np.array(small) + len(rows) * np.arange(len(faces))[:, None, None]).reshape(-1, 3)
    kept, position = geometry.weld(np.round(points, 12))  # a shared point is computed twice, not always equally
    return points[kept], position[triangles]


def _wrapped(rows: int, columns: int, closed: bool) -> Ints:
    """Triangles of a grid of points that closes on itself along its columns, and along its rows if ``closed``."""
    i, j = np.meshgrid(np.arange(rows if closed else rows - 1), np.arange(columns), indexing="ij")
    a, b = i * columns + j, i * columns + (j + 1) % columns
    c, d = ((i + 1) % rows) * columns + (j + 1) % columns, ((i + 1) % rows) * columns + j
    return np.concatenate([np.stack([a, d, c], axis=-1), np.stack([a, c, b], axis=-1)]).reshape(-1, 3)


def _turn(count: int) -> Floats:
    """``count`` equal steps (count,) of one turn, in radians."""
    return np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
