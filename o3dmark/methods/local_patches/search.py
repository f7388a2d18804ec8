"""Finding patches: every vertex is a place to look from, at every angle; the best are refined, and judged.

Refinement fits a place and an angle, and how the surface was strained since: by itself, or because its scale is
another. Where asked to, the reader also looks at surfaces as if mirrored or turned inside out, and at any scale.

What a place shows does not hang on the key (`Seen`), so that many keys are tried at the price of one.

A patch is judged by itself: the one that agrees best says how surely the key's mark is there, charged for all places,
angles, strengths and kinds, and for what refinement gains. Others of its kind say no more about that, as they share
its dither, and where surfaces are alike so are they; patches of another kind do. Of the bits all patches speak.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
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
_ASIDE = 0.004  # for differences: over the radius, as a strain, and in radians
_PRIOR = np.array([0.02, 0.02, 0.012, 0.01, 0.01, 0.01])  # how far off places may be, in the ways of `Seen._views`
_NOISE = 0.08  # of phases about codewords
_APART = 0.5  # of a radius: a patch that is nearer to one found is the same
_TIE = 1e-6  # orders those whose p-value is 1
_SURE = -5.0  # log10 of the p-value of a patch that is believed
_LIKELY = -2.0  # and of another beside it
_RADII = 0.03, 0.3  # over the root of the area, of a whole or a fragment, or of one among foreign things
_RADII_OF_ANY_SCALE = 0.05, 0.22  # the same where the unit is not known
_NEXT_SCALE = 0.035  # from one of these to the next, as the logarithm of their ratio: refinement reaches 0.02
_FIRST = 0.08  # radius looked at first, then those next to it
_COARSE = 0.4  # mean edge over the radius, above which no patch can have been written


class Side(NamedTuple):
    """How coefficients change: to the conjugates in a mirrored surface, by their sign in one turned inside out."""

    mirrored: bool
    sign: float

    def of(self, found: Complexes) -> Complexes:
        """What is found in the surface as it was, by what is found (..., q) now."""
        return self.sign * (found.conj() if self.mirrored else found)


OUTSIDE = Side(mirrored=False, sign=1.0)
REVERSED = (Side(mirrored=True, sign=1.0), Side(mirrored=True, sign=-1.0), Side(mirrored=False, sign=-1.0))
"""Mirrored; turned inside out, which turns directions of angles too; and both."""


class Guess(NamedTuple):
    """What a patch may be."""

    share: Share
    strength: float
    side: Side


class Fit(NamedTuple):
    """How many of the ways of `Seen._views` are fitted, and the decades of p-value that this gains at most."""

    ways: int
    gain: float


# Gains above those of 120 wrong keys on a mesh (1.4 at most), and of 280 on three (3.0)
_FITS = Fit(3, 1.5), Fit(6, 3.5)


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

    def candidates(self, shares: Sequence[Share], times: int, sides: Sequence[Side] = (OUTSIDE,)) -> list[Hit]:
        """What may be patches, the surest first; charged for what is tried here, so many ``times``."""
        places, strengths = len(self.patches.centre), self.sampled.form.strengths
        if not places:
            return []
        guesses = [Guess(*each) for each in product(shares, strengths, sides)]
        scores = [best_angles(share, side.of(self.found), strength, _ANGLES) for share, strength, side in guesses]
        agreement = np.array([each.agreement for each in scores])
        charge = float(np.log10(float(places) * _ANGLES * len(guesses) * len(_FITS) * times))
        promising, which = self._promising(agreement.max(axis=0)), agreement.argmax(axis=0)
        refined: list[Hit] = []
        for number, guess in enumerate(guesses):
            mine = promising[which[promising] == number]
            for fit in _FITS if len(mine) else ():
                refined += self._refined(guess, mine, scores[number].angle[mine], fit, charge)
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

    def _refined(self, guess: Guess, places: Ints, angles: Floats, fit: Fit, charge: float) -> list[Hit]:
        """The best view near each of the places (p,) and angles (p,), by Gauss and Newton's method."""
        share, prior = guess.share, _PRIOR[: fit.ways]
        at, best = np.zeros((len(places), fit.ways)), np.full(len(places), -np.inf)
        hits: list[Hit | None] = [None] * len(places)
        for _ in range(_STEPS + 1):
            patches, values = self._views(guess, places, angles, at)
            phase = values[0] - share.dither
            agreement = share.agreement(phase)
            log10_p = np.minimum(share.log10_p(agreement) + charge + fit.gain, 0.0)
            for i in np.flatnonzero(agreement > best):
                patch = patches.among(np.array([i]))
                hits[i] = Hit(patch, share, guess.strength, float(agreement[i]), float(log10_p[i]), phase[i])
            best = np.maximum(best, agreement)
            slope = ((values[1:] - values[0]) / _ASIDE).transpose(1, 0, 2)
            off, period = share.off(phase)
            weighted = slope * (np.exp(-((4.0 * off / period) ** 2)) / _NOISE**2)[:, None]
            form = weighted @ slope.transpose(0, 2, 1) + np.diag(prior**-2.0)
            pull = np.einsum("pck,pk->pc", weighted, off) + at / prior**2
            at = at - np.linalg.solve(form, pull[:, :, None])[:, :, 0]
        return [hit for hit in hits if hit is not None]

    def _views(self, guess: Guess, places: Ints, angles: Floats, at: Floats) -> tuple[Patches, Floats]:
        """The patches off their places by ``at`` (p, w), and values (1 + w, p, K): there, and a little off in each way.

        The ways are two shifts over the radius, an angle, and, if asked for, three strains.
        """
        sampled, start, (count, ways) = self.sampled, self.patches.among(places), at.shape
        there = at + _ASIDE * np.eye(ways)[:, None]
        aside = np.concatenate([at[None], there[:2]])
        centres = start.centre + sampled.radius * np.einsum("spc,pcd->spd", aside[:, :, :2], start.frames()[:, :2])
        patches = sampled.patches(centres.reshape(-1, 3), np.tile(start.axis, (3, 1)))
        if ways > 3:
            rows = np.concatenate([np.arange(3 * count), np.tile(np.arange(count), ways - 3)])
            strain = np.concatenate([aside, there[3:]])[:, :, 3:].reshape(-1, 3)
            patches = patches.among(rows)._replace(strain=strain)
        found = guess.side.of(coefficients(sampled.grid, patches, disk_functions(sampled.form)))
        found = found.reshape(-1, count, found.shape[-1])
        values = [guess.share.values(each, angles + at[:, 2]) for each in found]
        values.insert(3, guess.share.values(found[0], angles + there[2, :, 2]))
        return patches.among(np.arange(count)), np.array(values) / guess.strength


