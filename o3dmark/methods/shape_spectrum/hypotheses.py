"""What may be assumed of a received mesh: its frame, which way round it lies, how much smoothing it went through.

A `FrameHypothesis` is the spectrum of the solid in one frame, whoever's mark it may hold; a key makes a `Measurement`
of it: the projections, and how they answer to moving the frame. Which hypotheses there are, and in which order, is a
matter of `search`.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import scipy

from o3dmark.arrays import Floats
from o3dmark.methods.shape_spectrum.projections import Projections
from o3dmark.solid.frame import Frame
from o3dmark.solid.spectrum import Spectrum

PASSES = np.unique(np.rint(1.06 ** np.arange(80.0))).astype(int)  # numbers of passes to tell apart, up to 97
_MIN_KNOTS = 3  # surfaces that a spline through them needs


@dataclass(frozen=True, eq=False)
class Measurement:
    """A hypothesis as a key measures it: values (K,) and jacobian (K, 8), by seven frame motions and by bulging.

    ``covariance`` (8, 8) of these motions under vertex noise that gives each projection unit variance. It and the
    jacobian are for fitting, None where the hypothesis is not made for that. The words for people are those of an
    `Extraction`.
    """

    values: Floats
    jacobian: Floats | None
    covariance: Floats | None
    view: str
    smoothing: str | None = None
    passes: int = 0
    part: str = ""


@dataclass(frozen=True, eq=False)
class FrameHypothesis:
    """A solid's spectrum in a frame, to be measured with the axes permuted and flipped by ``symmetry`` (3, 3)."""

    frame: Frame
    spectrum: Spectrum
    covariance: Floats | None = None  # as in a Measurement, in the frame as it is; the spectrum then has its gradient
    bulge: Spectrum | None = None  # the change when the surface bulges fully
    bulging: float = 0.0  # the share of it to start from
    symmetry: Floats = field(default_factory=lambda: np.eye(3))
    view: str = "as received"
    smoothing: str | None = None
    passes: int = 0
    part: str = ""

    def values(self, projections: Projections) -> Floats:
        """The projections (K,) alone, before any bulging."""
        return projections(replace(self.spectrum, gradient=None).turned(self.symmetry).values)

    def measurements(self, projections: Projections) -> Iterator[Measurement]:
        """The one measurement that this hypothesis has."""
        hand = np.linalg.det(self.symmetry)
        view = self.view + (", mirrored" if hand < 0 else "")
        if self.covariance is None:
            yield Measurement(self.values(projections), None, None, view, self.smoothing, self.passes, self.part)
            return
        spectrum = self.spectrum.turned(self.symmetry)
        motions = spectrum.frame_derivative()
        bulge = np.zeros_like(motions[0]) if self.bulge is None else self.bulge.turned(self.symmetry).values
        axial = hand * self.symmetry  # which a rotation vector is
        turn = scipy.linalg.block_diag(self.symmetry, axial, 1.0, 1.0)
        yield Measurement(
            projections(spectrum.values + self.bulging * bulge),
            projections(np.concatenate([motions, bulge[None]])).T,
            turn @ self.covariance @ turn.T,
            view,
            self.smoothing,
            self.passes,
            self.part,
        )


@dataclass(frozen=True, eq=False)
class SmoothingSweep:
    """The solid before so many passes of a filter, for a few numbers of them; those in between are interpolated."""

    before: dict[int, FrameHypothesis]
    smoothing: str

    def measurements(self, projections: Projections) -> Iterator[Measurement]:
        """Before 1, 2, 3 ... passes, ever more sparsely: a spline through the surfaces that were worked out."""
        if len(self.before) < _MIN_KNOTS:
            return
        received = next(next(iter(self.before.values())).measurements(projections))
        known = [each.values(projections) for each in self.before.values()]
        values = scipy.interpolate.CubicSpline(list(self.before), known)
        for n in PASSES[max(self.before) >= PASSES]:
            yield replace(received, values=values(n), smoothing=self.smoothing, passes=int(n))
