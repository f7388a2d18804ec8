"""Where on a whole surface a fragment of it belongs, from any pose and scale.

    even samples -> FPFH features -> pairs of matches that agree -> poses -> iterated closest points with scale

A pair of points with normals, and its image, fix a similarity. Features need a radius, hence a scale: guesses of the
share of the whole's area that the fragment covers are gone through. Everything random is seeded: same meshes, same
answer. The door to Open3D's features (FPFH: Rusu, Blodow, Beetz, ICRA 2009).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import open3d as o3d
from scipy.spatial import cKDTree

from o3dmark.arrays import Floats, Ints
from o3dmark.mesh import geometry
from o3dmark.mesh.proximity import closest_points
from o3dmark.mesh.registration import apply, step_along
from o3dmark.mesh.surface import Surface, point_cloud

_SAMPLES = 4000  # on the whole, and as densely on the fragment: lengths below are in mean distances between samples
_LEAST_SAMPLES = 300
_NORMAL_RADIUS, _FEATURE_RADIUS = 3.0, 7.0
_APART = 14.0  # least length of a pair
_SHARES = 0.95 / 1.44 ** np.arange(9.0)  # of the whole's area, as guesses: from all of it down to a twentieth
_SMALLEST, _LARGEST = 0.03, 2.0  # shares believed: shrunk to a spot, anything lies anywhere
_NEARLY = 1.2  # a factor by which a share may be off
_REACH = 1.15  # a factor within which the scale may differ from that of a guess
_QUERIES, _MATCHES, _PAIRS = 1500, 4, 150_000  # features looked up, matches kept for each, pairs of matches drawn
_POSES, _REFINED, _RIVALS = 3000, 64, 32  # poses scored; refined; and returned at most
_TURNED = 0.2  # difference of the cosines in a pair and its image below which they agree
_STEPS = 5  # of iterated closest points to the exact surface
_CLOSE = 4e-3  # distance over the diagonal at which a point of a laid fragment counts as lying on the whole
_LIES, _SURE = 0.5, 0.9  # share of such points needed; and for the guesses to end
_DETAIL = 2e-4  # over the diagonal: misfits below it do not tell a place from another
_WORSE_OFF, _WORSE = 0.05, 1.6  # how much worse than the best a place may be: in that share, and in misfit, a factor


def places(fragment: Surface, whole: Surface) -> list[Floats]:
    """The similarities (4, 4) that lay ``fragment`` on ``whole``, best first; none when it belongs nowhere.

    Several where the shape repeats itself. Unmirrored; both surfaces wound alike. To about the size of the details
    that differ: finish with a fit of what is known of them.
    """
    unit = float(np.sqrt(whole.area / _SAMPLES))
    target = _Cloud.of(whole, _SAMPLES, unit)
    found: list[_Place] = []
    for guess in _SHARES:
        found += _by_features(fragment, whole, target, guess)
        best = min(found, key=lambda place: place.off, default=None)
        if best and best.off < 1.0 - _SURE:
            share = _share(best, fragment, whole)
            if not 1.0 / _NEARLY < share / guess < _NEARLY:  # a poor guess finds few of the places
                found = [*_by_features(fragment, whole, target, share), best]
            break
    few = fragment.vertices[:: 1 + len(fragment.vertices) // 100]
    return _rivals(found, few, 1.5 * unit, _DETAIL * whole.diagonal)


class _Place(NamedTuple):
    """A similarity (4, 4), the share of the fragment that it leaves off the whole, and how far the rest is off."""

    matrix: Floats
    off: float
    misfit: float


@dataclass(frozen=True, eq=False)
class _Cloud:
    """Even samples of a surface: points (n, 3), unit normals (n, 3), and the ``unit`` of length, their distance."""

    points: Floats
    normals: Floats
    unit: float

    @classmethod
    def of(cls, surface: Surface, count: int, unit: float) -> "_Cloud":
        """``count`` points spread by area, at random within triangles; normals are means over a ball."""
        rng = np.random.default_rng(0)
        vectors = geometry.area_vectors(surface.vertices, surface.triangles)
        heap = np.cumsum(np.linalg.norm(vectors, axis=1))
        place = (np.arange(count) + rng.random(count)) * heap[-1] / count
        triangle = np.minimum(np.searchsorted(heap, place), len(heap) - 1)
        a, b = np.sqrt(rng.random(count)), rng.random(count)
        weight = np.stack([1.0 - a, a * (1.0 - b), a * b], axis=1)
        points = np.einsum("nc,ncd->nd", weight, surface.vertices[surface.triangles[triangle]])
        normals = geometry.unit(vectors[triangle])
        near = cKDTree(points).sparse_distance_matrix(cKDTree(points), _NORMAL_RADIUS * unit, output_type="coo_matrix")
        same = np.einsum("nd,nd->n", normals[near.row], normals[near.col]) > 0.3
        total = normals.copy()
        np.add.at(total, near.row[same], normals[near.col[same]])
        return cls(points, geometry.unit(total), unit)

    def thinned(self, count: int) -> "_Cloud":
        """``count`` of the samples, or all."""
        some = np.random.default_rng(2).permutation(len(self.points))[:count]
        return _Cloud(self.points[some], self.normals[some], self.unit)

    @cached_property
    def tree(self) -> cKDTree:
        return cKDTree(self.points)

    @cached_property
    def features(self) -> Floats:
        """Fast point feature histograms (n, 33), each of unit length."""
        cloud = point_cloud(self.points / self.unit, self.normals)
        search = o3d.geometry.KDTreeSearchParamHybrid(_FEATURE_RADIUS, 400)
        histograms = np.asarray(o3d.pipelines.registration.compute_fpfh_feature(cloud, search).data).T
        return geometry.unit(np.sqrt(histograms))


def _by_features(fragment: Surface, whole: Surface, target: _Cloud, share: float) -> list[_Place]:
    """Where the fragment may lie if it covers a ``share`` of the whole's area, of which ``target`` are samples."""
    scale = float(np.sqrt(share * whole.area / fragment.area))
    source = _Cloud.of(fragment, max(_LEAST_SAMPLES, round(share * _SAMPLES)), target.unit / scale)
    poses = _refined(_poses(source, target, scale), source, target)
    laid = [place for place in _settled(poses, source, whole) if place.off < 1.0 - _LIES]
    return [place for place in laid if _SMALLEST < _share(place, fragment, whole) < _LARGEST]


