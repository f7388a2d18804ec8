"""The bytes that a glTF's buffers and their views hold: in the BIN chunk, in the text as data URIs, in files beside it.

A `Space` is a row of bytes in which numbers have their places: a buffer, or what a compressed view or primitive holds
when it is decoded. `Edits` are the spaces and the words of the text that have changed.
"""

import base64
import binascii
import json
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias
from urllib.parse import quote, quote_from_bytes, unquote, unquote_to_bytes

import numpy as np

from o3dmark.arrays import Bits, Floats
from o3dmark.errors import MeshError
from o3dmark.files.gltf.budget import Budget
from o3dmark.files.gltf.container import Container
from o3dmark.files.gltf.json_fields import Fields
from o3dmark.files.gltf.json_spans import JsonSpans, Span, Step, replaced
from o3dmark.files.references import Source

Path: TypeAlias = tuple[Step, ...]

_ALIGNMENT = 4  # of what is added to a buffer, as of its chunk
_SAFE = "/!$&'()*+,;=@-._~"  # what a relative reference may hold as it is (RFC 3986)


class Space(ABC):
    """A row of bytes (n,) in which numbers have their places."""

    @property
    @abstractmethod
    def content(self) -> Bits:
        """The bytes as they were read, read-only. Errors: MeshError where they are missing or damaged."""

    @property
    @abstractmethod
    def buffers(self) -> "tuple[Buffer, ...]":
        """The buffers that change with these bytes."""

    @property
    def fixed(self) -> str:
        """Why other bytes cannot be put here, if they cannot."""
        return ""

    @property
    def holds(self) -> "tuple[tuple[Buffer, int, int], ...]":
        """Where the file keeps these bytes in another form: buffers, first bytes and lengths."""
        return ()

    def steps(self, start: int, stride: int, shape: tuple[int, ...]) -> Floats | None:  # noqa: ARG002
        """How far apart the numbers (n, d) are that can be kept there, or None where only their type says it."""
        return None

    def put_back(self, edits: "Edits") -> None:  # noqa: B027 - a buffer's bytes are where they belong
        """Carry what changed in these bytes to where the file holds them; they become what is read from there."""


@dataclass
class Edits:
    """What is to be written otherwise: bytes of spaces, and words of the text by their paths in its JSON.

    added: what follows all bytes of a buffer; ends: where the last byte of it that is used ends.
    """

    spaces: dict[Space, Bits] = field(default_factory=dict)
    words: dict[Path, str] = field(default_factory=dict)
    added: dict["Buffer", bytearray] = field(default_factory=dict)
    ends: Mapping["Buffer", int] = field(default_factory=dict)

    def of(self, space: Space) -> Bits:
        """The bytes of a space, to be changed."""
        if space not in self.spaces:
            self.spaces[space] = space.content.copy()
        return self.spaces[space]

    def changed(self, buffer: "Buffer") -> bytes | None:
        """All bytes that a buffer has now, or None when they are as they were."""
        return self.spaces[buffer].tobytes() + self.added.get(buffer, b"") if buffer in self.spaces else None

    def put_back(self) -> None:
        """Carry all that was decoded back to the buffers."""
        for space in list(self.spaces):
            space.put_back(self)

    def replace(self, place: "tuple[Buffer, int, int]", packed: bytes, number: int, path: Path) -> None:
        """Put other bytes at a place (buffer ``number``, first byte, length); longer ones go behind all others.

        Nothing stays of what was there: a copy without a mark would be in a file that is given away. ``path`` leads to
        the object whose byteOffset and byteLength say where the bytes are.
        """
        buffer, start, length = place
        here = self.of(buffer)[start : start + length]
        here[:] = 0
        self.words[*path, "byteLength"] = str(len(packed))
        if len(packed) <= length:
            here[: len(packed)] = np.frombuffer(packed, np.uint8)
            return
        n = len(buffer.content)
        if buffer not in self.added and start + length >= self.ends.get(buffer, n):
            packed = packed.ljust(n - start, b"\0")
            self.of(buffer)[start:] = np.frombuffer(packed, np.uint8, n - start)
            self.added[buffer] = bytearray(packed[n - start :])
        else:
            added = self.added.setdefault(buffer, bytearray())
            added += bytes(-(n + len(added)) % _ALIGNMENT)
            self.words[*path, "byteOffset"] = str(n + len(added))
            added += packed
        self.words["buffers", number, "byteLength"] = str(n + len(self.added[buffer]))


