"""The primitives of a glTF's meshes, and the triangles that each is drawn as.

Source: glTF 2.0 specification, 3.7.2.1 (meshes).
"""

from dataclasses import dataclass

import numpy as np

from o3dmark.arrays import Ints
from o3dmark.errors import MeshError
from o3dmark.files.gltf.accessors import Accessor, Accessors
from o3dmark.files.gltf.budget import Budget
from o3dmark.files.gltf.draco import Streams
from o3dmark.files.gltf.json_fields import Fields

_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_MODES = 7


@dataclass(frozen=True)
class Primitive:
    """What is drawn at once."""

    where: str
    positions: Accessor
    indices: Accessor | None
    mode: int
    normals: Accessor | None = None
    tangents: Accessor | None = None

    @property
    def drawn(self) -> tuple[Accessor, Accessor | None, int]:
        """The same for primitives that are the same triangles, whatever they look like."""
        return self.positions, self.indices, self.mode

    def triangles(self, budget: Budget) -> Ints:
        """Its triangles (m, 3), which count from its own first vertex; none of points and lines.

        Errors: MeshError for corners that are no vertices.
        """
        if self.mode < _TRIANGLES:
            return np.empty((0, 3), np.int64)
        n_vertices = self.positions.count
        budget.take(24 * triangle_count(self.mode, self.indices.count if self.indices else n_vertices))
        return triangles_of(self.mode, corners(self.where, self.indices, n_vertices))


def primitive(fields: Fields, mesh: int, number: int, accessors: Accessors, streams: Streams) -> Primitive | None:
    """Primitive ``number`` of a mesh, or None for one without positions.

    Errors: MeshError for attributes of different lengths.
    """
    attributes = fields.part("attributes")
    if "POSITION" not in attributes:
        return None
    mode = fields.whole("mode", _TRIANGLES)
    if mode >= _MODES:
        raise fields.wrong("mode", f"below {_MODES}")
    given = {"POSITION": vectors(attributes, "POSITION", accessors)}
    for name in ("NORMAL", "TANGENT"):
        if name in attributes:
            given[name] = vectors(attributes, name, accessors, given["POSITION"].count)
    if "indices" in fields:
        given["indices"] = accessors[fields.number_of("indices", len(accessors))]
    packed = dict(streams.accessors(fields, mesh, number, given))
    given |= packed
    return Primitive(
        fields.where,
        given["POSITION"],
        given.get("indices"),
        _TRIANGLES if packed else mode,  # Draco has triangles only
        given.get("NORMAL"),
        given.get("TANGENT"),
    )


def vectors(attributes: Fields, name: str, accessors: Accessors, count: int | None = None) -> Accessor:
    """The accessor of POSITION, NORMAL or TANGENT. Errors: MeshError for another type or number."""
    accessor = accessors[attributes.number_of(name, len(accessors))]
    width = 4 if name == "TANGENT" else 3
    if accessor.width != width:
        raise MeshError(f"{attributes.where}: {name} has rows of {accessor.width} numbers, not {width}")
    if count is not None and accessor.count != count:
        raise MeshError(f"{attributes.where}: {accessor.count} rows of {name} for {count} positions")
    return accessor


def corners(where: str, indices: Accessor | None, n_vertices: int) -> Ints:
    """The vertices (k,) in the order that they are drawn in. Errors: MeshError for those that are none."""
    if indices is None:
        return np.arange(n_vertices)
    if indices.width != 1 or indices.dtype.kind != "u":
        raise MeshError(f"{where}: its indices are not whole numbers")
    drawn = indices.raw()[:, 0]
    if len(drawn) and drawn.max() >= n_vertices:
        raise MeshError(f"{where} names vertex {drawn.max()}, but has vertices 0 to {n_vertices - 1}")
    return drawn.astype(np.int64)


def triangle_count(mode: int, n_corners: int) -> int:
    return n_corners // 3 if mode == _TRIANGLES else max(n_corners - 2, 0)


def triangles_of(mode: int, drawn: Ints) -> Ints:
    """Triangles (m, 3) from the vertices (k,) of a list, a strip or a fan, wound as the specification says."""
    m = triangle_count(mode, len(drawn))
    if mode == _TRIANGLES:
        return drawn[: 3 * m].reshape(m, 3)
    if mode == _FAN:
        return np.column_stack([drawn[1 : m + 1], drawn[2 : m + 2], np.broadcast_to(drawn[:1], m)])
    odd = np.arange(m) % 2
    at = np.arange(m)
    return np.column_stack([drawn[at], drawn[at + 1 + odd], drawn[at + 2 - odd]])
