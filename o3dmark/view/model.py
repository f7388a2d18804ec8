"""Meshes and point clouds as triangles ready to be drawn: in the camera's axes, smooth where the shape is smooth."""

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import open3d as o3d
import scipy.sparse as sp
from numpy.typing import NDArray

from o3dmark.arrays import Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import PointCloud, Surface, is_cloud, legacy_cloud, point_cloud

Float32s = NDArray[np.float32]  # a picture needs no more
Shape: TypeAlias = Surface | PointCloud

# Triangles that meet at a greater angle are not smoothed together: CAD edges stay
CREASE, HALF_CREASE = np.cos(np.radians(45.0)), np.cos(np.radians(22.5))
MAX_VALENCE = 64  # triangles around a vertex beyond which each keeps its own normal at a crease: pairs cost memory
SPLATS = 0.002, 0.02  # smallest and largest radius of a drawn point, over the diagonal
NEIGHBOURS = 16  # points of a plane where a cloud has no normals
TRIANGLES_A_POINT = 4  # of the hexagon that a point is drawn as


@dataclass(frozen=True, eq=False)
class Model:
    """Triangles in the camera's axes, about the origin, with a diagonal near 1.

    points (n, 3); triangles (m, 3); normals (m, 3, 3), a unit normal at each corner; scalars (n,) or None.
    """

    points: Float32s
    triangles: Ints
    normals: Float32s
    scalars: Floats | None = None

    @classmethod
    def of(cls, shape: Shape, scalars: Floats | None, centre: Floats, to_camera: Floats) -> "Model":
        """``shape`` with ``centre`` moved to the origin and then multiplied by ``to_camera`` (3, 3), from the right."""
        points = (positions(shape) - centre) @ to_camera
        if not isinstance(shape, Surface):
            return _splats(points, cloud_normals(shape) @ to_camera, scalars)
        normals = corner_normals(points, shape.triangles)
        if scalars is not None:
            used = shape.vertex_map >= 0
            welded = np.zeros(len(points))
            welded[shape.vertex_map[used]] = scalars[used]
            scalars = welded
        return cls(points.astype(np.float32), shape.triangles, normals, scalars)


def shape_of(mesh: Any) -> Shape:
    """A checked point cloud, or the surface of a mesh, which may be given as such; MeshError with nothing to draw."""
    if isinstance(mesh, Surface):
        return mesh
    if not is_cloud(mesh):
        return Surface.of(mesh)
    cloud = legacy_cloud(mesh)
    if not cloud.has_points():
        raise MeshError("the point cloud has no point")
    if not np.isfinite(np.asarray(cloud.points)).all():
        raise MeshError("the point cloud has coordinates that are not finite")
    return cloud


def positions(shape: Shape) -> Floats:
    """Points or vertices (n, 3)."""
    return shape.vertices if isinstance(shape, Surface) else np.asarray(shape.points)


def n_vertices(shape: Shape) -> int:
    """Points, or vertices of the mesh that ``shape`` is the surface of: the scalars that it wants."""
    return len(shape.vertex_map) if isinstance(shape, Surface) else len(shape.points)


def corner_normals(vertices: Floats, triangles: Ints) -> Float32s:
    """A unit normal for each corner of each triangle (m, 3, 3), so that curved parts look smooth and edges sharp.

    It is the area-weighted mean over the triangles around the vertex; where one of them leans more than half of CREASE
    from that, so that two may differ by CREASE, over those within CREASE of the corner's own triangle.
    """
    area = geometry.area_vectors(vertices, triangles)
    flat, corner = geometry.unit(area), triangles.ravel()
    smooth = geometry.unit(geometry.vertex_area_vectors(vertices, triangles))
    own = np.repeat(flat, 3, axis=0)
    upright = np.einsum("kj,kj->k", own, smooth[corner])
    creased = np.bincount(corner, upright < HALF_CREASE, minlength=len(vertices)) > 0
    few = np.bincount(corner, minlength=len(vertices)) <= MAX_VALENCE
    normals = np.where((upright < CREASE)[:, None], own, smooth[corner])
    sharp = np.flatnonzero((creased & few)[corner])
    around = sp.csr_array((np.ones(len(sharp)), (np.arange(len(sharp)), corner[sharp])), (len(sharp), len(vertices)))
    one, other = (around @ around.T).nonzero()
    alike = np.einsum("kj,kj->k", own[sharp[one]], own[sharp[other]]) >= CREASE
    sums = sp.csr_array((alike.astype(float), (one, other)), (len(sharp), len(sharp))) @ area[sharp // 3]
    normals[sharp] = geometry.unit(sums)
    return normals.reshape(-1, 3, 3).astype(np.float32)


def cloud_normals(cloud: PointCloud) -> Floats:
    """The normals (n, 3) of a cloud, or where it has none those of planes through its points, of either sign."""
    if cloud.has_normals():
        return np.asarray(cloud.normals)
    points = np.asarray(cloud.points)
    unit = point_cloud((points - geometry.box_centre(points)) / (geometry.diagonal(points) or 1.0))
    unit.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(NEIGHBOURS))
    return np.asarray(unit.normals)


def splat_radius(points: Floats) -> float:
    """The radius to draw points (n, 3) with, in a bounding box of a diagonal near 1: as far as they are apart."""
    gaps = np.asarray(point_cloud(points).compute_nearest_neighbor_distance())
    return float(np.clip(np.median(gaps) if len(points) > 1 else SPLATS[1], *SPLATS))


def _splats(points: Floats, normals: Floats, scalars: Floats | None) -> Model:
    """A hexagon for each point that faces the camera, nearly as wide as points are apart, lit by the point's normal."""
    radius = splat_radius(points)
    angle = np.arange(6) * np.pi / 3
    corners = points[:, None] + radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    fan = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    triangles = (6 * np.arange(len(points))[:, None, None] + fan).reshape(-1, 3)
    normals = geometry.unit(normals * np.where(normals[:, 2:] < 0, -1.0, 1.0))
    at_corners = np.broadcast_to(normals[:, None, None], (len(points), TRIANGLES_A_POINT, 3, 3))
    return Model(
        corners.reshape(-1, 3).astype(np.float32),
        triangles,
        at_corners.reshape(-1, 3, 3).astype(np.float32),
        None if scalars is None else scalars.repeat(6),
    )
