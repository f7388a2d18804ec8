"""A tree of boxes about triangles, compiled by numba: halved by number, and in space where triangles overlap.

Boxes about triangles that pass through each other, or about needles, lie in each other as well, and no search is spared
by them: a point in a cube of 40 000 random triangles lies in the boxes of 5 000. There space is halved and triangles on
both sides are cut (Stich, Friedrich and Dietrich 2009, Spatial splits in bounding volume hierarchies), each in so many
pieces that a tree stays linear in the triangles. A surface whose triangles meet at edges only is never cut.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from o3dmark.arrays import Floats, Ints
from o3dmark.mesh.surface import Surface

_LEAF = 1  # triangles in a leaf: 200 000 points about horse_48485 take 0.9 s; with 4 1.3 s, with 8 2.0 s
# Among more than _CROWD boxes, of which a place lies in more than _FILLED on average, space is halved; meshes of shapes
# stay below 2. Where it can be halved no more, and a place lies in a share of _LEFT of the boxes, they stay one leaf:
# its planes are asked one after another 20 times as fast as boxes here and there
_CROWD, _FILLED, _LEFT = 16, 4.0, 0.06
_SPARE, _MOST_SPARE = 32, 1 << 20  # pieces beyond one a triangle: so many times the triangles, at most so many in all
_CUTS = 32  # of space one below another; with halves of the number, the tree is less than 64 deep
_ROUNDING = 1e-14  # of a coordinate, by which cuts may be wrong: six of them one after another
_CORNERS = 32  # of what is left of a triangle after six cuts: 9, and more where rounding dents it


class Tree(NamedTuple):
    """Boxes (k, 2, 3), the first child of each (its sibling follows; -1: a leaf), and the run of ``order`` within.

    ``order`` (r,) names triangles, each at least once, and once for each piece that it was cut into. ``plane`` (4, r)
    has their unit normals, and how far their planes lie from the middle of the first box along them; zeros where
    rounding says too much of them, the triangle's sine is below a millionth.
    """

    box: Floats
    child: Ints
    first: Ints
    last: Ints
    order: Ints
    plane: Floats


def tree_of(surface: Surface) -> Tree:
    """The boxes about a surface's triangles, for those who ask `closest_points` more than once."""
    corners = surface.vertices[surface.triangles]
    box, child, first, last, order = _build(corners)
    return Tree(box, child, first, last, order, _planes(corners, order, box[0]))


@njit(cache=True, nogil=True)
def _build(corners):  # type: ignore[no-untyped-def]
    """All of a tree but its planes."""
    m = len(corners)
    order, boxes = np.arange(m), _boxes(corners)
    box, child = np.empty((2 * m, 2, 3)), np.full(2 * m, -1)
    run, spare, cuts = np.zeros((2 * m, 2), np.int64), np.zeros(2 * m, np.int64), np.zeros(2 * m, np.int64)
    polygon = np.empty((2, _CORNERS, 3))
    run[0, 1], spare[0], count, node, end = m, min(_SPARE * m, _MOST_SPARE), 1, 0, m
    while node < count:  # children are appended, so every node is met once
        a, b = run[node]
        middle, after, cut = a, cuts[node], False
        for k in range(3):
            box[node, 0, k], box[node, 1, k] = boxes[a:b, 0, k].min(), boxes[a:b, 1, k].max()
        filled = _filled(box[node], boxes[a:b]) if b - a > _CROWD else 0.0
        if filled > _FILLED:
            side = np.argmax(box[node, 1] - box[node, 0])
            plane = 0.5 * (box[node, 0, side] + box[node, 1, side])
            both = _on_both_sides(boxes[a:b], side, plane)
            cut = cuts[node] < _CUTS and both <= spare[node]
            if cut:
                if end + b - a + both > len(order):
                    order, boxes = _longer(order, end + b - a + both), _longer(boxes, end + b - a + both)
                middle, size = _cut(corners, order, boxes, a, b, end, side, plane, polygon)
                spare[node] -= size - end - (b - a)
                a, b, end, after = end, size, size, cuts[node] + 1
        if b - a > _LEAF and (cut or filled <= max(_FILLED, _LEFT * (b - a))):
            if not a < middle < b:
                middle = _halve(order[a:b], boxes[a:b]) + a
            if count + 2 > len(child):
                box, child, run = _longer(box, count + 2), _longer(child, count + 2), _longer(run, count + 2)
                spare, cuts = _longer(spare, count + 2), _longer(cuts, count + 2)
            child[node] = count
            for low, high in ((a, middle), (middle, b)):
                run[count, 0], run[count, 1], child[count], cuts[count] = low, high, -1, after
                spare[count] = spare[node] * (high - low) // (b - a)
                count += 1
        node += 1
    return box[:count].copy(), child[:count].copy(), run[:count, 0].copy(), run[:count, 1].copy(), order[:end].copy()


