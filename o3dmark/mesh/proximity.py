"""The closest point of a triangle surface, exact in float64: a search in a tree of boxes, compiled by numba.

Open3D answers the same question in float32, which is worth 1e-7 of the coordinates: too coarse for marks whose MRMS is
1e-6 and for meshes far from the origin; among 40 000 triangles that overlap it takes 2 ms a point, 100 times as long.
libigl 2.6 answers in float64, to 6e-16 of the diagonal the same, and takes 0.7 to 0.9 of the time on one core; but of
several closest triangles it names any, and readers need to know which. Memory is linear in triangles and points;
nothing is random.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from o3dmark.arrays import Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.mesh.box_tree import Tree, tree_of
from o3dmark.mesh.surface import Surface

_DEPTH = 64  # of a tree; the search keeps at most one waiting box a level
_AT_ONCE = 64  # planes of a leaf that are asked together: the processor takes several in one step
_DOUBT = 1e-9  # of lengths, by which rounding may misplace a plane whose triangle's sine is a millionth
_A_BOX, _A_TRIANGLE = 32, 32  # what it takes to look at a pair of boxes, or at a triangle, in planes
# Work that is enough for shapes wherever they are: in all, a point, and a point and vertex. A point about horse_112642,
# scattered three times as wide, takes 15 000, a point of a polygon of 40 000 random corners 11 000
_ENOUGH, _A_POINT, _A_POINT_AND_VERTEX = 1_000_000_000, 20_000, 0.04


class Closest(NamedTuple):
    """For each of q points: its distance (q,), the closest triangle (q,) and the point of it that is closest (q, 3)."""

    distance: Floats
    triangle: Ints
    point: Floats


def closest_points(
    points: Floats, surface: Surface, tree: Tree | None = None, *, most_work: int | None = None
) -> Closest:
    """The point of ``surface`` closest to each of ``points`` (q, 3), in the units of the vertices.

    Of triangles at exactly the same distance (a vertex or an edge is closest) the lowest index is named, whatever the
    order of search. Triangles without area count as the segment or point that they are.
    Errors: MeshError where more than ``most_work`` is to be done, in planes of triangles looked at (1 to 3 ns each).
    """
    corners = surface.vertices[surface.triangles]
    distance, triangle = np.empty(len(points)), np.empty(len(points), np.int64)
    nearest = np.empty((len(points), 3))
    boxes = tree_of(surface) if tree is None else tree
    most = np.iinfo(np.int64).max if most_work is None else most_work
    asked = np.ascontiguousarray(points, np.float64)
    if not _search(asked, corners, surface.triangles, boxes, most, distance, triangle, nearest):
        raise MeshError(
            f"the closest points of {len(points)} cannot be told in bounded time: many of the {len(corners)} triangles"
            " overlap, or are equally far away; compare part by part, or without what overlaps"
        )
    return Closest(distance, triangle, nearest)


def enough_work(points: Floats, surface: Surface) -> int:
    """How much ``most_work`` is enough for whatever is no trick: 10 to 20 s for 200 000 points and 1 MB of surface."""
    a_point = _A_POINT + _A_POINT_AND_VERTEX * len(surface.vertices)
    return max(_ENOUGH, int(a_point * len(points)))


@njit(cache=True, nogil=True)
def _search(points, corners, triangles, tree, most, distance, triangle, nearest):  # type: ignore[no-untyped-def]
    """Fill the last three, as in `Closest`; False as soon as it is more work than ``most``."""
    waiting, bound = np.empty(_DEPTH, np.int64), np.empty(_DEPTH)
    plane, origin = tree.plane, tree.box[0].sum(axis=0) / 2.0
    size = np.sqrt(((tree.box[0, 1] - tree.box[0, 0]) ** 2).sum())
    start = work = 0  # the answer for the point before is a good first guess for this one
    for i in range(len(points)):
        p = points[i]
        u, v, w = p[0] - origin[0], p[1] - origin[1], p[2] - origin[2]
        doubt = _DOUBT * (size + np.sqrt(u * u + v * v + w * w))
        best, x, y, z = _on_triangle(p, corners[start], triangles[start])
        where, count, reach = start, 1, 1.01 * np.sqrt(best) + doubt
        nearest[i, 0], nearest[i, 1], nearest[i, 2] = x, y, z
        waiting[0], bound[0] = 0, 0.0
        while count:
            count -= 1
            node = waiting[count]
            if bound[count] > best:
                continue
            child = tree.child[node]
            if child < 0:
                work += tree.last[node] - tree.first[node]
                for first in range(tree.first[node], tree.last[node], _AT_ONCE):
                    last = min(first + _AT_ONCE, tree.last[node])
                    if not _any_near(plane[:, first:last], u, v, w, reach):
                        continue
                    for r in range(first, last):
                        if abs(plane[0, r] * u + plane[1, r] * v + plane[2, r] * w - plane[3, r]) > reach:
                            continue
                        t = tree.order[r]
                        if _beyond(p, corners[t, 0], plane[:, r], best):
                            continue
                        work += _A_TRIANGLE
                        d2, x, y, z = _on_triangle(p, corners[t], triangles[t])
                        if d2 < best or (d2 == best and t < where):
                            best, where, reach = d2, t, 1.01 * np.sqrt(d2) + doubt
                            nearest[i, 0], nearest[i, 1], nearest[i, 2] = x, y, z
                continue
            near, far = _to_box(p, tree.box[child]), _to_box(p, tree.box[child + 1])
            swap = far < near
            waiting[count], bound[count] = (child, near) if swap else (child + 1, far)
            waiting[count + 1], bound[count + 1] = (child + 1, far) if swap else (child, near)
            count, work = count + 2, work + _A_BOX
        distance[i], triangle[i], start = np.sqrt(best), where, where
        if work > most:
            return False
    return True


@njit(cache=True, nogil=True)
def _any_near(plane, u, v, w, reach):  # type: ignore[no-untyped-def]
    """Whether any of the planes (4, n) is within reach of a point. Slices from 0 on, which compilers do in parallel."""
    a, b, c, d = plane[0], plane[1], plane[2], plane[3]
    near = 0
    for r in range(len(a)):
        near += abs(a[r] * u + b[r] * v + c[r] * w - d[r]) <= reach
    return near > 0


@njit(cache=True, nogil=True)
def _beyond(p, a, plane, best):  # type: ignore[no-untyped-def]
    """Whether the plane through ``a`` is further away than the root of ``best``, whatever rounding did to it.

    The same question again, from nearby: all planes of a speck far from the middle look close from there.
    """
    along = length = 0.0
    for k in range(3):
        along += (p[k] - a[k]) * plane[k]
        length += (p[k] - a[k]) ** 2
    return along * along > 1.01 * best + _DOUBT**2 * length


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


@njit(cache=True, nogil=True)
def _along(p, a, b):  # type: ignore[no-untyped-def]
    """Where the foot of ``p`` lies on the segment from a (0) to b (1)."""
    along = length = 0.0
    for k in range(3):
        along += (p[k] - a[k]) * (b[k] - a[k])
        length += (b[k] - a[k]) ** 2
    return min(max(along / length, 0.0), 1.0) if length > 0.0 else 0.0
