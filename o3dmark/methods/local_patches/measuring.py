"""What a patch of a surface measures: the flux of a field through all that lies in a cylinder.

A patch has a centre c on the surface, an axis n, the mean normal about it, and a radius. In its coordinates, z along n
and r, theta across it, the coefficient of a disk function f = G(r) exp(-i m theta) is

    the integral over the surface of  z t(|z|) f(r, theta) n . dA,     over the cube of the radius,

the taper t bringing it to zero at the lids. As the divergence theorem has it, moving the surface by dx changes it by
the integral of d(z t)/dz f dx . dA: what the cylinder holds is measured, not a height, so that folds need no care.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numba import njit

from o3dmark.arrays import Bools, Complexes, Floats, Ints
from o3dmark.mesh import geometry
from o3dmark.mesh.patch import Patch
from o3dmark.mesh.surface import Surface
from o3dmark.methods.local_patches.disk import DiskFunctions
from o3dmark.methods.local_patches.format import PatchFormat, smooth_end
from o3dmark.solid.quadrature import Rule, Samples, rule
from o3dmark.threads import in_parts

_CELL = 0.4  # side of the grid's cells, over the radius
_MOST_CELLS = 1 << 22
_LONGEST_EDGE, _ONE_POINT = 0.15, 0.1  # of triangles that are sampled by three points, and by one, over the radius
_LONGEST_WHOLE = 0.17  # of triangles that are not cut for a first look
_MOST_POINTS = 1200  # of a first look in a flat patch, above which they are thinned
_THINNED = 0.05  # to one in cubes of that side, over the radius: waves lose a share of 0.03 at most
_RINGS = 256  # of a first look
_LANES = 4  # powers that are worked out side by side
_RIM = 0.95, 0.95  # of radius and half height: a boundary further in spoils a patch


class Grid(NamedTuple):
    """Points (q, 3) sorted by cubes of side ``cell`` from ``low`` (3,) on; those of cube i are ``first[i]`` to i + 1's.

    ``vectors`` (q, 3) are their area vectors, ``place`` (q,) their numbers before they were sorted.
    """

    points: Floats
    vectors: Floats
    place: Ints
    first: Ints
    shape: Ints
    low: Floats
    cell: float

    @classmethod
    def of(cls, points: Floats, vectors: Floats, cell: float) -> "Grid":
        """A grid of cells of that side, or larger ones where that would make too many."""
        low = points.min(axis=0)
        extent = points.max(axis=0) - low
        while np.prod(np.floor(extent / cell) + 1.0) > _MOST_CELLS:
            cell *= 1.5
        shape = np.floor(extent / cell).astype(np.int64) + 1
        x, y, z = np.minimum((points - low) // cell, shape - 1).astype(np.int64).T
        cube = (x * shape[1] + y) * shape[2] + z
        place = np.argsort(cube, kind="stable")
        first = np.searchsorted(cube[place], np.arange(np.prod(shape) + 1))
        return cls(points[place], vectors[place], place, first, shape, low, cell)


class Patches(NamedTuple):
    """Centres (p, 3) and axes (p, 3) of patches of one ``radius``.

    ``strain`` (p, 3), where they are looked at as if the surface had been deformed, is what to undo: larger all round,
    longer along the first direction across the axis and shorter along the second, and the same at 45 degrees.
    """

    form: PatchFormat
    centre: Floats
    axis: Floats
    radius: float
    strain: Floats | None = None

    def among(self, chosen: Bools | Ints) -> "Patches":
        """Some of them, by their numbers or a mask."""
        strain = None if self.strain is None else self.strain[chosen]
        return self._replace(centre=self.centre[chosen], axis=self.axis[chosen], strain=strain)

    def frames(self) -> Floats:
        """The rows (p, 3, 3) of each are its two directions across the axis, and the axis."""
        return _frames(self.axis)

    def charts(self) -> Floats:
        """From an offset to coordinates in the cylinder, r being 1 at its side: (p, 3, 3)."""
        rows = self.frames() / self.radius
        if self.strain is None:
            return rows
        growth, along, slanting = self.strain.T[:, :, None]
        u, v, up = rows.transpose(1, 0, 2)
        u, v = (1.0 + growth + along) * u + slanting * v, slanting * u + (1.0 + growth - along) * v
        return np.ascontiguousarray(np.stack([u, v, (1.0 + growth) * up], axis=1))

    @property
    def cylinder(self) -> Patch:
        """The one patch that there is, its strain left aside."""
        return Patch(self.centre[0], self.axis[0], float(self.radius), float(self.form.half_height * self.radius))

    @property
    def reach(self) -> float:
        """How far from its centre what a cylinder holds may lie."""
        most = 0.0 if self.strain is None else float(np.abs(self.strain).sum(axis=1).max(initial=0.0))
        return self.radius * float(np.hypot(1.0, self.form.half_height)) / max(1.0 - most, 0.5)


@dataclass(frozen=True, eq=False)
class Sampled:
    """A surface as patches of a radius see it."""

    form: PatchFormat
    surface: Surface
    radius: float

    @cached_property
    def rule(self) -> Rule:
        """Where it is sampled, once as finely as is worth while. Errors: MeshError as `quadrature.rule`."""
        return rule(self.surface, _LONGEST_EDGE * self.radius, _ONE_POINT * self.radius)

    @cached_property
    def samples(self) -> Samples:
        return self.rule.samples(self.surface)

    @cached_property
    def grid(self) -> Grid:
        return grid_of(self.samples.points, self.samples.area_vectors, self.radius)

    @cached_property
    def coarse(self) -> Grid:
        """The grid of fewer points, for a first look: the vertices and centroids of triangles that need not be cut.

        A twelfth of the area at each corner and three quarters in the middle are exact for quadratics, as three points
        within are; and vertices are shared.
        """
        surface, longest = self.surface, _LONGEST_WHOLE * self.radius
        found = rule(surface, longest, longest)
        samples = found.samples(surface)
        whole = found.share == 1.0
        weight = np.where(whole, 0.75, 1.0)[:, None]
        corners = surface.triangles[found.triangle[whole]]
        vectors = surface.area_vectors[found.triangle[whole]] / 12.0
        at_vertices = geometry.sum_at_vertices(vectors, corners, len(surface.vertices))
        points = np.concatenate([samples.points, surface.vertices])
        vectors = np.concatenate([weight * samples.area_vectors, at_vertices])
        if len(points) * np.pi * self.radius**2 > _MOST_POINTS * surface.area:
            points, vectors = _thinned(points, vectors, _THINNED * self.radius)
        return grid_of(points, vectors, self.radius)

    @cached_property
    def boundary(self) -> Grid | None:
        """Points along the edges that one triangle has alone, if there are any."""
        points = _along(*geometry.boundary_edges(self.surface.vertices, self.surface.triangles), 0.1 * self.radius)
        return grid_of(points, np.zeros_like(points), self.radius) if len(points) else None

    def patches(self, centres: Floats, normals: Floats) -> "Patches":
        """Those about centres (p, 3), the normals there (p, 3)."""
        return patches_at(self.form, self.grid, centres, normals, self.radius)

    def whole(self, patches: "Patches") -> Bools:
        """Whether patches (p,) are clear of any boundary, so that they measure what was written."""
        if self.boundary is None:
            return np.ones(len(patches.centre), bool)
        cylinders = patches.centre, patches.charts(), patches.reach, _RIM[0], _RIM[1] * self.form.half_height
        found = np.zeros(len(patches.centre), bool)
        in_parts(len(found), lambda *part: _holds(*part, self.boundary, *cylinders, found))
        return ~found


def _thinned(points: Floats, vectors: Floats, side: float) -> tuple[Floats, Floats]:
    """One point in place of all within a cube of a side whose area vectors point alike, to an eighth of all ways.

    At their mean place, so that what varies evenly over a cube is as before.
    """
    cube = np.floor((points - points.min(axis=0)) / side).astype(np.int64)
    rows = np.column_stack([cube, (vectors > 0.0) @ np.array([1, 2, 4])])
    _, one = geometry.distinct_rows(rows)
    count, weight = int(one.max()) + 1, np.linalg.norm(vectors, axis=1)
    total = np.maximum(np.bincount(one, weight, count), np.finfo(np.float64).tiny)
    places = [np.bincount(one, weight * column, count) / total for column in points.T]
    sums = [np.bincount(one, column, count) for column in vectors.T]
    return np.stack(places, axis=1), np.stack(sums, axis=1).astype(np.float64)


def grid_of(points: Floats, vectors: Floats, radius: float) -> Grid:
    """A grid that suits patches of a radius."""
    return Grid.of(points, vectors, _CELL * radius)


def patches_at(form: PatchFormat, grid: Grid, centres: Floats, normals: Floats, radius: float) -> Patches:
    """Patches about centres (p, 3); the mean normals start from ``normals`` (p, 3)."""
    axis = np.ascontiguousarray(normals, np.float64)
    centre = np.ascontiguousarray(centres, np.float64)
    for _ in range(form.passes):
        axis = _averaged(grid, centre, axis, form.normal_radius * radius)
    return Patches(form, centre, axis, radius)


def coefficients(grid: Grid, patches: Patches, functions: DiskFunctions) -> Complexes:
    """The coefficients (p, q) of the disk functions in each patch."""
    return _measured(_coefficients, grid, patches, functions.order, functions.by_radius)


def first_look(grid: Grid, patches: Patches, functions: DiskFunctions) -> Complexes:
    """The same in a quarter of the time, what a patch holds taken together in rings.

    In flat surroundings to 0.02 of each wave, among hills to 3e-4.
    """
    middle = (np.arange(_RINGS) + 0.5) / _RINGS * (len(functions.by_radius) - 1)
    radial = functions.by_radius[np.rint(middle).astype(np.int64)]
    return _measured(_first_look, grid, patches, functions.order, radial)


def _averaged(grid: Grid, centres: Floats, normals: Floats, reach: float) -> Floats:
    means = np.empty_like(normals)
    in_parts(len(means), lambda *part: _mean_normals(*part, grid, centres, normals, reach, means))
    return means


def _measured(kernel: Callable[..., None], grid: Grid, patches: Patches, order: Ints, radial: Floats) -> Complexes:
    form, shape = patches.form, (len(patches.centre), len(order))
    cylinders = patches.centre, patches.charts(), patches.reach, form.half_height, form.lid
    real, imaginary = np.zeros(shape), np.zeros(shape)
    in_parts(len(real), lambda *part: kernel(*part, grid, *cylinders, order, radial, real, imaginary))
    return np.asarray(real + 1j * imaginary)


def held(points: Floats, patches: Patches) -> Ints:
    """Which points (q, 3) lie in the cylinder of the one patch (k,)."""
    near = np.flatnonzero((np.abs(points - patches.centre[0]) < patches.reach).all(axis=1))
    return near[patches.cylinder.holds(points[near])]


def answers(points: Floats, patches: Patches, functions: DiskFunctions) -> Complexes:
    """What the coefficients of the one patch gain (k, q) for points (k, 3) that it holds.

    To a motion dx of a sample with area vector a they answer by that times a . dx.
    """
    offset = (points - patches.centre[0]) @ patches.charts()[0].T
    r, height = np.hypot(offset[:, 0], offset[:, 1]), np.abs(offset[:, 2]) / patches.form.half_height
    taper, slope = smooth_end(height, patches.form.lid)
    speed = (taper + height * slope) / patches.radius**3
    position = r * (functions.table.shape[1] - 1)
    left = np.minimum(position.astype(np.int64), functions.table.shape[1] - 2)
    radial = functions.table[:, left] + (position - left) * (functions.table[:, left + 1] - functions.table[:, left])
    turn = np.exp(-1j * np.arctan2(offset[:, 1], offset[:, 0])[:, None] * functions.order)
    return np.asarray(speed[:, None] * radial.T * turn)


def _along(start: Floats, end: Floats, spacing: float) -> Floats:
    """Points of segments (e, 3), no further than ``spacing`` apart."""
    if not len(start):
        return np.empty((0, 3))
    count = np.ceil(np.linalg.norm(end - start, axis=1) / spacing).astype(np.int64) + 1
    which = np.repeat(np.arange(len(start)), count)
    step = (np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)) / np.maximum(count - 1, 1)[which]
    return np.asarray(start[which] + step[:, None] * (end - start)[which])


def _frames(axis: Floats) -> Floats:
    least = np.abs(axis).argmin(axis=1)
    across = np.cross(axis, np.eye(3)[least])
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    return np.ascontiguousarray(np.stack([across, np.cross(axis, across), axis], axis=1))


@njit(cache=True, nogil=True)
def _runs(grid, centre, reach):  # type: ignore[no-untyped-def]
    """The points (begin, end) (k, 2) that may lie within a reach of a centre: a run for each row of cubes."""
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    for axis in range(3):
        offset = centre[axis] - grid.low[axis]
        low[axis] = max(int(np.floor((offset - reach) / grid.cell)), 0)
        high[axis] = min(int(np.floor((offset + reach) / grid.cell)), grid.shape[axis] - 1)
    if (low > high).any():
        return np.empty((0, 2), np.int64)
    runs = np.empty(((high[0] - low[0] + 1) * (high[1] - low[1] + 1), 2), np.int64)
    count = 0
    for x in range(low[0], high[0] + 1):
        for y in range(low[1], high[1] + 1):
            row = (x * grid.shape[1] + y) * grid.shape[2]
            runs[count, 0] = grid.first[row + low[2]]
            runs[count, 1] = grid.first[row + high[2] + 1]
            count += 1
    return runs


@njit(inline="always")
def _seen_from(point, centre, chart):  # type: ignore[no-untyped-def]
    """A point's place across the axis in two ways, and along it."""
    d0, d1, d2 = point[0] - centre[0], point[1] - centre[1], point[2] - centre[2]
    u = d0 * chart[0, 0] + d1 * chart[0, 1] + d2 * chart[0, 2]
    v = d0 * chart[1, 0] + d1 * chart[1, 1] + d2 * chart[1, 2]
    return u, v, d0 * chart[2, 0] + d1 * chart[2, 1] + d2 * chart[2, 2]


