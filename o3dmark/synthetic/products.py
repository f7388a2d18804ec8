"""Things that are made, not grown: flat faces and cylinders with sharp edges, and a body that is smooth all over."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from o3dmark.arrays import Bools, Floats, Ints
from o3dmark.mesh.surface import triangle_mesh
from o3dmark.registry import option
from o3dmark.synthetic import SHAPES
from o3dmark.synthetic.primitives import Primitive, unit_sphere

if TYPE_CHECKING:
    from o3dmark.mesh.surface import TriangleMesh

Box = tuple[tuple[int, int, int], tuple[int, int, int]]

# Boxes of the bracket, (low, high) along its length, height and depth, in cells of which there are 10 to a unit: a plate
# whose second half is bent upward, a wall on one side, a block, and a window through the plate.
_BOXES = (((0, 0, 0), (30, 2, 12)), ((0, 2, 0), (12, 8, 2)), ((3, 2, 6), (8, 5, 11)))
_WINDOW = ((16, 0, 4), (20, 2, 8))
_CORNERS = 1116  # of the surface of those cells
_STRAIGHT, _RADIUS = 1.2, 0.8  # of its length: how much is straight, and the inner radius of the bend


@SHAPES.register("bracket")
@dataclass(frozen=True)
class Bracket(Primitive):
    """A machine part: a plate bent upward, with a wall, a block and a window; planes and cylinders that meet in edges."""

    vertices: int = option(10044, "about how many vertices: 1 116 times a square")

    def build(self) -> "TriangleMesh":
        finer = max(1, round((self.vertices / _CORNERS) ** 0.5))
        points, triangles = skin_of_cells(np.kron(_bracket(), np.ones((finer,) * 3, bool)))
        length, height, depth = points.T / (10.0 * finer)
        beyond = np.maximum(length - _STRAIGHT, 0.0)
        angle, arm = beyond / (_RADIUS + 0.2), _RADIUS + 0.2 - height
        bent = np.stack(
            [np.minimum(length, _STRAIGHT) + arm * np.sin(angle), _RADIUS + 0.2 - arm * np.cos(angle), depth], axis=1
        )
        return triangle_mesh(bent - bent.mean(axis=0), triangles)


@SHAPES.register("car")
@dataclass(frozen=True)
class Car(Primitive):
    """The body of a car, smooth all over: bonnet, cabin and boot, bulging over the wheels, a scoop on one side."""

    vertices: int = option(10242, "about how many vertices")

    def build(self) -> "TriangleMesh":
        points, triangles = unit_sphere(self.vertices)
        x, y, z = points.T
        x, y, z = x * (1.45 - 0.45 * x**2), y * (1.3 - 0.3 * y**2), z * (1.5 - 0.5 * z**2)
        top = 1.0 / (1.0 + np.exp(-8.0 * y))
        cabin = 0.32 * np.exp(-(((x + 0.12) / 0.42) ** 4)) * np.exp(-((z / 0.75) ** 4)) * top
        bonnet = 0.1 * np.exp(-(((x - 0.75) / 0.5) ** 2)) * top
        arches = sum(np.exp(-(((x - at) / 0.24) ** 2) - ((y + 0.55) / 0.5) ** 2) for at in (-0.6, 0.62))
        scoop = (
            0.05 * np.exp(-(((x + 0.3) / 0.12) ** 2) - ((y - 0.2) / 0.18) ** 2) * (z > 0.0) * np.maximum(z, 0.0) ** 2
        )
        width = 0.42 * z * (1.0 - 0.12 * x - 0.25 * top * np.exp(-(((x + 0.12) / 0.5) ** 4)) + 0.07 * arches) - scoop
        return triangle_mesh(np.stack([x, 0.28 * y + cabin - bonnet, width], axis=1), triangles)


def _bracket() -> Bools:
    """Which cells (30, 8, 12) of the bracket are filled, before it is bent."""
    filled = cells(_BOXES)
    filled[tuple(slice(*ends) for ends in zip(*_WINDOW, strict=True))] = False
    return filled


def cells(boxes: Sequence[Box]) -> Bools:
    """The cells (a, b, c) from the origin on, True within the boxes (low, high)."""
    filled = np.zeros(np.max(boxes, axis=(0, 1)), bool)
    for low, high in boxes:
        filled[tuple(slice(*ends) for ends in zip(low, high, strict=True))] = True
    return filled


def skin_of_cells(filled: Bools) -> tuple[Floats, Ints]:
    """The surface of cells (a, b, c): corners (n, 3) in cells, and two triangles for each square, wound outward."""
    padded, squares = np.pad(filled, 1), []
    for axis in range(3):
        for side in (-1, 1):
            square = np.zeros((4, 3), np.int64)
            square[:, axis] = side > 0
            square[:, [(axis + 1) % 3, (axis + 2) % 3]] = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])[::side]
            open_to = np.argwhere(padded & ~np.roll(padded, -side, axis))
            squares.append(open_to[:, None] + square - 1)
    corners, position = np.unique(np.concatenate(squares).reshape(-1, 3), axis=0, return_inverse=True)
    quads = position.reshape(-1, 4)
    return corners.astype(np.float64), np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
