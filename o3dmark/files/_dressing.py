"""Open3D's reading of a file, with its textures, colours and normals, at the positions that the file really has.

Open3D reads float32, merges and repeats vertices, and has its own order of the meshes of a scene.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy

from o3dmark.arrays import Floats, Ints
from o3dmark.files import _open3d
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import mesh_arrays

if TYPE_CHECKING:
    from o3dmark.mesh.surface import TriangleMesh

_FLOAT32 = 2e-6  # of the largest coordinate: what transforms in float32 add up to


def dressed(path: Path, exact: "TriangleMesh") -> "TriangleMesh | None":
    """What Open3D reads at ``path``, at the positions of ``exact``; None where it has not the same triangles."""
    import open3d as o3d

    mesh = _open3d.read(path)
    found, corners = mesh_arrays(mesh)
    vertices, triangles = mesh_arrays(exact)
    if not len(triangles) or len(corners) != len(triangles):
        return None
    tolerance = _FLOAT32 * float(np.abs(vertices).max())
    positions = _in_order(found, corners, vertices[triangles], tolerance)
    if positions is None:
        positions = _nearest(found, corners, vertices, triangles, tolerance)
    if positions is None:
        return None
    mesh.vertices = o3d.utility.Vector3dVector(positions)
    return mesh


def _in_order(found: Floats, corners: Ints, wanted: Floats, tolerance: float) -> Floats | None:
    """Positions (n, 3) that put corners (m, 3) at ``wanted`` (m, 3, 3), where they nearly are; or None."""
    if not np.abs(found[corners] - wanted).max() <= tolerance:  # "not", for numbers that are none
        return None
    positions = found.copy()
    positions[corners] = wanted
    return positions if np.array_equal(positions[corners], wanted) else None


def _nearest(found: Floats, corners: Ints, vertices: Floats, triangles: Ints, tolerance: float) -> Floats | None:
    """The vertices nearest to those found (n, 3), where they make the same triangles in some order; or None."""
    if not (np.isfinite(found).all() and np.isfinite(vertices).all()):
        return None
    kept, place = geometry.weld(vertices)
    tree = scipy.spatial.cKDTree(vertices[kept])
    distance, nearest = tree.query(found, distance_upper_bound=2.0 * tolerance + 1e-300)
    if not (distance <= 2.0 * tolerance).all():
        return None
    same = np.array_equal(_canonical(nearest[corners]), _canonical(place[triangles]))
    return vertices[kept][nearest] if same else None


def _canonical(triangles: Ints) -> Ints:
    """Triangles (m, 3), each with its least corner first, in one order for all orders of the same."""
    first = triangles.argmin(axis=1)[:, None]
    turned = np.take_along_axis(triangles, (first + np.arange(3)) % 3, axis=1)
    return turned[np.lexsort(turned.T)]
