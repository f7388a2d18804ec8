"""A writer of GLB files that shares nothing with the reader under proof."""

import json
import struct
from typing import Any

import numpy as np

from o3dmark.arrays import AnyArray, Floats, Ints

COMPONENTS = {"float32": 5126, "uint32": 5125, "uint16": 5123, "uint8": 5121, "int8": 5120}
SHAPES = {(): "SCALAR", (2,): "VEC2", (3,): "VEC3", (4,): "VEC4", (4, 4): "MAT4"}
VERTICES, INDICES = 34962, 34963  # what a buffer view is for


class Glb:
    """A GLB in the making: the document, and its one buffer."""

    def __init__(self, **document: Any) -> None:
        scene = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}]}
        self.document = scene | {"accessors": [], "bufferViews": []} | document
        self.buffer = b""

    def view(self, content: bytes, **about: int) -> int:
        """The number of a new buffer view."""
        self.buffer += bytes(-len(self.buffer) % 4)
        self.document["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.buffer), "byteLength": len(content)} | about
        )
        self.buffer += content
        return len(self.document["bufferViews"]) - 1

    def accessor(self, array: AnyArray, target: int | None = None, **about: Any) -> int:
        """The number of a new accessor of an array (n, ...); rows of vertices begin at multiples of four bytes."""
        rows = array.reshape(len(array), -1)
        use: dict[str, int] = {} if target is None else {"target": target}
        if target == VERTICES and (short := -rows.itemsize * rows.shape[1] % 4):
            rows = np.pad(rows, ((0, 0), (0, short // rows.itemsize)))
            use["byteStride"] = rows.itemsize * rows.shape[1]
        here = {"bufferView": self.view(rows.tobytes(), **use), "count": len(array)}
        kind = {"componentType": COMPONENTS[array.dtype.name], "type": SHAPES[array.shape[1:]]}
        self.document["accessors"].append(here | kind | about)
        return len(self.document["accessors"]) - 1

    def positions(self, array: AnyArray, **about: Any) -> int:
        """An accessor with the bounds that positions must have."""
        return self.accessor(array, VERTICES, min=array.min(axis=0).tolist(), max=array.max(axis=0).tolist(), **about)

    def primitive(self, vertices: AnyArray, triangles: Ints, normals: Floats, **others: int) -> dict[str, Any]:
        """A primitive with positions, normals, triangles and ``others``, by the name of their attribute."""
        attributes = {"POSITION": self.positions(vertices), "NORMAL": self.accessor(single(normals), VERTICES)}
        return {
            "attributes": attributes | others,
            "indices": self.accessor(triangles.ravel().astype(np.uint32), INDICES),
        }

    def bytes(self) -> bytes:
        """The file."""
        self.document["buffers"] = [{"byteLength": len(self.buffer)}]
        text = json.dumps(self.document).encode()
        chunks = b"".join(
            struct.pack("<I4s", len(content), kind) + content
            for kind, content in (
                (b"JSON", text + b" " * (-len(text) % 4)),
                (b"BIN\0", self.buffer + bytes(-len(self.buffer) % 4)),
            )
        )
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def single(values: Floats) -> AnyArray:
    return values.astype(np.float32)