@njit(cache=True, nogil=True)
def _boxes(corners):  # type: ignore[no-untyped-def]
    boxes = np.empty((len(corners), 2, 3))
    for t in range(len(corners)):
        for k in range(3):
            boxes[t, 0, k] = min(corners[t, 0, k], corners[t, 1, k], corners[t, 2, k])
            boxes[t, 1, k] = max(corners[t, 0, k], corners[t, 1, k], corners[t, 2, k])
    return boxes


@njit(cache=True, nogil=True)
def _longer(array, least):  # type: ignore[no-untyped-def]
    """The same with room for ``least`` rows and more."""
    longer = np.empty((max(least, 2 * len(array)), *array.shape[1:]), array.dtype)
    longer[: len(array)] = array
    return longer


@njit(cache=True, nogil=True)
def _filled(box, boxes):  # type: ignore[no-untyped-def]
    """In how many of ``boxes`` (n, 2, 3) a place within ``box`` lies on average."""
    total = 0.0
    for r in range(len(boxes)):
        share = 1.0
        for k in range(3):
            side = box[1, k] - box[0, k]
            if side > 0.0:
                share *= (boxes[r, 1, k] - boxes[r, 0, k]) / side
        total += share
    return total


@njit(cache=True, nogil=True)
def _halve(order, boxes):  # type: ignore[no-untyped-def]
    """Sort by the centres of boxes, along the axis where these reach furthest; half of the number."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for r in range(len(boxes)):
        for k in range(3):
            centre = boxes[r, 0, k] + boxes[r, 1, k]
            low[k], high[k] = min(low[k], centre), max(high[k], centre)
    side = np.argmax(high - low)
    by_centre = np.argsort(boxes[:, 0, side] + boxes[:, 1, side], kind="mergesort")
    order[:], boxes[:] = order[by_centre], boxes[by_centre]
    return len(order) // 2


@njit(cache=True, nogil=True)
def _on_both_sides(boxes, side, plane):  # type: ignore[no-untyped-def]
    """How many of ``boxes`` (n, 2, 3) a plane across an axis passes through."""
    count = 0
    for r in range(len(boxes)):
        count += boxes[r, 0, side] < plane < boxes[r, 1, side]
    return count


@njit(cache=True, nogil=True)
def _cut(corners, order, boxes, a, b, end, side, plane, polygon):  # type: ignore[no-untyped-def]
    """Put the pieces a .. b below a plane across an axis, then those above it, from ``end`` on; where both end.

    A piece on both sides is cut in two.
    """
    middle = end
    for upper in (0, 1):
        for r in range(a, b):
            low, high = boxes[r, 0, side], boxes[r, 1, side]
            if (low >= plane and high > plane) if upper == 0 else high <= plane:
                continue
            order[end], boxes[end] = order[r], boxes[r]
            if low < plane < high:
                boxes[end, 1 - upper, side] = plane
                if not _shrunk(corners[order[r]], boxes[end], polygon[0], polygon[1]):
                    continue
            end += 1
        if upper == 0:
            middle = end
    return middle, end


@njit(cache=True, nogil=True)
def _shrunk(corner, box, polygon, scratch):  # type: ignore[no-untyped-def]
    """Shrink a box to the part of a triangle within it, with room for rounding. False: no part is.

    The part is cut a little too large, so that none is lost between two boxes.
    """
    n = 3
    polygon[:3] = corner
    for k in range(3):
        room = _ROUNDING * max(abs(corner[0, k]), abs(corner[1, k]), abs(corner[2, k]))
        for upper in (0, 1):
            sign = 1.0 - 2.0 * upper
            plane, size = box[upper, k] - sign * room, 0
            for i in range(n):
                p, q = polygon[i], polygon[(i + 1) % n]
                before, after = sign * (p[k] - plane), sign * (q[k] - plane)
                if before >= 0.0:
                    scratch[size] = p
                    size += 1
                if (before >= 0.0) != (after >= 0.0):
                    share = before / (before - after)
                    for j in range(3):
                        scratch[size, j] = p[j] + share * (q[j] - p[j])
                    scratch[size, k] = plane
                    size += 1
            n = size
            if n == 0:
                return False
            polygon[:n] = scratch[:n]
    for k in range(3):
        room = _ROUNDING * max(abs(corner[0, k]), abs(corner[1, k]), abs(corner[2, k]))
        box[0, k], box[1, k] = polygon[:n, k].min() - room, polygon[:n, k].max() + room
    return True


@njit(cache=True, nogil=True)
def _planes(corners, order, box):  # type: ignore[no-untyped-def]
    """The planes of a tree (4, r), see `Tree`."""
    plane = np.zeros((4, len(order)))
    for r in range(len(order)):
        corner = corners[order[r]]
        u, v = corner[1] - corner[0], corner[2] - corner[0]
        x, y, z = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
        area2, size = x * x + y * y + z * z, max(u @ u, v @ v)
        if area2 > 1e-12 * size * size:
            plane[0, r], plane[1, r], plane[2, r] = x / np.sqrt(area2), y / np.sqrt(area2), z / np.sqrt(area2)
            for k in range(3):
                plane[3, r] += plane[k, r] * (corner[0, k] - (box[0, k] + box[1, k]) / 2.0)
    return plane
