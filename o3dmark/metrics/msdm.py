"""Mesh structural distortion: how visibly two meshes differ, by the statistics of curvature in local windows.

MSDM    Lavoue, Gelasca, Dupont, Baskurt, Ebrahimi, "Perceptually driven 3D distance metrics with application to
        watermarking" (2006): vertex by vertex, one scale.
MSDM2   Lavoue, "A multiscale metric for 3D mesh visual quality assessment" (2011): any two meshes, three scales.

Both follow the programs that published tables come from, MEPP (e48ca42, 2018) and MEPP2 (d977d05, 2022), and not the
formulas as usually printed: the added ones in the comparisons, the weights of the covariance and the absolute
curvatures are theirs. The window is a share of the longest side of the axis-aligned box, so that a rotation of both
meshes changes the value by 1 to 2 %. Edges with more than two triangles count as boundary, see `normal_cycle`.
"""

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numba import njit

from o3dmark.arrays import Floats
from o3dmark.mesh.proximity import closest_points, enough_work
from o3dmark.mesh.surface import Surface
from o3dmark.metrics import METRICS, Metric
from o3dmark.metrics.displacement import paired
from o3dmark.metrics.normal_cycle import MOST_STEPS, check_within, curvature, rings_of, steps_for, walk
from o3dmark.registry import option

# Pairs compared in a window of MSDM on average over the vertices, above which a mesh is refused: windows of two meshes
# that differ by half in their edges, of which there are 60, make 5 000
_MOST_COMPARED = 300_000


@METRICS.register("msdm")
@dataclass(frozen=True)
class MSDM(Metric):
    """Mesh structural distortion measure in [0, 1): 0 for equal meshes, near 1 where nothing looks alike.

    Needs the same triangles over the same vertices in the same order. Vertices that coincide in the reference are
    compared as one, unused ones not at all. Swapping the meshes changes the value: noise by 1e-4, smoothing by 10 %.
    Without unit. Errors: MeshError where most of the mesh lies in a window.
    Source: Lavoue, Gelasca, Dupont, Baskurt and Ebrahimi 2006, Perceptually driven 3D distance metrics
    with application to watermarking; MEPP.
    """

    needs_equal_connectivity: ClassVar[bool] = True

    curvature_radius: float = option(0.005, "ball that curvature is taken over, of the longest side of the box")
    window: float = option(0.015, "radius of the local window, of the longest side of the reference's box")
    sigma: float = option(0.008, "width of the window's Gaussian, of the longest side of the reference's box")

    def __post_init__(self) -> None:
        if not (self.curvature_radius > 0 and 0 < self.window <= 30 * self.sigma):
            raise ValueError("curvature_radius and window should be above 0, sigma a thirtieth of window or more")

    def __call__(self, reference: Any, distorted: Any) -> float:
        return _pool(self.local(reference, distorted))

    def local(self, reference: Any, distorted: Any) -> Floats:
        """The distortion at each vertex (n,) of Surface.of(reference). Errors: MeshError as `displacement.paired`."""
        pair = paired(reference, distorted)
        a, b, triangles = pair.surface.vertices, pair.moved.vertices, pair.surface.triangles
        side, rings = _longest_side(a), rings_of(triangles, len(a))
        k_a, k_b = (side * curvature(v, triangles, rings, self.curvature_radius * side) for v in (a, b))
        room = steps_for(rings), steps_for(rings)
        moments, within = _paired_moments(a, b, k_a, k_b, rings, room, self.window * side, self.sigma * side)
        check_within(within)
        L, C, S = _comparisons(moments)
        return np.asarray(np.cbrt((L**3 + C**3 + 0.5 * S**3) / 2.5))


