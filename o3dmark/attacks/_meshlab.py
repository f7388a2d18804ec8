"""The only door to pymeshlab: MeshLab's filters on arrays, with clear errors.

MeshLab keeps float64 exactly. It never reads a file here: polygons that visit a vertex twice made it corrupt memory.
"""

from typing import Any

import numpy as np

from o3dmark.errors import BackendError
from o3dmark.geometry import Floats, Ints


def apply(vertices: Floats, triangles: Ints, *filters: tuple[str, dict[str, Any]]) -> tuple[Floats, Ints]:
    """Run MeshLab filters, each (name, parameters), one after the other; new vertices and triangles.

    Errors: BackendError with the filter's name and MeshLab's reason, or if no triangle or an unusable one is left.
    """
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(np.asarray(vertices, np.float64), np.asarray(triangles, np.int32)))
    for name, parameters in filters:
        try:
            meshes.apply_filter(name, **parameters)
        except pymeshlab.PyMeshLabException as error:
            raise BackendError(f"MeshLab's {name} failed: {_reason(error)}") from None
    mesh, done = meshes.current_mesh(), ", ".join(name for name, _ in filters)
    new, faces = np.array(mesh.vertex_matrix(), np.float64), np.array(mesh.face_matrix(), np.int64).reshape(-1, 3)
    if not len(faces):
        raise BackendError(f"MeshLab's {done} leaves no triangle of the {len(triangles)} given")
    if faces.min() < 0 or faces.max() >= len(new) or not np.isfinite(new).all():
        raise BackendError(f"MeshLab's {done} returns a damaged mesh")
    return new, faces


def length(value: float) -> Any:
    """A length in the mesh's own unit, in the form that MeshLab's filters take."""
    import pymeshlab

    return pymeshlab.PureValue(value)


def _reason(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[-1].removeprefix("Error details:").strip() if lines else type(error).__name__
