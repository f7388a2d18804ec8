"""Mesh saliency: where curvature differs from the curvature around it.

Lee, Varshney, Jacobs, "Mesh saliency", SIGGRAPH 2005, as Hamidi et al. use it:

    G(v, s)  = mean of the curvature over the points nearer than 2 s, weighted by exp(-|x - v|^2 / 2 s^2)
    S_i(v)   = |G(v, s_i) - G(v, 2 s_i)|                       s_i = scale x epsilon x bounding-box diagonal
    S(v)     = S_1(v)                                          Hamidi et al.: one scale, s = 2 epsilon
    S(v)     = sum_i S_i(v) (M_i - m_i)^2                      Lee et al.: five scales, 2 to 6 epsilon

where each S_i is first divided by its maximum M_i, and m_i is the mean of its other local maxima (Itti's suppression of
maps with many equal peaks). A local maximum is higher than all its neighbours, by edges on a mesh and among the six
nearest points in a cloud. Curvature is Taubin's mean curvature, so its sign matters and the winding should be coherent.

Lee's saliency has no unit, that of one scale the unit of curvature. The bounding box is the axis-aligned one, so a
rotation changes epsilon a little.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
import scipy.sparse as sp

from o3dmark.arrays import Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.mesh import curvature, geometry
from o3dmark.mesh.similarity import UnitSize
from o3dmark.mesh.surface import Surface, is_cloud, legacy_cloud
from o3dmark.registry import option
from o3dmark.threads import cores

LEE_SCALES = (2.0, 3.0, 4.0, 5.0, 6.0)  # the paper's
_CLOUD_NEIGHBOURS = 12  # for a cloud's curvature: two rings would be 18, one 6
_PEAK_NEIGHBOURS = 6  # for a cloud's local maxima: the valence of a regular mesh
_PAIRS_AT_ONCE = 8_000_000  # on four cores at a time in the radius search: 200 MB


@dataclass(frozen=True)
class Saliency:
    """Mesh saliency of a triangle mesh or a point cloud; one scale gives the paper's S, several give Lee's."""

    scales: tuple[float, ...] = option(LEE_SCALES, "sigma_i, in units of epsilon")
    epsilon: float = option(0.003, "the unit of the scales, over the bounding-box diagonal")

    def __call__(self, shape: Any) -> Floats:
        """Saliency (n,) per vertex of an Open3D mesh, or per point of a cloud; zero where no triangle is.

        Errors: MeshError for an unusable mesh, an empty cloud, or one too small.
        """
        if is_cloud(shape):
            return self._of_cloud(legacy_cloud(shape))
        surface = Surface.of(shape)
        values = np.append(self.of_surface(surface), 0.0)  # vertex_map is -1 for unused vertices
        return values[surface.vertex_map]

    def of_surface(self, surface: Surface) -> Floats:
        """Saliency (n,) per vertex of a surface."""
        mean = curvature.taubin(surface.vertices, surface.triangles).mean
        levels = self.levels(surface.vertices, mean)
        return combine(levels, geometry.adjacency(surface.triangles, len(surface.vertices)))

    def levels(self, points: Floats, values: Floats) -> Floats:
        """The raw S_i (k, n), one row a scale, of ``values`` (n,), the curvature at ``points`` (n, 3)."""
        sigmas = np.asarray(self.scales) * self.epsilon * geometry.diagonal(points)
        means = gaussian_means(points, values, np.concatenate([sigmas, 2.0 * sigmas]))
        return np.abs(means[: len(sigmas)] - means[len(sigmas) :])

    def _of_cloud(self, cloud: Any) -> Floats:
        import open3d as o3d

        points = np.array(cloud.points, np.float64)
        if len(points) <= _CLOUD_NEIGHBOURS:
            raise MeshError(
                f"a cloud of {len(points)} points is too small for curvature: {_CLOUD_NEIGHBOURS + 1} needed"
            )
        if not np.isfinite(points).all() or not geometry.diagonal(points):
            raise MeshError("the points are not finite, or all the same")
        if not cloud.has_normals():
            cloud = o3d.geometry.PointCloud(cloud)
            cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(_CLOUD_NEIGHBOURS + 1))
            cloud.orient_normals_consistent_tangent_plane(_CLOUD_NEIGHBOURS)
        neighbours = _nearest(points, _CLOUD_NEIGHBOURS)
        mean = curvature.of_points(points, geometry.unit(np.array(cloud.normals)), neighbours).mean
        near = neighbours[:, :_PEAK_NEIGHBOURS]
        rows = np.repeat(np.arange(len(points)), near.shape[1])
        graph = sp.csr_array((np.ones(near.size), (rows, near.ravel())), shape=(len(points), len(points)))
        return combine(self.levels(points, mean), graph)


def combine(levels: Floats, neighbours: sp.csr_array) -> Floats:
    """One map (n,) from the levels (k, n): the level itself, or Lee's sum under non-linear suppression."""
    if len(levels) == 1:
        return np.array(levels[0])
    total = np.zeros(levels.shape[1])
    for level in levels:
        top = level.max()
        if top > 0:
            share = level / top
            total += share * (1.0 - _mean_of_other_peaks(share, neighbours)) ** 2
    return total