@METRICS.register("msdm2")
@dataclass(frozen=True)
class MSDM2(Metric):
    """Multiscale mesh structural distortion measure in [0, 1), for meshes with any triangles.

    Forward has its windows on the distorted mesh and looks up the reference, backward the other way; symmetric is the
    mean of both. Coincident vertices are one vertex. Without unit.
    Errors: MeshError where most of a mesh lies in a window.
    Source: Lavoue 2011, A multiscale metric for 3D mesh visual quality assessment; MEPP2.
    """

    direction: Literal["symmetric", "forward", "backward"] = option("symmetric", "which mesh the windows are on")
    radius: float = option(0.002, "finest ball that curvature is taken over, of the longest side of the box")
    step: float = option(0.001, "by which each further scale's ball is larger, of the longest side of the box")
    scales: int = option(3, "number of scales; each window is five balls wide, its Gaussian half of that")

    def __post_init__(self) -> None:
        if not (self.radius > 0 and self.step >= 0 and self.scales >= 1):
            raise ValueError("radius should be above 0, step 0 or more, scales 1 or more")

    def __call__(self, reference: Any, distorted: Any) -> float:
        R, D = Surface.of(reference), Surface.of(distorted)
        ways = {"forward": [(D, R)], "backward": [(R, D)], "symmetric": [(D, R), (R, D)]}[self.direction]
        return float(np.mean([_pool(self.local(*way)) for way in ways]))

    def local(self, source: Surface, target: Surface) -> Floats:
        """The distortion at each vertex (n,) of ``source``, seen against the closest points of ``target``."""
        side, n = _longest_side(source.vertices), len(source.vertices)
        rings, target_rings = rings_of(source.triangles, n), rings_of(target.triangles, len(target.vertices))
        match = closest_points(source.vertices, target, most_work=enough_work(source.vertices, target))
        corners = target.triangles[match.triangle]
        shares = _shares(source.vertices, target.vertices[corners])
        total = np.zeros(n)
        for scale in range(self.scales):
            r = (self.radius + scale * self.step) * side
            k = side * curvature(source.vertices, source.triangles, rings, r)
            k_target = side * curvature(target.vertices, target.triangles, target_rings, r)
            k_match = np.sum(shares * k_target[corners], axis=1)
            moments, within = _matched_moments(
                source.vertices, match.point, k, k_match, rings, steps_for(rings), 5 * r, 2.5 * r
            )
            check_within(within)
            L, C, S = _comparisons(moments)
            total += (L + C + 0.5 * S) / 2.5
        return total / self.scales


def _pool(local: Floats) -> float:
    return float(np.cbrt(np.mean(local**3)))


def _longest_side(vertices: Floats) -> float:
    return float(np.ptp(vertices, axis=0).max())


def _shares(points: Floats, corners: Floats) -> Floats:
    """Weights (q, 3) of corners (q, 3, 3): the areas that the point, not its projection, spans with the other two."""
    spokes = corners - points[:, None]
    spans = np.linalg.norm(np.cross(spokes[:, [1, 2, 0]], spokes[:, [2, 0, 1]]), axis=2)
    total = spans.sum(axis=1, keepdims=True)
    return np.divide(spans, total, out=np.full_like(spans, 1 / 3), where=total > 0)


def _comparisons(moments: Floats) -> tuple[Floats, Floats, Floats]:
    """Curvature, contrast and structure comparison (n,) from means, deviations and covariance (n, 5)."""
    mu_a, mu_b, s_a, s_b, s_ab = moments.T
    L = np.abs(mu_a - mu_b) / (np.maximum(mu_a, mu_b) + 1)
    C = np.abs(s_a - s_b) / (np.maximum(s_a, s_b) + 1)
    S = np.abs(s_a * s_b - s_ab) / (s_a * s_b + 1)
    return L, C, S


