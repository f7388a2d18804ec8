"""Attacks that place a mesh elsewhere: similarities, mirrors, units, axes. The connectivity stays as it is."""

# ruff: noqa: ARG002 - attacks without randomness take an rng too

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from o3dmark.arrays import Floats
from o3dmark.attacks import ATTACKS, Attack
from o3dmark.attacks._carry import checked_arrays, copied, moved, picked
from o3dmark.registry import option


@ATTACKS.register("similarity")
@dataclass(frozen=True)
class Similarity(Attack):
    """Random rotation and uniform scale about the mean of the vertices, then a random translation.

    The angle is U(0, rotation) about an axis uniform on the sphere, the scale U(smallest, largest), each coordinate of
    the translation U(-translation, translation) mean distances between a vertex and the mean of all vertices.
    Source: Wang et al. 2010, A benchmark for 3D mesh watermarking, "similarity transformation".
    """

    translation: float = option(5.0, "largest shift along an axis, in mean vertex distances to the centre; 0: none")
    rotation: float = option(360.0, "largest angle, in degrees; 0: none")
    smallest: float = option(0.1, "least scale factor")
    largest: float = option(10.0, "greatest scale factor; smallest=1,largest=1: none")

    def __post_init__(self) -> None:
        if not 0 < self.smallest <= self.largest or self.translation < 0 or self.rotation < 0:
            raise ValueError("wants 0 < smallest <= largest, translation >= 0 and rotation >= 0")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, _ = checked_arrays(mesh)
        centre = vertices.mean(axis=0)
        mean_norm = np.linalg.norm(vertices - centre, axis=1).mean()
        shift = mean_norm * rng.uniform(-self.translation, self.translation, 3)
        turn = random_rotation(rng, np.radians(self.rotation))
        linear = rng.uniform(self.smallest, self.largest) * turn
        if np.array_equal(linear, np.eye(3)) and not shift.any():
            return copied(mesh)
        return moved(mesh, (vertices - centre) @ linear.T + (centre + shift))


@ATTACKS.register("stretch")
@dataclass(frozen=True)
class Stretch(Attack):
    """Each axis scaled about the mean of the vertices by its own random factor, U(1 - amount, 1 + amount).

    Source: the affine transform with no rotation or shear; the benchmark has similarities alone.
    """

    amount: float = option(0.1, "largest relative change of an axis, below 1; 0: none")

    def __post_init__(self) -> None:
        if not 0 <= self.amount < 1:
            raise ValueError(f"amount should be in [0, 1), not {self.amount}")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, _ = checked_arrays(mesh)
        factors = rng.uniform(1.0 - self.amount, 1.0 + self.amount, 3)
        if not self.amount:
            return copied(mesh)
        centre = vertices.mean(axis=0)
        return moved(mesh, (vertices - centre) * factors + centre)


@ATTACKS.register("strain")
@dataclass(frozen=True)
class Strain(Attack):
    """Stretched along one random direction, or sheared, about the mean of the vertices.

    stretch    lengths along the direction grow by ``amount``
    shear      points go by ``amount`` of their height above a plane, along a direction within it

    Source: affine transforms, of which the benchmark has similarities alone; "fit to box" and printers' compensation.
    """

    kind: Literal["stretch", "shear"] = option("stretch", "what is done")
    amount: float = option(0.01, "relative change of length, or tangent of the angle, -0.9 to 0.9; 0: none")

    def __post_init__(self) -> None:
        if not -0.9 <= self.amount <= 0.9:
            raise ValueError(f"amount should be -0.9 to 0.9, not {self.amount}")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, _ = checked_arrays(mesh)
        turn = random_rotation(rng, np.pi)
        if not self.amount:
            return copied(mesh)
        along, across = turn[0], turn[0] if self.kind == "stretch" else turn[1]
        centre = vertices.mean(axis=0)
        return moved(mesh, vertices + self.amount * ((vertices - centre) @ across)[:, None] * along)


@ATTACKS.register("mirror")
@dataclass(frozen=True)
class Mirror(Attack):
    """Reflected in the plane through the mean of the vertices across one axis; triangles wound outward again.

    Source: the mirror command of every modelling program; an isometry, but no similarity that keeps orientation.
    """

    axis: Literal["x", "y", "z"] = option("x", "axis whose coordinates change sign about the centre")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, _ = checked_arrays(mesh)
        column = "xyz".index(self.axis)
        vertices[:, column] = 2.0 * vertices[:, column].mean() - vertices[:, column]
        return moved(_rewound(mesh), vertices)


@ATTACKS.register("axes")
@dataclass(frozen=True)
class Axes(Attack):
    """Coordinates in another order, as between programs whose up is Y and whose up is Z.

    An exchange of two axes is a reflection: the triangles are wound outward again. "xyz" leaves the mesh as it is.
    Source: file formats that differ in what is up: glTF has Y, printers' STL has Z.
    """

    order: Literal["xzy", "yxz", "zyx", "yzx", "zxy", "xyz"] = option(
        "xzy", "which old coordinates are the new x, y, z"
    )

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, _ = checked_arrays(mesh)
        if self.order == "xyz":
            return copied(mesh)
        columns = ["xyz".index(letter) for letter in self.order]
        odd = np.linalg.det(np.eye(3)[columns]) < 0
        return moved(_rewound(mesh) if odd else mesh, vertices[:, columns])


@ATTACKS.register("units")
@dataclass(frozen=True)
class Units(Attack):
    """All coordinates times one factor about the origin: a change of unit.

    Source: formats without a unit (STL, OBJ, PLY), read as inches by one program and as millimetres by another.
    """

    factor: float = option(1.0 / 25.4, "new length of one old unit; 1/25.4: millimetres to inches; 1: none")

    def __post_init__(self) -> None:
        if not (np.isfinite(self.factor) and self.factor > 0):
            raise ValueError(f"factor should be positive, not {self.factor}")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, _ = checked_arrays(mesh)
        return copied(mesh) if self.factor == 1.0 else moved(mesh, vertices * self.factor)


def random_direction(rng: np.random.Generator) -> Floats:
    """A unit vector (3,) uniform on the sphere."""
    direction = rng.standard_normal(3)
    return np.asarray(direction / np.linalg.norm(direction))


def random_rotation(rng: np.random.Generator, largest: float) -> Floats:
    """A rotation (3, 3) by U(0, largest) radians about an axis uniform on the sphere."""
    axis = random_direction(rng)
    return np.asarray(Rotation.from_rotvec(rng.uniform(0.0, largest) * axis).as_matrix())


def _rewound(mesh: Any) -> Any:
    """Every triangle's last two corners exchanged."""
    vertices, triangles = checked_arrays(mesh)
    return picked(mesh, np.arange(len(vertices)), triangles[:, [0, 2, 1]], np.arange(len(triangles)))
