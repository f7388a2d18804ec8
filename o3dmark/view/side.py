"""The side of a mesh that shows most of it, or most of what is to be seen on it."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import open3d as o3d
from numpy.typing import ArrayLike

from o3dmark.arrays import Floats, Ints
from o3dmark.mesh.rays import scene_of
from o3dmark.mesh.similarity import UnitSize
from o3dmark.mesh.surface import Surface
from o3dmark.view.camera import THREE_QUARTER, Camera, Up
from o3dmark.view.colours import checked_scalars
from o3dmark.view.model import shape_of

AZIMUTHS = THREE_QUARTER.azimuth + np.arange(0.0, 360.0, 15.0)  # where cameras are tried, in degrees
ELEVATIONS = THREE_QUARTER.elevation, -18.0, 50.0, -50.0, 80.0, -80.0
LOOK = 64, 48  # pixels of a look at a side
GRAZING = 0.2  # cosine of the angle of view, below which a surface is seen too flat to count
WORTH = 1.25  # another side is taken when it shows so many times as much as the usual three quarters


class Seen(NamedTuple):
    """What k pixels of a look see, in the unit of size 1: points and ways to them (k, 3), distances, triangles (k,)."""

    points: Floats
    ways: Floats
    distances: Floats
    triangles: Ints


def cameras(up: Up = "y") -> list[Camera]:
    """Where a mesh is looked at from, all around."""
    around = [Camera(float(azimuth), elevation, up=up) for elevation, azimuth in product(ELEVATIONS, AZIMUTHS)]
    return [replace(THREE_QUARTER, up=up), *around[1:]]


def uprightness(tried: Sequence[Camera]) -> Floats:
    """How much a side of each camera counts: nobody likes to look at things from above, or from below."""
    return np.asarray(np.cos(np.radians([camera.elevation / 2 for camera in tried])))


def looks(unit: UnitSize, surface: Surface, tried: Sequence[Camera]) -> Iterator[Seen]:
    """What each camera sees of a surface brought to size 1."""
    points = unit.apply(surface.vertices)
    scene = scene_of(points, surface.triangles)
    for camera in tried:
        rays = camera.rays(points @ camera.axes.T, *LOOK).reshape(-1, 2, 3) @ camera.axes.astype(np.float32)
        cast = scene.cast_rays(o3d.core.Tensor(rays.reshape(-1, 6)))
        distance = cast["t_hit"].numpy()
        hit = np.isfinite(distance)
        ways, far = rays[hit, 1].astype(np.float64), distance[hit].astype(np.float64)
        yield Seen(rays[hit, 0] + far[:, None] * ways, ways, far, cast["primitive_ids"].numpy()[hit].astype(np.int64))


def best_side(mesh: Any, scalars: ArrayLike | None = None, up: Up = "y") -> Camera:
    """The camera that sees most of a mesh's area, or with ``scalars`` (n,) most of what rises above the least of them.

    A point cloud is looked at from three quarters, and so is a mesh whose other sides show little more.
    """
    shape, usual = shape_of(mesh), replace(THREE_QUARTER, up=up)
    if not isinstance(shape, Surface):
        return usual
    worth = np.ones(len(shape.triangles))
    if scalars is not None:
        values = checked_scalars(scalars, len(shape.vertex_map))
        welded = np.zeros(len(shape.vertices))
        welded[shape.vertex_map[shape.vertex_map >= 0]] = (values - values.min())[shape.vertex_map >= 0]
        worth = welded[shape.triangles].mean(axis=1)
    tried = cameras(up)
    shown = uprightness(tried) * [_area(seen, shape, worth) for seen in looks(_unit(shape), shape, tried)]
    best = int(shown.argmax())
    return tried[best] if shown[best] > WORTH * shown[0] else usual


def _unit(surface: Surface) -> UnitSize:
    return UnitSize.about_box(surface.vertices)


def _area(seen: Seen, surface: Surface, worth: Floats) -> float:
    """The area that the pixels see, each triangle's times its worth: wider where it is far away or aslant."""
    normals = surface.area_vectors[seen.triangles] / surface.areas[seen.triangles, None].clip(1e-300)
    facing = np.abs(np.einsum("kj,kj->k", normals, seen.ways))
    return float((worth[seen.triangles] * seen.distances**2 / facing.clip(GRAZING)).sum())
