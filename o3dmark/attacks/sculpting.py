"""Edits of a part of the shape, or of its grain: what a sculptor's brush, a saw or a filter does."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from o3dmark.arrays import Floats
from o3dmark.attacks import ATTACKS, Attack
from o3dmark.attacks._carry import checked_arrays, copied, made, moved
from o3dmark.attacks.connectivity import simplified
from o3dmark.attacks.geometry import random_direction
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface, with_vertices
from o3dmark.registry import option


@ATTACKS.register("flatten")
@dataclass(frozen=True)
class Flatten(Attack):
    """The vertices furthest along a random direction fall to the plane in which the next one lies.

    Source: defined here; a cap filed off, so that the model stands.
    """

    share: float = option(0.02, "share of the vertices that fall, 0 to 0.99; 0: none")

    def __post_init__(self) -> None:
        if not 0 <= self.share <= 0.99:
            raise ValueError(f"share should be 0 to 0.99, not {self.share}")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, triangles = checked_arrays(mesh)
        if not self.share:
            return copied(mesh)
        direction, used = random_direction(rng), geometry.used_vertices(triangles)
        height = vertices @ direction
        plane = np.sort(height[used])[-round(self.share * len(used)) - 1]
        return moved(mesh, vertices - np.maximum(height - plane, 0.0)[:, None] * direction)


@ATTACKS.register("bump")
@dataclass(frozen=True)
class Bump(Attack):
    """A bump about a random vertex: each vertex goes outward by height exp(-(distance/radius)^2 / 2).

    Source: defined here; one stroke of a sculptor's brush.
    """

    height: float = option(0.03, "of the bump, over the bounding box's diagonal; below 0: a dent; 0: none")
    radius: float = option(0.05, "of the bump, over the bounding box's diagonal")

    def __post_init__(self) -> None:
        if not (-1 <= self.height <= 1 and 0 < self.radius <= 1):
            raise ValueError("wants height in -1 .. 1 and radius in 0 .. 1")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, triangles = checked_arrays(mesh)
        if not self.height:
            return copied(mesh)
        seed = rng.choice(geometry.used_vertices(triangles))
        diagonal = geometry.diagonal(vertices)
        outward = geometry.unit(geometry.vertex_area_vectors(vertices, triangles)[seed][None])[0]
        distance = np.linalg.norm(vertices - vertices[seed], axis=1) / (self.radius * diagonal)
        return moved(mesh, vertices + self.height * diagonal * np.exp(-0.5 * distance**2)[:, None] * outward)


@ATTACKS.register("half")
@dataclass(frozen=True)
class Half(Attack):
    """One half of the surface smoothed or simplified; the other stays as it is.

    The halves are cut by a random plane through the middle vertex. Smoothing is umbrella smoothing of strength 0.1,
    simplification that of `simplify`. Source: defined here.
    """

    edit: Literal["smooth", "simplify"] = option("smooth", "what is done to the half")
    iterations: int = option(30, "passes of smoothing; 0: none")
    ratio: float = option(0.5, "share of the half's triangles that simplification removes; 0: none")

    def __post_init__(self) -> None:
        if self.iterations < 0 or not 0 <= self.ratio <= 0.999:
            raise ValueError("wants iterations >= 0 and ratio in 0 .. 0.999")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        surface = Surface.of(mesh)
        if not (self.iterations if self.edit == "smooth" else self.ratio):
            return copied(mesh)
        height = surface.vertices @ random_direction(rng)
        there = height > np.median(height)
        if self.edit == "simplify":
            return made(mesh, *simplified(surface, self.ratio, np.all(there[surface.triangles], axis=1)))
        v = surface.vertices
        for _ in range(self.iterations):
            v = v + 0.1 * there[:, None] * (surface.neighbour_mean @ v - v)
        return with_vertices(mesh, surface, v)


@ATTACKS.register("sharpen")
@dataclass(frozen=True)
class Sharpen(Attack):
    """Unsharp masking: v += strength * (v - v after some passes of umbrella smoothing).

    Source: the inverse of Wang et al.'s smoothing; the filter of modelling programs.
    """

    strength: float = option(0.5, "share of the removed detail that is added; 0: none")
    iterations: int = option(10, "passes of smoothing, of strength 0.1, that say what detail is")

    def __post_init__(self) -> None:
        if self.strength < 0 or self.iterations < 1:
            raise ValueError("wants strength >= 0 and iterations >= 1")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:  # noqa: ARG002
        surface = Surface.of(mesh)
        if not self.strength:
            return copied(mesh)
        smooth = surface.vertices
        for _ in range(self.iterations):
            smooth = smooth + 0.1 * (surface.neighbour_mean @ smooth - smooth)
        return with_vertices(mesh, surface, surface.vertices + self.strength * (surface.vertices - smooth))


@ATTACKS.register("bilateral")
@dataclass(frozen=True)
class Bilateral(Attack):
    """Bilateral denoising: each vertex goes along its normal by a mean of its neighbours' heights above its plane.

    Neighbours count the less the further away they are, over the mean edge, and the higher they stand, over ``height``
    mean edges, so that edges stay. Source: Fleishman, Drori and Cohen-Or 2003, Bilateral mesh denoising; here with the
    vertices one edge away.
    """

    iterations: int = option(5, "number of passes; 0: none")
    height: float = option(0.3, "standard deviation of the heights that are taken for noise, over the mean edge")

    def __post_init__(self) -> None:
        if self.iterations < 0 or self.height <= 0:
            raise ValueError("wants iterations >= 0 and height above 0")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:  # noqa: ARG002
        surface = Surface.of(mesh)
        if not self.iterations:
            return copied(mesh)
        edges = geometry.edges(surface.triangles)
        a, b = np.concatenate([edges, edges[:, ::-1]]).T
        mean = float(np.linalg.norm(surface.vertices[edges[:, 0]] - surface.vertices[edges[:, 1]], axis=1).mean())
        v = surface.vertices
        for _ in range(self.iterations):
            normals = surface.moved(v).normals
            away = v[b] - v[a]
            height = np.einsum("ed,ed->e", away, normals[a])
            weight = np.exp(-0.5 * np.sum(away**2, axis=1) / mean**2 - 0.5 * (height / (self.height * mean)) ** 2)
            total = 1.0 + np.bincount(
                a, weight, minlength=len(v)
            )  # the vertex itself counts whole, or corners would go
            v = v + (np.bincount(a, weight * height, minlength=len(v)) / total)[:, None] * normals
        return with_vertices(mesh, surface, v)


@ATTACKS.register("warp")
@dataclass(frozen=True)
class Warp(Attack):
    """Motion along the normals by a random sum of plane waves, as long as those that hide a mark.

    Waves fit between ``lowest`` and ``highest`` times into the box of six radii of gyration. Source: defined here; what
    who knows the method, but not the key, does against it.
    """

    amplitude: float = option(5.8e-4, "RMS motion, over the bounding box's diagonal; 0: none")
    lowest: float = option(4.0, "the longest waves fit so often into the box")
    highest: float = option(12.0, "the shortest waves fit so often into the box")

    def __post_init__(self) -> None:
        if self.amplitude < 0 or not 0 < self.lowest <= self.highest:
            raise ValueError("wants amplitude >= 0 and 0 < lowest <= highest")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        surface = Surface.of(mesh)
        if not self.amplitude:
            return copied(mesh)
        area = surface.vertex_areas
        x = surface.vertices - surface.centroid
        x = x / np.sqrt(area @ np.sum(x**2, axis=1) / area.sum()) / 6.0
        cube = rng.uniform(self.lowest**3, self.highest**3, 500) ** (1.0 / 3.0)
        waves = cube[:, None] * geometry.unit(rng.standard_normal((500, 3)))
        motion: Floats = np.zeros(len(x))
        for wave, phase in zip(waves, rng.uniform(0.0, 2.0 * np.pi, 500), strict=True):
            motion += np.cos(2.0 * np.pi * (x @ wave) + phase)
        motion *= self.amplitude * surface.diagonal / np.sqrt(area @ motion**2 / area.sum())
        return with_vertices(mesh, surface, surface.vertices + motion[:, None] * surface.normals)