@njit(inline="always")
def _flux(up, vector, row, height, lid):  # type: ignore[no-untyped-def]
    """z t(|z|) n . dA, over the cube of the radius; ``row`` is the axis over the radius."""
    s = max((abs(up) / height - lid) / (1.0 - lid), 0.0)
    flux = vector[0] * row[0] + vector[1] * row[1] + vector[2] * row[2]
    flux *= np.sqrt(row[0] * row[0] + row[1] * row[1] + row[2] * row[2])
    return flux * up * (1.0 - s * s * (3.0 - 2.0 * s))


@njit(nogil=True, cache=True)
def _mean_normals(start, stop, grid, centres, normals, reach, means):  # type: ignore[no-untyped-def]
    total = np.empty(3)
    for i in range(start, stop):
        centre, normal = centres[i], normals[i]
        total[:] = 0.0
        runs = _runs(grid, centre, reach)
        for run in range(len(runs)):
            for j in range(runs[run, 0], runs[run, 1]):
                d0 = grid.points[j, 0] - centre[0]
                d1 = grid.points[j, 1] - centre[1]
                d2 = grid.points[j, 2] - centre[2]
                away = 1.0 - (d0 * d0 + d1 * d1 + d2 * d2) / (reach * reach)
                if away <= 0.0:
                    continue
                vector = grid.vectors[j]
                if vector[0] * normal[0] + vector[1] * normal[1] + vector[2] * normal[2] > 0.0:
                    for axis in range(3):
                        total[axis] += away * away * vector[axis]
        length = np.sqrt(total[0] * total[0] + total[1] * total[1] + total[2] * total[2])
        for axis in range(3):
            means[i, axis] = total[axis] / length if length > 0.0 else normal[axis]


