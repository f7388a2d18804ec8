"""Where on a whole surface a fragment of it belongs, from any pose and scale.

    even samples -> FPFH features -> pairs of matches that agree -> poses -> iterated closest points with scale

A pair of points with normals, and its image, fix a similarity. Features need a radius, hence a scale, so several
guesses of the share of the whole's area that the fragment covers are tried. Everything random is seeded: same meshes,
same answer. The door to Open3D's features (FPFH: Rusu, Blodow, Beetz, ICRA 2009).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy

from o3dmark.arrays import Floats, Ints
from o3dmark.mesh import geometry, sampling, similarity
from o3dmark.mesh.proximity import closest_points
from o3dmark.mesh.surface import Surface, point_cloud

# "Placed" below: of eleven fragments, 5 to 50 % of bimba, rocker_arm_10044, gargoyle_10002 and cup, also after noise of
# 0.5 % or 30 passes of smoothing, scaled by 0.2 to 5, those that came within 0.6 % of the diagonal (cup, nearly round:
# 2.5 %; its mark was lost at 3 %). With these values all do, in 29 s together.
_SAMPLES = 4000  # on the whole, as densely on the fragment: 2 000 placed 8 in 17 s, 8 000 all in 51 s
_NORMAL_RADIUS = 3.0  # this and the lengths below in mean distances between samples: 2 and 5 placed 10
_FEATURE_RADIUS = 7.0  # 5 and 10 placed all
_MIN_LENGTH = 14.0  # of a pair, whose ends then differ in what is around them: 7 placed 10, 20 all
_SHARES = 0.95 / 1.44 ** np.arange(9.0)  # guesses, to a twentieth of the whole: in steps of 1.2 or 2.07 all were placed
_SCALE_RATIO = 1.15  # by which the scale may differ from that of a guess: 1.07 to 1.3 placed all
_SHARE_RATIO = 1.2  # a guess further off is made again: 1.001 to 1.45 are the same; never again placed 10, in 21 s
_MIN_SHARE = 0.03  # of the whole: 0.06 placed 9; 2 of 5 strangers were placed, with no limit 3, each shrunk to a spot
_QUERIES = 1500  # features looked up: 500 and 3 000 placed all
_MATCHES = 4  # kept for each: 2 placed 10, 8 all
_PAIRS = 150_000  # of matches, drawn: 50 000 and 300 000 placed all
_MAX_CANDIDATES = 3000  # scored: 1 000 and 6 000 placed all
_MAX_REFINED = 64  # 16 placed 10 in 25 s, 32 all in 27 s, 128 all in 32 s
_MAX_POSES = 32  # refined further and returned: 8 and 16 placed 10, as a crop of the cup fits in 19 ways; 64 all
_MAX_MISMATCH = 0.2  # of the cosines within a pair and within its image: 0.1 and 0.4 placed all, no limit all in 32 s
_STEPS = 5  # of iterated closest points to the exact surface: 2 placed 10, 3 and 10 all
_NEAR = 4e-3  # over the diagonal, from point to whole: 2e-3 took 6 s for a smoothed part, not 2; 8e-3 placed strangers
_MAX_OUTLIERS = 0.5  # share of the points further off: 0.25 placed all, 0.8 placed 2 of 2 strangers too
_FEW_OUTLIERS = 0.1  # for the guesses to end: 0.03 placed all, 0.2 placed 10
_DETAIL = 2e-4  # below it all are alike: 1e-4 to 1e-3 are the same; with 0 an exact half of cup fits in 1 way, not 17
_WORSE_OUTLIERS = 0.05  # than the best pose's, a difference: 0.02 to 0.4 are the same
_WORSE_DISTANCE = 1.6  # than the best pose's, a factor: 1 placed 10, 1.2 to 20 all

# None of these matters much: with any of them halved or doubled (cosines: 0 and 0.7, 0.4 and 0.9; the score: 0.5 and
# 0.95) the same ten of another eleven fragments of the four meshes were placed, in 24 to 35 s together, and not 29.
_MIN_COSINE_AVERAGED = 0.3  # between normals that are averaged: those across a thin wall are not
_THINNED = (120, 500, 1500)  # samples of the fragment that candidates are sorted by, moved by, chosen by
_REACH_FIRST, _REACH_LAST = 4.0, 1.5  # mean distances within which a sample counts, when sorted and when chosen
_APART_FIRST, _APART_LAST = 5.0, 1.5  # mean distances between two poses, below which they are one
_MIN_SCORE = 0.8  # of the best: others are not refined
_MIN_COSINE = 0.7  # between the normals of a sample and of what it lies on
_REACHES = (8.0, 6.0, 5.0, 4.0, 3.0, 3.0, 2.0, 2.0, 2.0)  # mean distances, step by step of iterated closest points
_MIN_HITS = 30  # samples within reach, or the pose stays as it is
_REFINED_BY = 600  # samples, at the exact surface
_MEDIANS_USED, _MEDIANS_SOFT = 3.0, 2.0  # median distances: beyond, a sample is left out; at, its weight is a half


def poses(fragment: Surface, whole: Surface) -> list[Floats]:
    """The similarities (4, 4) that align ``fragment`` with ``whole``, best first; none when it belongs nowhere.

    Several where the shape repeats itself. Unmirrored; both surfaces wound alike. Exact to about the size of the
    details that differ: finish with a fit of what is known of them.
    """
    unit = float(np.sqrt(whole.area / _SAMPLES))
    target = _Cloud.of(whole, _SAMPLES, unit)
    found: list[_Pose] = []
    for guess in _SHARES:
        found += _by_features(fragment, whole, target, guess)
        best = min(found, key=lambda pose: pose.outlier_share, default=None)
        if best and best.outlier_share < _FEW_OUTLIERS:
            share = _share(best, fragment, whole)
            if not 1.0 / _SHARE_RATIO < share / guess < _SHARE_RATIO:  # a poor guess finds few of the poses
                found = [*_by_features(fragment, whole, target, share), best]
            break
    few = fragment.vertices[:: 1 + len(fragment.vertices) // 100]
    return _ambiguous(found, few, _APART_LAST * unit, _DETAIL * whole.diagonal)


class _Pose(NamedTuple):
    """A similarity (4, 4), the share of the fragment that is far from the whole then, the median distance of all."""

    matrix: Floats
    outlier_share: float
    median_distance: float


@dataclass(frozen=True, eq=False)
class _Cloud:
    """Even samples of a surface: points (n, 3), unit normals (n, 3), and the ``unit`` of length, their distance."""

    points: Floats
    normals: Floats
    unit: float

    @classmethod
    def of(cls, surface: Surface, count: int, unit: float) -> "_Cloud":
        """``count`` points spread by area, at random within triangles; normals are means over a ball."""
        points, triangle = sampling.stratified(surface, count, np.random.default_rng(0))
        normals = geometry.unit(geometry.area_vectors(surface.vertices, surface.triangles)[triangle])
        tree = scipy.spatial.cKDTree(points)
        near = tree.sparse_distance_matrix(tree, _NORMAL_RADIUS * unit, output_type="coo_matrix")
        same = np.einsum("nd,nd->n", normals[near.row], normals[near.col]) > _MIN_COSINE_AVERAGED
        total = normals.copy()
        np.add.at(total, near.row[same], normals[near.col[same]])
        return cls(points, geometry.unit(total), unit)

    def thinned(self, count: int) -> "_Cloud":
        """``count`` of the samples, or all."""
        some = np.random.default_rng(2).permutation(len(self.points))[:count]
        return _Cloud(self.points[some], self.normals[some], self.unit)

    @cached_property
    def tree(self) -> "scipy.spatial.cKDTree":
        return scipy.spatial.cKDTree(self.points)

    @cached_property
    def features(self) -> Floats:
        """Fast point feature histograms (n, 33), each of unit length."""
        import open3d as o3d

        cloud = point_cloud(self.points / self.unit, self.normals)
        search = o3d.geometry.KDTreeSearchParamHybrid(_FEATURE_RADIUS, 400)
        histograms = np.asarray(o3d.pipelines.registration.compute_fpfh_feature(cloud, search).data).T
        return geometry.unit(np.sqrt(histograms))


def _by_features(fragment: Surface, whole: Surface, target: _Cloud, share: float) -> list[_Pose]:
    """The poses of a fragment that covers a ``share`` of the whole's area, of which ``target`` are samples."""
    scale = float(np.sqrt(share * whole.area / fragment.area))
    source = _Cloud.of(fragment, round(share * _SAMPLES), target.unit / scale)
    likely = _shortlisted(_candidates(source, target, scale), source, target)
    aligned = [pose for pose in _refined(likely, source, whole) if pose.outlier_share < _MAX_OUTLIERS]
    return [pose for pose in aligned if _share(pose, fragment, whole) > _MIN_SHARE]


