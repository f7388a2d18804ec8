"""The blind reader of shape-spectrum: which step, which frame, which smoothing? It tries them, and counts.

In each round of hypotheses (see `search`) every measurement is read with every step of the ladder, as it is and fitted;
the round is the last when its best reading is beyond doubt. Where none is, the solid is read as it was before a small
deformation (see `deformation`).
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from o3dmark.arrays import Floats, Ints
from o3dmark.coding.scs import coherence
from o3dmark.methods import Extraction
from o3dmark.methods.shape_spectrum.fit import fit, log10_p
from o3dmark.methods.shape_spectrum.hypotheses import Measurement
from o3dmark.methods.shape_spectrum.projections import Projections
from o3dmark.methods.shape_spectrum.search import Deformed, Hypotheses, Round

_STOP_LOG10_P = -6.0  # of the p-value, all readings charged, below which a reading is beyond doubt, if also
# its coherence is above this, as received or after a fit. Of 2 865 readings in the tables of 2026-11-23, wrong ones had
# 0.54 and 0.59 at most; of the right ones 95 in 100 had more than 0.81 and 0.69
_MIN_COHERENCE, _MIN_COHERENCE_FITTED = 0.8, 0.7
# log10 of how much rarer steps become for every octave that they are more than one from the expected: of meshes, a
# quarter of an octave; of thin sheets, one (see `method`)
_STEP_PRIOR = 2.0
_ROUNDS = 0.8  # of the chance of a mistake that is allowed, for what is read in rounds; the rest is for deformations
_STARTS, _KEPT = 500, 20  # deformations that are fitted, of each search, and those whose readings are kept
_NOISE = 0.1  # of a projection to expect, in steps: at a quarter bits are lost
# Standard deviations of the frame's seven motions and of bulging that are expected without any noise: 9 bits, half the
# triangles gone or a subdivision move the frames of bimba, cup, ant and fandisk by 1e-5 to 1e-3, turn them by 1e-5 to
# 3e-3; bulging starts from eight shares
_MIN_STD = np.array([2e-4, 2e-4, 2e-4, 4e-4, 4e-4, 4e-4, 2e-4, 0.2])


@dataclass(frozen=True, eq=False)
class _Readings:
    """Every measurement at every step, as it is or fitted: values u (h, K) in periods, log10 of their p-values (h,)."""

    u: Floats
    log10_p: Floats
    fitted: bool = False


@dataclass(frozen=True, eq=False)
class _Best:
    """The best reading of a round: values u (K,) in periods, and log10 of its p-value before readings are charged."""

    u: Floats
    log10_p: float
    measurement: Measurement
    step: float
    fitted: bool
    deformed: bool = False

    @property
    def clear(self) -> bool:
        """Whether its values lie so near to codewords that a better reading is not to be expected."""
        return bool(coherence(self.u) > (_MIN_COHERENCE_FITTED if self.fitted else _MIN_COHERENCE))


def _beyond_doubt(best: _Best | None, log10_p: float) -> bool:
    """Whether a reading is the one, with that p-value, all readings charged."""
    return best is not None and best.clear and log10_p < _STOP_LOG10_P


@dataclass(frozen=True, eq=False)
class Decoder:
    """Reads ``n_bits`` bits with the key's projections and the steps (s,) that the options allow.

    ``expected_step`` is that of a surface whose `Round.area_diagonal_ratio` is one; steps far from it need better
    evidence. ``search``: whether more than the first round is looked at.
    """

    projections: Projections
    steps: Floats
    n_bits: int
    expected_step: float
    search: bool = True

    def read(self, hypotheses: Hypotheses) -> Extraction:
        """The most significant reading; soft bits of zero where there is none.

        Rounds and deformations share the evidence asked for, as `_ROUNDS` says; within each all readings are alike.
        """
        best, least, readings = self._in_rounds(hypotheses)
        tried, deformed = len(readings), list[Floats]()
        if self.search and not _beyond_doubt(best, least):
            for candidate, kept in self._before_deformations(hypotheses):
                deformed.append(self._soft(kept).astype(np.float32))
                if candidate.log10_p < least:  # its own trials are charged already
                    best, least = candidate, candidate.log10_p
        if best is None:
            return Extraction(np.zeros(self.n_bits), view="nothing agrees with the key")
        readings = np.concatenate([readings, *deformed])
        charges = np.full(len(readings), math.ceil(tried / _ROUNDS))
        charges[tried:] = math.ceil((len(readings) - tried) / (1.0 - _ROUNDS))
        charge = charges[-1] if best.deformed else charges[0]
        return self._extraction(best, int(charge), readings, charges)

    def _in_rounds(self, hypotheses: Hypotheses) -> tuple[_Best | None, float, Floats]:
        """The best reading of the rounds, log10 of its p-value, all charged, and the soft bits (h, n_bits) of all."""
        best, least, readings = None, np.inf, list[Floats]()
        for round_ in hypotheses:
            measured = [m for each in round_.hypotheses for m in each.measurements(self.projections)]
            if not measured:
                continue
            found = self._readings(measured, round_.fit)
            readings += [self._soft(each.u).astype(np.float32) for each in found]
            log10_tried = np.log10(sum(map(len, readings)))
            candidate = self._best(measured, found, self._step_prior(round_))
            if candidate.log10_p + log10_tried < least:  # later rounds have more to choose from
                best, least = candidate, candidate.log10_p + log10_tried
            if not self.search or _beyond_doubt(best, best.log10_p + log10_tried if best else 0.0):
                break
        return best, least, np.concatenate(readings) if readings else np.empty((0, self.n_bits), np.float32)

    def _before_deformations(self, hypotheses: Hypotheses) -> Iterator[tuple[_Best, Floats]]:
        """Search by search, view by view, until one is beyond doubt."""
        for deformed in hypotheses.deformed:
            for candidate, kept in self._undeformed(deformed):
                yield candidate, kept
                if _beyond_doubt(candidate, candidate.log10_p):
                    return

    def _undeformed(self, deformed: Deformed) -> Iterator[tuple[_Best, Floats]]:
        """Search by search the best reading before a deformation, every trial charged, and the values (h, K) kept."""
        from o3dmark.methods.shape_spectrum.deformation import most_coherent

        expected = self.expected_step * deformed.area_diagonal_ratio
        steps = self.steps[np.abs(np.log2(self.steps / expected)) <= 1.0]
        if not len(steps):
            return
        seen = next(iter(deformed.undeformed.measurements(self.projections)))
        assert seen.jacobian is not None
        values, tried = deformed.surrogate.measured(self.projections), 0
        for starts, prior in values.searches(float(np.median(steps))):
            if not len(starts):
                continue
            tried += len(starts) * len(steps)
            d, place = most_coherent(values, starts, steps, self.projections.dither, self.n_bits, _STARTS)
            step = steps[place][:, None]
            motions = [np.broadcast_to(seen.jacobian[:, :7], (len(d), *seen.jacobian[:, :7].shape)), values.slope(d)]
            jacobian = np.concatenate(motions, axis=2)[:, :, : 7 + len(prior)] / step[:, :, None]
            priors = self._priors(seen, step, prior)
            moved = fit(values.at(d) / step - self.projections.dither, jacobian, priors)
            p = log10_p(moved.u, self.n_bits, moved.log10_trials) + np.log10(tried)
            order = np.argsort(p, kind="stable")
            found = replace(seen, view="before a deformation")
            best = moved.u[order[0]], float(p[order[0]]), found, float(step[order[0], 0])
            yield _Best(*best, fitted=True, deformed=True), moved.u[order[:_KEPT]]

    def _priors(self, seen: Measurement, steps: Floats, prior: Floats) -> Floats:
        """Covariances (h, 7 + p, 7 + p) of the frame's motions expected at steps (h, 1), and of others (p, p)."""
        assert seen.covariance is not None
        priors = np.zeros((len(steps), 7 + len(prior), 7 + len(prior)))
        priors[:, :7, :7] = seen.covariance[:7, :7] * (_NOISE * steps[:, :, None]) ** 2 + np.diag(_MIN_STD[:7] ** 2)
        priors[:, 7:, 7:] = prior
        return priors

    def _extraction(self, best: _Best, charge: int, readings: Floats, charges: Ints) -> Extraction:
        seen = best.measurement
        return Extraction(
            self._soft(best.u),
            charge,
            seen.part,
            seen.view,
            best.step,
            seen.smoothing,
            seen.passes,
            best.fitted,
            float(coherence(best.u)),
            readings=readings,
            charges=charges,
        )

    def _soft(self, u: Floats) -> Floats:
        """Soft bits (..., n_bits) of values (..., K) in periods; projection j carries bit j modulo n_bits."""
        return np.asarray(-np.cos(2.0 * np.pi * u).reshape(*u.shape[:-1], -1, self.n_bits).mean(axis=-2))

    def _step_prior(self, round_: Round) -> Floats:
        """What to add to log10 of the p-value of a reading at each step (s,)."""
        octaves = np.abs(np.log2(self.steps / (self.expected_step * round_.area_diagonal_ratio)))
        return np.asarray(_STEP_PRIOR * np.maximum(octaves - 1.0, 0.0))

    def _readings(self, measured: Sequence[Measurement], fitting: bool) -> list[_Readings]:
        """All measurements at all steps, as they are and, if so wanted, fitted."""
        values = np.array([each.values for each in measured])
        u = (values[:, None] / self.steps[:, None] - self.projections.dither).reshape(-1, values.shape[1])
        found = [_Readings(u, log10_p(u, self.n_bits))]
        if fitting:
            jacobian = np.array([each.jacobian for each in measured])[:, None] / self.steps[:, None, None]
            spread = (_NOISE * self.steps[:, None, None]) ** 2
            covariance = np.array([each.covariance for each in measured])[:, None] * spread
            prior = (covariance + np.diag(_MIN_STD**2)).reshape(-1, 8, 8)
            moved = fit(u, jacobian.reshape(len(u), -1, 8), prior)
            found.append(_Readings(moved.u, log10_p(moved.u, self.n_bits, moved.log10_trials), fitted=True))
        return found

    def _best(self, measured: Sequence[Measurement], found: list[_Readings], step_prior: Floats) -> _Best:
        """The most significant of all, the prior of its step included."""
        charged = [np.minimum(each.log10_p + np.tile(step_prior, len(measured)), 0.0) for each in found]
        which = int(np.argmin([each.min() for each in charged]))
        i = int(np.argmin(charged[which]))
        measurement, step = measured[i // len(self.steps)], float(self.steps[i % len(self.steps)])
        return _Best(found[which].u[i], float(charged[which][i]), measurement, step, found[which].fitted)
