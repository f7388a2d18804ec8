"""Point clouds marked: points go as the surface through them goes.

The reader of a cloud puts a closed surface through its points. So does the writer; the method marks that surface, and
every point moves along its normal by what the surface moves at the place nearest to it.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from o3dmark.arrays import Floats
from o3dmark.coding.keys import Key
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.proximity import closest_points, enough_work
from o3dmark.mesh.reconstruction import oriented, surface_of_points
from o3dmark.mesh.surface import MeshArrays, Surface, legacy_cloud, with_points
from o3dmark.methods import Method


def marked_cloud(method: Method, cloud: Any, bits: ArrayLike, key: Key) -> Any:
    """A copy of an Open3D point cloud, legacy or tensor, that carries ``bits`` (n,); all but its positions stay.

    A cloud without normals has them estimated for this, and gets none. Errors: MeshError for points that tell no
    surface, as of `Method.embed` for the surface, and where the bits are not read back from the marked points.
    """
    message = np.asarray(bits, np.uint8).ravel()
    points = oriented(legacy_cloud(cloud))
    surface = surface_of_points(points)
    marked = method.embed(MeshArrays(surface.vertices, surface.triangles), message, key)
    motion = _at(np.asarray(points.points), surface, marked.vertices - surface.vertices)
    normals = geometry.unit(np.asarray(points.normals, np.float64))
    along = np.einsum("pd,pd->p", motion, normals)[:, None] * normals
    moved = with_points(cloud, np.asarray(points.points) + along)
    if not np.array_equal(method.extract(moved, len(message), key).bits, message):
        raise MeshError(
            "the bits cannot be read back from the points: they may be too few, too noisy, or not close around a solid"
        )
    return moved


def _at(points: Floats, surface: Surface, motion: Floats) -> Floats:
    """What a surface whose vertices move by ``motion`` (n, 3) moves at the places nearest to points (p, 3)."""
    nearest = closest_points(points, surface, most_work=enough_work(points, surface))
    triangles = surface.triangles[nearest.triangle]
    share = geometry.barycentric(nearest.point, surface.vertices[triangles])
    return np.asarray(np.einsum("pc,pcd->pd", share, motion[triangles]))