def _share(pose: _Pose, fragment: Surface, whole: Surface) -> float:
    """The area of an aligned fragment over that of the whole."""
    return fragment.area * float(np.linalg.det(pose.matrix[:3, :3])) ** (2.0 / 3.0) / whole.area


class _Pairs(NamedTuple):
    """Pairs of points with normals: one end and the other, positions (p, 3) and unit normals (p, 3)."""

    one: Floats
    other: Floats
    one_normal: Floats
    other_normal: Floats

    @classmethod
    def of(cls, cloud: _Cloud, i: Ints, j: Ints) -> "_Pairs":
        return cls(cloud.points[i], cloud.points[j], cloud.normals[i], cloud.normals[j])

    def only(self, which: Ints) -> "_Pairs":
        return _Pairs(*(column[which] for column in self))

    @property
    def length(self) -> Floats:
        return np.asarray(np.linalg.norm(self.other - self.one, axis=1))

    @property
    def invariants(self) -> Floats:
        """What similarities leave of a pair: three cosines and a volume (p, 4)."""
        along = geometry.unit(self.other - self.one)
        volume = np.einsum("pd,pd->p", along, np.cross(self.one_normal, self.other_normal))
        two = ((along, self.one_normal), (along, self.other_normal), (self.one_normal, self.other_normal))
        return np.stack([*(np.einsum("pd,pd->p", x, y) for x, y in two), volume], axis=1)

    @property
    def axes(self) -> Floats:
        """Right-handed axes (p, 3, 3), in columns: along the pair, towards its normals, across."""
        x, normal = geometry.unit(self.other - self.one), self.one_normal + self.other_normal
        y = geometry.unit(normal - np.einsum("pd,pd->p", normal, x)[:, None] * x)
        return np.stack([x, y, np.cross(x, y)], axis=2)


