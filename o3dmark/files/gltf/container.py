"""What a glTF comes in: a text (.gltf), or a binary container of chunks (.glb), told apart by their first bytes.

Source: glTF 2.0 specification, chapter 4 (GLB file format).
"""

import struct
from dataclasses import dataclass
from typing import Any

from o3dmark.errors import MeshError
from o3dmark.files.gltf.json_spans import loads

_MAGIC = b"glTF"
_HEADER = struct.Struct("<4sII")
_CHUNK = struct.Struct("<I4s")
_JSON, _BIN = b"JSON", b"BIN\0"
_UNKNOWN_BYTES = "surrogateescape"  # a name in some old encoding comes back as the bytes that it was
_BLANKS = " \t\r\n\0"
_MOST_CHUNKS = 1000  # a file of empty ones would take twenty times its size


@dataclass(frozen=True)
class Container:
    """The JSON text of a glTF, what it says, and the bytes around it.

    text: all of it, padding too; start, end: where its value stands; chunks: type and content of all chunks of a .glb;
    rest: what follows the last one.
    """

    text: str
    start: int
    end: int
    value: Any
    version: int = 2
    chunks: tuple[tuple[bytes, memoryview], ...] = ()
    rest: bytes = b""

    @classmethod
    def of(cls, name: str, content: bytes) -> "Container":
        """Errors: MeshError for a damaged container or text."""
        if not content.startswith(_MAGIC):
            return cls(*_parsed(name, content))
        version, chunks, rest = _chunks(name, content)
        return cls(*_parsed(name, bytes(chunks[0][1])), version, chunks, rest)

    @property
    def binary(self) -> memoryview | None:
        """The content of the first BIN chunk, if there is one."""
        return next((content for kind, content in self.chunks if kind == _BIN), None)

    def built(self, text: str, binary: bytes | None = None) -> bytes:
        """The file with another text, which follows ``text`` up to its end, and with another BIN chunk."""
        if not self.chunks:
            return text.encode("utf-8", _UNKNOWN_BYTES)
        chunks = list(self.chunks)
        if text != self.text:
            chunks[0] = _JSON, memoryview(_padded(text.rstrip(_BLANKS).encode("utf-8", _UNKNOWN_BYTES), b" "))
        if binary is not None:
            place = next(number for number, (kind, _) in enumerate(chunks) if kind == _BIN)
            same = len(binary) == len(chunks[place][1])
            chunks[place] = _BIN, memoryview(binary if same else _padded(binary, b"\0"))
        length = _HEADER.size + sum(_CHUNK.size + len(content) for _, content in chunks)
        pieces: list[bytes | memoryview] = [_HEADER.pack(_MAGIC, self.version, length)]
        for kind, content in chunks:
            pieces += [_CHUNK.pack(len(content), kind), content]
        return b"".join([*pieces, self.rest])


def _parsed(name: str, content: bytes) -> tuple[str, int, int, Any]:
    """The text of a glTF, where its JSON value begins and ends, and the value."""
    text = content.decode("utf-8", _UNKNOWN_BYTES)
    start = 1 if text.startswith("\ufeff") else 0
    try:
        value, end = loads(text, start)
    except ValueError as error:
        raise MeshError(f"{name}: its JSON is damaged: {error}") from None
    if text[end:].strip(_BLANKS):
        raise MeshError(f"{name}: its JSON is damaged: something follows it at character {end}")
    return text, start, end, value


def _chunks(name: str, content: bytes) -> tuple[int, tuple[tuple[bytes, memoryview], ...], bytes]:
    """Version, chunks and what follows them. Errors: MeshError when a length does not fit, or without a JSON chunk."""
    if len(content) < _HEADER.size:
        raise MeshError(f"{name} is truncated: a GLB header has {_HEADER.size} bytes")
    _, version, length = _HEADER.unpack_from(content)
    if version != 2:
        raise MeshError(f"{name} is GLB version {version}; version 2 is read, which is what glTF 2.0 comes in")
    if length > len(content):
        raise MeshError(f"{name} is truncated: {len(content)} bytes, its header announces {length}")
    view, chunks, at = memoryview(content), [], _HEADER.size
    while at < length:
        if at + _CHUNK.size > length:
            raise MeshError(f"{name} is damaged: a chunk begins at byte {at} of {length}")
        size, kind = _CHUNK.unpack_from(content, at)
        at += _CHUNK.size
        if size > length - at:
            raise MeshError(
                f"{name} is damaged: a chunk at byte {at} announces {size} bytes, but {length - at} are left"
            )
        chunks.append((kind, view[at : at + size]))
        if len(chunks) > _MOST_CHUNKS:
            raise MeshError(f"{name} is damaged: it has more than {_MOST_CHUNKS} chunks")
        at += size
    if not chunks or chunks[0][0] != _JSON:
        raise MeshError(f"{name} is damaged: its first chunk is not JSON")
    return version, tuple(chunks), content[length:]


def _padded(content: bytes, filler: bytes) -> bytes:
    return content + filler * (-len(content) % 4)
