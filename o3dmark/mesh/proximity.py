"""The closest point of a triangle surface, exact in float64: a box tree over the triangles, compiled by numba.

Open3D answers the same question in float32, which is worth 1e-7 of the coordinates: too coarse for marks whose MRMS is
1e-6 and for meshes far from the origin. libigl 2.6 answers in float64, to 6e-16 of the diagonal the same, and takes
0.7 to 0.9 of the time on one core; but of several closest triangles it names any, and readers need to know which.
Memory is linear in triangles and points; nothing is random.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from o3dmark.arrays import Floats, Ints
from o3dmark.mesh.surface import Surface

_LEAF = 1  # triangles in a leaf: 200 000 points about horse_48485 take 0.9 s; with 4 1.3 s, with 8 2.0 s
_DEPTH = 64  # halving 2^64 triangles; the search keeps at most one waiting box a level
# A triangle that is longer than so many of its heights is boxed in slices, at most so many, or every point in the long
# diagonal box of a needle has to be compared with it: MRMS of the cone of a polygon of 20 000 corners took over 100 s,
# now 9 s
_SLENDER, _SLICES = 8.0, 32


class Closest(NamedTuple):
    """For each of q points: its distance (q,), the closest triangle (q,) and the point of it that is closest (q, 3)."""

    distance: Floats
    triangle: Ints
    point: Floats


class Tree(NamedTuple):
    """Boxes (k, 2, 3), the first child of each (its sibling follows; -1: a leaf), and the run of ``order`` within.

    ``order`` names triangles; a needle stands in it more than once, see `_slices`.
    """

    box: Floats
    child: Ints
    first: Ints
    last: Ints
    order: Ints


def tree_of(surface: Surface) -> Tree:
    """The boxes about a surface's triangles, for those who ask `closest_points` more than once."""
    return Tree(*_build(surface.vertices[surface.triangles]))


def closest_points(points: Floats, surface: Surface, tree: Tree | None = None) -> Closest:
    """The point of ``surface`` closest to each of ``points`` (q, 3), in the units of the vertices.

    Of triangles at exactly the same distance (a vertex or an edge is closest) the lowest index is named, whatever the
    order of search. Triangles without area count as the segment or point that they are.
    """
    corners = surface.vertices[surface.triangles]
    distance, triangle = np.empty(len(points)), np.empty(len(points), np.int64)
    nearest = np.empty((len(points), 3))
    boxes = tree_of(surface) if tree is None else tree
    _search(np.ascontiguousarray(points, np.float64), corners, surface.triangles, boxes, distance, triangle, nearest)
    return Closest(distance, triangle, nearest)


@njit(cache=True, nogil=True)
def _build(corners):  # type: ignore[no-untyped-def]
    """Halve the boxes of triangles at the median of their centres, along the longest side, until few are left."""
    owner, boxes = _slices(corners)
    m = len(owner)
    order = np.arange(m)
    box = np.empty((2 * m, 2, 3))
    child, first, last = np.full(2 * m, -1), np.zeros(2 * m, np.int64), np.zeros(2 * m, np.int64)
    last[0], count, node = m, 1, 0
    while node < count:  # children are appended, so every node is met once
        a, b = first[node], last[node]
        box[node, 0], box[node, 1] = np.inf, -np.inf
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for t in order[a:b]:
            for k in range(3):
                centre = boxes[t, 0, k] + boxes[t, 1, k]
                low[k], high[k] = min(low[k], centre), max(high[k], centre)
                box[node, 0, k] = min(box[node, 0, k], boxes[t, 0, k])
                box[node, 1, k] = max(box[node, 1, k], boxes[t, 1, k])
        if b - a > _LEAF:
            side = np.argmax(high - low)
            keys = boxes[order[a:b], 0, side] + boxes[order[a:b], 1, side]
            order[a:b] = order[a:b][np.argsort(keys, kind="mergesort")]
            child[node] = count
            first[count], last[count] = a, (a + b) // 2
            first[count + 1], last[count + 1] = (a + b) // 2, b
            count += 2
        node += 1
    return box[:count].copy(), child[:count].copy(), first[:count].copy(), last[:count].copy(), owner[order]


