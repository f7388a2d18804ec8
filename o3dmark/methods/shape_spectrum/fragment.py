"""Reading a fragment of a marked mesh when its cover is at hand: the informed reader of shape-spectrum.

    fragment -> poses on the cover -> correspondences -> least squares: which change of the projections? -> bits

The embedding moves every vertex of the cover along its normal by a combination of K known functions, so a fragment
that shows part of the surface shows part of each. With the cover moved as far as is known, the distance d of a point
of the fragment to it is, to first order,

    d = sum_j F_j c_j - (residual motion of the fragment: 7) + (smoothing: 3, where it shows) + noise

with c the change of the projections still to be explained. Robust least squares, repeated with the cover moved on, ends
with d without curvature errors and with the information H that the fragment has about c. The less of the surface there
is the worse H is conditioned, but c is not arbitrary: it takes the projections to codewords, a lattice, and is small.
The bits are those of the lattice's points that fit best, by H and by what the change costs, weighed together.

Only distances are used, and nothing but the fragment and the unmarked cover is seen; what is missing stays missing.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from o3dmark.arrays import Floats, Ints
from o3dmark.mesh import fragments, geometry, similarity
from o3dmark.mesh.proximity import closest_points
from o3dmark.mesh.surface import Surface
from o3dmark.methods import Extraction
from o3dmark.methods.shape_spectrum.embedder import Cover
from o3dmark.methods.shape_spectrum.lattice import Lattice
from o3dmark.received import View, views

# Measured on ten fragments of bimba, rocker_arm_10044 and gargoyle_10002, 10 to 100 % of the surface, after noise to
# 1 %, 30 and 50 passes of smoothing, 7 bits or simplification to a tenth: all 64 bits of nine are read, in 1.1 s each.
# From _MAX_DISTANCE on, on six of them, of which five are read. "Lost" are those that are no longer read in full.
_MOST_VIEWS = 6  # that are laid on the cover, each in some seconds
_CERTAIN = 0.5  # mean of the soft bits' magnitudes above which no other view is looked at
_MAX_POINTS = 60_000  # of the fragment that are used at most, for speed: the fragments measured have fewer
_FEW_POINTS = 4_000  # to choose a pose by: 1 000 and 2 000 chose as well (two fragments of cup, 15 to 19 poses)
_ROUNDS = 6  # of correspondences: 3 and 12 lost none, in 0.8 s and 1.5 s each; with 3 the odds were a little lower
_REWEIGHTED = 3  # of weights in each: 1 lost one, 6 none
_MAX_DISTANCE = 0.01  # over the diagonal: points further off the cover are not of it; 0.005 and 0.02 lost none
_MIN_COSINE = 0.3  # least, between the normals of a point and of its counterpart: 0.6 and no limit lost none
_MIN_NOISE = 1e-6  # over the diagonal, less is not believed: 1e-7 and 1e-5 are the same
_MIN_INSIDE = 1e-6  # least barycentric coordinate off the edges: 1e-9 to 1e-3 are the same
_MODE_PASSES = (3, 10, 40)  # umbrella smoothings combined to allow for any: (10,) lost one, 100 more lost none
_MODE_STRENGTH = 0.1  # of their passes: 0.05 and 0.2 lost none
_MODE_STD = 2.0  # how much of each mode is expected: 0.5 to 20 lost none
_SOFT_LIMIT = 3.0  # residuals, in standard deviations, at which the weight is a quarter: 1.5 lost one, 6 none
_CODEWORD_STD = 0.03  # RMS distance, in steps, of a value from its codeword: 0 lost one, 0.015 and 0.06 none
_MIN_POINTS = 1  # a parameter, or nothing is read: 1.3 told all 64 bits of bimba, 1.5 of gargoyle, 0.8 of neither


def read_beside(received: Surface, cover: Cover, steps: Floats, n_bits: int) -> Extraction:
    """What `read_fragment` reads of ``received`` or, where that lies nowhere on the cover, of what it may be taken for.

    All views that could have been looked at are charged.
    """
    best: Extraction | None = None
    for number, view in enumerate(_beside(received)):
        found = replace(read_fragment(view.surface, cover, steps, n_bits), part=view.name).times(_MOST_VIEWS)
        if best is None or found.certainty > best.certainty:
            best = found
        if best.certainty > _CERTAIN or number + 1 == _MOST_VIEWS:
            break
    assert best is not None
    return best


def _beside(received: Surface) -> Iterator[View]:
    """The views in which a fragment may lie on a cover: pieces, the outermost, what is seen, not how it is wound."""
    return (view for view in views(received) if not view.surface.as_wound)


def read_fragment(received: Surface, cover: Cover, steps: Floats, n_bits: int) -> Extraction:
    """The bits of ``received``, a part of the marked ``cover`` in any pose and scale, mirror images excepted.

    ``steps`` (s,) are those that the writer may have used. Soft bits in -1 .. 1; of zero, with a note, where the
    fragment lies nowhere on the cover. Errors: MeshError as for marking the cover.
    """
    poses = fragments.poses(received, cover.surface)
    tried = 2 * max(1, len(poses)) * len(steps)  # twice: smoothed, or not
    model, points = _CoverModel(cover, steps), _Points.of(received)
    fit = _best_fit(model, points, poses)
    if fit is None:
        return Extraction(np.zeros(n_bits), tried, view="lies nowhere on the cover")
    values = model.cover.project(model.cover.moved(fit.change))
    readings = [_decoded(model, fit, values, step) for step in steps]
    best = max(range(len(steps)), key=lambda i: readings[i].evidence)
    soft = np.tanh(readings[best].log_odds.reshape(-1, n_bits).sum(axis=0) / 2.0)
    view = f"aligned with the cover, {fit.noise / model.surface.diagonal:.1e} of its diagonal off"
    residual = fit.noise / model.surface.diagonal
    return Extraction(soft, tried, view=view, step=float(steps[best]), residual=residual)


class _CoverModel:
    """The cover, how smoothing would move it (``modes``), and how large changes are to be expected."""

    def __init__(self, cover: Cover, steps: Floats) -> None:
        self.cover, self.surface, self.normals = cover, cover.surface, cover.normals
        self.modes = np.array([self._smoothed(passes) for passes in _MODE_PASSES])  # (s, n), along the normals
        self.step = float(np.median(steps))
        t = np.random.default_rng(0).random((4, len(cover.values)))
        self._size = float(np.mean([cover.lattice.closest(row).cost[0] for row in t]))  # for a step of one

    def _smoothed(self, passes: int) -> Floats:
        """How far umbrella smoothing carries each vertex along its normal (n,)."""
        vertices = self.surface.vertices
        for _ in range(passes):
            vertices = vertices + _MODE_STRENGTH * (self.surface.neighbour_mean @ vertices - vertices)
        return np.einsum("nd,nd->n", vertices - self.surface.vertices, self.normals)

    def answers(self, corners: Ints, ways: Floats) -> Floats:
        """Change (q, K) of q values, each the sum of the motions of three vertices (q, 3) along vectors (q, 3, 3)."""
        along = geometry.motions_along(corners, ways, len(self.surface.vertices))
        return np.asarray(along @ self.cover.directions @ self.cover.basis.T)

    def prior(self, step: float) -> Floats:
        """The inverse (K, K) of the covariance of the changes to be expected at a step: Q times K over their size."""
        return np.asarray(self.cover.metric * len(self.cover.values) / (self._size * step**2))


class _Points(NamedTuple):
    """What is used of a fragment: positions (q, 3) and unit normals (q, 3)."""

    positions: Floats
    normals: Floats

    @classmethod
    def of(cls, received: Surface) -> "_Points":
        """The vertices off the boundary, which a cut or a simplification moves; a sample where they are many."""
        inner = ~geometry.boundary_vertices(received.triangles, len(received.vertices))
        return cls(received.vertices[inner], received.normals[inner]).thinned(_MAX_POINTS)

    def thinned(self, count: int) -> "_Points":
        some = np.random.default_rng(0).permutation(len(self.positions))[:count]
        return _Points(self.positions[some], self.normals[some])

    def aligned(self, pose: Floats) -> "_Points":
        """As moved by a similarity (4, 4)."""
        turn = pose[:3, :3] / np.cbrt(np.linalg.det(pose[:3, :3]))
        return _Points(similarity.apply(pose, self.positions), self.normals @ turn.T)


class _Fit(NamedTuple):
    """The change (K,) that explains a fragment best, its gradient and information there, and the noise.

    A change c costs (c - change)' information (c - change) - 2 gradient' (c - change), minus twice the log likelihood.
    """

    change: Floats
    gradient: Floats
    information: Floats
    noise: float


def _best_fit(model: _CoverModel, points: _Points, poses: list[Floats]) -> _Fit | None:
    """The fit in the pose where the mark explains most; with smoothing if that explains more. None: in no pose."""
    if len(poses) > 1:
        few = points.thinned(_FEW_POINTS)
        noise = [fit.noise if (fit := _fitted(model, few, pose, model.modes)) else np.inf for pose in poses]
        poses = [poses[int(np.argmin(noise))]]
    tried = (_fitted(model, points, pose, modes) for pose in poses for modes in (model.modes[:0], model.modes))
    return min((fit for fit in tried if fit), key=lambda fit: fit.noise, default=None)


def _fitted(model: _CoverModel, points: _Points, pose: Floats, modes: Floats) -> _Fit | None:
    """Least squares from a first ``pose`` (4, 4), allowing for ``modes`` (s, n) of smoothing, along the normals.

    None where too few points lie on the cover.
    """
    K, size = len(model.cover.values), model.surface.diagonal
    others = np.diag([0.0] * 7 + [_MODE_STD**-2.0] * len(modes))
    change, prior, fit = np.zeros(K), block_diag(model.prior(model.step), others), None
    for _ in range(_ROUNDS):
        found = _correspondences(model, change, points.aligned(pose), modes)
        if len(found.d) < _MIN_POINTS * len(prior):
            return None
        A = np.concatenate([found.functions, -found.motions, found.modes], axis=1)
        x, before = np.zeros(len(prior)), np.pad(change, (0, len(others)))
        for _ in range(_REWEIGHTED):
            residual = found.d - A @ x
            noise = max(1.4826 * float(np.median(np.abs(residual))), _MIN_NOISE * size)
            weighted = A.T * ((1.0 + (residual / (_SOFT_LIMIT * noise)) ** 2) ** -2.0 / noise**2)
            N = weighted @ A
            x = np.linalg.solve(N + prior, weighted @ found.d - prior @ before)
        change = change + x[:K]
        pose = similarity.small(x[K : K + 7], found.centre) @ pose
        N[K:, K:] += others
        fit = _Fit(change, *_schur_complement(N, weighted @ (found.d - A @ x), K), noise)
    return fit


def _schur_complement(N: Floats, gradient: Floats, K: int) -> tuple[Floats, Floats]:
    """Gradient (K,) and information (K, K) about the first K unknowns when the others are anything."""
    taken = np.linalg.solve(N[K:, K:], N[K:, :K])
    return gradient[:K] - taken.T @ gradient[K:], N[:K, :K] - N[:K, K:] @ taken


class _Correspondences(NamedTuple):
    """What the points of an aligned fragment show: signed distances d (q,) to the cover as moved so far.

    And how these answer: functions (q, K) to the change, motions (q, 7) to moving the fragment about ``centre`` (3,),
    modes (q, s) to smoothing.
    """

    d: Floats
    functions: Floats
    motions: Floats
    modes: Floats
    centre: Floats


def _correspondences(model: _CoverModel, change: Floats, aligned: _Points, modes: Floats) -> _Correspondences:
    """Distances of those of the aligned points that have a counterpart on the cover as moved by ``change``."""
    surface = model.surface.moved(model.cover.moved(change))
    near = closest_points(aligned.positions, surface)
    offset, corners = aligned.positions - near.point, surface.triangles[near.triangle]
    share = geometry.barycentric(near.point, surface.vertices[corners])
    face = geometry.unit(geometry.area_vectors(surface.vertices, surface.triangles))[near.triangle]
    normal = _directions(offset, share, face, surface.normals[corners], 1e-9 * surface.diagonal)
    kept = near.distance < _MAX_DISTANCE * surface.diagonal
    kept &= np.einsum("qd,qd->q", aligned.normals, face) > _MIN_COSINE
    kept &= model.cover.solid.movable[corners].all(axis=1)
    normal, corners, points = normal[kept], corners[kept], aligned.positions[kept]
    ways = share[kept][:, :, None] * normal[:, None, :]  # how the distance of a point answers to its triangle's corners
    smoothing = np.einsum("qc,qck->qk", np.einsum("qcd,qcd->qc", model.normals[corners], ways), modes.T[corners])
    functions = model.answers(corners, ways)
    centre = points.sum(axis=0) / max(1, len(points))
    motions = similarity.motions(points - centre, normal)
    return _Correspondences(np.einsum("qd,qd->q", offset[kept], normal), functions, motions, smoothing, centre)


def _directions(offset: Floats, share: Floats, face: Floats, corner: Floats, least: float) -> Floats:
    """Along which distances are taken (q, 3): the face's normal, or beyond its edges the way from it to the point.

    ``share`` (q, 3) tells where in the face the closest point is, ``corner`` (q, 3, 3) has the normals at its corners:
    where a point lies on an edge, ``least`` apart or less, its way is theirs.
    """
    smooth = geometry.unit(np.einsum("qc,qcd->qd", share, corner))
    way = geometry.unit(offset)
    slope = np.einsum("qd,qd->q", way, smooth)[:, None]
    clear = (np.abs(slope) > 0.5) & (np.linalg.norm(offset, axis=1, keepdims=True) > least)
    beyond = np.where(clear, way * np.sign(slope), smooth)
    return np.where(share.min(axis=1, keepdims=True) > _MIN_INSIDE, face, beyond)


class _Decoded(NamedTuple):
    """For each projection the log odds (K,) of bit 1 against 0, and the log evidence for the step."""

    log_odds: Floats
    evidence: float


def _decoded(model: _CoverModel, fit: _Fit, values: Floats, step: float) -> _Decoded:
    """The lattice of a ``step`` searched; ``values`` (K,) are the projections at the change that was fitted."""
    h, V = np.linalg.eigh(fit.information)
    h = np.maximum(h, 1e-14 * h[-1])
    slack = (_CODEWORD_STD * step) ** 2
    blurred = (V * (h / (1.0 + slack * h))) @ V.T  # information about the codeword, from which the value strays
    best = fit.change + V @ ((V.T @ fit.gradient) / h)
    prior = model.prior(step)
    M = blurred + prior
    change = np.linalg.solve(M, blurred @ best)
    rest = change @ prior @ change + (best - change) @ blurred @ (best - change)
    t = 2.0 * ((values + change - fit.change) / step - model.cover.projections.dither)
    found = Lattice(M * step**2 / 4.0).closest(t)
    odd = found.z % 2 == 1
    cost = np.stack([_least(found.cost, ~odd), _least(found.cost, odd)])
    evidence = 0.5 * (np.log(h / (1.0 + slack * h)).sum() - rest - found.cost[0])
    return _Decoded(0.5 * (cost[0] - cost[1]), float(evidence))


def _least(cost: Floats, which: np.ndarray) -> Floats:
    """Least cost (K,) among the candidates of each column of ``which`` (c, K); the largest cost where none is."""
    return np.asarray(np.where(which, cost[:, None], cost[-1]).min(axis=0))
