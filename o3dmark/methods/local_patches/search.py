"""Finding patches: every vertex is a place to look from, at every angle; the best are refined, and judged.

What a place shows does not hang on the key (`Seen`), so that many keys are tried at the price of one.

A patch is judged by itself: the one that agrees best says how surely the key's mark is there, charged for all places,
angles, strengths and kinds, and for what refinement gains. Others of its kind say no more about that, as they share
its dither, and where surfaces are alike so are they; patches of another kind do. Of the bits all patches speak.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from o3dmark.arrays import Complexes, Floats, Ints
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface
from o3dmark.methods.local_patches.codewords import Share
from o3dmark.methods.local_patches.disk import disk_functions
from o3dmark.methods.local_patches.format import PatchFormat
from o3dmark.methods.local_patches.measuring import Patches, Sampled, coefficients, first_look, patches_at
from o3dmark.methods.local_patches.scoring import best_angles

_ANGLES = 256
_REFINED = 40  # places, each at its best angle
_WALKED = 4000  # places that are looked through for these
_PER_PATCH = 3  # of them within half a radius
_STEPS = 4  # of Gauss and Newton's method
_SHIFT, _TURN = 0.004, 0.004  # for differences: over the radius, and in radians
_PRIOR = np.array([0.02, 0.02, 0.012])  # how far off a place may be, over the radius, and an angle, in radians
_NOISE = 0.08  # of phases about codewords
_REFINEMENT = 1.5  # decades of p-value that fitting three parameters gains at most, of 400 readings with wrong keys
_APART = 0.5  # of a radius: a patch that is nearer to one found is the same
_TIE = 1e-6  # orders those whose p-value is 1
_SURE = -5.0  # log10 of the p-value of a patch that is believed
_LIKELY = -1.0  # and of another beside it
_RADII = 0.03, 0.3  # over the root of the area, of a whole or a fragment, or of one among foreign things
_FIRST = 0.08  # radius looked at first, then those next to it
_COARSE = 0.4  # mean edge over the radius, above which no patch can have been written


class Hit(NamedTuple):
    """What may be a patch: its share, strength, agreement T, log10 of its p-value, all charged, and phases (K,)."""

    patch: Patches
    share: Share
    strength: float
    agreement: float
    log10_p: float
    phase: Floats


@dataclass(frozen=True, eq=False)
class Seen:
    """What a surface shows at a radius from each of its places."""

    sampled: Sampled

    @cached_property
    def patches(self) -> Patches:
        """Those about its vertices that are clear of boundaries."""
        surface, sampled = self.sampled.surface, self.sampled
        here = surface.vertices, surface.normals
        everywhere = patches_at(sampled.form, sampled.coarse, *here, sampled.radius)
        return everywhere.among(sampled.whole(everywhere))

    @cached_property
    def found(self) -> Complexes:
        """The coefficients (p, q) of each."""
        return first_look(self.sampled.coarse, self.patches, disk_functions(self.sampled.form))

    def candidates(self, shares: Sequence[Share], times: int) -> list[Hit]:
        """What may be patches, the surest first; charged for what is tried here, so many ``times``."""
        places, strengths = len(self.patches.centre), self.sampled.form.strengths
        if not places:
            return []
        looks = [(share, strength) for share in shares for strength in strengths]
        scores = [best_angles(share, self.found, strength, _ANGLES) for share, strength in looks]
        agreement = np.array([each.agreement for each in scores])
        charge = float(np.log10(float(places) * _ANGLES * len(looks) * times)) + _REFINEMENT
        promising, which = self._promising(agreement.max(axis=0)), agreement.argmax(axis=0)
        refined: list[Hit] = []
        for number, (share, strength) in enumerate(looks):
            mine = promising[which[promising] == number]
            if len(mine):
                refined += self._refined(share, strength, mine, scores[number].angle[mine], charge)
        found: list[Hit] = []
        for hit in sorted(refined, key=lambda each: each.log10_p - each.agreement * _TIE):
            offset = [np.linalg.norm(hit.patch.centre - other.patch.centre) for other in found]
            if min(offset, default=np.inf) > _APART * self.sampled.radius:
                found.append(hit)
        return found

    def _promising(self, best: Floats) -> Ints:
        """The places to refine, the best first: of those about one patch a few."""
        kept: list[int] = []
        for place in np.argsort(-best, kind="stable")[:_WALKED].tolist():
            offset = self.patches.centre[kept] - self.patches.centre[place]
            if (np.linalg.norm(offset, axis=1) < _APART * self.patches.radius).sum() < _PER_PATCH:
                kept.append(place)
            if len(kept) == _REFINED:
                break
        return np.array(kept, np.int64)

    def _refined(self, share: Share, strength: float, places: Ints, angles: Floats, charge: float) -> list[Hit]:
        """The best view near each of the places (p,) and angles (p,), by Gauss and Newton's method."""
        at, best = np.zeros((len(places), 3)), np.full(len(places), -np.inf)
        hits: list[Hit | None] = [None] * len(places)
        for _ in range(_STEPS + 1):
            patches, values = self._views(share, strength, places, angles, at)
            phase = values[0] - share.dither
            agreement = share.agreement(phase)
            log10_p = np.minimum(share.log10_p(agreement) + charge, 0.0)
            for i in np.flatnonzero(agreement > best):
                patch = patches.among(np.array([i]))
                hits[i] = Hit(patch, share, strength, float(agreement[i]), float(log10_p[i]), phase[i])
            best = np.maximum(best, agreement)
            slope = ((values[1:] - values[0]) / np.array([_SHIFT, _SHIFT, _TURN])[:, None, None]).transpose(1, 0, 2)
            off, period = share.off(phase)
            weighted = slope * (np.exp(-((4.0 * off / period) ** 2)) / _NOISE**2)[:, None]
            form = weighted @ slope.transpose(0, 2, 1) + np.diag(_PRIOR**-2.0)
            pull = np.einsum("pck,pk->pc", weighted, off) + at / _PRIOR**2
            at = at - np.linalg.solve(form, pull[:, :, None])[:, :, 0]
        return [hit for hit in hits if hit is not None]

    def _views(self, share: Share, strength: float, places: Ints, angles: Floats, at: Floats) -> tuple[Patches, Floats]:
        """The patches at offsets (p, 3) from places, and values (4, p, K): there, a little aside twice, and turned."""
        sampled, start, count = self.sampled, self.patches.among(places), len(places)
        aside = at[None, :, :2] + np.array([[0.0, 0.0], [_SHIFT, 0.0], [0.0, _SHIFT]])[:, None]
        centres = start.centre + sampled.radius * np.einsum("spc,pcd->spd", aside, start.frames()[:, :2])
        patches = sampled.patches(centres.reshape(-1, 3), np.tile(start.axis, (3, 1)))
        found = coefficients(sampled.grid, patches, disk_functions(sampled.form)).reshape(3, count, -1)
        turned = angles + at[:, 2]
        values = [share.values(each, turned) for each in found] + [share.values(found[0], turned + _TURN)]
        return patches.among(np.arange(count)), np.array(values) / strength


def believed(candidates: Sequence[Hit]) -> list[Hit]:
    """Those of the candidates, surest first, that are patches: if one is beyond doubt, others are likely."""
    if not candidates or candidates[0].log10_p > _SURE:
        return []
    return [hit for hit in candidates if hit.log10_p < _LIKELY]


def radii(form: PatchFormat, surface: Surface) -> list[float]:
    """The radii at which a surface may have patches, the likeliest first."""
    unit, edge = float(np.sqrt(surface.area)), mean_edge(surface)
    rungs = [rung for rung in form.rungs(_RADII[0] * unit, _RADII[1] * unit) if edge < _COARSE * rung]
    return sorted(rungs, key=lambda rung: abs(np.log(rung / (_FIRST * unit))))


def mean_edge(surface: Surface) -> float:
    """The mean length of the edges."""
    ends = surface.vertices[geometry.edges(surface.triangles)]
    return float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).mean())
