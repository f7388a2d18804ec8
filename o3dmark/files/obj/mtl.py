"""What an OBJ file refers to: material libraries, and the textures that those name."""

import os
import posixpath
import re
from collections.abc import Iterable, Iterator

from o3dmark.errors import MeshError
from o3dmark.files.references import Source, inside

_NUMBER = rb"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?(?=\s)"
_LONGEST = 8192  # bytes of a line
_TEXTURE = re.compile(
    rb"\s*(?:map_(?!aat\s)\w+|bump|disp|decal|refl|norm)\s+"
    rb"(?:(?:-(?:blendu|blendv|boost|bm|cc|clamp|imfchan|texres|type)\s+\S+|-mm\s+\S+\s+\S+"
    rb"|-[ost](?:\s+" + _NUMBER + rb"){1,3})\s+)*"
    rb"(?P<name>.*)",
    re.I,
)


def libraries(source: Source, lines: Iterable[bytes]) -> list[str]:
    """The files that lines of mtllib name, given without that word: several each, or one with spaces in its name."""
    return list(dict.fromkeys(name for line in dict.fromkeys(lines) for name in _libraries(source, line)))


def textures(source: Source, libraries: Iterable[str]) -> list[str]:
    """The files that those libraries name that are there; relative to the folder of the OBJ file."""
    named = ((library, name) for library in libraries for name in dict.fromkeys(_textures(source, library)))
    return list(dict.fromkeys(_place(source, library, name) for library, name in named))


def _libraries(source: Source, text: bytes) -> Iterator[str]:
    line, without_comment = _name(text), _name(text.split(b" #", 1)[0].rstrip())
    for whole in (line, without_comment):
        if _is_there(source, whole):
            yield whole
            return
    words: list[str] = []
    for word in re.finditer(r"\S+", without_comment):
        words.append(word[0])
        if word[0].lower().endswith(".mtl"):
            yield " ".join(words)
            words.clear()
    yield from words


def _textures(source: Source, library: str) -> Iterator[str]:
    """The textures that a library names, as it names them; none when it is not there, or not in the folder."""
    try:
        lines = source.beside(library).splitlines() if _is_there(source, library) else []
    except OSError:
        return
    for line in lines:
        found = _TEXTURE.match(line[:_LONGEST])
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
