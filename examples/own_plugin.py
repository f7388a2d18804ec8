"""A toy method, a dithered distance of each vertex from the centre, and an attack: what `own.toml` measures."""

from dataclasses import dataclass

import numpy as np

from o3dmark.attacks import ATTACKS, Attack
from o3dmark.mesh.surface import Surface, with_vertices
from o3dmark.methods import METHODS, Extraction, Method
from o3dmark.registry import option


@METHODS.register("toy")
@dataclass(frozen=True)
class Toy(Method):
    """Distances from the centre on multiples of a step, a half aside for a 1; the vertices' order says which bit."""

    step: float = option(4e-3, "quantisation step, over the bounding-box diagonal")

    def embed(self, mesh, bits, key):
        surface, bits = Surface.of(mesh), np.asarray(bits)
        place, dither = self._carriers(surface, len(bits), key)
        radius = np.linalg.norm(surface.vertices - surface.centroid, axis=1)
        half = dither + bits[place] / 2
        wanted = (np.rint(radius / self._length(surface) - half) + half) * self._length(surface)
        outward = (surface.vertices - surface.centroid) / radius[:, None]
        return with_vertices(mesh, surface, surface.centroid + wanted[:, None] * outward)

    def extract(self, mesh, n_bits, key, *, reference=None):
        surface = Surface.of(mesh)
        place, dither = self._carriers(surface, n_bits, key)
        radius = np.linalg.norm(surface.vertices - surface.centroid, axis=1)
        soft = -np.cos(2 * np.pi * (radius / self._length(surface) - dither))
        return Extraction(np.bincount(place, soft, n_bits) / np.bincount(place, minlength=n_bits))

    def capacity(self, mesh):
        return len(Surface.of(mesh).vertices) // 8

    def _length(self, surface):
        return self.step * surface.diagonal

    def _carriers(self, surface, n_bits, key):
        """Which bit each vertex holds, and its dither: fair coins to whoever lacks the key."""
        n = len(surface.vertices)
        return key.stream("toy/order").permutation(n) % n_bits, key.stream("toy/dither").uniform(n)


@ATTACKS.register("swell")
@dataclass(frozen=True)
class Swell(Attack):
    """Every vertex goes along its normal."""

    amount: float = option(1e-3, "how far, over the bounding-box diagonal")

    def attack(self, mesh, rng):
        surface = Surface.of(mesh)
        return with_vertices(mesh, surface, surface.vertices + self.amount * surface.diagonal * surface.normals)
