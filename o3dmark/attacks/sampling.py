"""Oriented points from a mesh: drawn evenly, or as a scanner sees it."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from o3dmark.arrays import Bools, Floats
from o3dmark.attacks.geometry import random_rotation
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.rays import scene_of
from o3dmark.mesh.sampling import sampled
from o3dmark.mesh.similarity import UnitSize
from o3dmark.mesh.surface import Surface, point_cloud
from o3dmark.solid.closing import oriented

if TYPE_CHECKING:
    from o3dmark.mesh.surface import PointCloud

_ROUNDS = 50  # of drawing candidates before the scan takes what it has; shapes in the open take two to five
_LIFT = 1e-4  # over the diagonal: rays start off the surface, or float32 would let it hide its own points


def sampled_points(mesh: Any, rng: np.random.Generator, points: int) -> "PointCloud":
    """``points`` positions uniform on the surface, each with the unit normal of its triangle."""
    return point_cloud(*_oriented_points(Surface.of(mesh), points, rng))


def scanned_points(
    mesh: Any, rng: np.random.Generator, points: int = 30_000, noise: float = 5e-4, views: int = 8
) -> "PointCloud":
    """The oriented points of a simulated scan of a mesh.

    ``views`` scanners stand far away, evenly about the mesh and turned at random. Each sees only what faces it and is
    not hidden, the less densely the more it slants (by the cosine); a point is off by N(0, (noise diagonal)^2) along
    its line of sight. A mesh that is inside out is seen from outside all the same. Fewer than ``points`` come back only
    if next to nothing can be seen. Normals (unit) are those of the triangles turned outward, without error.
    Errors: MeshError if no scanner sees anything.
    """
    received = Surface.of(mesh)
    surface = replace(received, triangles=oriented(received.vertices, received.triangles))
    directions = _directions(views) @ random_rotation(rng, 2.0 * np.pi).T
    unit = UnitSize(surface.centroid, surface.diagonal)  # Open3D casts rays in float32
    scene, seen = scene_of(unit.apply(surface.vertices), surface.triangles), []
    for _ in range(_ROUNDS):
        positions, normals = _oriented_points(surface, 4 * points, rng)
        sight = directions[rng.integers(len(directions), size=len(positions))]
        facing = np.einsum("ij,ij->i", normals, sight) > rng.uniform(0.0, 1.0, len(positions))
        positions, normals, sight = positions[facing], normals[facing], sight[facing]
        open_sky = _unhidden(scene, unit.apply(positions + _LIFT * surface.diagonal * normals), sight)
        depth = noise * surface.diagonal * rng.standard_normal((open_sky.sum(), 1))
        seen.append(np.hstack([positions[open_sky] + depth * sight[open_sky], normals[open_sky]]))
        if sum(map(len, seen)) >= points:
            break
    rows = np.concatenate(seen)[:points]
    if not len(rows):
        raise MeshError(f"none of {views} scanners sees anything of this mesh; is it hidden in a box?")
    return point_cloud(rows[:, :3], rows[:, 3:])


def _oriented_points(surface: Surface, count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Positions (count, 3) uniform by area and the unit normals of their triangles."""
    points, triangle = sampled(surface, count, rng)
    return points, geometry.unit(geometry.area_vectors(surface.vertices, surface.triangles[triangle]))


def _directions(count: int) -> Floats:
    """Unit vectors (count, 3) spread evenly over the sphere (Fibonacci spiral)."""
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = np.arange(count) * np.pi * (3.0 - np.sqrt(5.0))
    radius = np.sqrt(1.0 - height**2)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)


def _unhidden(scene: Any, origins: Floats, sight: Floats) -> Bools:
    """True (n,) where nothing lies between a point (n, 3) and the scanner far away along ``sight`` (n, 3)."""
    import open3d as o3d

    rays = np.hstack([origins, sight]).astype(np.float32)
    return ~np.asarray(scene.test_occlusions(o3d.core.Tensor(rays)).numpy(), bool)
