"""glTF with all its bytes in one place, and from there into a .glb or a .gltf: nothing of its scene is lost.

The JSON keeps every key; buffers become one, in the BIN chunk or a .bin file, and images that were files become part of
it in a .glb. Source: glTF 2.0 specification, chapters 3.6 (binary data) and 4 (GLB).
"""

import base64
import json
import posixpath
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any
from urllib.parse import unquote, unquote_to_bytes

from o3dmark.errors import MeshError
from o3dmark.files.references import Source

_JSON, _BIN = 0x4E4F534A, 0x004E4942
_PICTURES = {  # by their first bytes
    b"\x89PNG": "image/png",
    b"\xff\xd8\xff": "image/jpeg",
    b"RIFF": "image/webp",
    b"\xabKTX": "image/ktx2",
    b"DDS ": "image/vnd-ms.dds",
}


@dataclass
class Packed:
    """The JSON of a glTF, and the content of its buffer 0, which all views are on; others have no content."""

    tree: dict[str, Any]
    content: bytearray

    def append(self, content: bytes) -> int:
        """Add a view on new bytes, and say its number."""
        self.content += bytes(-len(self.content) % 8)
        view = {"buffer": 0, "byteOffset": len(self.content), "byteLength": len(content)}
        self.content += content
        self.tree.setdefault("bufferViews", []).append(view)
        return len(self.tree["bufferViews"]) - 1

    def glb(self) -> bytes:
        self._set_buffer({})
        text = _json(self.tree)
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<LL", len(text), _JSON) + text
        if self.content:
            padding = bytes(-len(self.content) % 4)
            chunks += struct.pack("<LL", len(self.content) + len(padding), _BIN) + self.content + padding
        return struct.pack("<4sLL", b"glTF", 2, 12 + len(chunks)) + chunks

    def gltf(self, stem: str) -> dict[str, bytes]:
        """A .gltf and the .bin that it refers to."""
        self._set_buffer({"uri": f"{stem}.bin"})
        files = {f"{stem}.gltf": _json(self.tree)}
        return {**files, f"{stem}.bin": bytes(self.content)} if self.content else files

    def _set_buffer(self, where: dict[str, str]) -> None:
        if self.content:
            first, *others = self.tree["buffers"]
            first = {key: value for key, value in first.items() if key != "uri"}
            self.tree["buffers"] = [{**first, **where, "byteLength": len(self.content)}, *others]


def packed(source: Source) -> Packed:
    """A .glb or .gltf and what it refers to, images too.

    Errors: MeshError for a missing file, one outside the folder, or chunks of a .glb that a .gltf has no place for.
    """
    tree, chunk = _container(source)
    buffers = tree.get("buffers", [])
    contents = [_buffer(source, buffer, chunk if number == 0 else None) for number, buffer in enumerate(buffers)]
    result, starts = Packed(tree, bytearray()), {}
    for number, content in enumerate(contents):
        if content is not None:
            result.content += bytes(-len(result.content) % 8)
            starts[number] = len(result.content)
            result.content += content[: buffers[number]["byteLength"]]
    empty = [number for number in range(len(buffers)) if number not in starts]
    place = {number: 1 + order for order, number in enumerate(empty)}
    for view in _views(tree):
        number = view["buffer"]
        view["byteOffset"] = view.get("byteOffset", 0) + starts.get(number, 0)
        view["buffer"] = place.get(number, 0)
    tree["buffers"] = [buffers[min(starts)] if starts else {}, *(buffers[number] for number in empty)]
    _take_images(source, result)
    if not result.content:
        del tree["buffers"]
    return result


def _views(tree: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """All that says where in a buffer something is: views, and extensions of theirs (compressed forms)."""
    for view in tree.get("bufferViews", []):
        yield view
        yield from (extension for extension in view.get("extensions", {}).values() if "buffer" in extension)


def _container(source: Source) -> tuple[dict[str, Any], bytes | None]:
    content = source.read()
    if not content.startswith(b"glTF"):
        return json.loads(content.decode("utf-8-sig", "surrogateescape")), None
    at, chunks = 12, []
    while at < struct.unpack_from("<L", content, 8)[0]:
        size, kind = struct.unpack_from("<LL", content, at)
        chunks.append((kind, content[at + 8 : at + 8 + size]))
        at += 8 + size
    if [kind for kind, _ in chunks] not in ([_JSON], [_JSON, _BIN]):
        raise MeshError(f"{source.name} has chunks that only a .glb can hold, with no word on them; keep it a .glb")
    tree = json.loads(chunks[0][1].rstrip(b"\0").decode("utf-8", "surrogateescape"))
    return tree, chunks[1][1] if len(chunks) > 1 else b""


def _buffer(source: Source, buffer: dict[str, Any], chunk: bytes | None) -> bytes | None:
    """The content of a buffer; None where it has none, as when only a compressed form of it is there."""
    if "uri" in buffer:
        return _uri(source, buffer["uri"])
    return chunk or None


def _uri(source: Source, uri: str) -> bytes:
    if not uri.startswith("data:"):
        return source.beside(uri) if uri in source.files else source.beside(unquote(uri))
    kind, _, data = uri.partition(",")
    return base64.b64decode(unquote(data) + "==") if kind.endswith(";base64") else unquote_to_bytes(data)


def _take_images(source: Source, result: Packed) -> None:
    for image in result.tree.get("images", []):
        uri = image.get("uri", "")
        if uri and not uri.startswith("data:"):
            content = _uri(source, uri)
            del image["uri"]
            image["bufferView"] = result.append(content)
            suffix = posixpath.splitext(unquote(uri))[1].lstrip(".").lower()
            found = (kind for start, kind in _PICTURES.items() if content.startswith(start))
            image.setdefault("mimeType", next(found, f"image/{suffix}"))
            image.setdefault("name", posixpath.splitext(posixpath.basename(unquote(uri)))[0])


def _json(tree: dict[str, Any]) -> bytes:
    return json.dumps(tree, ensure_ascii=False, separators=(",", ":")).encode("utf-8", "surrogateescape")
