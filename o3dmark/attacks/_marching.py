"""A surface built anew on a grid: the zero set of the signed distance to the old one, by marching cubes.

As MeshLab's "uniform mesh resampling" has it, the field reaches 3.5 cells to both sides, and its sign is the side of
the normal at the closest point. MeshLab itself is not used, because its search tree doubles with every level wherever
the boxes of more than 64 triangles overlap: a slanted rod of 40 sides takes all memory. The distance
comes from `proximity`, the cubes from Open3D (Flying Edges); memory goes with the surface and a slab of the grid.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from o3dmark.arrays import Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.box_tree import Tree, tree_of
from o3dmark.mesh.proximity import closest_points
from o3dmark.mesh.surface import Surface

_REACH = 3.5  # of the field to both sides, in cells: MeshLab's
_COARSEST = 16  # cells: side of the blocks that the search for the surface begins with
_CHUNK = 1_000_000  # nodes whose distance is taken at once: some 100 MB
_SLAB = 48  # layers of cells marched at once: 200 MB with 1000 cells a side
_LEAST = 1e-3  # cells: a node nearer to the surface counts as that far from it, or slivers without area come out
_OCTANTS = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), axis=-1).reshape(-1, 3)


def resampled(surface: Surface, cells: int) -> Surface:
    """Marching cubes of the signed distance to ``surface`` on a grid of ``cells`` cells along its longest side.

    The distance is negative behind the normals, so a surface that is inside out stays so. An open boundary grows a
    collar up to 3.5 cells wide, where the sign changes beyond it.
    Errors: MeshError when no node sees an inside, as between the sides of a plate thinner than a cell.
    """
    extent = np.ptp(surface.vertices, axis=0)
    size = float(extent.max()) / cells
    margin = int(np.ceil(_REACH)) + 0.5  # half a cell, so that no side of the box lies in a plane of nodes
    low = surface.vertices.min(axis=0) - margin * size
    blocks = np.ceil((extent / size + 2 * margin) / _COARSEST).astype(np.int64)
    tree = tree_of(surface)
    nodes = _near(surface, tree, low, size, blocks)
    normals = _pseudonormals(surface)
    parts = (low + part * size for part in np.array_split(nodes, 1 + len(nodes) // _CHUNK))
    distance = np.concatenate([_signed_distance(part, surface, tree, normals) for part in parts]) / size
    pieces = list(_marched(nodes, distance, blocks * _COARSEST))
    if not pieces:
        raise MeshError(f"nothing of this mesh is wide enough for {cells} cells along its longest side; try more")
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in pieces])
    vertices = np.concatenate([vertices for vertices, _ in pieces])
    triangles = np.concatenate([corners + start for (_, corners), start in zip(pieces, starts[:-1], strict=True)])
    welded = Surface.from_arrays(vertices, triangles)  # slabs share the vertices between them
    return welded.moved(low + welded.vertices * size)


def _near(surface: Surface, tree: Tree, low: Floats, size: float, blocks: Ints) -> Ints:
    """Integer coordinates (k, 3) of the grid nodes within reach of the surface, block by block."""
    side, corners = _COARSEST, _COARSEST * np.stack([axis.ravel() for axis in np.indices(tuple(blocks))], axis=1)
    while side > 1:
        centres = low + (corners + 0.5 * (side - 1)) * size
        reach = (_REACH + 0.5 * 3**0.5 * (side - 1)) * size
        corners = corners[closest_points(centres, surface, tree).distance <= reach]
        side //= 2
        corners = (corners[:, None] + side * _OCTANTS).reshape(-1, 3)
    return corners


def _signed_distance(points: Floats, surface: Surface, tree: Tree, pseudonormals: tuple[Floats, ...]) -> Floats:
    """Distance (q,) of points (q, 3), negative behind the normal of the closest triangle, edge or vertex.

    Edges have the sum of their triangles' normals, vertices the angle-weighted sum.
    Source: Baerentzen and Aanaes 2005, Signed distance computation using the angle weighted pseudonormal.
    """
    faces, sides, tips = pseudonormals
    closest = closest_points(points, surface, tree)
    shares = geometry.barycentric(closest.point, surface.vertices[surface.triangles[closest.triangle]])
    vanishing = shares < 1e-9
    normals = faces[closest.triangle]
    edge, vertex = vanishing.sum(axis=1) == 1, vanishing.sum(axis=1) == 2
    normals[edge] = sides[closest.triangle[edge], np.argmin(shares[edge], axis=1)]
    normals[vertex] = tips[surface.triangles[closest.triangle[vertex], np.argmax(shares[vertex], axis=1)]]
    behind = np.einsum("ij,ij->i", points - closest.point, normals) < 0
    return np.where(behind, -closest.distance, closest.distance)


def _pseudonormals(surface: Surface) -> tuple[Floats, Floats, Floats]:
    """Unit normals of the triangles (m, 3), sums at the side opposite each corner (m, 3, 3) and at vertices (n, 3)."""
    vertices, triangles = surface.vertices, surface.triangles
    faces = geometry.unit(geometry.area_vectors(vertices, triangles))
    edges, side = geometry.numbered_edges(triangles)
    opposite = np.roll(side, -1, axis=1)
    sums = geometry.sum_at_vertices(faces, opposite, len(edges))
    angles = geometry.angles(vertices, triangles)
    weighted = [(angles * axis[:, None]).ravel() for axis in faces.T]
    tips: Floats = np.stack([np.bincount(triangles.ravel(), axis, len(vertices)) for axis in weighted], axis=1)
    return faces, sums[opposite], tips


def _marched(nodes: Ints, distance: Floats, shape: Ints) -> Iterator[tuple[Floats, Ints]]:
    """Slab by slab, vertices (n, 3) in cells and triangles (m, 3) of the cells with all corners within reach."""
    import open3d as o3d

    nodes, distance = nodes[np.abs(distance) <= _REACH], distance[np.abs(distance) <= _REACH]
    value = np.copysign(np.maximum(np.abs(distance), _LEAST), distance)
    for start in range(0, int(shape[2]) - 1, _SLAB):
        mine = (nodes[:, 2] >= start) & (nodes[:, 2] <= start + _SLAB)
        volume = np.full((_SLAB + 1, shape[1], shape[0]), np.nan, np.float32)
        x, y, z = nodes[mine].T
        volume[z - start, y, x] = value[mine]
        known = np.isfinite(volume)
        volume[~known] = _REACH
        if volume.min() > 0:
            continue
        built = o3d.t.geometry.TriangleMesh.create_isosurfaces(o3d.core.Tensor(volume), [0.0])
        vertices = built.vertex.positions.numpy().astype(np.float64)
        triangles = built.triangle.indices.numpy().astype(np.int64)[:, ::-1]  # Open3D winds about what is positive
        triangles = triangles[_within(known, vertices[triangles].mean(axis=1))]
        if len(triangles):
            yield vertices + np.array([0, 0, start]), triangles


def _within(known: NDArray[np.bool_], points: Floats) -> NDArray[np.bool_]:
    """True (q,) where all eight corners of a point's cell are known (z, y, x)."""
    corners = points.astype(np.int64)[:, None] + _OCTANTS
    return known[corners[..., 2], corners[..., 1], corners[..., 0]].all(axis=1)
