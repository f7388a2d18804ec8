"""Which hypotheses about a received mesh are worth trying, likeliest first.

They cost far more than a key's measurement of them, so they are worked out when first asked for, and kept for the next
key.
"""

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from o3dmark.arrays import Floats
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.pn_triangles import pn_triangles
from o3dmark.mesh.smoothing import InverseSmoothing, Transfer, hc, taubin, umbrella
from o3dmark.mesh.surface import Surface
from o3dmark.methods._remembered import Remembered
from o3dmark.methods.shape_spectrum.hypotheses import PASSES, FrameHypothesis, SmoothingSweep
from o3dmark.received import View, views
from o3dmark.solid.frame import Frame, FrameFormat, FrameRule, rules
from o3dmark.solid.solid import Solid
from o3dmark.solid.spectrum import Band, Spectrum

if TYPE_CHECKING:
    from o3dmark.methods.shape_spectrum.deformation import Surrogate

_MAX_COARSE = 20_000  # triangles; a mark on 112 642 vertices was still read through bulges after remeshing to fewer
_ABRUPT = 3e-4  # RMS motion in a pass of smoothing, over the diagonal, above which every pass is worked out
_BULGES = np.arange(0.0, 1.0, 0.125)  # shares of full bulging to start from; 0.125 to 0.625 read simplified meshes
_MAX_AREA_GROWTH = 2.5  # unsmoothing that makes the area grow by more has gone too far
_MIRRORS = [np.diag(signs) for signs in itertools.product((1.0, -1.0), repeat=3)]


@dataclass(frozen=True, eq=False)
class Filter:
    """A way to smooth: its name, its transfer for a number of passes, the passes at which to work the surface out.

    A high ``gain`` undoes it exactly; a low one suits files that were rounded or disturbed after the smoothing. Where
    a pass does much, as on machine parts with long triangles, there may be ``every_pass`` instead of ``knots``.
    """

    name: str
    transfer: Callable[[float], Transfer]
    gain: float
    knots: tuple[int, ...]
    every_pass: tuple[int, ...] = ()


_UMBRELLA, _TAUBIN = (2, 6, 12, 22, 36, 55, 78), (3, 9, 20, 35, 55)
_EXACT = Filter("umbrella", lambda n: umbrella(n, 0.1), 1000.0, _UMBRELLA, tuple(PASSES[PASSES <= 78].tolist()))
_FILTERS = (
    _EXACT,
    Filter("Taubin", lambda n: taubin(n, 0.5, -0.53), 30.0, _TAUBIN),
    Filter("HC", hc, 8.0, (1, 2, 4, 7, 10, 14)),
    Filter("umbrella", lambda n: umbrella(n, 0.1), 8.0, _UMBRELLA),
    Filter("Taubin", lambda n: taubin(n, 0.5, -0.53), 8.0, _TAUBIN),
)


class Round(NamedTuple):
    """Hypotheses that are equally likely, and whether a reader should fit the frame of each.

    ``area_diagonal_ratio`` is the surface's area times its diagonal over the cube of the frame's scale: the longest
    step within a given distortion is about proportional to it, since a thin shape has little to integrate.
    """

    hypotheses: Sequence[FrameHypothesis | SmoothingSweep]
    fit: bool
    area_diagonal_ratio: float


class Deformed(NamedTuple):
    """A view as it would be under any small deformation, and the hypothesis that there was none."""

    surrogate: "Surrogate"
    undeformed: FrameHypothesis
    area_diagonal_ratio: float