def _candidates(source: _Cloud, target: _Cloud, scale: float) -> Floats:
    """Similarities (h, 4, 4) from pairs of matched points whose distances and normals agree; ``scale`` is a guess."""
    here, there = _matched(source, target)
    long = here.length
    ratio = there.length / np.maximum(scale * long, 1e-300)
    good = (long > _MIN_LENGTH * source.unit) & (ratio < _SCALE_RATIO) & (ratio > 1.0 / _SCALE_RATIO)
    here, there = here.only(np.flatnonzero(good)), there.only(np.flatnonzero(good))
    mismatch = np.abs(here.invariants - there.invariants).max(axis=1)
    best = np.argsort(mismatch, kind="stable")[:_MAX_CANDIDATES]
    best = best[mismatch[best] < _MAX_MISMATCH]
    found = _carrying(here.only(best), there.only(best))
    return found[np.linalg.det(found[:, :3, :3]) > 0.0]  # normals along the pair leave it without axes


def _matched(source: _Cloud, target: _Cloud) -> tuple[_Pairs, _Pairs]:
    """Random pairs of samples, and of samples with similar features."""
    rng = np.random.default_rng(1)
    asked = rng.permutation(len(source.points))[:_QUERIES]
    likeness = source.features[asked] @ target.features.T
    matches = np.argpartition(-likeness, _MATCHES, axis=1)[:, :_MATCHES]
    i, j = rng.integers(len(asked), size=(2, _PAIRS))
    a, b = matches[i, rng.integers(_MATCHES, size=_PAIRS)], matches[j, rng.integers(_MATCHES, size=_PAIRS)]
    return _Pairs.of(source, asked[i], asked[j]), _Pairs.of(target, a, b)


def _carrying(here: _Pairs, there: _Pairs) -> Floats:
    """The similarities (p, 4, 4) that carry one pair to the other."""
    matrix = np.tile(np.eye(4), (len(here.one), 1, 1))
    turn = there.axes @ here.axes.transpose(0, 2, 1)
    matrix[:, :3, :3] = (there.length / here.length)[:, None, None] * turn
    middle = np.einsum("pij,pj->pi", matrix[:, :3, :3], here.one + here.other)
    matrix[:, :3, 3] = 0.5 * (there.one + there.other - middle)
    return matrix


def _shortlisted(candidates: Floats, source: _Cloud, target: _Cloud) -> Floats:
    """The best (r, 4, 4) of many candidates (h, 4, 4), all distinct, after iterated closest points among samples."""
    few, some, many = (source.thinned(count) for count in _THINNED)
    candidates = candidates[np.argsort(-_scores(candidates, few, target, _REACH_FIRST), kind="stable")]
    candidates = _distinct(candidates, few.points, _APART_FIRST * target.unit, _MAX_REFINED)
    candidates = np.array([_icp(pose, some, target) for pose in candidates]).reshape(-1, 4, 4)
    score = _scores(candidates, many, target, _REACH_LAST)
    order = np.argsort(-score, kind="stable")
    order = order[score[order] > _MIN_SCORE * score.max(initial=0.0)]
    return _distinct(candidates[order], few.points, _APART_LAST * target.unit, _MAX_POSES)


