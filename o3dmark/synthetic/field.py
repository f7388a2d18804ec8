"""Implicit solids: functions of points that are negative inside, positive outside and, near the surface, a distance.

A `Field` takes points (n, 3) and returns (n,). Solids are joined by `blend`, cut by `carve` and `common`, given relief
by `emboss` and a pose by `placed` and `sway`. None is exactly a distance, but none should grow much faster than one,
which is what `isosurface` relies on. A ``turn`` is (pitch, yaw, roll), degrees about the axes x, y and z, the roll
applied first and the yaw last. The smooth minimum is the quadratic one of I. Quilez, "Smooth minimum" (2013).
"""

from collections.abc import Callable, Sequence
from functools import reduce

import numpy as np
from scipy.spatial.transform import Rotation

from o3dmark.arrays import Floats

Field = Callable[[Floats], Floats]
Triple = Sequence[float] | Floats


def ellipsoid(centre: Triple, radii: Triple, turn: Triple = (0.0, 0.0, 0.0)) -> Field:
    """A turned ellipsoid; its longest radius is at most some four of its shortest."""
    middle, semi, frame = np.asarray(centre, np.float64), np.asarray(radii, np.float64), _frame(turn)

    def field(points: Floats) -> Floats:
        local = (points - middle) @ frame / semi
        scaled = _norm(local) + 1e-9
        # the estimate is good at the surface, but deep inside a flat one it would exceed the distance many times
        return np.maximum(scaled * (scaled - 1.0) / (_norm(local / semi) + 1e-9 / semi.max()), -semi.min())

    return field


def blade(centre: Triple, size: Triple, turn: Triple = (0.0, 0.0, 0.0), bend: float = 0.0, taper: float = 0.0) -> Field:
    """A thin plate with a round rim: a petal, a leaf, an ear.

    ``size`` is (half width along x, half thickness along y, half length along z) before it is turned. The plate is
    lifted by ``bend`` z^2 and wider by the share ``taper`` z at z.
    """
    middle, frame = np.asarray(centre, np.float64), _frame(turn)
    width, rim, length = size
    outline = np.array([width - rim, length - rim])

    def field(points: Floats) -> Floats:
        x, y, z = ((points - middle) @ frame).T
        along = np.clip(z, -1.2 * length, 1.2 * length)
        flat = np.stack([x / (1.0 + taper * along), z], axis=1) / outline
        scaled = _norm(flat) + 1e-9
        beside = scaled * (scaled - 1.0) / (_norm(flat / outline) + 1e-9)
        return np.hypot(np.maximum(beside, 0.0), y - bend * along * along) - rim

    return field


def ball(x: float, y: float, z: float, radius: float) -> Field:
    """A ball, written like one knot of a `tube`."""
    return lambda points: _norm(points - np.array([x, y, z])) - radius


def tube(*knots: Sequence[float], smooth: int = 3) -> Field:
    """A limb through knots (x, y, z, radius): round cones along the Catmull-Rom spline, ``smooth`` to a span."""
    line = _spline(np.asarray(knots, np.float64), smooth)
    pieces = [
        (start, step, 1.0 / (step[:3] @ step[:3])) for start, step in zip(line[:-1], np.diff(line, axis=0), strict=True)
    ]

    def field(points: Floats) -> Floats:
        nearest = np.full(len(points), np.inf)
        for start, step, scale in pieces:
            offset = points - start[:3]
            along = np.clip(offset @ (step[:3] * scale), 0.0, 1.0)
            offset -= along[:, None] * step[:3]
            np.minimum(nearest, _norm(offset) - start[3] - along * step[3], out=nearest)
        return nearest

    return field


def half_space(point: Triple, outward: Triple) -> Field:
    """Everything behind the plane through ``point`` with the normal ``outward``."""
    normal = np.asarray(outward, np.float64) / np.linalg.norm(outward)
    return lambda points: (points - np.asarray(point)) @ normal


def revolve(profile: Field) -> Field:
    """The solid of revolution about the y axis of a field in the plane (r, y, 0)."""

    def field(points: Floats) -> Floats:
        radius = np.hypot(points[:, 0], points[:, 2])
        return profile(np.stack([radius, points[:, 1], np.zeros_like(radius)], axis=1))

    return field


def blend(width: float, *parts: Field) -> Field:
    """The union of solids; where two surfaces come within ``width`` of one another a fillet joins them."""
    return lambda points: reduce(lambda a, b: _smooth_minimum(a, b, width), (part(points) for part in parts))


def carve(width: float, solid: Field, *tools: Field) -> Field:
    """``solid`` without the tools, its new edges rounded over ``width``."""
    return lambda points: (
        -reduce(lambda a, b: _smooth_minimum(a, b, width), (tool(points) for tool in tools), -solid(points))
    )