class Hypotheses:
    """The rounds of hypotheses about a received surface, for any number of keys. Iterate as often as you like.

    First each view of it (see `received`) at sight, then what takes longer in those views that are worth it. No round:
    the solid has no frame.
    """

    def __init__(self, received: Surface, band: Band, form: FrameFormat, *, search: bool = True) -> None:
        self.received, self.band, self.search, self._form = received, band, search, form
        self._found = Remembered(self._rounds())
        self._thorough: list[_Sight] = []
        self._deformed = Remembered(self._deformations())

    def __iter__(self) -> Iterator[Round]:
        return iter(self._found)

    def _rounds(self) -> Iterator[Round]:
        looked_at: list[_Sight] = []
        for view in views(self.received):
            try:
                sight = _Sight(view, self.band, self._form)
                yield sight.at_once()
                if not self.search:
                    return
                yield sight.fitted()
            except MeshError:  # no frame, or out of all proportion
                continue
            if view.thorough:
                looked_at.append(sight)
        self._thorough = looked_at
        for sight in looked_at:
            try:
                yield from sight.searched()
            except MeshError:
                continue

    @property
    def deformed(self) -> Iterator["Deformed"]:
        """After all rounds: those views as they were before they were stretched, sheared, bent or twisted."""
        yield from self._deformed

    def _deformations(self) -> Iterator["Deformed"]:
        for sight in self._thorough:
            try:
                yield from sight.deformed()
            except MeshError:
                continue