@njit(nogil=True, cache=True, fastmath=True)
def _coefficients(  # type: ignore[no-untyped-def]
    start, stop, grid, centres, charts, reach, height, lid, order, radial, real, imaginary
):
    n_functions, steps = radial.shape[1], radial.shape[0] - 1
    highest = order[-1]
    first = np.searchsorted(order, np.arange(highest + 2))
    cosine, sine = np.empty(n_functions), np.empty(n_functions)
    for i in range(start, stop):
        re, im = real[i], imaginary[i]
        runs = _runs(grid, centres[i], reach)
        for run in range(len(runs)):
            for j in range(runs[run, 0], runs[run, 1]):
                u, v, up = _seen_from(grid.points[j], centres[i], charts[i])
                r = np.sqrt(u * u + v * v)
                if abs(up) >= height or r >= 1.0:
                    continue
                weight = _flux(up, grid.vectors[j], charts[i, 2], height, lid)
                c1, s1 = (u / r, -v / r) if r > 0.0 else (1.0, 0.0)
                cm, sm = 1.0, 0.0
                for m in range(highest + 1):
                    for q in range(first[m], first[m + 1]):
                        cosine[q], sine[q] = cm, sm
                    cm, sm = cm * c1 - sm * s1, sm * c1 + cm * s1
                position = r * steps
                k = min(int(position), steps - 1)
                part = position - k
                for q in range(n_functions):
                    g = weight * (radial[k, q] + part * (radial[k + 1, q] - radial[k, q]))
                    re[q] += g * cosine[q]
                    im[q] += g * sine[q]