def gaussian_means(points: Floats, values: Floats, sigmas: Floats) -> Floats:
    """G(v, sigma) of ``values`` (n,) at ``points`` (n, 3) for every sigma (k,): an array (k, n).

    The window is the open ball of radius 2 sigma, the point itself included. Points are taken in clusters half as wide
    as the largest window; one radius search of Open3D's KD-tree around a cluster serves all of its points and all
    sigmas. Time grows with the number of pairs in the largest window, memory stays linear in n.
    """
    import open3d as o3d

    cutoffs, inverse = np.unique(2.0 * np.asarray(sigmas, np.float64), return_inverse=True)
    scale = geometry.diagonal(points) or 1.0
    points = np.ascontiguousarray(UnitSize(points.mean(axis=0), scale).apply(points))
    cutoffs /= scale
    members, starts, centres, reach = _clusters(points, cutoffs[-1] / 2.0)
    search = o3d.core.nns.NearestNeighborSearch(o3d.core.Tensor(points), o3d.core.int64)
    radius = float(cutoffs[-1] + reach.max())
    search.fixed_radius_index(radius)
    means = np.empty((len(points), len(cutoffs)))

    def gather(first: int, last: int) -> int:
        around = centres[first:last]
        found, squares, splits = search.fixed_radius_search(o3d.core.Tensor(around), radius, sort=True)
        near = found.numpy(), np.sqrt(squares.numpy()), splits.numpy()
        _gather(points, values, cutoffs, members, starts[first : last + 1], around, *near, means)
        return len(found)

    step = max(1, int(_PAIRS_AT_ONCE / max(gather(0, min(8, len(centres))), 1) * 8 / 4))
    with ThreadPoolExecutor(cores()) as pool:
        bounds = [*range(0, len(centres), step), len(centres)]
        list(pool.map(gather, bounds[:-1], bounds[1:]))
    return means.T[inverse]


def _clusters(points: Floats, width: float) -> tuple[Ints, Ints, Floats, Floats]:
    """Points by the cells of a grid: indices cell by cell, each cell's start (and the end), centre and reach."""
    cells = np.floor((points - points.min(axis=0)) / width).astype(np.int64)
    sides = cells.max(axis=0) + 1
    cell = (cells[:, 0] * sides[1] + cells[:, 1]) * sides[2] + cells[:, 2]
    members = np.argsort(cell, kind="stable")
    starts = np.flatnonzero(np.diff(cell[members], prepend=-1))
    sizes = np.diff(starts, append=len(points))
    centres = np.add.reduceat(points[members], starts, axis=0) / sizes[:, None]
    distance = np.linalg.norm(points[members] - np.repeat(centres, sizes, axis=0), axis=1)
    return members, np.append(starts, len(points)), centres, np.maximum.reduceat(distance, starts)


# On a window's support the Gaussian is exp(-2 x) of x = |d|^2 / (2 sigma)^2 in [0, 1): the eighth power of a polynomial
# that is exact to 1e-16. Written out, it lets the compiler take several points at once.
_ROOT = tuple(
    np.polynomial.Chebyshev.interpolate(lambda x: np.exp(-x / 4.0), 8, domain=[0, 1])
    .convert(kind=np.polynomial.Polynomial)
    .coef.tolist()
)
_SUMS_IN_ANY_ORDER = {"reassoc", "contract", "nsz"}


@numba.njit(inline="always", fastmath=_SUMS_IN_ANY_ORDER)
def _gaussian(x):  # type: ignore[no-untyped-def]
    p0, p1, p2, p3, p4, p5, p6, p7, p8 = _ROOT
    root = p0 + x * (p1 + x * (p2 + x * (p3 + x * (p4 + x * (p5 + x * (p6 + x * (p7 + x * p8)))))))
    fourth = (root * root) * (root * root)
    return fourth * fourth


@numba.njit(nogil=True, cache=True, fastmath=_SUMS_IN_ANY_ORDER)
def _gather(points, values, cutoffs, members, starts, centres, found, distance, splits, means):  # type: ignore[no-untyped-def]
    """For each cluster (starts), the means (n, k) of its members over the points found around it, nearest first."""
    for c in range(len(starts) - 1):
        near = found[splits[c] : splits[c + 1]]
        x, y, z, value = points[near, 0], points[near, 1], points[near, 2], values[near]
        square = np.empty(len(near))
        for v in members[starts[c] : starts[c + 1]]:
            for j in range(len(near)):
                square[j] = (x[j] - points[v, 0]) ** 2 + (y[j] - points[v, 1]) ** 2 + (z[j] - points[v, 2]) ** 2
            aside = np.sqrt(np.sum((points[v] - centres[c]) ** 2))
            for w in range(len(cutoffs)):
                limit = cutoffs[w] ** 2
                last = np.searchsorted(distance[splits[c] : splits[c + 1]], cutoffs[w] + aside, side="right")
                total, weight = 0.0, 0.0
                for j in range(last):  # beyond, no point is in this window
                    g = _gaussian(square[j] / limit) if square[j] < limit else 0.0
                    total += g * value[j]
                    weight += g
                means[v, w] = total / weight


def _mean_of_other_peaks(level: Floats, neighbours: sp.csr_array) -> float:
    """Mean of the local maxima of ``level`` other than the global one; zero when there is none."""
    rows = np.repeat(np.arange(len(level)), np.diff(neighbours.indptr))
    highest = np.full(len(level), -np.inf)
    np.maximum.at(highest, rows, level[neighbours.indices])
    peaks = (level > highest) & np.isfinite(highest)
    peaks[level.argmax()] = False
    return float(level[peaks].mean()) if peaks.any() else 0.0


def _nearest(points: Floats, count: int) -> Ints:
    """The ``count`` nearest other points (n, count) by index, nearest first."""
    import open3d as o3d

    search = o3d.core.nns.NearestNeighborSearch(o3d.core.Tensor(points), o3d.core.int64)
    search.knn_index()
    found, _ = search.knn_search(o3d.core.Tensor(points), count + 1)
    found = found.numpy()
    itself = found == np.arange(len(points))[:, None]
    itself[~itself.any(axis=1), -1] = True  # a coincident point may push the point itself off its own list
    return found[~itself].reshape(len(points), count)
