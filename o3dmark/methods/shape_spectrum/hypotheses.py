"""The ways in which a received mesh may be seen: which frame, which handedness, before how much smoothing.

A `Sight` is what one way shows of the spectrum, whoever's mark it may hold; a key makes a `View` of it: projections,
and how they answer to moving the frame. Sights come in rounds, likeliest first. They cost far more than a key's reading
of them, so they are worked out when first asked for, and kept for the next key.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import block_diag

from o3dmark.arrays import Floats
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.pn_triangles import curved
from o3dmark.mesh.smoothing import Transfer, Unfilter, humphrey, taubin, umbrella
from o3dmark.mesh.surface import Surface
from o3dmark.methods.shape_spectrum.embedder import spectrum_of
from o3dmark.methods.shape_spectrum.projections import Projections
from o3dmark.solid.frame import FRAME_2026, Frame, FrameRule, rules
from o3dmark.solid.solid import Solid
from o3dmark.solid.spectrum import Band, Spectrum

_COARSE = 20_000  # triangles, below which the surface may be a simplified one
_ABRUPT = 3e-4  # RMS motion in a pass of smoothing, over the diagonal, above which every pass is worked out
_BULGES = np.arange(0.0, 1.0, 0.125)  # where to start from: the share of the fully curved surface's bulging
_ROUGH = 2.5  # unsmoothing that makes the area grow by more than this has gone too far
_PASSES = np.unique(np.rint(1.06 ** np.arange(80.0))).astype(int)  # numbers of passes to tell apart
_FLIPS = [np.diag(s) for s in itertools.product((1.0, -1.0), repeat=3)]


class _Smoothing(NamedTuple):
    """A way to smooth: its name, its transfer for a number of passes, the passes at which to work the surface out.

    A high ``gain`` undoes it exactly; a low one suits files that were rounded or disturbed after the smoothing. Where
    a pass does much, as on machine parts with long triangles, there may be ``dense`` numbers of passes.
    """

    name: str
    transfer: Callable[[float], Transfer]
    gain: float
    nodes: tuple[int, ...]
    dense: tuple[int, ...] = ()

    def spaced(self, abrupt: bool) -> "_Smoothing":
        """The same with the numbers of passes that are to be worked out."""
        return self._replace(nodes=self.dense) if abrupt and self.dense else self


_UMBRELLA_NODES, _TAUBIN_NODES = (2, 6, 12, 22, 36, 55, 78), (3, 9, 20, 35, 55)
_SMOOTHINGS = (
    _Smoothing("umbrella", lambda n: umbrella(n, 0.1), 1000.0, _UMBRELLA_NODES, tuple(_PASSES[_PASSES <= 78])),
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
class Sight:
    """A solid's spectrum in a frame, to be viewed with the axes permuted and flipped by ``symmetry`` (3, 3)."""

    frame: Frame
    spectrum: Spectrum
    doubt: Floats  # as in a View, in the frame as it is
    bulge: Spectrum | None = None  # the change when the surface bulges fully
    bulging: float = 0.0  # the share of it to start from
    symmetry: Floats = field(default_factory=lambda: np.eye(3))
    note: str = "as received"

    def values(self, projections: Projections) -> Floats:
        """The projections (K,) alone, before any bulging."""
        return projections(replace(self.spectrum, gradient=None).turned(self.symmetry).values)

    def views(self, projections: Projections) -> Iterator[View]:
        """The one view that this sight has."""
        spectrum, hand = self.spectrum.turned(self.symmetry), np.linalg.det(self.symmetry)
        motions = spectrum.frame_derivative()
        bulge = np.zeros_like(motions[0]) if self.bulge is None else self.bulge.turned(self.symmetry).values
        turn = block_diag(self.symmetry, hand * self.symmetry, 1.0, 1.0)  # a rotation vector is an axial one
        yield View(
            projections(spectrum.values + self.bulging * bulge),
            projections(np.concatenate([motions, bulge[None]])).T,
            turn @ self.doubt @ turn.T,
            self.note + (", mirrored" if hand < 0 else ""),
        )


@dataclass(frozen=True, eq=False)
class Path:
    """What was seen with so many passes of a smoothing undone, for a few numbers of them; the others lie in between."""

    sights: dict[int, Sight]
    name: str

    def views(self, projections: Projections) -> Iterator[View]:
        """Before 1, 2, 3 ... passes, ever more sparsely: a spline through the sights."""
        if len(self.sights) < 3:
            return
        received = next(next(iter(self.sights.values())).views(projections))
        values = CubicSpline(list(self.sights), [sight.values(projections) for sight in self.sights.values()])
        for n in _PASSES[max(self.sights) >= _PASSES]:
            yield View(values(n), received.jacobian, received.doubt, f"smoothed {n} times ({self.name})")


