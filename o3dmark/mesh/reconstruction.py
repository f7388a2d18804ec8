"""The closed surface through a point cloud."""

import numpy as np

from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import PointCloud, Surface, TriangleMesh

_LEAST = 1000
_NEIGHBOURS = 30  # that a normal is estimated from


def surface_of_cloud(cloud: PointCloud) -> Surface:
    """Screened Poisson reconstruction (Kazhdan and Hoppe 2013), as Open3D has it.

    Normals are taken as they are, pointing outward; a cloud without any has them estimated, and oriented alike along a
    spanning tree, which fails where parts of the surface are close to each other.
    Errors: MeshError for fewer than 1000 points, and for points that are not finite or all one.
    """
    count = len(cloud.points)
    if count < _LEAST:
        raise MeshError(f"{count} points are too few to tell a surface; {_LEAST} are the least")
    points = np.asarray(cloud.points)
    middle, size = points.mean(axis=0), geometry.diagonal(points)
    if not 0.0 < size < np.inf:
        raise MeshError("the points are not finite, or all in one place")
    cloud = PointCloud(cloud).translate(-middle).scale(1.0 / size, np.zeros(3))  # Poisson computes in float32
    if not cloud.has_normals():
        cloud.estimate_normals()
        cloud.orient_normals_consistent_tangent_plane(_NEIGHBOURS)
    depth = 8 if count < 400_000 else 9
    built, _ = TriangleMesh.create_from_point_cloud_poisson(cloud, depth=depth, n_threads=1)
    surface = Surface.of(built)
    return surface.moved(middle + size * surface.vertices)