@njit(nogil=True, cache=True, fastmath=True)
def _first_look(  # type: ignore[no-untyped-def]
    start, stop, grid, centres, charts, reach, height, lid, order, radial, real, imaginary
):
    n_functions, rings = radial.shape[1], radial.shape[0]
    blocks = order[-1] // _LANES + 1
    of_rings = np.empty((2, rings, blocks * _LANES), np.float32)
    cosine, sine = np.empty(_LANES, np.float32), np.empty(_LANES, np.float32)
    for i in range(start, stop):
        of_rings[:] = 0.0
        runs = _runs(grid, centres[i], reach)
        for run in range(len(runs)):
            for j in range(runs[run, 0], runs[run, 1]):
                u, v, up = _seen_from(grid.points[j], centres[i], charts[i])
                r = np.sqrt(u * u + v * v)
                if abs(up) >= height or r >= 1.0:
                    continue
                weight = _flux(up, grid.vectors[j], charts[i, 2], height, lid)
                ring = int(r * rings)
                c1, s1 = np.float32(1.0), np.float32(0.0)
                if r > 0.0:
                    c1, s1 = np.float32(u / r), np.float32(-v / r)
                cm, sm = np.float32(weight), np.float32(0.0)
                for lane in range(_LANES):
                    cosine[lane], sine[lane] = cm, sm
                    cm, sm = cm * c1 - sm * s1, sm * c1 + cm * s1
                c2, s2 = c1 * c1 - s1 * s1, np.float32(2.0) * c1 * s1
                c4, s4 = c2 * c2 - s2 * s2, np.float32(2.0) * c2 * s2
                a, b = of_rings[0, ring], of_rings[1, ring]
                for block in range(blocks):
                    for lane in range(_LANES):
                        c, s = cosine[lane], sine[lane]
                        a[block * _LANES + lane] += c
                        b[block * _LANES + lane] += s
                        cosine[lane] = c * c4 - s * s4
                        sine[lane] = s * c4 + c * s4
        for ring in range(rings):
            for q in range(n_functions):
                real[i, q] += radial[ring, q] * of_rings[0, ring, order[q]]
                imaginary[i, q] += radial[ring, q] * of_rings[1, ring, order[q]]


@njit(nogil=True, cache=True)
def _holds(start, stop, grid, centres, charts, reach, rim, height, found):  # type: ignore[no-untyped-def]
    for i in range(start, stop):
        runs = _runs(grid, centres[i], reach)
        for run in range(len(runs)):
            for j in range(runs[run, 0], runs[run, 1]):
                u, v, up = _seen_from(grid.points[j], centres[i], charts[i])
                if abs(up) < height and u * u + v * v < rim * rim:
                    found[i] = True
