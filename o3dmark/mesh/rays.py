"""Open3D's ray caster on plain arrays. It computes in float32: bring what it sees to the origin and to size one."""

from typing import TYPE_CHECKING

import numpy as np

from o3dmark.arrays import AnyArray, Ints

if TYPE_CHECKING:
    import open3d as o3d


def scene_of(vertices: AnyArray, triangles: Ints) -> "o3d.t.geometry.RaycastingScene":
    """A scene of one mesh: vertices (n, 3) and triangles (m, 3)."""
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor(np.asarray(vertices, np.float32)), o3d.core.Tensor(np.asarray(triangles, np.uint32))
    )
    return scene
