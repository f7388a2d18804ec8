"""The blind reader of shape-spectrum: which step, which frame, which smoothing? It tries them, and counts.

A `View` is one way to see the received mesh: its projections, and how they answer to moving the frame. Views come in
rounds, likeliest first. In each round every view is read with every step of the ladder, as it is and fitted; the round
is the last when its best reading is beyond doubt.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import block_diag

from o3dmark import geometry
from o3dmark.curved import curved
from o3dmark.errors import MeshError
from o3dmark.frame import Frame, Rule, rules
from o3dmark.geometry import Floats
from o3dmark.mesh import Surface
from o3dmark.methods import Extraction
from o3dmark.methods._cover import spectrum_of
from o3dmark.methods._fit import fit, significance
from o3dmark.methods._projections import Projections, coherence
from o3dmark.solid import Solid
from o3dmark.spectrum import Spectrum
from o3dmark.unfilter import Transfer, Unfilter, humphrey, taubin, umbrella

_SETTLED = -6.0  # log10 of the p-value, all tries charged, below which a reading is beyond doubt, if also
_CLEAR = 0.8  # its coherence is above this as received,
_CLEAR_FITTED = 0.7  # or this after a fit
_NOISE = 0.1  # vertex noise to expect, by the noise that it makes in a projection, in steps
_FLOOR = np.array([2e-4, 2e-4, 2e-4, 4e-4, 4e-4, 4e-4, 2e-4, 0.5])  # least doubt about frame motions and bulging
_COARSE = 20_000  # triangles, below which the surface may be a simplified one
_ROUGH = 2.5  # unsmoothing that makes the area grow by more than this has gone too far
_PASSES = np.unique(np.rint(1.06 ** np.arange(80.0))).astype(int)  # numbers of passes to tell apart
_FLIPS = [np.diag(s) for s in itertools.product((1.0, -1.0), repeat=3)]


class _Smoothing(NamedTuple):
    """A way to smooth: its name, its transfer for a number of passes, the passes at which to work the surface out.

    A high ``gain`` undoes it exactly; a low one suits files that were rounded or disturbed after the smoothing.
    """

    name: str
    transfer: Callable[[float], Transfer]
    gain: float
    nodes: tuple[int, ...]


_UMBRELLA_NODES, _TAUBIN_NODES = (2, 6, 12, 22, 36, 55, 78), (3, 9, 20, 35, 55)
_SMOOTHINGS = (
    _Smoothing("umbrella", lambda n: umbrella(n, 0.1), 1000.0, _UMBRELLA_NODES),
    _Smoothing("Taubin", lambda n: taubin(n, 0.5, -0.53), 30.0, _TAUBIN_NODES),
    _Smoothing("HC", humphrey, 8.0, (1, 2, 4, 7, 10, 14)),
    _Smoothing("umbrella", lambda n: umbrella(n, 0.1), 8.0, _UMBRELLA_NODES),
    _Smoothing("Taubin", lambda n: taubin(n, 0.5, -0.53), 8.0, _TAUBIN_NODES),
)


@dataclass(frozen=True, eq=False)
class View:
    """Projections seen one way: values (K,) and jacobian (K, 8), by the frame's seven motions and by bulging.

    ``doubt`` (8, 8) is the covariance of these under vertex noise that gives each projection unit variance.
    """

    values: Floats
    jacobian: Floats
    doubt: Floats
    note: str


@dataclass(frozen=True, eq=False)
class _Reading:
    """The best values u (K,) of a round, in periods, and log10 of their p-value before the tries are charged."""

    u: Floats
    log_p: float
    clear: bool
    note: str


class Reader:
    """Reads ``n_bits`` bits with the key's projections and the steps (s,) that the options allow."""

    def __init__(self, projections: Projections, steps: Floats, n_bits: int, search: bool) -> None:
        self.projections, self.steps, self.n_bits, self.search = projections, steps, n_bits, search

    def read(self, received: Surface) -> Extraction:
        """The most significant reading of a surface; soft bits of zero where it has no frame."""
        best, tried = _Reading(np.full(len(self.projections), 0.25), 0.0, False, "nothing agrees with the key"), 0
        for views, fitted in self._rounds(received):
            tried += len(views) * len(self.steps)
            reading = self._best(views, fitted)
            if reading.log_p < best.log_p:
                best = reading
            if best.clear and best.log_p + np.log10(tried) < _SETTLED:
                break
        soft = -np.cos(2.0 * np.pi * best.u).reshape(-1, self.n_bits).mean(axis=0)
        return Extraction(soft, max(tried, 1), best.note)

    def _rounds(self, received: Surface) -> Iterator[tuple[Sequence[View], bool]]:
        """Views to try together, and whether to fit the frame."""
        solid = Solid.of(received)
        try:
            choices = rules(solid)
        except MeshError:
            return
        rule, frames = choices[0], choices[0].frames(solid)
        first = self._seen(rule, solid, frames[0])
        yield [first.view(np.eye(3), "as received")], False
        if not self.search:
            return
        doubts = rule.doubts(solid, frames)
        yield [first.view(symmetry, "as received") for symmetry in doubts], True
        if len(received.triangles) < _COARSE:
            coarse = self._bulging(received, rule, first)
            yield [coarse.view(symmetry, "as received, bulging") for symmetry in doubts], True
        others = [self._seen(r, solid, f) for r in choices for f in r.frames(solid) if not _related(f, frames[0])]
        symmetries = _distinct([flip @ symmetry for symmetry in doubts for flip in _FLIPS])
        yield [seen.view(symmetry, "as received") for seen in (first, *others) for symmetry in symmetries], True
        basis = Unfilter(received)
        for smoothing in _SMOOTHINGS:
            path = self._unsmoothed(basis, solid, rule, first, smoothing)
            yield [view for symmetry in doubts for view in _along(path, symmetry, smoothing.name)], True

    def _seen(self, rule: Rule, solid: Solid, frame: Frame) -> "_Seen":
        seen = frame.solid(solid)
        spectrum = spectrum_of(self.projections, seen, gradient=True)
        normals = geometry.unit(solid.vertex_area_vectors) * solid.free[:, None]
        response = rule.response(solid, frame, normals)
        doubt = np.zeros((8, 8))
        doubt[:7, :7] = response @ response.T / np.sum(seen.vertex_areas**2)
        return _Seen(self.projections, frame, spectrum, doubt)

    def _bulging(self, received: Surface, rule: Rule, first: "_Seen") -> "_Seen":
        """The view for a mesh that has lost vertices: its surface may bulge between those that are left."""
        solid = Solid.of(curved(received))
        spectrum = spectrum_of(self.projections, rule.near(solid, first.frame).solid(solid))
        bulge = Spectrum(spectrum.band, spectrum.values - first.spectrum.values)
        return replace(first, bulge=bulge)

    def _unsmoothed(
        self, basis: Unfilter, solid: Solid, rule: Rule, first: "_Seen", smoothing: _Smoothing
    ) -> dict[int, "_Seen"]:
        """The solid as received and before the numbers of passes in ``nodes``, until it grows rough.

        How the spectrum answers to moving the frame hardly changes on the way, and is not worked out again.
        """
        path, frame = {0: first}, first.frame
        for n in smoothing.nodes:
            before = solid.moved(basis.undo(smoothing.transfer(n), smoothing.gain))
            try:
                frame = rule.near(before, frame)
            except MeshError:
                break
            if before.area > _ROUGH * solid.area:
                break
            spectrum = spectrum_of(self.projections, frame.solid(before))
            path[n] = replace(first, frame=frame, spectrum=replace(spectrum, gradient=first.spectrum.gradient))
        return path

    def _best(self, views: Sequence[View], fitted: bool) -> _Reading:
        """The most significant of all views at all steps, as they are or fitted."""
        if not len(views):
            return _Reading(np.zeros(len(self.projections)), 0.0, False, "")
        values = np.array([view.values for view in views])
        u = (values[:, None] / self.steps[:, None] - self.projections.dither).reshape(-1, values.shape[1])
        plain = significance(u, self.n_bits)
        best, p, clear, note = u, plain, _CLEAR, ""
        if fitted:
            jacobian = np.array([view.jacobian for view in views])[:, None] / self.steps[:, None, None]
            doubt = np.array([view.doubt for view in views])[:, None] * (_NOISE * self.steps[:, None, None]) ** 2
            prior = (doubt + np.diag(_FLOOR**2)).reshape(-1, 8, 8)
            moved, freedom = fit(u, jacobian.reshape(len(u), -1, 8), prior)
            fitted_p = significance(moved, self.n_bits, freedom)
            if fitted_p.min() < plain.min():
                best, p, clear, note = moved, fitted_p, _CLEAR_FITTED, ", frame fitted"
        i = int(np.argmin(p))
        view, step = views[i // len(self.steps)], self.steps[i % len(self.steps)]
        return _Reading(best[i], float(p[i]), bool(coherence(best[i]) > clear), f"{view.note}{note}, step {step:.5f}")


@dataclass(frozen=True, eq=False)
class _Seen:
    """A solid in one frame, to be viewed with its axes in either direction without a new transform."""

    projections: Projections
    frame: Frame
    spectrum: Spectrum
    doubt: Floats
    bulge: Spectrum | None = None  # its change when the surface bulges fully

    def view(self, symmetry: Floats, note: str) -> View:
        """With the axes permuted and flipped by a signed permutation (3, 3)."""
        spectrum, hand = self.spectrum.turned(symmetry), np.linalg.det(symmetry)
        motions = spectrum.frame_derivative()
        bulge = np.zeros_like(motions[:1]) if self.bulge is None else self.bulge.turned(symmetry).values[None]
        turn = block_diag(symmetry, hand * symmetry, 1.0, 1.0)  # a rotation vector is an axial one
        return View(
            self.projections(spectrum.values),
            self.projections(np.concatenate([motions, bulge])).T,
            turn @ self.doubt @ turn.T,
            note + (", mirrored" if hand < 0 else ""),
        )


def _along(path: dict[int, _Seen], symmetry: Floats, name: str) -> Iterator[View]:
    """Views before 1, 2, 3 ... passes, ever more sparsely: a spline through those of a ``path``."""
    if len(path) < 3:
        return
    views = [seen.view(symmetry, "") for seen in path.values()]
    values = CubicSpline(list(path), [view.values for view in views])
    for n in _PASSES[max(path) >= _PASSES]:
        yield View(values(n), views[0].jacobian, views[0].doubt, f"smoothed {n} times ({name})")


def _related(frame: Frame, other: Frame) -> bool:
    """Whether the axes of two frames are permutations and flips of each other."""
    turn = np.abs(frame.axes @ other.axes.T)
    return bool(np.abs(turn - np.rint(turn)).max() < 1e-6)


def _distinct(matrices: Sequence[Floats]) -> list[Floats]:
    """The different ones, in the order of first appearance."""
    return list({tuple(matrix.ravel()): matrix for matrix in matrices}.values())