def _scores(candidates: Floats, source: _Cloud, target: _Cloud, reach: float) -> Floats:
    """Share (h,) of samples that each pose brings near the other cloud, ``reach`` units at most, facing alike."""
    turn = candidates[:, :3, :3]
    moved = np.einsum("hij,nj->hni", turn, source.points) + candidates[:, None, :3, 3]
    facing = np.einsum("hij,nj->hni", turn / np.cbrt(np.linalg.det(turn))[:, None, None], source.normals)
    distance, at = target.tree.query(moved, distance_upper_bound=reach * target.unit)
    normal = target.normals[np.where(np.isfinite(distance), at, 0)]
    return np.mean(np.isfinite(distance) & (np.einsum("hni,hni->hn", facing, normal) > _MIN_COSINE), axis=1)


def _distinct(candidates: Floats, points: Floats, apart: float, most: int) -> Floats:
    """The first ``most`` poses, without those that bring ``points`` within ``apart`` (RMS) of where an earlier does."""
    kept: list[Floats] = []
    images = np.empty((0, *points.shape))
    for pose in candidates:
        image = similarity.apply(pose, points)
        if np.all(np.mean(np.sum((images - image) ** 2, axis=2), axis=1) > apart**2):
            kept.append(pose)
            images = np.concatenate([images, image[None]])
        if len(kept) == most:
            break
    return np.array(kept).reshape(-1, 4, 4)


def _icp(pose: Floats, source: _Cloud, target: _Cloud) -> Floats:
    """Point-to-plane iterated closest points with scale, the reach shrinking round by round."""
    for reach in _REACHES:
        moved = similarity.apply(pose, source.points)
        distance, at = target.tree.query(moved, distance_upper_bound=reach * target.unit)
        hit = np.isfinite(distance)
        if hit.sum() < _MIN_HITS:
            break
        normal = target.normals[at[hit]]
        gap = np.einsum("nd,nd->n", target.points[at[hit]] - moved[hit], normal)
        pose = similarity.step_along(moved[hit], normal, gap, np.ones(hit.sum())) @ pose
    return pose


def _refined(likely: Floats, source: _Cloud, whole: Surface) -> list[_Pose]:
    """Poses (r, 4, 4) after point-to-plane steps to the exact surface."""
    points, limit = source.thinned(_REFINED_BY).points, _NEAR * whole.diagonal
    faces = geometry.unit(geometry.area_vectors(whole.vertices, whole.triangles))
    refined = [_Pose(matrix, 1.0, np.inf) for matrix in likely]
    for _ in range(_STEPS if len(refined) else 0):
        moved = np.array([similarity.apply(pose.matrix, points) for pose in refined])
        near = closest_points(moved.reshape(-1, 3), whole)
        normals = faces[near.triangle].reshape(moved.shape)
        offsets, distances = near.point.reshape(moved.shape) - moved, near.distance.reshape(len(refined), -1)
        refined = [
            _stepped(pose, moved[i], normals[i], offsets[i], distances[i], limit) for i, pose in enumerate(refined)
        ]
    return refined


def _stepped(pose: _Pose, moved: Floats, normals: Floats, offsets: Floats, distances: Floats, limit: float) -> _Pose:
    """One such step, by the points within ``limit`` or three median distances, those far off counting little."""
    outlier_share, median_distance = float(np.mean(distances > limit)), float(np.median(distances))
    used = distances < max(limit, _MEDIANS_USED * median_distance)
    gap = np.einsum("nd,nd->n", offsets[used], normals[used])
    weight = 1.0 / (1.0 + (gap / (_MEDIANS_SOFT * median_distance + 1e-300)) ** 2)
    step = similarity.step_along(moved[used], normals[used], gap, weight)
    return _Pose(step @ pose.matrix, outlier_share, median_distance)


def _ambiguous(found: list[_Pose], points: Floats, apart: float, detail: float) -> list[Floats]:
    """The similarities that fit about as well as the best, nearest first, and bring ``points`` ``apart``.

    Median distances below ``detail`` are taken for it.
    """
    best = min((pose.outlier_share for pose in found), default=1.0)
    near = sorted((p for p in found if p.outlier_share < best + _WORSE_OUTLIERS), key=lambda p: p.median_distance)
    good = [p.matrix for p in near if p.median_distance <= _WORSE_DISTANCE * max(near[0].median_distance, detail)]
    return list(_distinct(np.reshape(good, (-1, 4, 4)), points, apart, _MAX_POSES))
