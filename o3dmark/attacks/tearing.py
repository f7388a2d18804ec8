"""Attacks that tear a surface where nobody sees it: every triangle apart, or the whole into pieces."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from o3dmark.attacks import ATTACKS, Attack
from o3dmark.attacks._carry import checked_arrays, copied, moved, picked
from o3dmark.mesh import geometry
from o3dmark.registry import option


@ATTACKS.register("soup")
@dataclass(frozen=True)
class Soup(Attack):
    """Every triangle has corners of its own, each moved by U(-jitter, jitter) along every axis.

    ``flipped`` of the triangles, at random, are wound the other way round. Source: defined here; triangle soups come
    from converters that round, and one line of a program makes one.
    """

    jitter: float = option(1e-6, "largest motion of a coordinate, over the bounding box's diagonal")
    flipped: float = option(0.0, "share of the triangles turned over")

    def __post_init__(self) -> None:
        if self.jitter < 0 or not 0 <= self.flipped <= 1:
            raise ValueError("wants jitter >= 0 and flipped in 0 .. 1")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, triangles = checked_arrays(mesh)
        m = len(triangles)
        turned = rng.random(m) < self.flipped
        corners = np.arange(3 * m).reshape(-1, 3)
        corners[turned] = corners[turned][:, ::-1]
        torn = picked(mesh, triangles.ravel(), corners, np.arange(m))
        size = self.jitter * geometry.diagonal(vertices)
        return moved(torn, np.asarray(torn.vertices) + size * rng.uniform(-1.0, 1.0, (3 * m, 3)))


@ATTACKS.register("crack")
@dataclass(frozen=True)
class Crack(Attack):
    """Cut into ``pieces``, the triangles nearest to each of as many random vertices, each moved a little as a whole.

    Each piece goes ``gap`` of the bounding box's diagonal in a direction of its own. Source: defined here; parts that
    were exported one by one, and an edit that no eye sees.
    """

    pieces: int = option(64, "number of pieces; 1: none")
    gap: float = option(1e-6, "motion of each piece, over the bounding box's diagonal; 0: none")

    def __post_init__(self) -> None:
        if self.pieces < 1 or self.gap < 0:
            raise ValueError("wants pieces >= 1 and gap >= 0")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, triangles = checked_arrays(mesh)
        if self.pieces == 1 or not self.gap:
            return copied(mesh)
        seeds = vertices[rng.choice(geometry.used_vertices(triangles), min(self.pieces, len(vertices)), replace=False)]
        piece = cKDTree(seeds).query(vertices[triangles].mean(axis=1))[1]
        place = np.unique(np.stack([np.repeat(piece, 3), triangles.ravel()], axis=1), axis=0, return_inverse=True)
        (owner, old), corners = place[0].T, place[1].reshape(-1, 3)
        torn = picked(mesh, old, corners, np.arange(len(triangles)))
        shift = self.gap * geometry.diagonal(vertices) * geometry.unit(rng.standard_normal(seeds.shape))
        return moved(torn, np.asarray(torn.vertices) + shift[owner])
