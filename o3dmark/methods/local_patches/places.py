"""Where a surface takes patches, and how strong: as many as fit, none so strong that it is seen.

Places whose coefficients hardly change as one looks from a little aside are found again best. Among those, patches are
set one after the other so that their cylinders share no triangle. Each is as strong as its surroundings hide.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy

from o3dmark.arrays import Bits, Floats, Ints
from o3dmark.mesh.surface import Surface
from o3dmark.methods.local_patches.codewords import Share
from o3dmark.methods.local_patches.disk import disk_functions
from o3dmark.methods.local_patches.embedder import Piece, Plan
from o3dmark.methods.local_patches.measuring import Sampled, coefficients
from o3dmark.motion.visibility import Visibility

_LOOKED_AT = 2000  # vertices, of which places are chosen
_OF_COVER = 1000  # the best of them in a cover, looked at again in its copies: 500 took venus_50002 22 patches for 30
_ASIDE, _TURN = 0.01, np.pi / 256  # a shift, over the radius, and an angle by which places are tried
_SENSITIVE = 0.2  # rms change of phases by either, above which a place is no use
_CLEAR = 0.95  # of a radius about a centre, within which no other patch moves anything
_AGREEMENTS = (33.0, 30.0)  # of a patch that nothing disturbed, by preference
_MISSED = 0.12  # rms distance of phases from where they should be, above which a patch is given up
_MOST_TRIED = 300
_AROUND = 0.7  # of a radius, within which it is asked how well eyes see
_LEAST = 1.3  # vertices that may move, over the coefficients
_SEEN = 0.95  # of a patch that stays below what is said to be seen of it


class Place(NamedTuple):
    """A patch in a marked surface: the vertex at its centre, strength, agreement T, and how far it is seen, in jnd."""

    vertex: int
    kind: int
    strength: float
    agreement: float
    jnd: float


class Marked(NamedTuple):
    """Vertices (n, 3) with all patches written, and what these are."""

    vertices: Floats
    places: list[Place]


@dataclass(frozen=True, eq=False)
class Limits:
    """Of all patches together: RMS of the motion, in the mesh's unit; of each: its part that is seen, in jnd."""

    rms: float
    jnd: float


def spread(surface: Surface) -> Ints:
    """Some of the vertices (k,), all over their numbers."""
    return np.unique(np.linspace(0, len(surface.vertices) - 1, _LOOKED_AT).astype(np.int64))


def candidates(sampled: Sampled) -> Ints:
    """The best (k,) of those for patches, in a cover whose copies are yet to be moved; key and bits do not matter."""
    return _by_merit(sampled, Visibility(sampled.surface), spread(sampled.surface))[0][:_OF_COVER]


def written(sampled: Sampled, shares: Sequence[Share], bits: Bits, most: Limits, places: Ints) -> Marked:
    """The surface with as many patches as it takes within the limits; none where it takes none.

    ``places`` (k,): vertices, of which the best are taken.
    """
    surface = sampled.surface
    visibility = Visibility(surface)
    pieces = _pieces(sampled, *_by_merit(sampled, visibility, places))
    plans = [
        _Choices(piece, sensitivity, shares[i % len(shares)], bits) for i, (piece, sensitivity) in enumerate(pieces)
    ]
    look = surface.vertices.copy()
    for choices in plans:
        look[choices.piece.number[choices.piece.held]] = choices.first[choices.piece.held]
    seen = visibility.local(surface.moved(look))
    vertices, taken, square = surface.vertices.copy(), [], 0.0
    for choices in sorted(plans, key=lambda each: each.square):
        found = choices.within(float(np.quantile(seen[choices.piece.number[choices.piece.held]], _SEEN)), most.jnd)
        if found is None:
            continue
        plan, agreement, jnd = found
        done = plan.write(agreement)
        cost = choices.price(done.vertices)
        if done.missed > _MISSED or square + cost > most.rms**2 * surface.area:
            continue
        square += cost
        vertices[choices.piece.number] = done.vertices
        taken.append(
            Place(int(choices.piece.number[choices.piece.centre]), plan.share.kind, plan.strength, agreement, jnd)
        )
    return Marked(vertices, taken)