def _share(place: _Place, fragment: Surface, whole: Surface) -> float:
    """The area of a laid fragment over that of the whole."""
    return fragment.area * float(np.linalg.det(place.matrix[:3, :3])) ** (2.0 / 3.0) / whole.area


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


def _poses(source: _Cloud, target: _Cloud, scale: float) -> Floats:
    """Similarities (h, 4, 4) from pairs of matched points whose distances and normals agree; ``scale`` is a guess."""
    here, there = _matched(source, target)
    long = here.length
    ratio = there.length / np.maximum(scale * long, 1e-300)
    good = (long > _APART * source.unit) & (ratio < _REACH) & (ratio > 1.0 / _REACH)
    here, there = here.only(np.flatnonzero(good)), there.only(np.flatnonzero(good))
    wrong = np.abs(here.invariants - there.invariants).max(axis=1)
    best = np.argsort(wrong, kind="stable")[:_POSES]
    best = best[wrong[best] < _TURNED]
    return _carrying(here.only(best), there.only(best))


def _matched(source: _Cloud, target: _Cloud) -> tuple[_Pairs, _Pairs]:
    """Random pairs of samples, and of samples that look like them."""
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


def _refined(poses: Floats, source: _Cloud, target: _Cloud) -> Floats:
    """The best (r, 4, 4) of many poses (h, 4, 4), no two alike, after iterated closest points among samples."""
    few, some, many = source.thinned(120), source.thinned(500), source.thinned(1500)
    poses = poses[np.argsort(-_scores(poses, few, target, 4.0), kind="stable")]
    poses = _unlike(poses, few.points, 5.0 * target.unit, _REFINED)
    poses = np.array([_icp(pose, some, target) for pose in poses]).reshape(-1, 4, 4)
    score = _scores(poses, many, target, 1.5)
    order = np.argsort(-score, kind="stable")
    order = order[score[order] > 0.8 * score.max(initial=0.0)]
    return _unlike(poses[order], few.points, 1.5 * target.unit, _RIVALS)


