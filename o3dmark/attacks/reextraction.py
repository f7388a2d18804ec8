"""Attacks that keep the shape and lose the mesh: it is sampled, and a surface is built anew from the samples.

Colours are those of the nearest old vertex, texture coordinates are dropped.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from scipy.spatial import KDTree

from o3dmark.attacks import ATTACKS, Attack
from o3dmark.attacks._carry import kept, made
from o3dmark.attacks._marching import resampled
from o3dmark.attacks.sampling import sampled_points, scanned_points
from o3dmark.errors import BackendError
from o3dmark.mesh.reconstruction import poisson
from o3dmark.mesh.similarity import UnitSize
from o3dmark.mesh.surface import Surface, mesh_arrays, triangle_mesh
from o3dmark.registry import option

if TYPE_CHECKING:
    from o3dmark.mesh.surface import PointCloud, TriangleMesh


@ATTACKS.register("resample")
@dataclass(frozen=True)
class Resample(Attack):
    """Marching cubes of the signed distance to the surface on a uniform grid.

    Only what is wider than a cell stays; an open boundary grows a collar up to 3.5 cells wide. The field is that of
    MeshLab's "uniform mesh resampling", in less memory: there a slanted rod of 40 sides takes all that there is.
    Source: Lorensen and Cline 1987, Marching cubes.
    """

    cells: int = option(100, "cells along the longest side of the bounding box, 4 to 1000")

    def __post_init__(self) -> None:
        if not 4 <= self.cells <= 1000:
            raise ValueError(f"cells should be 4 to 1000, not {self.cells}")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:  # noqa: ARG002
        built = resampled(Surface.of(mesh), self.cells)
        return made(mesh, built.vertices, built.triangles)


@ATTACKS.register("poisson")
@dataclass(frozen=True)
class Poisson(Attack):
    """Screened Poisson reconstruction from points uniform on the surface, with its normals.

    Source: Kazhdan and Hoppe 2013, Screened Poisson surface reconstruction; as Open3D has it.
    """

    points: int = option(30_000, "number of points")
    depth: int = option(7, "octree depth: the longest side is cut in about 2^depth cells, 3 to 11")
    trim: float = option(0.02, "surface further than this from every point is dropped, over the diagonal; 0: kept")

    def __post_init__(self) -> None:
        _check(self.points, self.depth, self.trim)

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        def build(unit: "TriangleMesh") -> "TriangleMesh":
            return _trimmed_poisson(sampled_points(unit, rng, self.points), self.depth, self.trim)

        return _rebuilt(mesh, build)


@ATTACKS.register("rescan")
@dataclass(frozen=True)
class Rescan(Attack):
    """A simulated scan (`sampling.scanned_points`: noise, occlusion, uneven density), then a surface through it.

    poisson     screened Poisson; smooth, closed over small gaps
    pivot       ball pivoting: goes through the noisy points themselves, leaves holes

    Source: the scanner is defined here; Kazhdan and Hoppe 2013 (poisson), Bernardini et al. 1999, The ball-pivoting
    algorithm for surface reconstruction (pivot), as Open3D has them.
    """

    points: int = option(30_000, "number of points")
    noise: float = option(5e-4, "standard deviation along the line of sight, over the bounding box's diagonal")
    views: int = option(8, "number of scanners around the mesh")
    surface: Literal["poisson", "pivot"] = option("poisson", "how the points become a mesh")
    depth: int = option(7, "octree depth of poisson, 3 to 11")
    trim: float = option(
        0.02, "poisson surface further than this from every point is dropped, over the diagonal; 0: kept"
    )

    def __post_init__(self) -> None:
        _check(self.points, self.depth, self.trim)
        if self.noise < 0 or self.views < 1:
            raise ValueError("wants noise >= 0 and views >= 1")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        def build(unit: "TriangleMesh") -> "TriangleMesh":
            cloud = scanned_points(unit, rng, self.points, self.noise, self.views)
            return _pivoted(cloud) if self.surface == "pivot" else _trimmed_poisson(cloud, self.depth, self.trim)

        return _rebuilt(mesh, build)


def _check(points: int, depth: int, trim: float) -> None:
    if points < 100 or not 3 <= depth <= 11 or trim < 0:
        raise ValueError("wants points >= 100, depth 3 to 11 and trim >= 0")


def _rebuilt(mesh: Any, build: "Callable[[TriangleMesh], TriangleMesh]") -> "TriangleMesh":
    """What ``build`` makes of a mesh that is brought to the origin and to a diagonal of one, in the place of ``mesh``.

    Open3D's Poisson reconstruction computes in float32, and its ball pivoting knows no ball below a millionth.
    """
    surface = Surface.of(mesh)
    unit = UnitSize.about_mean(surface.vertices)
    vertices, triangles = mesh_arrays(build(triangle_mesh(unit.apply(surface.vertices), surface.triangles)))
    return made(mesh, unit.undo(vertices), triangles)


def _trimmed_poisson(cloud: "PointCloud", depth: int, trim: float) -> "TriangleMesh":
    """The Poisson surface of oriented points, without what is further than ``trim`` diagonals from all of them.

    Not even the largest gap between evenly drawn points is trimmed: it is about three times their mean spacing.
    """
    built = poisson(cloud, depth)
    vertices, triangles = mesh_arrays(built)
    reach = trim * float(np.linalg.norm(cloud.get_max_bound() - cloud.get_min_bound())) if trim else np.inf
    spacing = float(np.mean(cloud.compute_nearest_neighbor_distance()))
    far = KDTree(np.asarray(cloud.points)).query(vertices)[0] > max(reach, 4.0 * spacing)
    stays = ~far[triangles].any(axis=1)
    return kept(built, stays) if stays.any() else built


def _pivoted(cloud: "PointCloud") -> "TriangleMesh":
    """The surface that balls of twice and four times the mean spacing roll over."""
    import open3d as o3d

    spacing = float(np.mean(cloud.compute_nearest_neighbor_distance()))
    radii = o3d.utility.DoubleVector([2.0 * spacing, 4.0 * spacing])
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        built = o3d.geometry.TriangleMesh.create_from_point_cloud_ball_pivoting(cloud, radii)
    if not built.has_triangles():
        raise BackendError(f"Open3D's ball pivoting of {len(cloud.points)} points has no triangle")
    return built
