"""Arrays and pictures as text, for a page; what is equal is kept once."""

import base64
import hashlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from o3dmark.arrays import AnyArray

TYPES = {"float32": "<f4", "uint32": "<u4", "uint8": "u1"}  # as the script knows them, and as numpy does


@dataclass
class Buffers:
    """The texts, in base64, under names that follow from their content."""

    texts: dict[str, str] = field(default_factory=dict)

    def array(self, values: AnyArray, kind: str) -> dict[str, Any]:
        """What an array is called, in a type of `TYPES`; its rows one after the other, little-endian."""
        dtype: DTypeLike = TYPES[kind]
        return {"type": kind, "data": self.bytes(np.ascontiguousarray(values, dtype).tobytes())}

    def bytes(self, data: bytes) -> str:
        """What some bytes are called."""
        name = hashlib.sha256(data).hexdigest()[:16]
        self.texts.setdefault(name, base64.b64encode(data).decode())
        return name
