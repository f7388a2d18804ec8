"""The only door to pymeshlab: MeshLab's filters on arrays, with clear errors.

MeshLab computes in float64, but with thresholds that are lengths: a mesh a millionth of a unit in size is simplified
twice as badly, one of a hundred million units is torn. So it gets every mesh about the origin with a diagonal of one.
It reads no files here: polygons that visit a vertex twice made it corrupt its memory.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np

from o3dmark.arrays import Bools, Floats, Ints
from o3dmark.errors import BackendError
from o3dmark.mesh.similarity import UnitSize


def apply(
    vertices: Floats, triangles: Ints, *filters: tuple[str, dict[str, Any]], selected: Bools | None = None
) -> tuple[Floats, Ints]:
    """Run MeshLab filters, each (name, parameters), one after the other; new vertices and triangles.

    The filters see the mesh with a bounding box of diagonal one about the origin, and the triangles ``selected`` (m,).
    Errors: BackendError with the filter's name and MeshLab's reason, or if no triangle or an unusable one is left.
    """
    import pymeshlab

    unit, corners = UnitSize.about_box(vertices), np.asarray(triangles, np.int32)
    marks = np.zeros(len(corners)) if selected is None else np.asarray(selected, np.float64)
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(unit.apply(vertices), corners, f_scalar_array=marks))
    if selected is not None:
        filters = (("compute_selection_by_condition_per_face", {"condselect": "fq > 0.5"}), *filters)
    return _filtered(meshes, unit, len(triangles), filters)


def union(vertices: Floats, triangles: Ints, others: Floats, corners: Ints) -> tuple[Floats, Ints]:
    """The surface of two closed solids together. Errors: as `apply`, also where one is not closed."""
    import pymeshlab

    unit = UnitSize.about_box(np.concatenate([vertices, others]))
    meshes = pymeshlab.MeshSet()
    for points, faces in ((vertices, triangles), (others, corners)):
        meshes.add_mesh(pymeshlab.Mesh(unit.apply(points), np.asarray(faces, np.int32)))
    both = {"first_mesh": 0, "second_mesh": 1}
    return _filtered(meshes, unit, len(triangles) + len(corners), [("generate_boolean_union", both)])


def _filtered(
    meshes: Any, unit: UnitSize, given: int, filters: Iterable[tuple[str, dict[str, Any]]]
) -> tuple[Floats, Ints]:
    """The current mesh after the filters, in the size that it had; ``given`` triangles, for the complaint."""
    import pymeshlab

    filters = list(filters)
    for name, parameters in filters:
        try:
            meshes.apply_filter(name, **parameters)
        except pymeshlab.PyMeshLabException as error:
            raise BackendError(f"MeshLab's {name} failed: {_reason(error)}") from None
    mesh, done = meshes.current_mesh(), ", ".join(name for name, _ in filters)
    new, faces = np.array(mesh.vertex_matrix(), np.float64), np.array(mesh.face_matrix(), np.int64).reshape(-1, 3)
    if not len(faces):
        raise BackendError(f"MeshLab's {done} leaves no triangle of the {given} given")
    if faces.min() < 0 or faces.max() >= len(new) or not np.isfinite(new).all():
        raise BackendError(f"MeshLab's {done} returns a damaged mesh")
    return unit.undo(new), faces


def length(share: float) -> Any:
    """A length, as a share of the bounding box's diagonal, in the form that MeshLab's filters take."""
    import pymeshlab

    return pymeshlab.PureValue(share)


def _reason(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[-1].removeprefix("Error details:").strip() if lines else type(error).__name__
