"""What of a surface is inside: pieces within other pieces, and triangles that are seen from nowhere.

Rays are cast by Open3D, in single precision; the answers are votes of many rays, so that one that grazes an edge does
not matter, nor which way a triangle is wound.
"""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from o3dmark.arrays import Bools, Floats, Ints
from o3dmark.mesh import geometry
from o3dmark.mesh.rays import scene_of
from o3dmark.mesh.surface import Surface

_POINTS, _DIRECTIONS = 15, 3  # of a piece, that vote on whether it is inside another
_RAYS = 6_000_000  # at most, to look at a surface from all around
_MOST_DIRECTIONS, _FEWEST_DIRECTIONS = 96, 8


def pieces(surface: Surface) -> Ints:
    """For each triangle (m,) the number of the piece it belongs to, the largest by area first.

    Pieces hang together by edges: what only touches in a vertex is two.
    """
    corners = surface.triangles
    edges, side = geometry.numbered_edges(corners)
    m = len(corners)
    links = (np.ones(3 * m, bool), (np.repeat(np.arange(m), 3), m + side.ravel()))
    graph = sp.coo_array(links, shape=(m + len(edges), m + len(edges)))
    piece = np.unique(connected_components(graph, directed=False)[1][:m], return_inverse=True)[1].ravel()
    order = np.argsort(-np.bincount(piece, geometry.areas(surface.vertices, corners)), kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return np.asarray(rank[piece], np.int64)


def within(surface: Surface, piece: Ints, count: int) -> Bools:
    """Of the first ``count`` pieces (count,): whether most of it lies within another of these."""
    import open3d as o3d

    scene = scene_of(surface.vertices, surface.triangles[piece < count])
    kept = np.flatnonzero(piece < count)
    rng = np.random.default_rng(0)
    directions = geometry.unit(rng.standard_normal((_DIRECTIONS, 3)))
    found = np.zeros(count, bool)
    centres = surface.vertices[surface.triangles].mean(axis=1)
    for number in range(count):
        mine = np.flatnonzero(piece == number)
        points = centres[rng.choice(mine, min(_POINTS, len(mine)), replace=False)]
        rays = np.concatenate([np.repeat(points, _DIRECTIONS, axis=0), np.tile(directions, (len(points), 1))], axis=1)
        hits = scene.list_intersections(o3d.core.Tensor(np.asarray(rays, np.float32)))
        ray, triangle = hits["ray_ids"].numpy(), hits["primitive_ids"].numpy()
        times = np.zeros((len(rays), count), np.int64)
        np.add.at(times, (ray, piece[kept[triangle]]), 1)
        inside = (times % 2 == 1).mean(axis=0) > 0.5
        inside[number] = False
        found[number] = bool(inside.any())
    return found


def seen(surface: Surface) -> Bools:
    """Which triangles (m,) are seen from outside, from either side, in some of many directions."""
    import open3d as o3d

    m = len(surface.triangles)
    count = int(np.clip(_RAYS // max(m, 1), _FEWEST_DIRECTIONS, _MOST_DIRECTIONS))
    scene, found = scene_of(surface.vertices, surface.triangles), np.zeros(m, bool)
    centres = surface.vertices[surface.triangles].mean(axis=1)
    normals = geometry.unit(geometry.area_vectors(surface.vertices, surface.triangles))
    step = 1e-5 * surface.diagonal  # off the surface, so that a ray does not hit where it starts
    for direction in _sphere(count):
        waiting = np.flatnonzero(~found)
        if not len(waiting):
            break
        side = np.sign(normals[waiting] @ direction)[:, None]
        start = centres[waiting] + step * side * normals[waiting]
        rays = np.concatenate([start, np.broadcast_to(direction, start.shape)], axis=1)
        blocked = scene.test_occlusions(o3d.core.Tensor(np.asarray(rays, np.float32))).numpy()
        found[waiting] = ~blocked
    return found


def _sphere(count: int) -> Floats:
    """Directions (count, 3) spread over the sphere: a Fibonacci lattice, dealt so that the first few are spread too."""
    i = np.arange(count) + 0.5
    z, angle = 1.0 - 2.0 * i / count, np.pi * (1.0 + 5.0**0.5) * i
    radius = np.sqrt(1.0 - z * z)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)
    return np.asarray(points[np.random.default_rng(0).permutation(count)])