@njit(cache=True, nogil=True)
def _slices(corners):  # type: ignore[no-untyped-def]
    """What is put into boxes, and the boxes (r, 2, 3): triangles (r,), those that are needles slice by slice."""
    m = len(corners)
    count, longest = np.ones(m, np.int64), np.zeros(m, np.int64)
    for t in range(m):
        length = np.zeros(3)
        for i in range(3):
            for k in range(3):
                length[i] += (corners[t, (i + 1) % 3, k] - corners[t, i, k]) ** 2
        longest[t] = np.argmax(length)
        i = longest[t]
        a, b, c = corners[t, i], corners[t, (i + 1) % 3], corners[t, (i + 2) % 3]
        height2 = _on_edge(c, a, b, 0, 1)[0]
        if length[i] > (_SLENDER**2) * height2:
            share = _SLICES if height2 == 0.0 else min(np.sqrt(length[i] / height2) / _SLENDER, _SLICES)
            count[t] = int(np.ceil(share))
    owner, boxes, r = np.empty(count.sum(), np.int64), np.empty((count.sum(), 2, 3)), 0
    for t in range(m):
        i = longest[t]
        a, b, c = corners[t, i], corners[t, (i + 1) % 3], corners[t, (i + 2) % 3]
        top = _along(c, a, b)
        for n in range(count[t]):
            low, high = n / count[t], (n + 1) / count[t]
            owner[r], boxes[r, 0], boxes[r, 1] = t, np.inf, -np.inf
            for k in range(3):
                for s in (low, high):  # on the longest edge, and on the way over the corner
                    if s <= top:
                        over = a[k] + (s / top if top > 0.0 else 0.0) * (c[k] - a[k])
                    else:
                        over = b[k] + ((1.0 - s) / (1.0 - top) if top < 1.0 else 0.0) * (c[k] - b[k])
                    on = a[k] + s * (b[k] - a[k])
                    boxes[r, 0, k] = min(boxes[r, 0, k], on, over)
                    boxes[r, 1, k] = max(boxes[r, 1, k], on, over)
                if low <= top <= high:
                    boxes[r, 0, k], boxes[r, 1, k] = min(boxes[r, 0, k], c[k]), max(boxes[r, 1, k], c[k])
                for corner, end in ((a, 0), (b, count[t] - 1)):
                    if n == end:
                        boxes[r, 0, k] = min(boxes[r, 0, k], corner[k])
                        boxes[r, 1, k] = max(boxes[r, 1, k], corner[k])
                if count[t] > 1:  # a slice's corners are rounded
                    rounding = 1e-15 * max(abs(boxes[r, 0, k]), abs(boxes[r, 1, k]))
                    boxes[r, 0, k], boxes[r, 1, k] = boxes[r, 0, k] - rounding, boxes[r, 1, k] + rounding
            r += 1
    return owner, boxes


@njit(cache=True, nogil=True)
def _along(p, a, b):  # type: ignore[no-untyped-def]
    """Where the foot of ``p`` lies on the segment from a (0) to b (1)."""
    along = length = 0.0
    for k in range(3):
        along += (p[k] - a[k]) * (b[k] - a[k])
        length += (b[k] - a[k]) ** 2
    return min(max(along / length, 0.0), 1.0) if length > 0.0 else 0.0


@njit(cache=True, nogil=True)
def _search(points, corners, triangles, tree, distance, triangle, nearest):  # type: ignore[no-untyped-def]
    normals = _normals(corners)
    waiting, bound = np.empty(_DEPTH, np.int64), np.empty(_DEPTH)
    start = 0  # the answer for the point before is a good first guess for this one
    for i in range(len(points)):
        p = points[i]
        d2, x, y, z = _on_triangle(p, corners[start], triangles[start])
        best, where, size = d2, start, 1
        nearest[i, 0], nearest[i, 1], nearest[i, 2] = x, y, z
        waiting[0], bound[0] = 0, 0.0
        while size:
            size -= 1
            node = waiting[size]
            if bound[size] > best:
                continue
            child = tree.child[node]
            if child < 0:
                for t in tree.order[tree.first[node] : tree.last[node]]:
                    if _beyond(p, corners[t, 0], normals[t], best):
                        continue
                    d2, x, y, z = _on_triangle(p, corners[t], triangles[t])
                    if d2 < best or (d2 == best and t < where):
                        best, where = d2, t
                        nearest[i, 0], nearest[i, 1], nearest[i, 2] = x, y, z
                continue
            near, far = _to_box(p, tree.box[child]), _to_box(p, tree.box[child + 1])
            swap = far < near
            waiting[size], bound[size] = (child, near) if swap else (child + 1, far)
            waiting[size + 1], bound[size + 1] = (child + 1, far) if swap else (child, near)
            size += 2
        distance[i], triangle[i], start = np.sqrt(best), where, where


