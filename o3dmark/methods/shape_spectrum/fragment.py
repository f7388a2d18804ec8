"""Reading a fragment of a marked mesh when its cover is at hand: the informed reader of shape-spectrum.

    fragment -> laid on the cover -> distances to it -> least squares: which change of the projections? -> bits

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

from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from o3dmark.arrays import Floats
from o3dmark.mesh import geometry, registration
from o3dmark.mesh.fragments import places as places_of
from o3dmark.mesh.proximity import closest_points
from o3dmark.mesh.surface import Surface
from o3dmark.methods import Extraction
from o3dmark.methods.shape_spectrum.embedder import Cover
from o3dmark.methods.shape_spectrum.lattice import closest_vectors

_POINTS, _FEW = 60_000, 4_000  # of the fragment that are used at most; and to choose its place by
_PASSES, _REWEIGHTED = 6, 3
_FAR = 0.01  # over the diagonal: points further off the cover are not of it
_ALIKE = 0.3  # least cosine between the normals of a point and of its counterpart
_EXACT = 1e-6  # over the diagonal: noise below it is not believed
_INSIDE = 1e-6  # least barycentric coordinate off the edges
_SMOOTHED, _UMBRELLA = (3, 10, 40), 0.1  # passes and strength of the smoothings whose combinations are allowed for
_DOUBTED = 1.3  # a factor by which allowing for smoothing must lessen the noise, to be believed
_AMOUNT = 2.0  # how much of each, a standard deviation
_CUT = 3.0  # residuals, in standard deviations, at which the weight is a quarter
_SLACK = 0.03  # RMS distance, in steps, of an embedded value from its codeword
_LEAST = 2  # points a parameter, below which nothing is read


def read_fragment(received: Surface, cover: Cover, steps: Floats, n_bits: int) -> Extraction:
    """The bits of ``received``, a part of the marked ``cover`` in any pose and scale, mirror images excepted.

    ``steps`` (s,) are those that the writer may have used. Soft bits in -1 .. 1; of zero, with a note, where the
    fragment lies nowhere on the cover. Errors: MeshError as for marking the cover.
    """
    places = places_of(received, cover.surface)
    tried = 2 * max(1, len(places)) * len(steps)  # twice: smoothed, or not
    host, points = _Host(cover, steps), _Points.of(received)
    fit = _best_fit(host, points, places)
    if fit is None:
        return Extraction(np.zeros(n_bits), tried, "lies nowhere on the cover")
    values = host.cover.measured(host.cover.moved(fit.change))
    readings = [_decoded(host, fit, values, step) for step in steps]
    best = max(range(len(steps)), key=lambda i: readings[i].evidence)
    soft = np.tanh(readings[best].log_odds.reshape(-1, n_bits).sum(axis=0) / 2.0)
    note = f"laid on the cover, {fit.noise / host.surface.diagonal:.1e} of its diagonal off, step {steps[best]:.5f}"
    return Extraction(soft, tried, note)


class _Host:
    """The cover, how smoothing would move it, and how large changes are to be expected."""

    def __init__(self, cover: Cover, steps: Floats) -> None:
        self.cover, self.surface, self.normals = cover, cover.surface, cover.normals
        self.flows = np.array([self._smoothed(passes) for passes in _SMOOTHED])  # (s, n), along the normals
        self.step = float(np.median(steps))
        t = np.random.default_rng(0).random((4, len(cover.values)))
        self._size = float(np.mean([closest_vectors(cover.cost, row).cost[0] for row in t]))  # for a step of one

    def _smoothed(self, passes: int) -> Floats:
        """How far umbrella smoothing carries each vertex along its normal (n,)."""
        vertices = self.surface.vertices
        for _ in range(passes):
            vertices = vertices + _UMBRELLA * (self.surface.neighbour_mean @ vertices - vertices)
        return np.einsum("nd,nd->n", vertices - self.surface.vertices, self.normals)

    def prior(self, step: float) -> Floats:
        """The inverse (K, K) of the covariance of the changes to be expected at a step: Q times K over their size."""
        return np.asarray(self.cover.cost * len(self.cover.values) / (self._size * step**2))


class _Points(NamedTuple):
    """What is used of a fragment: positions (q, 3) and unit normals (q, 3)."""

    positions: Floats
    normals: Floats

    @classmethod
    def of(cls, received: Surface) -> "_Points":
        """The vertices off the borders, which a cut or a simplification moves; a sample where they are many."""
        inner = ~geometry.border_vertices(received.triangles, len(received.vertices))
        return cls(received.vertices[inner], received.normals[inner]).thinned(_POINTS)

    def thinned(self, count: int) -> "_Points":
        some = np.random.default_rng(0).permutation(len(self.positions))[:count]
        return _Points(self.positions[some], self.normals[some])

    def laid(self, place: Floats) -> "_Points":
        """As moved by a similarity (4, 4)."""
        turn = place[:3, :3] / np.cbrt(np.linalg.det(place[:3, :3]))
        return _Points(registration.apply(place, self.positions), self.normals @ turn.T)


class _Fit(NamedTuple):
    """The change (K,) that explains a fragment best, its gradient and information there, and the noise.

    A change c costs (c - change)' information (c - change) - 2 gradient' (c - change), minus twice the log likelihood.
    """

    change: Floats
    gradient: Floats
    information: Floats
    noise: float


def _best_fit(host: _Host, points: _Points, places: list[Floats]) -> _Fit | None:
    """The fit at the place where the mark explains most; with smoothing if that explains a lot. None: at no place."""
    if len(places) > 1:
        few = points.thinned(_FEW)
        noise = [fit.noise if (fit := _fitted(host, few, place, host.flows)) else np.inf for place in places]
        places = [places[int(np.argmin(noise))]]
    fits = [fit for place in places for f in (host.flows[:0], host.flows) if (fit := _fitted(host, points, place, f))]
    return min(fits, key=lambda fit: fit.noise * (1.0 if fit is fits[0] else _DOUBTED), default=None)


def _fitted(host: _Host, points: _Points, place: Floats, flows: Floats) -> _Fit | None:
    """Least squares from a first ``place`` (4, 4), allowing for ``flows`` (s, n) of the cover along its normals.

    None where too few points lie on the cover.
    """
    K, size = len(host.cover.values), host.surface.diagonal
    others = np.diag([0.0] * 7 + [_AMOUNT**-2.0] * len(flows))
    change, prior, fit = np.zeros(K), block_diag(host.prior(host.step), others), None
    for _ in range(_PASSES):
        gaps = _gaps(host, change, points.laid(place), flows)
        if len(gaps.d) < _LEAST * len(prior):
            return None
        A = np.concatenate([gaps.functions, -gaps.motions, gaps.flows], axis=1)
        x, before = np.zeros(len(prior)), np.pad(change, (0, len(others)))
        for _ in range(_REWEIGHTED):
            residual = gaps.d - A @ x
            noise = max(1.4826 * float(np.median(np.abs(residual))), _EXACT * size)
            weighted = A.T * ((1.0 + (residual / (_CUT * noise)) ** 2) ** -2.0 / noise**2)
            N = weighted @ A
            x = np.linalg.solve(N + prior, weighted @ gaps.d - prior @ before)
        change = change + x[:K]
        place = registration.small_similarity(x[K : K + 7], gaps.centre) @ place
        N[K:, K:] += others
        fit = _Fit(change, *_without_others(N, weighted @ (gaps.d - A @ x), K), noise)
    return fit


def _without_others(N: Floats, gradient: Floats, K: int) -> tuple[Floats, Floats]:
    """Gradient (K,) and information (K, K) about the first K unknowns when the others are anything."""
    taken = np.linalg.solve(N[K:, K:], N[K:, :K])
    return gradient[:K] - taken.T @ gradient[K:], N[:K, :K] - N[:K, K:] @ taken


class _Gaps(NamedTuple):
    """What the points of a laid fragment show: signed distances d (q,) to the cover as moved so far, and how they
    answer to the change, functions (q, K), to moving the fragment about ``centre`` (3,), motions (q, 7), and to
    smoothing, flows (q, s)."""

    d: Floats
    functions: Floats
    motions: Floats
    flows: Floats
    centre: Floats


def _gaps(host: _Host, change: Floats, laid: _Points, flows: Floats) -> _Gaps:
    """Distances of those of the laid points that have a counterpart on the cover as moved by ``change``."""
    surface = host.surface.moved(host.cover.moved(change))
    near = closest_points(laid.positions, surface)
    offset, corners = laid.positions - near.point, surface.triangles[near.triangle]
    share = geometry.barycentric(near.point, surface.vertices[corners])
    face = geometry.unit(geometry.area_vectors(surface.vertices, surface.triangles))[near.triangle]
    normal = _directions(offset, share, face, surface.normals[corners], 1e-9 * surface.diagonal)
    kept = (near.distance < _FAR * surface.diagonal) & (np.einsum("qd,qd->q", laid.normals, face) > _ALIKE)
    kept &= host.cover.solid.movable[corners].all(axis=1)
    normal, corners, points = normal[kept], corners[kept], laid.positions[kept]
    speed = share[kept] * np.einsum("qcd,qd->qc", host.normals[corners], normal)
    functions, flowing = (np.einsum("qc,qck->qk", speed, f.T[corners]) for f in (host.cover.motions, flows))
    centre = points.sum(axis=0) / max(1, len(points))
    motions = registration.motions(points - centre, normal)
    return _Gaps(np.einsum("qd,qd->q", offset[kept], normal), functions, motions, flowing, centre)


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
    return np.where(share.min(axis=1, keepdims=True) > _INSIDE, face, beyond)


class _Decoded(NamedTuple):
    """For each projection the log odds (K,) of bit 1 against 0, and the log evidence for the step."""

    log_odds: Floats
    evidence: float


def _decoded(host: _Host, fit: _Fit, values: Floats, step: float) -> _Decoded:
    """The lattice of a ``step`` searched; ``values`` (K,) are the projections at the change that was fitted."""
    h, V = np.linalg.eigh(fit.information)
    h = np.maximum(h, 1e-14 * h[-1])
    slack = (_SLACK * step) ** 2
    blurred = (V * (h / (1.0 + slack * h))) @ V.T  # information about the codeword, from which the value strays
    best = fit.change + V @ ((V.T @ fit.gradient) / h)
    prior = host.prior(step)
    M = blurred + prior
    change = np.linalg.solve(M, blurred @ best)
    rest = change @ prior @ change + (best - change) @ blurred @ (best - change)
    t = 2.0 * ((values + change - fit.change) / step - host.cover.projections.dither)
    found = closest_vectors(M * step**2 / 4.0, t)
    odd = found.z % 2 == 1
    cost = np.stack([_least(found.cost, ~odd), _least(found.cost, odd)])
    evidence = 0.5 * (np.log(h / (1.0 + slack * h)).sum() - rest - found.cost[0])
    return _Decoded(0.5 * (cost[0] - cost[1]), float(evidence))


def _least(cost: Floats, which: np.ndarray) -> Floats:
    """Least cost (K,) among the candidates of each column of ``which`` (c, K); the largest cost where none is."""
    return np.asarray(np.where(which, cost[:, None], cost[-1]).min(axis=0))
