"""Simple solids with known areas, volumes and curvatures: the fixtures of tests, regular and symmetric on purpose."""

from dataclasses import dataclass

import numpy as np

from o3dmark.geometry import Floats, Ints
from o3dmark.mesh import TriangleMesh, triangle_mesh
from o3dmark.registry import option
from o3dmark.synthetic import SHAPES, Shape


@SHAPES.register("tetrahedron")
@dataclass(frozen=True)
class Tetrahedron(Shape):
    """Four vertices of the cube [-1, 1]^3: the smallest closed mesh."""

    def build(self) -> TriangleMesh:
        vertices = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], np.float64)
        return triangle_mesh(vertices, np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]))


@SHAPES.register("grid")
@dataclass(frozen=True)
class Grid(Shape):
    """The square [-1, 1]^2 in the plane z = 0, facing +z: open, flat everywhere."""

    cells: int = option(20, "squares along a side")

    def __post_init__(self) -> None:
        _at_least(1, cells=self.cells)

    def build(self) -> TriangleMesh:
        x = np.linspace(-1.0, 1.0, self.cells + 1)
        points = np.stack([*np.meshgrid(x, x, indexing="ij"), np.zeros((len(x), len(x)))], axis=-1)
        return triangle_mesh(points.reshape(-1, 3), _quads(len(x), len(x)))


@SHAPES.register("cube")
@dataclass(frozen=True)
class Cube(Shape):
    """The surface of [-1, 1]^3 in squares of two triangles."""

    cells: int = option(10, "squares along an edge")

    def __post_init__(self) -> None:
        _at_least(1, cells=self.cells)

    def build(self) -> TriangleMesh:
        return _welded(*_cube_faces(np.linspace(-1.0, 1.0, self.cells + 1)))


@SHAPES.register("sphere")
@dataclass(frozen=True)
class Sphere(Shape):
    """The unit sphere: a cube's grid with equal angles between its lines, pushed out along the radii."""

    cells: int = option(20, "squares along an edge of the cube")

    def __post_init__(self) -> None:
        _at_least(1, cells=self.cells)

    def build(self) -> TriangleMesh:
        vertices, triangles = _cube_faces(np.tan(np.linspace(-np.pi / 4, np.pi / 4, self.cells + 1)))
        mesh = _welded(vertices, triangles)
        points = np.asarray(mesh.vertices)
        return triangle_mesh(points / np.linalg.norm(points, axis=1, keepdims=True), np.asarray(mesh.triangles))


@SHAPES.register("torus")
@dataclass(frozen=True)
class Torus(Shape):
    """A tube about the z axis: genus 1, volume 2 pi^2 radius tube^2."""

    radius: float = option(1.0, "from the axis to the middle of the tube")
    tube: float = option(0.4, "radius of the tube")
    cells: int = option(40, "squares around the axis; half as many around the tube")

    def __post_init__(self) -> None:
        _at_least(6, cells=self.cells)
        if not 0 < self.tube < self.radius:
            raise ValueError("tube must lie between 0 and radius")

    def build(self) -> TriangleMesh:
        u, v = np.meshgrid(_turn(self.cells), _turn(self.cells // 2), indexing="ij")
        ring = self.radius + self.tube * np.cos(v)
        points = np.stack([ring * np.cos(u), ring * np.sin(u), self.tube * np.sin(v)], axis=-1)
        return triangle_mesh(points.reshape(-1, 3), _quads(*u.shape, wrap=(True, True)))


@SHAPES.register("cylinder")
@dataclass(frozen=True)
class Cylinder(Shape):
    """A closed cylinder about the y axis, radius 1, from y = -1 to 1, with flat caps around one vertex each."""

    cells: int = option(40, "squares around, and half as many along")

    def __post_init__(self) -> None:
        _at_least(6, cells=self.cells)

    def build(self) -> TriangleMesh:
        turn, rows = _turn(self.cells), np.linspace(-1.0, 1.0, self.cells // 2 + 1)
        y, a = np.meshgrid(rows, turn, indexing="ij")
        side = np.stack([np.cos(a), y, -np.sin(a)], axis=-1).reshape(-1, 3)
        quads = _quads(*y.shape, wrap=(False, True))[:, ::-1]
        low, high = np.arange(self.cells), np.arange(self.cells) + len(side) - self.cells
        bottom, top = len(side), len(side) + 1
        caps = [
            np.stack([np.full(self.cells, bottom), np.roll(low, -1), low], axis=1),
            np.stack([np.full(self.cells, top), high, np.roll(high, -1)], axis=1),
        ]
        return triangle_mesh(np.vstack([side, [[0, -1, 0], [0, 1, 0]]]), np.vstack([quads, *caps]))


@SHAPES.register("two-spheres")
@dataclass(frozen=True)
class TwoSpheres(Shape):
    """Two separate spheres of radius 1 and 1/2 side by side: two components."""

    cells: int = option(12, "squares along an edge of each sphere's cube")

    def build(self) -> TriangleMesh:
        one = Sphere(self.cells).build()
        return one + TriangleMesh(one).scale(0.5, (0.0, 0.0, 0.0)).translate((2.0, 0.0, 0.0))


def _turn(count: int) -> Floats:
    return np.asarray(np.arange(count) * (2.0 * np.pi / count), np.float64)


def _quads(rows: int, columns: int, wrap: tuple[bool, bool] = (False, False)) -> Ints:
    """Triangles (2 q, 3) of a grid of vertices in row-major order, optionally closed along either direction."""
    i, j = np.meshgrid(np.arange(rows - (not wrap[0])), np.arange(columns - (not wrap[1])), indexing="ij")
    a, b = i * columns + j, (i + 1) % rows * columns + j
    c, d = (i + 1) % rows * columns + (j + 1) % columns, i * columns + (j + 1) % columns
    return np.concatenate([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]).reshape(-1, 3).astype(np.int64)


def _cube_faces(lines: Floats) -> tuple[Floats, Ints]:
    """Six separate grids on the faces of [-1, 1]^3, with grid lines at ``lines``, wound outward."""
    u, v = (axis.ravel() for axis in np.meshgrid(lines, lines, indexing="ij"))
    face, quads = np.ones_like(u), _quads(len(lines), len(lines))
    vertices: list[Floats] = []
    triangles: list[Ints] = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            points = np.empty((len(u), 3))
            points[:, axis], points[:, (axis + 1) % 3], points[:, (axis + 2) % 3] = sign * face, u, v
            triangles.append((quads if sign > 0 else quads[:, ::-1]) + len(vertices) * len(u))
            vertices.append(points)
    return np.vstack(vertices), np.vstack(triangles)


def _welded(vertices: Floats, triangles: Ints) -> TriangleMesh:
    """Vertices that fall together, up to rounding, made one."""
    _, first, place = np.unique(np.round(vertices, 9), axis=0, return_index=True, return_inverse=True)
    return triangle_mesh(vertices[first], place.ravel()[triangles])


def _at_least(least: int, **counts: int) -> None:
    for name, count in counts.items():
        if count < least:
            raise ValueError(f"{name} must be at least {least}, not {count}")
