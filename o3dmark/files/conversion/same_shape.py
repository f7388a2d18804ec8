"""Whether two assets show the same triangles, whatever the order that their formats keep them in."""

import numpy as np
import scipy

from o3dmark.arrays import AnyArray, Bools, Floats
from o3dmark.files.asset import Asset
from o3dmark.mesh import geometry


def same_shape(before: Asset, after: Asset) -> bool:
    """True when each triangle of one is one of the other too, within what float32 can tell; no others are there."""
    one, other = _corners(before), _corners(after)
    if len(one) != len(other):
        return False
    with np.errstate(over="ignore"):
        reach = np.float32(max(np.abs(one).max(initial=0.0), np.abs(other).max(initial=0.0)))
    if not np.isfinite(reach):
        return False
    distance = 4.0 * float(np.spacing(reach))
    if np.abs(one - other).max(initial=0.0) <= distance:  # in the same order, as most are
        return True
    return _near(_unmatched(one, other), other, distance) and _near(_unmatched(other, one), one, distance)


def _corners(asset: Asset) -> Floats:
    """The corners (m, 9) of all triangles with three different ones."""
    vertices, triangles = asset.placed()
    _, position = geometry.weld(vertices)
    corners = position[triangles]
    proper = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    return vertices[triangles[proper]].reshape(-1, 9)


def _unmatched(corners: Floats, others: Floats) -> Floats:
    """Those triangles (k, 9) that are not among others, when both are rounded to float32; copies are matched by one."""
    return corners[~np.isin(_hashes(corners), _hashes(others))]


def _hashes(corners: Floats) -> AnyArray:
    """A number of 64 bits for each triangle (m, 9) in float32, whichever corner it begins with."""
    with np.errstate(over="ignore"):
        points = (corners.astype(np.float32) + np.float32(0.0)).reshape(-1, 3, 3)  # and no negative zero
    least = _less(points[:, 1], points[:, 0]).astype(np.int64)
    least[_less(points[:, 2], points[np.arange(len(points)), least])] = 2
    turned = np.take_along_axis(points, ((least[:, None] + np.arange(3)) % 3)[:, :, None], axis=1)
    factors = np.random.default_rng(0).integers(1 << 63, size=9, dtype=np.uint64) * np.uint64(2) + np.uint64(1)
    return (turned.reshape(-1, 9).view(np.uint32) * factors).sum(axis=1, dtype=np.uint64)


def _less(one: AnyArray, other: AnyArray) -> Bools:
    """Which points (m, 3) come before others, by x, then y, then z."""
    result = one[:, 2] < other[:, 2]
    for axis in (1, 0):
        result = (one[:, axis] < other[:, axis]) | ((one[:, axis] == other[:, axis]) & result)
    return np.asarray(result)


def _near(corners: Floats, others: Floats, distance: float) -> bool:
    """Whether each triangle (k, 9) has one of others (l, 9) within a distance, from whichever corner on."""
    if not len(corners):
        return True
    turns = np.concatenate([np.roll(others, 3 * turn, axis=1) for turn in range(3)])
    found, _ = scipy.spatial.cKDTree(turns).query(corners, p=np.inf, distance_upper_bound=distance)
    return bool(np.isfinite(found).all())
