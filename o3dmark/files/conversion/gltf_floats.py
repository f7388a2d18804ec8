"""glTF for readers that know only float32: quantised and sparse attributes of vertices are written out.

A texture transform of the base colour goes into the texture coordinates. Source: glTF 2.0 specification, chapter 3.6.2
(accessors), KHR_mesh_quantization, KHR_texture_transform.
"""

from typing import Any

import numpy as np

from o3dmark.arrays import AnyArray
from o3dmark.files.conversion.repack import Packed

_TYPES: dict[int, type[np.generic]] = {
    5120: np.int8,
    5121: np.uint8,
    5122: np.int16,
    5123: np.uint16,
    5125: np.uint32,
    5126: np.float32,
}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_FLOAT = 5126
_NAMES = ("POSITION", "NORMAL", "TANGENT", "TEXCOORD", "COLOR")
_TRANSFORM = "KHR_texture_transform"


def write_out(packed: Packed) -> None:
    """Make all attributes of vertices float32, each in a view of its own where it was anything else."""
    accessors = packed.tree.get("accessors", [])
    for mesh in packed.tree.get("meshes", []):
        for primitive in mesh["primitives"]:
            attributes = primitive["attributes"]
            for name, number in attributes.items():
                accessor = accessors[number]
                if name.split("_")[0] in _NAMES and (accessor["componentType"] != _FLOAT or "sparse" in accessor):
                    accessors[number] = _accessor(packed, accessor, _values(packed, accessor))
            _transform_texture(packed, primitive)


def _transform_texture(packed: Packed, primitive: dict[str, Any]) -> None:
    material = packed.tree["materials"][primitive["material"]] if "material" in primitive else {}
    texture = material.get("pbrMetallicRoughness", {}).get("baseColorTexture", {})
    transform = texture.get("extensions", {}).get(_TRANSFORM)
    number = primitive["attributes"].get("TEXCOORD_0")
    if transform is None or number is None or transform.get("texCoord", texture.get("texCoord", 0)) != 0:
        return
    angle = transform.get("rotation", 0.0)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    accessors = packed.tree["accessors"]
    values = _values(packed, accessors[number]).astype(np.float64) * transform.get("scale", (1.0, 1.0))
    accessors.append(_accessor(packed, accessors[number], values @ turn.T + transform.get("offset", (0.0, 0.0))))
    primitive["attributes"]["TEXCOORD_0"] = len(accessors) - 1


def _accessor(packed: Packed, old: dict[str, Any], values: AnyArray) -> dict[str, Any]:
    view = packed.append(values.astype("<f4").tobytes())
    return {"bufferView": view, "componentType": _FLOAT, "count": len(values), "type": old["type"]}


def _values(packed: Packed, accessor: dict[str, Any]) -> AnyArray:
    """What an accessor says (n, d), integers as the fractions that they stand for."""
    width, kind = _WIDTHS[accessor["type"]], accessor["componentType"]
    values = np.zeros((accessor["count"], width), _TYPES[kind])
    if "bufferView" in accessor:
        values[:] = _rows(packed, accessor, kind, accessor["count"], width)
    if "sparse" in accessor:
        count, places, new = (accessor["sparse"][key] for key in ("count", "indices", "values"))
        rows = _rows(packed, places, places["componentType"], count, 1)[:, 0]
        values[rows] = _rows(packed, new, kind, count, width)
    if accessor.get("normalized") and kind != _FLOAT:
        return np.maximum(values / np.iinfo(values.dtype).max, -1.0).astype(np.float32)
    return values


def _rows(packed: Packed, place: dict[str, Any], kind: int, count: int, width: int) -> AnyArray:
    view = packed.tree["bufferViews"][place["bufferView"]]
    dtype = np.dtype(_TYPES[kind]).newbyteorder("<")
    start = view.get("byteOffset", 0) + place.get("byteOffset", 0)
    strides = view.get("byteStride", width * dtype.itemsize), dtype.itemsize
    return np.ndarray((count, width), dtype, packed.content, start, strides).copy()
