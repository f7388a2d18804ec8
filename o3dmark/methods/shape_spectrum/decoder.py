"""The blind reader of shape-spectrum: which step, which frame, which smoothing? It tries them, and counts.

In each round of sights (see `_sights`) every view is read with every step of the ladder, as it is and fitted; the round
is the last when its best reading is beyond doubt.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from o3dmark.arrays import Floats
from o3dmark.methods import Extraction
from o3dmark.methods.shape_spectrum.fit import fit, significance
from o3dmark.methods.shape_spectrum.hypotheses import Sights, View
from o3dmark.methods.shape_spectrum.projections import Projections, coherence

_SETTLED = -6.0  # log10 of the p-value, all tries charged, below which a reading is beyond doubt, if also
_CLEAR = 0.8  # its coherence is above this as received,
_CLEAR_FITTED = 0.7  # or this after a fit
_RARITY = 2.0  # log10 of how much rarer steps become for every octave that they are more than one from the usual
_NOISE = 0.1  # vertex noise to expect, by the noise that it makes in a projection, in steps
_FLOOR = np.array([2e-4, 2e-4, 2e-4, 4e-4, 4e-4, 4e-4, 2e-4, 0.2])  # least doubt about frame motions and bulging


@dataclass(frozen=True, eq=False)
class _Candidates:
    """Every view at every step, as it is or fitted: values u (h, K), in periods, and log10 of their p-values (h,)."""

    u: Floats
    log_p: Floats
    clear: float  # the coherence from which on one of them may be beyond doubt
    note: str = ""


@dataclass(frozen=True, eq=False)
class _Reading:
    """The best values u (K,) of a round, in periods, and log10 of their p-value before the tries are charged."""

    u: Floats
    log_p: float
    clear: bool
    note: str


@dataclass(frozen=True, eq=False)
class Reader:
    """Reads ``n_bits`` bits with the key's projections and the steps (s,) that the options allow.

    ``usual`` is the step that a surface of `Sights.extent` one takes; steps far from it need better evidence.
    """

    projections: Projections
    steps: Floats
    n_bits: int
    usual: float

    def read(self, received: Sights) -> Extraction:
        """The most significant reading of what is seen; soft bits of zero where nothing is."""
        best, tried = _Reading(np.full(len(self.projections), 0.25), 0.0, False, "nothing agrees with the key"), 0
        least, readings = np.inf, list[Floats]()
        for sights, fitted in received:
            views = [view for sight in sights for view in sight.views(self.projections)]
            tried += len(views) * len(self.steps)
            if not views:
                continue
            candidates = self._candidates(views, fitted)
            readings += [self._soft(each.u).astype(np.float32) for each in candidates]
            reading = self._best(views, candidates, self._rarity(received))
            charged = reading.log_p + np.log10(max(tried, 1))  # later rounds have more to choose from
            if charged < least:
                best, least = reading, charged
            if best.clear and best.log_p + np.log10(tried) < _SETTLED:
                break
        return Extraction(self._soft(best.u), max(tried, 1), best.note, np.concatenate(readings) if readings else None)

    def _soft(self, u: Floats) -> Floats:
        """Soft bits (..., n_bits) of values (..., K) in periods; projection j carries bit j modulo n_bits."""
        return np.asarray(-np.cos(2.0 * np.pi * u).reshape(*u.shape[:-1], -1, self.n_bits).mean(axis=-2))

    def _rarity(self, received: Sights) -> Floats:
        """What to add to log10 of the p-value of a reading at each step (s,)."""
        octaves = np.abs(np.log2(self.steps / (self.usual * received.extent)))
        return np.asarray(_RARITY * np.maximum(octaves - 1.0, 0.0))

    def _candidates(self, views: Sequence[View], fitted: bool) -> list[_Candidates]:
        """All views at all steps, as they are and, if so wanted, fitted."""
        values = np.array([view.values for view in views])
        u = (values[:, None] / self.steps[:, None] - self.projections.dither).reshape(-1, values.shape[1])
        found = [_Candidates(u, significance(u, self.n_bits), _CLEAR)]
        if fitted:
            jacobian = np.array([view.jacobian for view in views])[:, None] / self.steps[:, None, None]
            doubt = np.array([view.doubt for view in views])[:, None] * (_NOISE * self.steps[:, None, None]) ** 2
            prior = (doubt + np.diag(_FLOOR**2)).reshape(-1, 8, 8)
            moved, freedom = fit(u, jacobian.reshape(len(u), -1, 8), prior)
            p = significance(moved, self.n_bits, freedom)
            found.append(_Candidates(moved, p, _CLEAR_FITTED, ", frame fitted"))
        return found

    def _best(self, views: Sequence[View], candidates: Sequence[_Candidates], rarity: Floats) -> _Reading:
        """The most significant of all."""
        among = min(candidates, key=lambda each: float(each.log_p.min()))
        p = np.minimum(among.log_p + np.tile(rarity, len(views)), 0.0)
        i = int(np.argmin(p))
        view, step = views[i // len(self.steps)], self.steps[i % len(self.steps)]
        clear = bool(coherence(among.u[i]) > among.clear)
        return _Reading(among.u[i], float(p[i]), clear, f"{view.note}{among.note}, step {step:.5f}")