class _Choices:
    """A piece of the surface, and the strengths that it may take."""

    def __init__(self, piece: Piece, sensitivity: float, share: Share, bits: Bits) -> None:
        usable = [s for s in piece.form.strengths if sensitivity < _SENSITIVE * s]
        self.piece = piece
        self.plans = piece.plans(share, bits, usable)
        self.first = self.plans[0].first_order(_AGREEMENTS[0])
        self.square = self.price(self.first)

    def price(self, vertices: Floats) -> float:
        """The integral of the squared motion."""
        surface = self.piece.surface
        return float(((vertices - surface.vertices) ** 2).sum(axis=1) @ surface.vertex_areas)

    def within(self, jnd: float, most: float) -> tuple[Plan, float, float] | None:
        """The strongest plan, its agreement and its jnd, of which not too much is seen, where that is the first's."""
        for plan in self.plans:
            for agreement in _AGREEMENTS:
                seen = jnd * float(np.sqrt(self.price(plan.first_order(agreement)) / self.square))
                if seen <= most:
                    return plan, agreement, seen
        return None


def _by_merit(sampled: Sampled, visibility: Visibility, vertices: Ints) -> tuple[Ints, Floats]:
    """Of some vertices those (k,) where patches are clear of boundaries, and their sensitivities (k,): rms changes of
    coefficients as one looks a little aside. First those that are found again well for how strong nobody sees them."""
    surface, functions = sampled.surface, disk_functions(sampled.form)
    patches = sampled.patches(surface.vertices[vertices], surface.normals[vertices])
    whole = sampled.whole(patches)
    vertices, patches = vertices[whole], patches.among(whole)
    found = coefficients(sampled.grid, patches, functions)
    square = ((_TURN * functions.order * np.abs(found)) ** 2).sum(axis=1)
    for across in patches.frames()[:, :2].transpose(1, 0, 2):
        aside = sampled.patches(patches.centre + _ASIDE * sampled.radius * across, patches.axis)
        square += (np.abs(coefficients(sampled.grid, aside, functions) - found) ** 2).sum(axis=1)
    sensitivity = np.sqrt(square / functions.n_real)
    around = scipy.spatial.cKDTree(surface.vertices).query_ball_point(patches.centre, _AROUND * sampled.radius)
    acuity = np.array([visibility.acuity[near].mean() for near in around])
    order = np.argsort(sensitivity * acuity, kind="stable")
    order = order[sensitivity[order] < _SENSITIVE * max(sampled.form.strengths)]
    return vertices[order], sensitivity[order]


def _pieces(sampled: Sampled, vertices: Ints, sensitivities: Floats) -> list[tuple[Piece, float]]:
    """Pieces of the surface about some of the vertices that share no vertex that moves, with their sensitivities."""
    surface = sampled.surface
    scale = float(
        np.sqrt(np.average(((surface.vertices - surface.centroid) ** 2).sum(axis=1), weights=surface.vertex_areas))
    )
    taken = np.zeros(len(surface.vertices), bool)
    tree, found, tried = scipy.spatial.cKDTree(surface.vertices), [], 0
    for vertex, sensitivity in zip(vertices.tolist(), sensitivities.tolist(), strict=True):
        if tried == _MOST_TRIED:
            break
        here = surface.vertices[vertex]
        if taken[tree.query_ball_point(here, _CLEAR * sampled.radius)].any():
            continue
        tried += 1
        piece = Piece.about(sampled, vertex, scale)
        inside = piece.number[piece.held]
        if taken[inside].any() or len(inside) < _LEAST * disk_functions(sampled.form).n_real:
            continue
        taken[inside] = True
        found.append((piece, sensitivity))
    return found