def believed(candidates: Sequence[Hit]) -> list[Hit]:
    """Those of the candidates, surest first, that are patches: if one is beyond doubt, others are likely."""
    if not candidates or candidates[0].log10_p > _SURE:
        return []
    return [hit for hit in candidates if hit.log10_p < _LIKELY]


def radii(form: PatchFormat, surface: Surface) -> list[float]:
    """The radii at which a surface may have patches, the likeliest first."""
    unit = float(np.sqrt(surface.area))
    return _likeliest_first(form.rungs(_RADII[0] * unit, _RADII[1] * unit), surface)


def radii_of_any_scale(surface: Surface) -> list[float]:
    """The radii at which a surface whose unit nobody knows may have patches, the likeliest first."""
    low, high = (np.log(limit) for limit in _RADII_OF_ANY_SCALE)
    over_unit = np.exp(np.linspace(low, high, int(np.ceil((high - low) / _NEXT_SCALE)) + 1))
    return _likeliest_first((over_unit * np.sqrt(surface.area)).tolist(), surface)


def _likeliest_first(rungs: Sequence[float], surface: Surface) -> list[float]:
    """Those of the radii that the surface is not too coarse for, in the order in which they are tried."""
    first, edge = _FIRST * np.sqrt(surface.area), mean_edge(surface)
    return sorted((rung for rung in rungs if edge < _COARSE * rung), key=lambda rung: abs(np.log(rung / first)))


def mean_edge(surface: Surface) -> float:
    """The mean length of the edges."""
    ends = surface.vertices[geometry.edges(surface.triangles)]
    return float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).mean())