@njit(cache=True, nogil=True)
def _distance2(p, q):  # type: ignore[no-untyped-def]
    return (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 + (p[2] - q[2]) ** 2


@njit(cache=True, nogil=True)
def _spread(value, weight, n):  # type: ignore[no-untyped-def]
    """Weighted mean and standard deviation of the first ``n`` values."""
    total = mean = square = 0.0
    for i in range(n):
        total += weight[i]
        mean += weight[i] * value[i]
    mean /= total
    for i in range(n):
        square += weight[i] * (value[i] - mean) ** 2
    return mean, np.sqrt(square / total)


@njit(cache=True, nogil=True)
def _window(v, points, values, rings, steps, radius, sigma, point, value, weight):  # type: ignore[no-untyped-def]
    """MSDM's list around a vertex: the end, or the clipped end, of every edge used; its length."""
    n = walk(v, radius, points, rings, steps)
    for i in range(n):
        p, q, t = steps.source[i], rings.target[steps.entry[i]], steps.inside[i]
        value[i] = (1 - t) * values[p] + t * values[q]
        for x in range(3):
            point[i, x] = points[p, x] + t * (points[q, x] - points[p, x])
        weight[i] = np.exp(-_distance2(point[i], points[v]) / (2 * sigma * sigma))
    return n


@njit(cache=True, nogil=True)
def _covariance(x, at_x, mu_x, n_x, y, at_y, mu_y, n_y, centre, sigma):  # type: ignore[no-untyped-def]
    """Weighted covariance of list x with partners from list y: the nearest of those near the same place in the list.

    Zero for meshes so far apart that no weight is left.
    """
    reach = 2 * abs(n_x - n_y)
    total = sum_xy = 0.0
    for i in range(n_x):
        partner, best = i, np.inf
        for j in range(max(i - reach, 0), min(i + reach, n_y - 1) + 1):
            d2 = _distance2(at_x[i], at_y[j])
            if d2 < best:
                partner, best = j, d2
        w = np.exp(-_distance2(at_x[i], centre) / (2 * sigma * sigma))
        total += w
        sum_xy += w * (x[i] - mu_x) * (y[partner] - mu_y)
    return sum_xy / total if total > 0.0 else 0.0


@njit(cache=True, nogil=True)
def _paired_moments(a, b, k_a, k_b, rings, steps, radius, sigma):  # type: ignore[no-untyped-def]
    """Means, deviations and covariance (n, 5) in MSDM's windows, one on each mesh; whether these are small enough."""
    moments, e = np.empty((len(a), 5)), len(rings.target)
    taken = compared = 0
    at_a, x, w_a = np.empty((e, 3)), np.empty(e), np.empty(e)
    at_b, y, w_b = np.empty((e, 3)), np.empty(e), np.empty(e)
    for v in range(len(a)):
        n_a = _window(v, a, k_a, rings, steps[0], radius, sigma, at_a, x, w_a)
        n_b = _window(v, b, k_b, rings, steps[1], radius, sigma, at_b, y, w_b)
        taken, compared = taken + n_a + n_b, compared + (n_a + n_b) * min(2 * abs(n_a - n_b), n_a + n_b)
        if taken > MOST_STEPS * len(a) or compared > _MOST_COMPARED * len(a):
            return moments, False
        mu_a, s_a = _spread(x, w_a, n_a)
        mu_b, s_b = _spread(y, w_b, n_b)
        # sic: both weighted by the distance from b's vertex
        one = _covariance(x, at_a, mu_a, n_a, y, at_b, mu_b, n_b, b[v], sigma)
        two = _covariance(y, at_b, mu_b, n_b, x, at_a, mu_a, n_a, b[v], sigma)
        moments[v] = mu_a, mu_b, s_a, s_b, (one + two) / 2
    return moments, True


@njit(cache=True, nogil=True)
def _matched_moments(points, matched, k, k_match, rings, steps, radius, sigma):  # type: ignore[no-untyped-def]
    """Means, deviations and covariance (n, 5) in MSDM2's windows: one walk, and what its points match.

    And whether the windows are small enough.
    """
    moments, e, taken = np.empty((len(points), 5)), len(rings.target) + 1, 0
    x, y, w_x, w_y = np.empty(e), np.empty(e), np.empty(e), np.empty(e)
    for v in range(len(points)):
        x[0], y[0], w_x[0], w_y[0], n = k[v], k_match[v], 1.0, 1.0, 1
        used = walk(v, radius, points, rings, steps)
        taken += used
        if taken > MOST_STEPS * len(points):
            return moments, False
        for i in range(used):
            p, q, t = steps.source[i], rings.target[steps.entry[i]], steps.inside[i]
            if t == 1.0 and not steps.fresh[i]:
                continue
            x[n] = (1 - t) * k[p] + t * k[q]
            y[n] = (1 - t) * k_match[p] + t * k_match[q]
            d2_x = d2_y = 0.0
            for c in range(3):
                d2_x += (points[p, c] + t * (points[q, c] - points[p, c]) - points[v, c]) ** 2
                d2_y += (matched[p, c] + t * (matched[q, c] - matched[p, c]) - matched[v, c]) ** 2
            w_x[n], w_y[n] = np.exp(-d2_x / (2 * sigma * sigma)), np.exp(-d2_y / (2 * sigma * sigma))
            n += 1
        mu_x, s_x = _spread(x, w_x, n)
        mu_y, s_y = _spread(y, w_y, n)
        total = sum_xy = 0.0
        for i in range(n):
            total += w_x[i]
            sum_xy += w_y[i] * (x[i] - mu_x) * (y[i] - mu_y)
        moments[v] = mu_x, mu_y, s_x, s_y, sum_xy / total  # sic: weights of y above, of x below
    return moments, True
