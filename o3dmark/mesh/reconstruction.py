"""The closed surface through a point cloud, by screened Poisson reconstruction (Kazhdan and Hoppe 2013).

The door to Open3D's, which computes in float32 and so gets points about the origin, of size one.
"""

from typing import TYPE_CHECKING

import numpy as np
import scipy

from o3dmark.errors import BackendError, MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.similarity import UnitSize
from o3dmark.mesh.surface import Surface, point_cloud

if TYPE_CHECKING:
    from o3dmark.mesh.surface import PointCloud, TriangleMesh

_MIN_POINTS = 1000  # fewer show no shape worth reading: the mark of bimba takes 4 000, that of cup 8 000
_NEIGHBOURS = 15  # by which estimated normals are oriented alike; 8 to 30 did the same on bimba, camel, hand, nefertiti
# Points whose normals are oriented by the tree: of 200 000 on camel and octopus this leaves as many wrong as all do
# (0.3 and 1 in 100), in 5 s for 13; of 40 000, 5 in 100 were wrong on camel
_ORIENTED = 70_000
_FOLLOWED, _ACROSS = 4, 8.0  # of them each of the others looks at, and how much farther those are that lie across
_MANY = 400_000  # points that may fill cells half as large: 100 000 give the same surface with either


def surface_of_points(cloud: "PointCloud") -> Surface:
    """The surface of a point cloud (Open3D's), which stays as it is.

    Normals are taken as they are, pointing outward; a cloud without any has them estimated, and oriented alike (see
    `oriented`), which fails where parts of the surface are close to each other.
    Errors: MeshError for fewer than 1000 points, and for points that are not finite or all one; BackendError.
    """
    points = np.asarray(cloud.points)
    if len(points) < _MIN_POINTS:
        raise MeshError(f"{len(points)} points are too few to tell a surface; {_MIN_POINTS} are the least")
    if not 0.0 < geometry.diagonal(points) < np.inf:
        raise MeshError("the points are not finite, or all in one place")
    frame = UnitSize.about_mean(points)
    unit = point_cloud(frame.apply(points), np.asarray(oriented(cloud).normals))
    surface = Surface.of(poisson(unit, 8 if len(points) < _MANY else 9))
    return surface.moved(frame.undo(surface.vertices))


def oriented(cloud: "PointCloud") -> "PointCloud":
    """The same points with unit normals that agree on one side: a cloud that has normals as it is, others in a copy.

    Normals are estimated, and those of some of the points oriented along a spanning tree, which takes most of the time;
    the others follow the nearest of these, as one goes along the surface.
    """
    if cloud.has_normals():
        return cloud
    there = np.asarray(cloud.points)
    frame = UnitSize.about_mean(there)
    points = frame.apply(there)
    every = point_cloud(points)
    every.estimate_normals()
    normals = np.asarray(every.normals).copy()
    some = np.unique(np.linspace(0, len(points) - 1, _ORIENTED).astype(np.int64))
    few = point_cloud(points[some], normals[some])
    few.orient_normals_consistent_tangent_plane(_NEIGHBOURS)
    found = np.asarray(few.normals)
    if len(some) == len(points):
        return point_cloud(there, found)
    near = scipy.spatial.cKDTree(points[some]).query(points, _FOLLOWED)[1]
    offset = points[some][near] - points[:, None]
    across = np.einsum("pnd,pd->pn", offset, normals)
    far = (offset**2).sum(axis=2) + _ACROSS * across**2
    leader = near[np.arange(len(points)), far.argmin(axis=1)]
    sign = np.where(np.einsum("pd,pd->p", normals, found[leader]) < 0.0, -1.0, 1.0)
    return point_cloud(there, sign[:, None] * normals)


def poisson(cloud: "PointCloud", depth: int) -> "TriangleMesh":
    """The Poisson surface of oriented points of about size one; the longest side has about 2^depth cells.

    Errors: BackendError if it has no triangle.
    """
    import open3d as o3d

    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        # one thread: with more, sums come in another order and the same points give another mesh
        built, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=depth, n_threads=1)
    if not built.has_triangles():
        raise BackendError(f"Open3D's Poisson reconstruction of {len(cloud.points)} points has no triangle")
    return built
