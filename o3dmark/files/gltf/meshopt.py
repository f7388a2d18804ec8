"""Buffer views that meshoptimizer has compressed: decoded, and encoded again where numbers in them have changed.

Sources: EXT_meshopt_compression, KHR_meshopt_compression.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from o3dmark.arrays import Bits, Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.files.gltf import meshopt_codec as codec
from o3dmark.files.gltf.budget import Budget
from o3dmark.files.gltf.buffers import Buffer, Buffers, Edits, Space
from o3dmark.files.gltf.json_fields import Fields

EXTENSIONS = ("EXT_meshopt_compression", "KHR_meshopt_compression")
_ENCODED = ("NONE", "OCTAHEDRAL", "EXPONENTIAL")  # filters of positions and normals


@dataclass(frozen=True)
class Packing:
    """How view number ``view`` is compressed: from ``start`` of a buffer, to ``count`` rows of ``stride`` bytes."""

    where: str
    view: int
    extension: str
    buffer: int
    start: int
    length: int
    count: int
    stride: int
    mode: str
    filter: str

    @classmethod
    def of(cls, number: int, view: Fields, buffers: Buffers) -> "Packing | None":
        """None for a view that is not compressed. Errors: MeshError for what the extensions do not allow."""
        extensions = view.part("extensions")
        name = next((name for name in EXTENSIONS if name in extensions), None)
        if name is None:
            return None
        fields = extensions.part(name)
        buffer = fields.number_of("buffer", len(buffers))
        start, length = fields.whole("byteOffset", 0), fields.whole("byteLength")
        count, stride, mode = fields.whole("count"), fields.whole("byteStride"), fields.text("mode")
        if start + length > buffers.fields[buffer].whole("byteLength"):
            raise MeshError(f"{fields.where} reaches beyond buffer {buffer}")
        if count * stride != view.whole("byteLength"):
            raise MeshError(f"{fields.where}: {count} rows of {stride} bytes are not the length of the view")
        fits = stride in (codec.STRIDES["NONE"] if mode == "ATTRIBUTES" else (2, 4))
        if mode not in ("ATTRIBUTES", "TRIANGLES", "INDICES") or not fits or (mode == "TRIANGLES" and count % 3):
            raise MeshError(f"{fields.where}: {count} rows of {stride} bytes cannot be {mode!r}")
        kind = fields.text("filter", "NONE") if mode == "ATTRIBUTES" else "NONE"
        return cls(fields.where, number, name, buffer, start, length, count, stride, mode, kind)


class MeshoptSpace(Space):
    """The bytes that a compressed view holds.

    plain: the buffer, and where in it, that holds the same as it is for readers without the codec, if it is there.
    """

    def __init__(self, packing: Packing, buffers: Buffers, plain: tuple[Buffer, int], budget: Budget) -> None:
        self._packing, self._budget = packing, budget
        self._buffer = buffers[packing.buffer]
        self._plain = plain if plain[0].has(plain[1], packing.count * packing.stride) else None

    @property
    def buffers(self) -> tuple[Buffer, ...]:
        return tuple(buffer for buffer, _, _ in self.holds)

    @property
    def holds(self) -> tuple[tuple[Buffer, int, int], ...]:
        packing = self._packing
        here = (self._buffer, packing.start, packing.length)
        return (here, (*self._plain, packing.count * packing.stride)) if self._plain else (here,)

    @property
    def fixed(self) -> str:
        mode, kind = self._packing.mode, self._packing.filter
        return "" if mode == "ATTRIBUTES" and kind in _ENCODED else f"it is compressed as {mode} with the filter {kind}"

    @cached_property
    def content(self) -> Bits:
        rows = codec.unfiltered(self._packing.where, self._filtered, self._packing.filter).reshape(-1)
        rows.setflags(write=False)
        return rows

    @cached_property
    def _filtered(self) -> Bits:
        """The rows (count, stride) as they are compressed."""
        packing = self._packing
        self._budget.take(2 * packing.count * packing.stride)
        return codec.decoded(packing.where, self._packed, packing.mode, packing.count, packing.stride)

    @property
    def _packed(self) -> bytes:
        start, length, content = self._packing.start, self._packing.length, self._buffer.content
        if start + length > len(content):
            raise MeshError(f"{self._packing.where} reaches beyond the {len(content)} bytes that there are")
        return content[start : start + length].tobytes()

    def steps(self, start: int, stride: int, shape: tuple[int, ...]) -> Floats | None:
        if self._packing.filter != "EXPONENTIAL":
            return None
        return np.ldexp(1.0, self._exponents(start, stride, shape))

    def _exponents(self, start: int, stride: int, shape: tuple[int, ...]) -> Ints:
        exponents = codec.exponents_of(self._filtered).reshape(-1)
        first = start // 4 + stride // 4 * np.arange(shape[0])[:, None]
        return exponents[first + np.arange(shape[1])]

    def put_back(self, edits: Edits) -> None:
        """Encode again, with the rows that have changed."""
        shape = self._packing.count, self._packing.stride
        changed = edits.of(self).reshape(shape)
        rows = (changed != self.content.reshape(shape)).any(axis=1)
        if not rows.any():
            return
        filtered = self._filtered.copy()
        filtered[rows] = codec.filtered(changed[rows], self._packing.filter, filtered[rows])
        now = codec.unfiltered(self._packing.where, filtered, self._packing.filter)
        edits.spaces[self] = now.reshape(-1)
        version = codec.version_of(self._packing.where, self._packed)
        packed = codec.encoded(self._packing.where, filtered, version)
        path = "bufferViews", self._packing.view, "extensions", self._packing.extension
        edits.replace(self.holds[0], packed, self._packing.buffer, path)
        if self._plain:
            buffer, start = self._plain
            plain = edits.of(buffer)[start : start + shape[0] * shape[1]].reshape(shape)
            plain[rows] = now[rows]
