"""Low-pass filters. They act on the welded surface, so that no seam opens, and keep the vertices of the boundary."""

# ruff: noqa: ARG002 - attacks without randomness take an rng too

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp

from o3dmark.arrays import Floats
from o3dmark.attacks import ATTACKS, Attack
from o3dmark.attacks._carry import copied
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface, with_vertices
from o3dmark.registry import option

_LARGEST = 1e12  # cotangent: beyond, the triangle has no area but for rounding, and counts nowhere


@ATTACKS.register("smooth")
@dataclass(frozen=True)
class Smooth(Attack):
    """Laplacian smoothing: all vertices at once, v += strength * (weighted mean of the neighbours - v), repeated.

    umbrella     every neighbour counts the same (the benchmark; Taubin 2000, A signal processing approach)
    cotangent    neighbours count by the cotangents opposite the edge, none below zero, computed anew each time: moves
                 vertices along the normal more than within the surface (Desbrun et al. 1999)

    Source: Wang et al. 2010, A benchmark for 3D mesh watermarking, "smoothing", strength 0.1, 5 to 50 iterations.
    """

    iterations: int = option(10, "number of passes; 0: none")
    strength: float = option(0.1, "lambda, the share of the way to the neighbours' mean; 0: none")
    weights: Literal["umbrella", "cotangent"] = option("umbrella", "how neighbours count")

    def __post_init__(self) -> None:
        if self.iterations < 0 or not 0 <= self.strength <= 1:
            raise ValueError("wants iterations >= 0 and strength in 0 .. 1")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        def one_pass(surface: Surface, v: Floats) -> Floats:
            mean = surface.neighbour_mean if self.weights == "umbrella" else _cotangent_mean(surface.moved(v))
            return np.asarray(v + self.strength * (mean @ v - v))

        return _repeated(mesh, one_pass, self.iterations if self.strength else 0)


@ATTACKS.register("taubin")
@dataclass(frozen=True)
class Taubin(Attack):
    """Smoothing without shrinkage: a pass with ``strength`` (lambda), then one with the negative ``back`` (mu).

    Source: Taubin 1995, A signal processing approach to fair surface design.
    """

    iterations: int = option(10, "number of double passes; 0: none")
    strength: float = option(0.5, "lambda, the share of the way to the neighbours' mean")
    back: float = option(-0.53, "mu, the share of the way back from their mean, a little below -lambda")

    def __post_init__(self) -> None:
        if self.iterations < 0 or not 0 <= self.strength <= 1 or not -1.1 <= self.back <= 0:
            raise ValueError("wants iterations >= 0, strength in 0 .. 1 and back in -1.1 .. 0")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        def one_pass(surface: Surface, v: Floats) -> Floats:
            for step in (self.strength, self.back):
                v = v + step * (surface.neighbour_mean @ v - v)
            return v

        return _repeated(mesh, one_pass, self.iterations)


@ATTACKS.register("hc")
@dataclass(frozen=True)
class HC(Attack):
    """Laplacian smoothing that pushes vertices back towards where they were ("humphrey's classes").

    Source: Vollmer, Mencl and Mueller 1999, Improved Laplacian smoothing of noisy surface meshes.
    """

    iterations: int = option(10, "number of passes; 0: none")
    alpha: float = option(0.0, "pull to the original position rather than to the previous one, 0 .. 1")
    beta: float = option(0.5, "a vertex's own share in its push back, against its neighbours', 0 .. 1")

    def __post_init__(self) -> None:
        if self.iterations < 0 or not 0 <= self.alpha <= 1 or not 0 <= self.beta <= 1:
            raise ValueError("wants iterations >= 0, alpha and beta in 0 .. 1")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        def one_pass(surface: Surface, q: Floats) -> Floats:
            o, mean = surface.vertices, surface.neighbour_mean
            p = mean @ q
            b = p - (self.alpha * o + (1.0 - self.alpha) * q)
            return np.asarray(p - (self.beta * b + (1.0 - self.beta) * (mean @ b)))

        return _repeated(mesh, one_pass, self.iterations)


def _repeated(mesh: Any, one_pass: Callable[[Surface, Floats], Floats], iterations: int) -> Any:
    surface = Surface.of(mesh)
    if not iterations:
        return copied(mesh)
    boundary = geometry.boundary_vertices(surface.triangles, len(surface.vertices))[:, None]
    v = surface.vertices
    for _ in range(iterations):
        v = np.where(boundary, surface.vertices, one_pass(surface, v))
    return with_vertices(mesh, surface, v)


def _cotangent_mean(surface: Surface) -> sp.csr_array:
    """The row-stochastic matrix (n, n) of clipped cotangent weights; a vertex without any stays where it is."""
    t, n = surface.triangles, len(surface.vertices)
    cotangents = geometry.cotangents(surface.vertices, t)
    cotangents = np.where(np.abs(cotangents) < _LARGEST, cotangents, 0.0)
    weights = sp.csr_array((n, n))
    for corner in range(3):  # a corner's cotangent weighs the edge that faces it
        half = sp.csr_array((cotangents[:, corner], (t[:, (corner + 1) % 3], t[:, (corner + 2) % 3])), shape=(n, n))
        weights = weights + half + half.T
    weights.data = np.maximum(weights.data, 0.0)
    total = np.asarray(weights.sum(axis=1)).ravel()
    weights = weights + sp.diags_array((total == 0.0).astype(np.float64))
    return sp.csr_array(sp.diags_array(1.0 / np.where(total == 0.0, 1.0, total)) @ weights)
