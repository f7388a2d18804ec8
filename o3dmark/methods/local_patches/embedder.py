"""Writing a patch: the cheapest motion that takes its coefficients to codewords, by Newton's method.

Patches whose cylinders share no triangle do not feel each other, so each is solved by itself, on the piece of the
surface that its cylinder holds; beyond that piece nothing moves. What a motion costs is told by `motion.metric`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from o3dmark.arrays import Bits, Bools, Complexes, Floats, Ints
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface
from o3dmark.methods.local_patches.codewords import Share
from o3dmark.methods.local_patches.disk import DiskFunctions, disk_functions
from o3dmark.methods.local_patches.format import PatchFormat
from o3dmark.methods.local_patches.measuring import (
    Patches,
    Sampled,
    answers,
    coefficients,
    grid_of,
    held,
    patches_at,
)
from o3dmark.motion.metric import Motions
from o3dmark.solid.quadrature import Rule

_RIDGE = 1e-3  # of the Gram matrix, over its mean eigenvalue: what is next to impossible is left undone
_STEPS = 6
_ARRIVED = 0.01  # rms distance of phases from codewords, at which to stop
_ANGLES = 128  # at which codewords are looked for
_WEIGHTS, _HALVINGS = (1e-6, 1e3), 30  # of errors, over the mean price; and how often their range is halved
_MIN_AREA_SHARE = 1e-3  # of the mean vertex area, so that slivers do not fly off


class Written(NamedTuple):
    """Where the vertices of a piece go (v, 3), and the rms distance of the phases from their codewords."""

    vertices: Floats
    missed: float


@dataclass(frozen=True, eq=False)
class Piece:
    """The part of a surface that a patch's cylinder holds, with the triangles next to it.

    ``number`` (v,) of its vertices in the whole; which of them are ``held`` (v,) and may move; ``centre``: the row of
    the patch's. ``scale``: the unit of length in which motions are priced.
    """

    surface: Surface
    number: Ints
    held: Bools
    centre: int
    rule: Rule
    form: PatchFormat
    radius: float
    scale: float

    @classmethod
    def about(cls, sampled: Sampled, centre: int, scale: float) -> "Piece":
        """Of the patch about a vertex of a surface."""
        surface, samples = sampled.surface, sampled.samples
        patch = sampled.patches(surface.vertices[[centre]], surface.normals[[centre]])
        inside = np.zeros(len(surface.vertices), bool)
        inside[samples.corners[held(samples.points, patch)]] = True
        near = np.asarray(inside[surface.triangles].any(axis=1))
        number, rows = np.unique(surface.triangles[near], return_inverse=True)
        piece = Surface(surface.vertices[number].copy(), rows.reshape(-1, 3), np.arange(len(number)))
        mine = near[sampled.rule.triangle]
        place = np.cumsum(near) - 1
        rule = Rule(place[sampled.rule.triangle[mine]], sampled.rule.share[mine], sampled.rule.weights[mine])
        row = int(np.searchsorted(number, centre))
        return cls(piece, number, inside[number], row, rule, sampled.form, sampled.radius, scale)

    @property
    def functions(self) -> DiskFunctions:
        return disk_functions(self.form)

    def measured(self, vertices: Floats) -> tuple[Patches, Complexes]:
        """The patch and its coefficients (q,), as a reader finds them with the vertices there."""
        surface = self.surface.moved(vertices)
        samples = self.rule.samples(surface)
        grid = grid_of(samples.points, samples.area_vectors, self.radius)
        here = surface.vertices[[self.centre]], surface.normals[[self.centre]]
        patch = patches_at(self.form, grid, *here, self.radius)
        return patch, coefficients(grid, patch, self.functions)[0]

    @cached_property
    def motions(self) -> Motions:
        surface = self.surface
        normals = surface.normals
        area = surface.vertex_areas / self.scale**2
        weights = np.maximum(area, _MIN_AREA_SHARE * area.mean())
        vertices = surface.vertices / self.scale
        return Motions.unseen(vertices, surface.triangles, normals, weights, self.held & (normals != 0).any(axis=1))

    def jacobian(self, vertices: Floats, patch: Patches) -> Complexes:
        """Change of each coefficient as vertices go by one unit in each of the directions of `motions`: (q, d)."""
        samples = self.rule.samples(self.surface.moved(vertices))
        inside = held(samples.points, patch)
        gain = answers(samples.points[inside], patch, self.functions)
        ways = samples.weights[inside][:, :, None] * samples.area_vectors[inside][:, None, :]
        speed = geometry.motions_along(samples.corners[inside], ways, len(self.number)) @ self.motions.directions
        return np.asarray((speed.T @ gain).T * self.scale)

    def plans(self, share: Share, bits: Bits, strengths: Sequence[float]) -> "list[Plan]":
        """How to take the coefficients to codewords of the bits at each strength, from the angle of least cost."""
        answer, least = (_seen(share, each, np.zeros(1)) for each in self._answers)
        price = _inverse(answer @ least.T)
        return [self._plan(share, bits, strength, price) for strength in strengths]

    def _plan(self, share: Share, bits: Bits, strength: float, price: Floats) -> "Plan":
        found = self._unmoved[1] / strength
        angle = _cheapest(share, found, bits, price)
        answer, least = (_seen(share, each, angle) for each in self._answers)
        phase = share.values(found[None], angle)[0]
        gram = answer @ least.T / strength**2
        return Plan(self, share, strength, angle, least / strength, gram, phase, share.codewords(phase, bits))

    @cached_property
    def _unmoved(self) -> tuple[Patches, Complexes]:
        return self.measured(self.surface.vertices)

    @cached_property
    def _answers(self) -> tuple[Complexes, Complexes]:
        """The jacobian (q, d), and the cheapest motions that go along with it (q, d)."""
        jacobian = self.jacobian(self.surface.vertices, self._unmoved[0])
        return jacobian, self.motions.least(jacobian.real) + 1j * self.motions.least(jacobian.imag)

    def moved(self, vertices: Floats, along: Floats) -> Floats:
        """Vertices (v, 3) after a motion (d,) in the directions of `motions`."""
        return np.asarray(vertices + (self.motions.directions @ along).reshape(-1, 3) * self.scale)


@dataclass(frozen=True, eq=False)
class Plan:
    """A patch about to be written: the ``least`` motions (K, d) for its coefficients, their Gram matrix (K, K), the
    phases (K,) as they are and the codewords (K,) that they should have, in periods."""

    piece: Piece
    share: Share
    strength: float
    angle: Floats
    least: Floats
    gram: Floats
    phase: Floats
    codeword: Floats

    def first_order(self, agreement: float) -> Floats:
        """Where the vertices (v, 3) go for so much agreement, nearly."""
        asked = self.least.T @ (self._inverse @ (self.target(agreement) - self.phase))
        return self.piece.moved(self.piece.surface.vertices, asked)

    def write(self, agreement: float) -> Written:
        """Take the coefficients so far that they agree so well."""
        vertices, phase, missed = self.piece.surface.vertices, self.phase, np.inf
        target = self.target(agreement)
        for _ in range(_STEPS):
            vertices = self.piece.moved(vertices, self.least.T @ (self._inverse @ (target - phase)))
            _, found = self.piece.measured(vertices)
            phase = self.share.values(found[None] / self.strength, self.angle)[0]
            missed = float(np.sqrt(np.mean((target - phase) ** 2)))
            if missed < _ARRIVED:
                break
        return Written(vertices, missed)

    @cached_property
    def _inverse(self) -> Floats:
        return _inverse(self.gram)

    @cached_property
    def _spectrum(self) -> tuple[Floats, Floats]:
        """Eigenvalues (K,) and vectors (K, K) of the Gram matrix, errors of carriers counted fourfold."""
        root = 1.0 / self.share.period
        values, vectors = np.linalg.eigh(root[:, None] * self.gram * root)
        return values, vectors

    def target(self, agreement: float) -> Floats:
        """How far to take phases (K,) towards their codewords for so much agreement at the least cost.

        Of the price of the motion plus a weight times the squared distances left, carriers' counted fourfold, the
        least.
        """
        root, (values, vectors) = 1.0 / self.share.period, self._spectrum
        wanted = vectors.T @ (root * (self.codeword - self.phase))
        low, high = _WEIGHTS
        for _ in range(_HALVINGS):
            weight = np.sqrt(low * high)
            share = values / (values + weight * values.mean())
            target = self.phase + vectors @ (share * wanted) / root
            if self.share.agreement(target - self.share.dither) > agreement:
                low = weight
            else:
                high = weight
        return np.asarray(target)


def _cheapest(share: Share, found: Complexes, bits: Bits, price: Floats) -> Floats:
    """The angle (1,) from which the codewords of the bits are nearest, as motion goes: by the ``price`` (K, K) of
    changes seen from angle 0."""
    angles = 2.0 * np.pi / _ANGLES * np.arange(float(_ANGLES))
    phase = share.values(found[None], angles)
    turned = share.restored(share.codewords(phase, bits) - phase, angles)
    change = share.values(turned, np.zeros(1))
    return angles[[np.argmin(((change @ price) * change).sum(axis=1))]]


def _seen(share: Share, jacobian: Complexes, angle: Floats) -> Floats:
    """The answers (K, d) of the real coefficients seen from an angle (1,), from those (q, d) of the complex ones."""
    return share.values(jacobian.T, angle).T


def _inverse(gram: Floats) -> Floats:
    return np.asarray(np.linalg.inv(gram + _RIDGE * np.trace(gram) / len(gram) * np.eye(len(gram))))