class _Sight:
    """A view of a surface, in the frames that its solid has. Errors: MeshError where it has none."""

    def __init__(self, view: View, band: Band, form: FrameFormat) -> None:
        self.view, self.received, self.band, self._form = view, view.surface, band, form
        self.solid = Solid.of(self.received)
        self.choices = rules(self.solid, form)
        self.rule = self.choices[0]
        self.frames = self.rule.frames(self.solid)
        self._ratio = self.received.area * self.received.diagonal / self.frames[0].scale ** 3

    def at_once(self) -> Round:
        """The values as they are."""
        frame = self.frames[0]
        spectrum = Spectrum.of_solid(self.band, frame.solid(self.solid))
        return self._round([FrameHypothesis(frame, spectrum, part=self.view.name)], fit=False)

    def fitted(self) -> Round:
        """With the frame fitted."""
        return self._round(_every([self._first], self._ambiguities), fit=True)

    def searched(self) -> Iterator[Round]:
        """With more surface between the vertices, mirrored, and before some smoothing."""
        solid, rule, first, ambiguities = self.solid, self.rule, self._first, self._ambiguities
        if len(self.received.triangles) < _MAX_COARSE:
            yield self._round(_every(self._bulging(rule, first), ambiguities))
        frames = [(rule, frame) for rule in self.choices for frame in rule.frames(solid)]
        others = [self._seen(rule, solid, frame) for rule, frame in frames if not _related(frame, self.frames[0])]
        yield self._round(_every([first, *others], _distinct([m @ a for a in ambiguities for m in _MIRRORS])))
        yield from self._unsmoothed(solid, rule, first, ambiguities)

    def deformed(self) -> Iterator["Deformed"]:
        """Before a deformation, in each position of the axes. Errors: MeshError where one has no frame."""
        from o3dmark.methods.shape_spectrum.deformation import Surrogate

        surrogate = Surrogate.of(self.band, self.solid, self.rule, self.frames[0])
        for symmetry in self._ambiguities:
            first = replace(self._first, symmetry=symmetry)
            yield Deformed(surrogate.turned(self.band, symmetry), first, self._ratio)

    def _round(self, hypotheses: Sequence[FrameHypothesis | SmoothingSweep], *, fit: bool = True) -> Round:
        return Round(hypotheses, fit, self._ratio)

    @cached_property
    def _first(self) -> FrameHypothesis:
        return self._seen(self.rule, self.solid, self.frames[0])

    @cached_property
    def _ambiguities(self) -> list[Floats]:
        return self.rule.ambiguities(self.solid, self.frames)

    def _seen(self, rule: FrameRule, solid: Solid, frame: Frame) -> FrameHypothesis:
        """A solid in one of the frames of a rule, with all that it takes to fit the frame."""
        seen = frame.solid(solid)
        normals = geometry.unit(solid.vertex_area_vectors) * solid.movable[:, None]
        response = rule.response(solid, frame, normals)
        covariance = np.zeros((8, 8))
        covariance[:7, :7] = response @ response.T / np.sum(seen.vertex_areas**2)
        spectrum = Spectrum.of_solid(self.band, seen, gradient=True)
        return FrameHypothesis(frame, spectrum, covariance, part=self.view.name)

    def _bulging(self, rule: FrameRule, first: FrameHypothesis) -> Iterator[FrameHypothesis]:
        """What a mesh that has lost vertices looked like: its surface may bulge between those that are left."""
        solid = Solid.of(pn_triangles(self.received))
        spectrum = Spectrum.of_solid(self.band, rule.near(solid, first.frame).solid(solid))
        bulge = Spectrum(self.band, spectrum.values - first.spectrum.values)
        for share in _BULGES:
            yield replace(first, bulge=bulge, bulging=share, view=f"bulging by {share:g}")

    def _unsmoothed(
        self, solid: Solid, rule: FrameRule, first: FrameHypothesis, ambiguities: list[Floats]
    ) -> Iterator[Round]:
        """For each filter the surface before its passes; where a pass moves much, also in frames of its own."""
        inverse = InverseSmoothing(self.received)
        abrupt = self._motion(inverse) > _ABRUPT
        for each in _FILTERS:
            passes = each.every_pass if abrupt and each.every_pass else each.knots
            before = self._before(inverse, solid, rule, first, each, passes)
            yield self._round([_turned(before, each.name, symmetry) for symmetry in ambiguities])
            if abrupt and each.every_pass:
                yield self._round(list(self._anew(inverse, solid, before, each, ambiguities)))

    def _motion(self, inverse: InverseSmoothing) -> float:
        """RMS motion of the surface in a pass of umbrella smoothing, over the diagonal."""
        area = self.received.vertex_areas
        motion = inverse.undo(_EXACT.transfer(2), _EXACT.gain) - self.received.vertices
        return float(np.sqrt(area @ np.sum(motion**2, axis=1) / area.sum())) / 2.0 / self.received.diagonal

    def _before(
        self,
        inverse: InverseSmoothing,
        solid: Solid,
        rule: FrameRule,
        first: FrameHypothesis,
        each: Filter,
        passes: Sequence[int],
    ) -> dict[int, FrameHypothesis]:
        """The solid as received and before some numbers of passes, until it grows rough.

        How the spectrum answers to moving the frame hardly changes on the way, and is not worked out again.
        """
        found, frame = {0: first}, first.frame
        for n in passes:
            before = solid.moved(inverse.undo(each.transfer(n), each.gain))
            try:
                frame = rule.near(before, frame)
            except MeshError:
                break
            if before.area > _MAX_AREA_GROWTH * solid.area:
                break
            spectrum = Spectrum.of_solid(self.band, frame.solid(before))
            found[n] = replace(first, frame=frame, spectrum=replace(spectrum, gradient=first.spectrum.gradient))
        return found

    def _anew(
        self,
        inverse: InverseSmoothing,
        solid: Solid,
        before: dict[int, FrameHypothesis],
        each: Filter,
        ambiguities: list[Floats],
    ) -> Iterator[FrameHypothesis]:
        """The same surfaces in frames of their own, where these differ from that of the received surface."""
        for n, known in itertools.islice(before.items(), 1, None):
            surface = solid.moved(inverse.undo(each.transfer(n), each.gain))
            try:
                rule = rules(surface, self._form)[0]
            except MeshError:
                continue
            frames = rule.frames(surface)
            if not _same(frames[0], known.frame, ambiguities):
                seen = replace(self._seen(rule, surface, frames[0]), smoothing=each.name, passes=n)
                yield from _every([seen], rule.ambiguities(surface, frames))


def _every(hypotheses: Iterable[FrameHypothesis], symmetries: list[Floats]) -> list[FrameHypothesis]:
    """Each hypothesis with each symmetry."""
    return [replace(each, symmetry=symmetry) for each in hypotheses for symmetry in symmetries]


def _turned(before: dict[int, FrameHypothesis], smoothing: str, symmetry: Floats) -> SmoothingSweep:
    return SmoothingSweep({n: replace(each, symmetry=symmetry) for n, each in before.items()}, smoothing)


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