class Sights:
    """The rounds of ways to see a received surface, for any number of keys. Iterate as often as you like.

    A round is a list of sights or paths, and whether a reader should fit the frame. No round: the solid has no frame.
    ``extent``, from the first round on, is area times diagonal over the cube of the frame's scale: the longest step
    within a given distortion is about proportional to it, since a thin shape has little to integrate.
    """

    def __init__(self, received: Surface, band: Band, *, search: bool = True) -> None:
        self.received, self.band, self.search = received, band, search
        self.extent = 1.0
        self._found: list[tuple[Sequence[Sight | Path], bool]] = []
        self._more = self._rounds()

    def __iter__(self) -> Iterator[tuple[Sequence[Sight | Path], bool]]:
        for i in itertools.count():
            if i == len(self._found):
                found = next(self._more, None)
                if found is None:
                    return
                self._found.append(found)
            yield self._found[i]

    def _rounds(self) -> Iterator[tuple[Sequence[Sight | Path], bool]]:
        solid = Solid.of(self.received)
        try:
            choices = rules(solid, FRAME_2026)
        except MeshError:
            return
        rule, frames = choices[0], choices[0].frames(solid)
        first = self._sight(rule, solid, frames[0])
        self.extent = self.received.area * self.received.diagonal / first.frame.scale**3
        yield [first], False
        if not self.search:
            return
        doubts = rule.ambiguities(solid, frames)
        yield [replace(first, symmetry=symmetry) for symmetry in doubts], True
        if len(self.received.triangles) < _COARSE:
            yield [replace(s, symmetry=symmetry) for s in self._bulging(rule, first) for symmetry in doubts], True
        others = [self._sight(r, solid, f) for r in choices for f in r.frames(solid) if not _related(f, frames[0])]
        symmetries = _distinct([flip @ symmetry for symmetry in doubts for flip in _FLIPS])
        yield [replace(sight, symmetry=symmetry) for sight in (first, *others) for symmetry in symmetries], True
        basis = Unfilter(self.received)
        abrupt = self._motion(basis) > _ABRUPT
        for smoothing in (s.spaced(abrupt) for s in _SMOOTHINGS):
            path = self._unsmoothed(basis, solid, rule, first, smoothing)
            yield [_turned(path, symmetry, smoothing.name) for symmetry in doubts], True
            if abrupt and smoothing.dense:
                yield list(self._anew(basis, solid, path, smoothing, doubts)), True

    def _sight(self, rule: FrameRule, solid: Solid, frame: Frame) -> Sight:
        seen = frame.solid(solid)
        normals = geometry.unit(solid.vertex_area_vectors) * solid.movable[:, None]
        response = rule.response(solid, frame, normals)
        doubt = np.zeros((8, 8))
        doubt[:7, :7] = response @ response.T / np.sum(seen.vertex_areas**2)
        return Sight(frame, spectrum_of(self.band, seen, gradient=True), doubt)

    def _bulging(self, rule: FrameRule, first: Sight) -> Iterator[Sight]:
        """What a mesh that has lost vertices looked like: its surface may bulge between those that are left."""
        solid = Solid.of(curved(self.received))
        spectrum = spectrum_of(self.band, rule.near(solid, first.frame).solid(solid))
        bulge = Spectrum(self.band, spectrum.values - first.spectrum.values)
        for share in _BULGES:
            yield replace(first, bulge=bulge, bulging=share, note=f"bulging by {share:g}")

    def _motion(self, basis: Unfilter) -> float:
        """RMS motion of the surface in a pass of umbrella smoothing, over the diagonal."""
        exact, area = _SMOOTHINGS[0], self.received.vertex_areas
        motion = basis.undo(exact.transfer(2), exact.gain) - self.received.vertices
        return float(np.sqrt(area @ np.sum(motion**2, axis=1) / area.sum())) / 2.0 / self.received.diagonal

    def _unsmoothed(
        self, basis: Unfilter, solid: Solid, rule: FrameRule, first: Sight, smoothing: _Smoothing
    ) -> dict[int, Sight]:
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
            spectrum = spectrum_of(self.band, frame.solid(before))
            path[n] = replace(first, frame=frame, spectrum=replace(spectrum, gradient=first.spectrum.gradient))
        return path

    def _anew(
        self, basis: Unfilter, solid: Solid, path: dict[int, Sight], smoothing: _Smoothing, symmetries: list[Floats]
    ) -> Iterator[Sight]:
        """The surfaces of a path as one sees them who never saw the received one, where that is in another frame."""
        for n, sight in itertools.islice(path.items(), 1, None):
            before = solid.moved(basis.undo(smoothing.transfer(n), smoothing.gain))
            try:
                rule = rules(before, FRAME_2026)[0]
            except MeshError:
                continue
            frames = rule.frames(before)
            if not _same(frames[0], sight.frame, symmetries):
                seen = replace(self._sight(rule, before, frames[0]), note=f"smoothed {n} times ({smoothing.name})")
                yield from (replace(seen, symmetry=symmetry) for symmetry in rule.ambiguities(before, frames))


def _turned(path: dict[int, Sight], symmetry: Floats, name: str) -> Path:
    return Path({n: replace(sight, symmetry=symmetry) for n, sight in path.items()}, name)


def _related(frame: Frame, other: Frame) -> bool:
    """Whether the axes of two frames are permutations and flips of each other."""
    turn = np.abs(frame.axes @ other.axes.T)
    return bool(np.abs(turn - np.rint(turn)).max() < 1e-6)


def _same(frame: Frame, other: Frame, symmetries: list[Floats]) -> bool:
    """Whether a frame is the other one, or one of its symmetric positions."""
    turn = frame.axes @ other.axes.T
    return abs(frame.scale / other.scale - 1.0) < 1e-6 and any(np.abs(turn - s).max() < 1e-6 for s in symmetries)


def _distinct(matrices: Sequence[Floats]) -> list[Floats]:
    """The different ones, in the order of first appearance."""
    return list({tuple(matrix.ravel()): matrix for matrix in matrices}.values())