def common(width: float, *parts: Field) -> Field:
    """What all parts share, the edges rounded over ``width``."""
    return lambda points: -reduce(lambda a, b: _smooth_minimum(a, b, width), (-part(points) for part in parts))


def emboss(solid: Field, *reliefs: Field) -> Field:
    """``solid`` raised by the sum of the reliefs, which are heights along its normal."""
    return lambda points: solid(points) - sum(relief(points) for relief in reliefs)


def within(mask: Field, width: float, relief: Field) -> Field:
    """A relief that fades to nothing over ``width`` outside the solid ``mask``."""

    def field(points: Floats) -> Floats:
        fade = np.clip(1.0 - mask(points) / width, 0.0, 1.0)
        return fade * fade * (3.0 - 2.0 * fade) * relief(points)

    return field


def noise(rng: np.random.Generator, height: float, wavelength: float, waves: int = 20) -> Field:
    """A smooth random relief of about ``height``: plane waves in random directions, each near ``wavelength``."""
    directions = rng.normal(size=(waves, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    wave = (2.0 * np.pi / wavelength * rng.uniform(0.6, 1.3, (waves, 1)) * directions).T
    phase, scale = rng.uniform(0.0, 2.0 * np.pi, waves), height * (2.0 / waves) ** 0.5
    return lambda points: scale * np.sin(points @ wave + phase).sum(axis=1)


def strands(centre: Triple, axis: Triple, count: int, height: float, wander: Field) -> Field:
    """Locks of hair that run from pole to pole of ``axis`` through ``centre``; ``wander`` bends them (radians).

    ``height`` is that of a lock 0.3 wide; thinner ones are lower in proportion.
    """
    frame = Rotation.align_vectors([[0.0, 1.0, 0.0]], [list(axis)])[0].as_matrix()

    def field(points: Floats) -> Floats:
        x, _, z = (frame @ (points - np.asarray(centre)).T).astype(np.float64)
        fade = np.minimum(1.0, np.hypot(x, z) * 20.0 / count)
        return height * fade * np.sin(count * np.arctan2(x, z) + wander(points))

    return field


def both(part: Callable[[int], Field]) -> tuple[Field, Field]:
    """What an animal has twice: ``part`` of its right (+1) and of its left (-1)."""
    return part(1), part(-1)


def flute(solid: Field, relief: Field) -> Field:
    """``solid``, walls and all, pushed away from the y axis by a relief."""

    def field(points: Floats) -> Floats:
        radius = np.maximum(np.hypot(points[:, 0], points[:, 2]), 0.1)
        shrink = 1.0 - relief(points) / radius
        return solid(points * np.stack([shrink, np.ones_like(shrink), shrink], axis=1))

    return field


def sway(solid: Field, rng: np.random.Generator, amount: float, wavelength: float = 3.0) -> Field:
    """``solid`` bent by a slow random displacement of about ``amount``: no two halves stay equal."""
    shift = [noise(rng, amount, wavelength, waves=4) for _ in range(3)]
    return lambda points: solid(points + np.stack([axis(points) for axis in shift], axis=1))


def placed(solid: Field, at: Triple, turn: Triple = (0.0, 0.0, 0.0), size: float = 1.0) -> Field:
    """``solid`` scaled by ``size``, turned, and moved from the origin to ``at``."""
    middle, frame = np.asarray(at, np.float64), _frame(turn)
    return lambda points: solid((points - middle) @ (frame / size)) * size


def scaled(solid: Field, factors: Triple) -> Field:
    """``solid`` stretched along x, y and z by factors near one."""
    stretch = np.asarray(factors, np.float64)
    return lambda points: solid(points / stretch) * stretch.min()


def _frame(turn: Triple) -> Floats:
    """The rotation matrix of a turn; rows times it are taken back into the turned frame."""
    return np.asarray(Rotation.from_euler("zxy", (turn[2], turn[0], turn[1]), degrees=True).as_matrix())


def _smooth_minimum(a: Floats, b: Floats, width: float) -> Floats:
    overlap = np.maximum(width - np.abs(a - b), 0.0)
    return np.minimum(a, b) - overlap * overlap * (0.25 / width)


def _norm(vectors: Floats) -> Floats:
    return np.sqrt(np.einsum("ij,ij->i", vectors, vectors))


def _spline(knots: Floats, smooth: int) -> Floats:
    """Points of the Catmull-Rom spline through knots (k, d): ((k - 1) * smooth + 1, d)."""
    padded = np.concatenate([2 * knots[:1] - knots[1:2], knots, 2 * knots[-1:] - knots[-2:-1]])
    t = (np.arange(smooth) / smooth)[:, None]
    spans = []
    for a, b, c, d in zip(padded[:-3], padded[1:-2], padded[2:-1], padded[3:], strict=True):
        spans.append(b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a))))
    return np.concatenate([*spans, knots[-1:]])
