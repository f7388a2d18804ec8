"""Oriented points from a mesh: drawn evenly, or as a scanner sees it."""

from dataclasses import replace
from typing import Any

import numpy as np
import open3d as o3d
from numpy.typing import NDArray

from o3dmark.arrays import Floats, Ints
from o3dmark.attacks.geometry import random_direction, rotation_matrix
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import PointCloud, Surface, point_cloud
from o3dmark.solid.solid import oriented

_ROUNDS = 50  # of drawing candidates before the scan takes what it has


def sampled_points(mesh: Any, rng: np.random.Generator, points: int) -> PointCloud:
    """``points`` positions uniform on the surface, each with the unit normal of its triangle."""
    return point_cloud(*_draw(Surface.of(mesh), points, rng))


def scanned_points(
    mesh: Any, rng: np.random.Generator, points: int = 30_000, noise: float = 5e-4, views: int = 8
) -> PointCloud:
    """The oriented points of a simulated scan of a mesh.

    ``views`` scanners stand far away, evenly about the mesh and turned at random. Each sees only what faces it and is
    not hidden, the less densely the more it slants (by the cosine); a point is off by N(0, (noise diagonal)^2) along
    its line of sight. A mesh that is inside out is seen from outside all the same. Fewer than ``points`` come back only
    if next to nothing can be seen. Normals (unit) are those of the triangles turned outward, without error.
    Errors: MeshError if no scanner sees anything.
    """
    received = Surface.of(mesh)
    surface = replace(received, triangles=oriented(received.vertices, received.triangles))
    directions = _directions(views) @ rotation_matrix(random_direction(rng), rng.uniform(0.0, 2.0 * np.pi)).T
    scene, seen = _scene(surface), []
    for _ in range(_ROUNDS):
        positions, normals = _draw(surface, 4 * points, rng)
        sight = directions[rng.integers(len(directions), size=len(positions))]
        facing = np.einsum("ij,ij->i", normals, sight) > rng.uniform(0.0, 1.0, len(positions))
        positions, normals, sight = positions[facing], normals[facing], sight[facing]
        open_sky = _unhidden(scene, surface, positions + 1e-4 * surface.diagonal * normals, sight)
        depth = noise * surface.diagonal * rng.standard_normal((open_sky.sum(), 1))
        seen.append(np.hstack([positions[open_sky] + depth * sight[open_sky], normals[open_sky]]))
        if sum(map(len, seen)) >= points:
            break
    rows = np.concatenate(seen)[:points]
    if not len(rows):
        raise MeshError(f"none of {views} scanners sees anything of this mesh; is it hidden in a box?")
    return point_cloud(rows[:, :3], rows[:, 3:])


def _draw(surface: Surface, count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Positions (count, 3) uniform by area and the unit normals of their triangles."""
    vectors = geometry.area_vectors(surface.vertices, surface.triangles)
    cumulative = np.cumsum(np.linalg.norm(vectors, axis=1))
    chosen: Ints = np.searchsorted(cumulative, rng.uniform(0.0, cumulative[-1], count), side="right")
    chosen = np.minimum(chosen, len(vectors) - 1)
    a, b, c = np.moveaxis(surface.vertices[surface.triangles[chosen]], 1, 0)
    root, along = np.sqrt(rng.uniform(size=(count, 1))), rng.uniform(size=(count, 1))
    return (1.0 - root) * a + root * (1.0 - along) * b + root * along * c, geometry.unit(vectors[chosen])


def _directions(count: int) -> Floats:
    """Unit vectors (count, 3) spread evenly over the sphere (Fibonacci spiral)."""
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = np.arange(count) * np.pi * (3.0 - np.sqrt(5.0))
    radius = np.sqrt(1.0 - height**2)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)


def _scene(surface: Surface) -> Any:
    """A ray-casting scene of the surface, centred and with diagonal 1: Open3D casts in float32."""
    vertices = (surface.vertices - surface.centroid) / surface.diagonal
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor(vertices.astype(np.float32)), o3d.core.Tensor(surface.triangles.astype(np.uint32))
    )
    return scene


def _unhidden(scene: Any, surface: Surface, origins: Floats, sight: Floats) -> NDArray[np.bool_]:
    """True (n,) where nothing lies between a point (n, 3) and the scanner far away along ``sight`` (n, 3)."""
    rays = np.hstack([(origins - surface.centroid) / surface.diagonal, sight]).astype(np.float32)
    return ~np.asarray(scene.test_occlusions(o3d.core.Tensor(rays)).numpy(), bool)