class Buffer(Space):
    """The bytes of a buffer, read when they are first asked for. Buffers that name one file are one."""

    def __init__(self, source: Source, budget: Budget, where: str, uri: str | None, binary: memoryview | None) -> None:
        self.where, self.uri = where, uri
        self.file = "" if uri is None else file_of(uri)
        self._source, self._budget, self._binary = source, budget, binary

    @property
    def buffers(self) -> "tuple[Buffer, ...]":
        return (self,)

    @property
    def is_chunk(self) -> bool:
        return self.uri is None and self._binary is not None

    def has(self, start: int, length: int) -> bool:
        """Whether it has these bytes; a file may be missing that not every reader needs."""
        try:
            return start + length <= len(self.content)
        except MeshError:
            return False

    @cached_property
    def content(self) -> Bits:
        if self.uri is None and self._binary is None:
            raise MeshError(f"{self.where} names no file, and no BIN chunk stands for it")
        if self.uri is None:
            return np.frombuffer(self._binary or b"", np.uint8)
        if self.file:
            found = self._source.beside(self.file)
            self._budget.size += len(found)
            return np.frombuffer(found, np.uint8)
        try:
            return np.frombuffer(_data(self.uri), np.uint8)
        except (ValueError, binascii.Error):
            raise MeshError(f"{self.where} is a damaged data URI") from None


class Buffers:
    """All buffers of a glTF, and how a file with other bytes in them is written."""

    def __init__(self, source: Source, container: Container, root: Fields, budget: Budget) -> None:
        self._source, self._container = source, container
        self.fields = root.parts("buffers", "buffer")
        named: dict[str, Buffer] = {}
        self._buffers = []
        for number, fields in enumerate(self.fields):
            uri = fields.text("uri") if "uri" in fields else None
            buffer = Buffer(source, budget, fields.where, uri, container.binary if number == 0 else None)
            self._buffers.append(named.setdefault(buffer.file, buffer) if buffer.file else buffer)

    def __len__(self) -> int:
        return len(self._buffers)

    def __getitem__(self, number: int) -> Buffer:
        return self._buffers[number]

    @property
    def files(self) -> list[str]:
        return [buffer.file for buffer in self._buffers if buffer.file]

    def written(self, edits: Edits, names: Mapping[str, str], wanted: tuple[str, ...]) -> dict[str, bytes]:
        """The asset with what was edited, and the ``wanted`` files beside it, under new names where they get one."""
        files, binary, words = {}, None, dict(edits.words)
        for number, buffer in enumerate(self._buffers):
            changed = edits.changed(buffer)
            if buffer.file in wanted and buffer.file:
                name = names.get(buffer.file, buffer.file)
                files[name] = buffer.content.tobytes() if changed is None else changed
                if name != buffer.file:
                    words["buffers", number, "uri"] = json.dumps(quote(name, safe=_SAFE))
            elif changed is not None and buffer.is_chunk:
                binary = changed
            elif changed is not None and buffer.uri is not None:
                words["buffers", number, "uri"] = self._data_uri(number, changed)
        return {self._source.name: self._container.built(self._text(words), binary), **files}

    @cached_property
    def _spans(self) -> JsonSpans:
        return JsonSpans(self._container.text, self._container.start)

    def span(self, *path: Step) -> Span | None:
        return self._spans.of(*path)

    def raw(self, *path: Step) -> str:
        """The words at a place of the text, "" when there are none."""
        span = self.span(*path)
        return self._container.text[slice(*span)] if span else ""

    def _text(self, words: Mapping[Path, str]) -> str:
        """The text with other words at some paths; a key that is not there becomes the first of its object."""
        changes: dict[Span, str] = {}
        for path, new in words.items():
            if span := self.span(*path):
                changes[span] = new
            elif parent := self.span(*path[:-1]):
                changes[parent[0] + 1, parent[0] + 1] = f"{json.dumps(path[-1])}: {new}, "
        return replaced(self._container.text, changes)

    def _data_uri(self, number: int, content: bytes) -> str:
        """A data URI of the same head as that of a buffer, as JSON writes it."""
        head = (self[number].uri or "").partition(",")[0]
        in_base64 = head.endswith(";base64")
        uri = head + "," + (base64.b64encode(content).decode("ascii") if in_base64 else quote_from_bytes(content))
        words = json.dumps(uri)
        return words.replace("/", "\\/") if "\\/" in self.raw("buffers", number, "uri") else words


def file_of(uri: str) -> str:
    """The file beside the asset that a reference names, "" for a data URI."""
    return "" if uri[:5].lower() == "data:" else unquote(uri)


def _data(uri: str) -> bytes:
    """What a data URI holds (RFC 2397). Errors: ValueError."""
    head, comma, body = uri.partition(",")
    if not comma:
        raise ValueError("a data URI has a comma")
    if not head.endswith(";base64"):
        return unquote_to_bytes(body)
    return base64.b64decode(unquote(body) if "%" in body else body, validate=True)
