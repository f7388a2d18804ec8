"""A mark's distortion to first order, and the strength at which a mark has the one asked for."""

import math
from collections.abc import Callable

from o3dmark.arrays import Floats
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface

MRMS_MARGIN = 0.97  # the estimate of the MRMS was up to 2 % below the measured one
_TOLERANCE = 0.04  # of the distortion asked for; beyond the margin
_MOST_TRIES = 30
_CAUTION = 0.7  # of a strength that was out of reach is tried next
_CLOSE = 1.02  # ratio of the largest strength and one that is taken for it


def estimated_mrms(surface: Surface, vertices: Floats) -> float:
    """RMS distance to the surface moved to ``vertices`` (n, 3), to first order, over the diagonal."""
    return geometry.motion_mrms(surface.vertices, vertices, surface.triangles)


class OutOfReachError(MeshError):
    """A strength that a mesh cannot bear; a smaller one may do."""


def with_mrms(
    surface: Surface, moved: Callable[[float], Floats], target: float, start: float, least: float, largest: float
) -> Floats:
    """The vertices ``moved(strength)`` whose MRMS is ``target``, over the diagonal, or up to 7 % less.

    Where the MRMS jumps, as who carries bits may change with the strength: the nearest below that was found.

    The strength is looked for between ``least`` and ``largest``, from ``start`` on, by regula falsi between logarithms,
    or by bisection where that does not narrow the range. Where a strength is too large,
    ``moved`` raises OutOfReachError.

    Errors: MeshError when no strength in the range has that distortion; says which distortions there are.
    """
    goal = MRMS_MARGIN * (1.0 - _TOLERANCE / 2.0) * target
    below: tuple[float, float] | None = None  # strength and log ratio of MRMS and goal, on either side of the goal
    above: tuple[float, float] | None = None
    strength, nearest = start, None
    for attempt in range(_MOST_TRIES):
        try:
            vertices = moved(strength)
        except OutOfReachError:
            if below is None and strength <= least:
                raise
            largest = strength * _CAUTION if below is None else math.sqrt(below[0] * strength)
            strength = max(largest, least)
            continue
        error = math.log(max(estimated_mrms(surface, vertices), 1e-300) / goal)
        if abs(error) <= _TOLERANCE / 2.0:
            return vertices
        if (error < 0 and strength >= largest / _CLOSE) or (error > 0 and strength <= least):
            word = "at most" if error < 0 else "at least"
            raise MeshError(
                f"an MRMS of {target:.3g} of the diagonal is out of reach: a mark in this mesh costs {word}"
                f" {goal * math.exp(error):.3g}, at the strength {strength:.3g}. Ask for that, or for no mrms"
            )
        if error < 0:
            below, nearest = (strength, error), vertices
        else:
            above = strength, error
        strength = min(max(_next(strength, error, below, above, attempt), least), largest)
    if nearest is None:
        raise MeshError(f"no strength has an MRMS of {target:.3g} of the diagonal or less; ask for a larger one")
    return nearest


def within_mrms(surface: Surface, moved: Callable[[float], Floats], target: float, strengths: Floats) -> Floats:
    """The vertices ``moved(strength)`` of the largest of the ``strengths``, in ascending order, with an MRMS in target.

    Errors: MeshError when the MRMS of the least strength is larger.
    """
    low, high = -1, len(strengths)  # the target lies between
    best = None
    while high - low > 1:
        middle = (low + high) // 2
        vertices = moved(float(strengths[middle]))
        if estimated_mrms(surface, vertices) <= MRMS_MARGIN * target:
            low, best = middle, vertices
        else:
            high = middle
    if best is None:
        raise MeshError(f"no strength meets an MRMS of {target:.3g} of the diagonal; ask for a larger one")
    return best


def _next(
    strength: float, error: float, below: tuple[float, float] | None, above: tuple[float, float] | None, attempt: int
) -> float:
    """The strength to try next: as if distortion grew in proportion, until it was met from both sides."""
    if below is None or above is None:
        return strength * math.exp(-1.5 * error)
    (low, under), (high, over) = below, above
    share = 0.5 if attempt % 3 == 2 else -under / (over - under)
    return math.exp(math.log(low) + share * math.log(high / low))
