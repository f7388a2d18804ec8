"""Local deformation: one part of the mesh stays, a band bends or twists, the rest follows rigidly.

The band is ``band`` of the bounding box's extent along the axis, about a place drawn at random such that all of it lies
within the box. Connectivity and attributes stay. Source: Barr 1984, Global and local deformations of solid primitives.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from o3dmark.arrays import Floats
from o3dmark.attacks import ATTACKS, Attack
from o3dmark.attacks._carry import checked_arrays, copied, moved
from o3dmark.attacks.geometry import random_rotation
from o3dmark.registry import option

Columns = tuple[Floats, Floats, Floats]  # two coordinates (n,) across the axis, from the box's centre; one along it


@ATTACKS.register("twist")
@dataclass(frozen=True)
class Twist(Attack):
    """Turned about an axis through the box's centre, by an angle that grows from 0 to ``angle`` across the band.

    The band lies where the seed puts it; what is before it stays, what is after it turns as a whole.
    Source: Barr 1984, Global and local deformations of solid primitives.
    """

    angle: float = option(15.0, "turn of the far part, in degrees; 0: none")
    axis: Literal["x", "y", "z", "random"] = option("y", "axis of the twist; random: any direction")
    band: float = option(0.5, "length of the twisted band, over the extent along the axis")

    def __post_init__(self) -> None:
        _check_band(self.band)

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        def twisted(u: Floats, v: Floats, along: Floats, start: float, length: float) -> Columns:
            theta = np.radians(self.angle) * np.clip((along - start) / length, 0.0, 1.0)
            return np.cos(theta) * u - np.sin(theta) * v, np.sin(theta) * u + np.cos(theta) * v, along

        return _deformed(mesh, self, twisted, rng)


@ATTACKS.register("bend")
@dataclass(frozen=True)
class Bend(Attack):
    """The axis through the box's centre becomes a circular arc of ``angle`` across the band, and straight after it.

    Within the band a plane across the axis stays a plane across the arc; the length of the arc is that of the band,
    which lies where the seed puts it. Source: Barr 1984, Global and local deformations of solid primitives.
    """

    angle: float = option(15.0, "angle between the two ends, in degrees, -180 to 180; 0: none")
    axis: Literal["x", "y", "z", "random"] = option(
        "y", "axis that bends, towards the next one (x to y to z to x); random: any direction, towards any"
    )
    band: float = option(0.5, "length of the bent band, over the extent along the axis")

    def __post_init__(self) -> None:
        _check_band(self.band)
        if not -180 <= self.angle <= 180:
            raise ValueError(f"angle should be -180 to 180, not {self.angle}")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        def bent(u: Floats, v: Floats, along: Floats, start: float, length: float) -> Columns:
            inside = np.clip(along - start, 0.0, length)
            theta, radius = np.radians(self.angle) * inside / length, length / np.radians(self.angle)
            rest = along - start - inside  # the straight parts before (negative) and after the band
            across = radius - (radius - u) * np.cos(theta) + rest * np.sin(theta)
            return across, v, start + (radius - u) * np.sin(theta) + rest * np.cos(theta)

        return _deformed(mesh, self, bent, rng)


def _check_band(band: float) -> None:
    if not 0 < band <= 1:
        raise ValueError(f"band should be in (0, 1], not {band}")


def _deformed(mesh: Any, attack: Twist | Bend, deform: Callable[..., Columns], rng: np.random.Generator) -> Any:
    """The mesh with its coordinates in the frame of the axis mapped by deform(u, v, along, band start, band length)."""
    vertices, _ = checked_arrays(mesh)
    if not attack.angle:
        return copied(mesh)
    turn = random_rotation(rng, np.pi) if attack.axis == "random" else np.eye(3)
    vertices = vertices @ turn.T
    w = "xyz".index("y" if attack.axis == "random" else attack.axis)
    across = [(w + 1) % 3, (w + 2) % 3]
    centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2.0
    vertices[:, across] -= centre[across]
    u, v, along = vertices[:, [*across, w]].T
    vertices[:, [*across, w]] = np.stack(deform(u, v, along, *_band(along, attack.band, rng)), axis=1)
    vertices[:, across] += centre[across]
    return moved(mesh, vertices @ turn)


def _band(along: Floats, band: float, rng: np.random.Generator) -> tuple[float, float]:
    """Start and length of the band."""
    extent = float(np.ptp(along))
    if extent == 0.0:
        return float(along[0]), 1.0
    return float(along.min()) + rng.uniform(0.0, 1.0 - band) * extent, band * extent