def _scores(poses: Floats, source: _Cloud, target: _Cloud, reach: float) -> Floats:
    """Share (h,) of samples that each pose lays near the other cloud, ``reach`` units at most, facing alike."""
    turn = poses[:, :3, :3]
    moved = np.einsum("hij,nj->hni", turn, source.points) + poses[:, None, :3, 3]
    facing = np.einsum("hij,nj->hni", turn / np.cbrt(np.linalg.det(turn))[:, None, None], source.normals)
    distance, at = target.tree.query(moved, distance_upper_bound=reach * target.unit)
    normal = target.normals[np.where(np.isfinite(distance), at, 0)]
    return np.mean(np.isfinite(distance) & (np.einsum("hni,hni->hn", facing, normal) > 0.7), axis=1)


def _unlike(poses: Floats, points: Floats, apart: float, most: int) -> Floats:
    """The first ``most`` poses, without those that lay ``points`` within ``apart`` (RMS) of an earlier one."""
    kept: list[Floats] = []
    images = np.empty((0, *points.shape))
    for pose in poses:
        image = apply(pose, points)
        if np.all(np.mean(np.sum((images - image) ** 2, axis=2), axis=1) > apart**2):
            kept.append(pose)
            images = np.concatenate([images, image[None]])
        if len(kept) == most:
            break
    return np.array(kept).reshape(-1, 4, 4)


def _icp(pose: Floats, source: _Cloud, target: _Cloud) -> Floats:
    """Point-to-plane iterated closest points with scale, the reach shrinking round by round."""
    for reach in (8.0, 6.0, 5.0, 4.0, 3.0, 3.0, 2.0, 2.0, 2.0):
        moved = apply(pose, source.points)
        distance, at = target.tree.query(moved, distance_upper_bound=reach * target.unit)
        hit = np.isfinite(distance)
        if hit.sum() < 30:
            break
        normal = target.normals[at[hit]]
        gap = np.einsum("nd,nd->n", target.points[at[hit]] - moved[hit], normal)
        pose = step_along(moved[hit], normal, gap, np.ones(hit.sum())) @ pose
    return pose


def _settled(poses: Floats, source: _Cloud, whole: Surface) -> list[_Place]:
    """Poses (r, 4, 4) after point-to-plane steps to the exact surface."""
    points, limit = source.thinned(600).points, _CLOSE * whole.diagonal
    faces = geometry.unit(geometry.area_vectors(whole.vertices, whole.triangles))
    places = [_Place(pose, 1.0, np.inf) for pose in poses]
    for _ in range(_STEPS if len(places) else 0):
        moved = np.array([apply(place.matrix, points) for place in places])
        near = closest_points(moved.reshape(-1, 3), whole)
        normals = faces[near.triangle].reshape(moved.shape)
        offsets, distances = near.point.reshape(moved.shape) - moved, near.distance.reshape(len(places), -1)
        places = [
            _stepped(place, moved[i], normals[i], offsets[i], distances[i], limit) for i, place in enumerate(places)
        ]
    return places


def _stepped(place: _Place, moved: Floats, normals: Floats, offsets: Floats, distances: Floats, limit: float) -> _Place:
    """One such step, of the points within ``limit`` or thrice the misfit, those far off counting little."""
    off, misfit = float(np.mean(distances > limit)), float(np.median(distances))
    used = distances < max(limit, 3.0 * misfit)
    gap = np.einsum("nd,nd->n", offsets[used], normals[used])
    weight = 1.0 / (1.0 + (gap / (2.0 * misfit + 1e-300)) ** 2)
    return _Place(step_along(moved[used], normals[used], gap, weight) @ place.matrix, off, misfit)


def _rivals(found: list[_Place], points: Floats, apart: float, detail: float) -> list[Floats]:
    """The similarities of the best places, the least misfit first, of those that lay ``points`` ``apart``.

    Misfits below ``detail`` are taken for it.
    """
    best = min((place.off for place in found), default=1.0)
    near = sorted((p for p in found if p.off < best + _WORSE_OFF), key=lambda p: p.misfit)
    good = [place.matrix for place in near if place.misfit <= _WORSE * max(near[0].misfit, detail)]
    return list(_unlike(np.reshape(good, (-1, 4, 4)), points, apart, _RIVALS))
