"""What an OBJ file refers to: material libraries, and the textures that those name."""

import os
import posixpath
import re
from collections.abc import Iterable, Iterator

from o3dmark.errors import MeshError
from o3dmark.files.references import Source, inside

_NUMBER = rb"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?(?=\s)"
_TEXTURE = re.compile(
    rb"\s*(?:map_(?!aat\s)\w+|bump|disp|decal|refl|norm)\s+"
    rb"(?:(?:-(?:blendu|blendv|boost|bm|cc|clamp|imfchan|texres|type)\s+\S+|-mm\s+\S+\s+\S+"
    rb"|-[ost](?:\s+" + _NUMBER + rb"){1,3})\s+)*"
    rb"(?P<name>.*)",
    re.I,
)


def libraries(source: Source, lines: Iterable[bytes]) -> tuple[str, ...]:
    """The files that lines of mtllib name, given without that word: several each, or one with spaces in its name."""
    return tuple(dict.fromkeys(name for line in dict.fromkeys(lines) for name in _libraries(source, line)))


def textures(source: Source, libraries: Iterable[str]) -> tuple[str, ...]:
    """The files that those libraries name that are there; relative to the folder of the OBJ file."""
    found = (_place(source, library, name) for library in libraries for name in _textures(source, library))
    return tuple(dict.fromkeys(found))


def _libraries(source: Source, line: bytes) -> list[str]:
    line, without_comment = _name(line), _name(line.split(b" #", 1)[0].rstrip())
    for whole in (line, without_comment):
        if _is_there(source, whole):
            return [whole]
    names: list[str] = []
    words: list[str] = []
    for word in without_comment.split():
        words.append(word)
        if word.lower().endswith(".mtl"):
            names.append(" ".join(words))
            words.clear()
    return names + words


def _textures(source: Source, library: str) -> Iterator[str]:
    """The textures that a library names, as it names them; none when it is not there, or not in the folder."""
    try:
        lines = source.beside(library).splitlines() if _is_there(source, library) else []
    except OSError:
        return
    for line in lines:
        found = _TEXTURE.match(line)
        if found and found["name"].strip():
            yield _name(found["name"].strip())


def _place(source: Source, library: str, name: str) -> str:
    """Where a texture is looked for: beside the library, or else beside the OBJ file."""
    folder = posixpath.dirname(library)
    beside = posixpath.normpath(posixpath.join(folder, name)) if folder else name
    return name if _is_there(source, name) and not _is_there(source, beside) else beside


def _is_there(source: Source, name: str) -> bool:
    try:
        return name in source.files or os.path.isfile(inside(source.path, name))
    except MeshError:
        return False


def _name(text: bytes) -> str:
    """A name in UTF-8, or else Latin-1, with the separators that all systems understand."""
    try:
        return text.decode().replace("\\", "/")
    except UnicodeDecodeError:
        return text.decode("latin-1").replace("\\", "/")
