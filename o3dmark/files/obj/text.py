"""The lines of an OBJ file as arrays: vertices, their colours, normals and faces, and where in the file they stand."""

import functools
import itertools
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from o3dmark.arrays import Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.files.text.polygons import check_corners
from o3dmark.files.text.words import Places, Text, blocks, mask

_SLASH = 47
_COMMENT = re.compile(rb"#[^\r\n]*")
_LINE = re.compile(rb"[^\r\n]*")
_INDEX = re.compile(rb"[+-]?0*[1-9]\d*(/([+-]?\d+)?){0,2}")
_NUMBER = re.compile(rb"[+-]?((\d+\.?\d*|\.\d+)(e[+-]?\d+)?|nan|inf|infinity)", re.I)
_KINDS = {  # of content, by the words that lines begin with
    b"l": "lines",
    b"p": "points",
    b"o": "names",
    **dict.fromkeys((b"g", b"s", b"mg"), "groups"),
    **dict.fromkeys((b"usemtl", b"mtllib"), "materials"),
    **dict.fromkeys(b"vp cstype deg bmat step curv curv2 surf parm trim hole scrv sp end con".split(), "free forms"),
}


class ObjText:
    """An OBJ file. Errors: MeshError when it has no vertex, or where what is asked for is damaged."""

    def __init__(self, path: Path, content: bytes) -> None:
        self._path, self._content = path, content
        self._text = Text(_without_continuations(content))
        found = self._text.lines(b"v", b"vt", b"vn", b"f", b"mtllib")
        self._vertices, self._coordinates, self._normals, self._faces, self._libraries = found
        if not len(self._vertices):
            raise MeshError(f"{path.name} holds no mesh")

    def vertices(self) -> tuple[Places, Floats]:
        """Where the coordinates of each vertex stand (n, 3, 2), and what they say (n, 3)."""
        places = self._text.columns(self._vertices, 1)
        try:
            return places, self._text.floats(places)
        except ValueError:
            raise self._damage(places, _NUMBER, "a vertex is not 3 numbers") from None

    def colours(self) -> Floats | None:
        """The three numbers (n, 3) that follow the coordinates, if all vertices have them."""
        if self._text.counts(self._vertices).min() < 7:
            return None
        try:
            return self._text.floats(self._text.columns(self._vertices, 4))
        except ValueError:
            return None

    def normals(self) -> tuple[Places, Floats]:
        """As `vertices`, of normals (k, 3); what is not three numbers (some programs write 1.#IND) is not a number."""
        places = self._text.columns(self._normals, 1)
        try:
            return places, self._text.floats(places)
        except ValueError:
            values = np.empty(places.shape[:2])
            for number, row in enumerate(places):
                values[number] = self._normal(row)
            return places, values

    def faces(self) -> tuple[Places, list[Places]]:
        """How many corners each face has (f,); and the vertices (c,) of all corners, one face after another, from 0.

        If any corner has a normal, also the normals (c,), -1 for none. Errors: also for a corner that is no vertex.
        """
        counts = self._text.counts(self._faces) - 1
        vertices = np.empty(counts.sum(dtype=np.int64), counts.dtype)
        normals, done = np.full(len(vertices), -1, counts.dtype), 0
        for words in self._corner_words():
            here = slice(done, done := done + len(words))
            vertices[here], normals[here] = self._corners(words)
        return counts, [vertices, normals] if (normals >= 0).any() else [vertices]

    def libraries(self) -> Iterator[bytes]:
        """What follows mtllib on each of its lines."""
        for start in self._text.places[self._text.first[self._libraries], 1]:
            end = int(start)
            while True:
                end = _LINE.match(self._content, end).end()  # type: ignore[union-attr]
                if self._content[end - 1 : end] != b"\\" or end == len(self._content):
                    break
                end += 2 if self._content.startswith(b"\r\n", end) else 1
            yield _blanked(self._content[start:end]).strip()

    def kinds(self) -> frozenset[str]:
        """What is in it, in the words of `asset.KINDS`."""
        words = self._text.counts(self._vertices)
        also = {
            "polygons": (self._text.counts(self._faces) > 4).any(),
            "texture coordinates": len(self._coordinates) > 0,
            "normals": len(self._normals) > 0,
            "vertex colours": (words >= 7).any(),
            "weights": (words == 5).any(),
            "comments": re.search(rb"(?<!\S)#", self._content),
        }
        kinds = {_KINDS.get(word, "other statements") for word in self._other_words()}
        return frozenset(kinds | {kind for kind, there in also.items() if there})

    def _other_words(self) -> set[bytes]:
        """Those that lines begin with, other than the most common."""
        others = np.ones(len(self._text.first) - 1, bool)
        for lines in (self._vertices, self._coordinates, self._normals, self._faces):
            others[lines] = False
        words: set[bytes] = set()
        for block in blocks(len(others)):
            places = self._text.places[self._text.first[:-1][block][others[block]]].tolist()
            words.update(self._content[start:end] for start, end in places)
        return words

    def _normal(self, places: Places) -> list[float]:
        try:
            return [float(self._content[start:end]) for start, end in places]
        except ValueError:
            return [np.nan] * 3

    def _corner_words(self) -> Iterator[Ints]:
        """The numbers of the words that are corners of faces, block by block."""
        first = self._text.first
        corners = mask(len(self._text.places), np.column_stack([first[self._faces] + 1, first[self._faces + 1]]))
        for block in blocks(len(corners)):
            words = np.flatnonzero(corners[block]) + block.start
            if len(words):
                yield words

    def _corners(self, words: Ints) -> tuple[Ints, Ints]:
        """The vertices (c,) and the normals (c,), or -1, that some words name."""
        places = self._text.places[words]
        damage = functools.partial(self._damage, places, _INDEX, "a face has a corner that is no vertex number")
        vertex, normal = self._fields(places)
        named = (normal[:, 0] < normal[:, 1]) & (len(self._normals) > 0)
        normals = np.zeros(len(words), np.int64)
        try:
            vertices = self._text.integers(vertex)
            normals[named] = self._text.integers(normal[named])
        except ValueError:
            raise damage() from None
        if not vertices.all():  # OBJ counts from 1
            raise damage()
        vertices = self._from_zero(vertices, words, self._vertices)
        normals = self._from_zero(normals, words, self._normals)
        check_corners(self._path, vertices, len(self._vertices))
        return vertices, np.where((normals >= 0) & (normals < len(self._normals)), normals, -1)

    def _fields(self, places: Places) -> tuple[Places, Places]:
        """Where in the words of corners (c, 2) the vertex stands, and where, after two slashes, the normal, if any."""
        start, end = places.T
        slashes = np.flatnonzero(self._text.bytes[start[0] : end[-1]] == _SLASH) + start[0]
        if not len(slashes):
            return places, places[:, [1, 1]]
        following = np.searchsorted(slashes, start)
        slashes = np.append(slashes, [len(self._content)] * 2)
        first, second = (np.minimum(slashes[following + place], end) for place in (0, 1))
        return np.column_stack([start, first]), np.column_stack([np.minimum(second + 1, end), end])

    def _from_zero(self, indices: Ints, words: Ints, lines: Places) -> Ints:
        """Indices (c,) from 1, or from -1 back from the line where they stand, as indices of ``lines``, from 0."""
        if indices.min(initial=0) < 0:
            line = np.searchsorted(self._text.first, words, side="right") - 1
            indices = np.where(indices < 0, indices + np.searchsorted(lines, line) + 1, indices)
        return indices - 1

    def _damage(self, places: Ints, pattern: re.Pattern[bytes], what: str) -> MeshError:
        """The error for the first word that is not as it should be; it names the line, if that can be told."""
        spans = ((a, b) for a, b in places.reshape(-1, 2).tolist() if not pattern.fullmatch(self._content, a, b))
        start = next(spans, (None,))[0]
        if start is None:
            return MeshError(f"{self._path.name}: {what}")
        ends = [self._content.count(end, 0, start) for end in (b"\n", b"\r", b"\r\n")]
        return MeshError(f"{self._path.name}, line {1 + ends[0] + ends[1] - ends[2]}: {what}")


def _without_continuations(content: bytes) -> bytes:
    """An OBJ file with blanks for the ends of lines that go on; not of comments, which may end with a folder."""
    if b"\\" not in content:
        return content
    result, done = bytearray(content), 0
    comments = (comment.span() for comment in _COMMENT.finditer(content))
    for start, end in itertools.chain(comments, [(len(content), len(content))]):
        if content.find(b"\\", done, start) >= 0:
            result[done:start] = _blanked(content[done:start])
        done = end
    return bytes(result)


def _blanked(text: bytes) -> bytes:
    """Lines that go on as one, as long as they were."""
    return text.replace(b"\\\r\n", b"   ").replace(b"\\\n", b"  ").replace(b"\\\r", b"  ")