@njit(cache=True, nogil=True)
def _normals(corners):  # type: ignore[no-untyped-def]
    """Unit normals (m, 3); zero where rounding says too much of them: the triangle's sine is below a millionth."""
    normals = np.zeros((len(corners), 3))
    for t in range(len(corners)):
        u, v = corners[t, 1] - corners[t, 0], corners[t, 2] - corners[t, 0]
        x, y, z = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
        area2, size = x * x + y * y + z * z, max(u @ u, v @ v)
        if area2 > 1e-12 * size * size:
            normals[t, 0], normals[t, 1], normals[t, 2] = x / np.sqrt(area2), y / np.sqrt(area2), z / np.sqrt(area2)
    return normals


@njit(cache=True, nogil=True)
def _beyond(p, a, normal, best):  # type: ignore[no-untyped-def]
    """Whether the plane through ``a`` is further away than the root of ``best``, whatever rounding did to it.

    Quick to ask: of 52 000 triangles that all pass through each other, in whose boxes each point lies, few are left.
    """
    along = length = 0.0
    for k in range(3):
        along += (p[k] - a[k]) * normal[k]
        length += (p[k] - a[k]) ** 2
    return along * along > 1.01 * best + 1e-18 * length


@njit(cache=True, nogil=True)
def _to_box(p, box):  # type: ignore[no-untyped-def]
    """Squared distance from a point to a box."""
    d2 = 0.0
    for k in range(3):
        gap = max(box[0, k] - p[k], p[k] - box[1, k], 0.0)
        d2 += gap * gap
    return d2


@njit(cache=True, nogil=True)
def _on_triangle(p, corner, names):  # type: ignore[no-untyped-def]
    """Squared distance and coordinates of the triangle's closest point: inside it, or on the best of its edges."""
    a, b, c = corner[0], corner[1], corner[2]
    uu = uv = vv = pu = pv = 0.0
    for k in range(3):
        u, v, w = b[k] - a[k], c[k] - a[k], p[k] - a[k]
        uu, uv, vv, pu, pv = uu + u * u, uv + u * v, vv + v * v, pu + w * u, pv + w * v
    area, s, t = uu * vv - uv * uv, vv * pu - uv * pv, uu * pv - uv * pu
    if area > 0.0 and s >= 0.0 and t >= 0.0 and s + t <= area:
        s, t = s / area, t / area
        x = a[0] + s * (b[0] - a[0]) + t * (c[0] - a[0])
        y = a[1] + s * (b[1] - a[1]) + t * (c[1] - a[1])
        z = a[2] + s * (b[2] - a[2]) + t * (c[2] - a[2])
        return (p[0] - x) ** 2 + (p[1] - y) ** 2 + (p[2] - z) ** 2, x, y, z
    best = _on_edge(p, a, b, names[0], names[1])
    for i, j in ((1, 2), (2, 0)):
        other = _on_edge(p, corner[i], corner[j], names[i], names[j])
        if other[0] < best[0]:
            best = other
    return best


@njit(cache=True, nogil=True)
def _on_edge(p, a, b, name_a, name_b):  # type: ignore[no-untyped-def]
    """The same of a segment. Taken from the lower vertex index up, so that both triangles of an edge agree to a bit."""
    if name_a > name_b:
        a, b = b, a
    t = _along(p, a, b)
    if t == 1.0:
        x, y, z = b[0], b[1], b[2]
    else:
        x, y, z = a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])
    return (p[0] - x) ** 2 + (p[1] - y) ** 2 + (p[2] - z) ** 2, x, y, z
