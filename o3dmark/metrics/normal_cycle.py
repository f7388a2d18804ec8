"""Curvature over a ball around each vertex (Cohen-Steiner and Morvan's normal cycle), and the walk that collects it.

This is what the MSDM programs (MEPP, LIRIS) compute, in their order of visits, so that their published values can be
reproduced: a depth-first walk along edges that lead away from the centre, clipped by a sphere. An edge bends only where
exactly two triangles meet, wound consistently; boundary edges, and edges with more triangles, are walked over but bend
nothing.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from o3dmark.arrays import Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry

# Steps that a walk may take on average over the vertices: horse_112642 takes 420 at the widest. Where most of the mesh
# is a speck beside its box, every ball holds all of it
MOST_STEPS = 10_000


class Rings(NamedTuple):
    """The directed edges out of each vertex v: entries start[v] to start[v + 1] of the others.

    start (n + 1,); target (e,): where the edge leads; sides (e, 2): the triangles with the edge target -> v and
    v -> target, -1 for both unless each is one. A ring is in the order in which CGAL's circulator meets the edges: it
    begins at the last triangle around v and goes on over ``next`` and ``opposite``.
    """

    start: Ints
    target: Ints
    sides: Ints


class Steps(NamedTuple):
    """Room for one walk: the edges used, by entry; where each starts; how much is inside; whether its end is new."""

    entry: Ints
    source: Ints
    inside: Floats
    fresh: NDArray[np.bool_]
    seen: Ints
    stack: Ints


def rings_of(triangles: Ints, n_vertices: int) -> Rings:
    """The rings of a mesh with triangles (m, 3), all corners different."""
    start, target = _rings(triangles, n_vertices)
    source = np.repeat(np.arange(n_vertices), np.diff(start))
    half = (triangles * n_vertices + np.roll(triangles, -1, axis=1)).ravel()
    order = np.argsort(half, kind="stable")
    inward, outward = target * n_vertices + source, source * n_vertices + target
    sides = []
    for wanted in (inward, outward):
        first = np.searchsorted(half, wanted, sorter=order)
        single = np.searchsorted(half, wanted, side="right", sorter=order) - first == 1
        sides.append(np.where(single, order[np.minimum(first, len(half) - 1)] // 3, -1))
    both = np.stack(sides, axis=1)
    both[(both < 0).any(axis=1)] = -1
    return Rings(start, target, both)


def steps_for(rings: Rings) -> Steps:
    """Room for walks over ``rings``: no edge is used twice in one."""
    n, e = len(rings.start) - 1, len(rings.target)
    counters = np.empty(e, np.int64), np.empty(e, np.int64), np.empty(e), np.empty(e, np.bool_)
    return Steps(*counters, np.full(n, -1), np.empty(n, np.int64))


def bends(vertices: Floats, triangles: Ints, rings: Rings) -> Floats:
    """Per entry (e,): the signed angle between both triangles' normals (by arcsine) over the edge's length.

    Zero where the edge does not bend or one of the triangles has no area; NaN where an edge that would has no length.
    """
    inner = rings.sides[:, 0] >= 0
    source = np.repeat(np.arange(len(vertices)), np.diff(rings.start))[inner]
    edge = vertices[rings.target[inner]] - vertices[source]
    length = np.linalg.norm(edge, axis=1)
    normal = geometry.unit(geometry.area_vectors(vertices, triangles))
    bend = np.zeros(len(rings.target))
    with np.errstate(invalid="ignore"):
        sine = np.sum(np.cross(*normal[rings.sides[inner].T]) * edge, axis=1) / length
        bend[inner] = np.arcsin(np.clip(sine, -1.0, 1.0)) / length
    return bend


def curvature(vertices: Floats, triangles: Ints, rings: Rings, radius: float) -> Floats:
    """Mean of both absolute principal curvatures (n,), in one over the units of the vertices, over balls of ``radius``.

    As in those programs, values are low: edges across the walk's way are used from neither end (a fine unit sphere gets
    0.83), and the tensor is divided by the flat disc pi radius^2, at a boundary too. A vertex whose ball meets an edge
    without length gets zero. Errors: MeshError where most of the mesh lies in a ball.
    """
    tensors, within = _tensors(vertices, rings, bends(vertices, triangles, rings), radius, steps_for(rings))
    check_within(within)
    tensors[~np.isfinite(tensors).all(axis=(1, 2))] = 0.0
    sizes = np.sort(np.abs(np.linalg.eigvalsh(tensors)), axis=1)
    return np.asarray(sizes[:, 1:].mean(axis=1) / (np.pi * radius**2))


def check_within(within: bool) -> None:
    """MeshError unless walks were as short as windows are good for."""
    if not within:
        raise MeshError(
            "most of the mesh lies in one window of this metric: something is far away from it, or its vertices cluster"
            " in a speck; compare without what is far away, or part by part"
        )


@njit(cache=True, nogil=True)
def _tensors(points, rings, bend, radius, steps):  # type: ignore[no-untyped-def]
    """The tensors (n, 3, 3), and whether they took no more than `MOST_STEPS`."""
    tensors, taken, most = np.zeros((len(points), 3, 3)), 0, MOST_STEPS * len(points)
    for v in range(len(points)):
        used = walk(v, radius, points, rings, steps)
        taken += used
        if taken > most:
            return tensors, False
        for i in range(used):
            k = steps.entry[i]
            p, q = points[steps.source[i]], points[rings.target[k]]
            weight = bend[k] * steps.inside[i]
            for x in range(3):
                for y in range(3):
                    tensors[v, x, y] += weight * (q[x] - p[x]) * (q[y] - p[y])
    return tensors, True


@njit(cache=True, nogil=True)
def walk(centre, radius, points, rings, steps):  # type: ignore[no-untyped-def]
    """Fill ``steps`` with the edges around vertex ``centre`` inside the sphere of ``radius``; their number.

    From the centre all edges are used, from elsewhere those that lead away from it. ``inside`` is 1 for an edge within
    the sphere and the fraction of it within otherwise; only the former are walked on from. ``steps.seen`` must not hold
    ``centre`` from another surface or radius: it is stamped with it.
    """
    seen, stack = steps.seen, steps.stack
    o = points[centre]
    stack[0], seen[centre] = centre, centre
    waiting, used = 1, 0
    while waiting:
        waiting -= 1
        v = stack[waiting]
        p = points[v]
        for k in range(rings.start[v], rings.start[v + 1]):
            w = rings.target[k]
            a = b = c = 0.0
            for x in range(3):
                edge, out = points[w, x] - p[x], p[x] - o[x]
                a, b, c = a + edge * edge, b + edge * out, c + out * out
            if v != centre and not b > 0.0:
                continue
            t = 1.0
            if a > 0.0:
                t = (-b + np.sqrt(max(b * b - a * (c - radius * radius), 0.0))) / a
            inside = t >= 1.0
            steps.entry[used], steps.source[used] = k, v
            steps.inside[used] = min(max(t, 0.0), 1.0)
            steps.fresh[used] = inside and seen[w] != centre
            if steps.fresh[used]:
                seen[w] = centre
                stack[waiting] = w
                waiting += 1
            used += 1
    return used


@njit(cache=True, nogil=True)
def _rings(triangles, n):  # type: ignore[no-untyped-def]
    """(start, target) of `Rings`. Where several fans meet at a vertex they follow one another."""
    first, before, after = _corners(triangles, n)
    start, target, size = np.zeros(n + 1, np.int64), np.empty(2 * triangles.size, np.int64), 0
    leaving, entered, listed = np.full(n, -1), np.full(n, -1), np.full(n, -1)
    done = np.zeros(triangles.size, np.bool_)
    for v in range(n):
        a, b = first[v], first[v + 1]
        for i in range(b - 1, a - 1, -1):
            leaving[before[i]], entered[after[i]] = i, v
        i, turn = b - 1, 0  # a second turn takes corners that another one leads to
        while turn < 2 * (b - a):
            while not done[i]:
                done[i] = True
                follower = leaving[after[i]]
                goes_on = a <= follower < b and not done[follower]
                for w in (before[i], after[i]):
                    if listed[w] != v and (w == before[i] or not goes_on):
                        target[size], listed[w] = w, v
                        size += 1
                if goes_on:
                    i = follower
            while turn < 2 * (b - a):
                i = a + turn % (b - a)
                if not done[i] and (turn >= b - a or entered[before[i]] != v):
                    break
                turn += 1
        start[v + 1] = size
    return start, target[:size].copy()


@njit(cache=True, nogil=True)
def _corners(triangles, n):  # type: ignore[no-untyped-def]
    """The corners of each vertex v, from first[v] to first[v + 1] in file order: the vertices before and after it."""
    first = np.zeros(n + 1, np.int64)
    for vertex in triangles.ravel():
        first[vertex + 1] += 1
    first = np.cumsum(first)
    free = first[:-1].copy()
    before, after = np.empty(triangles.size, np.int64), np.empty(triangles.size, np.int64)
    for face in triangles:
        for k in range(3):
            before[free[face[k]]], after[free[face[k]]] = face[k - 1], face[k - 2]
            free[face[k]] += 1
    return first, before, after
