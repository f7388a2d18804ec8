"""The lines of an OBJ file as arrays: vertices, their colours, normals and faces, and where in the file they stand."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from o3dmark.arrays import Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.files._parsing import check_corners, ranges
from o3dmark.files._text import Text, where

_SLASH = 47
_COMMENT = re.compile(rb"(?<!\S)#")
_CONTINUED = re.compile(rb"(?<!\S)#[^\r\n]*|\\(?:\r\n|\r|\n)")  # a comment is not: it may end with the name of a folder
_REST = re.compile(rb"[^\r\n]*")
_INDEX = re.compile(rb"[+-]?0*[1-9]\d*(/([+-]?\d+)?)*")
_NUMBER = re.compile(rb"[+-]?((\d+\.?\d*|\.\d+)(e[+-]?\d+)?|nan|inf|infinity)", re.I)
_KINDS = {  # of content, by the words that lines begin with
    b"v": "",
    b"f": "",
    b"vt": "texture coordinates",
    b"vn": "normals",
    b"l": "lines",
    b"p": "points",
    b"o": "names",
    **dict.fromkeys((b"g", b"s", b"mg"), "groups"),
    **dict.fromkeys((b"usemtl", b"mtllib"), "materials"),
    **dict.fromkeys(b"vp cstype deg bmat step curv curv2 surf parm trim hole scrv sp end con".split(), "free forms"),
}


@dataclass(frozen=True, eq=False)
class Faces:
    """counts (f,): how many corners each face has; vertices (c,): of all corners, from 0.

    normals (c,): of all corners, -1 for none; None where no corner has one.
    """

    counts: Ints
    vertices: Ints
    normals: Ints | None


class ObjText:
    """An OBJ file. Errors: MeshError when it has no vertex, or where what is asked for is damaged."""

    def __init__(self, path: Path, content: bytes) -> None:
        self._path, self._content = path, content
        self._text = Text(_joined(content))
        self._vertices, self._normals, self._faces = (self._text.lines(word) for word in (b"v", b"vn", b"f"))
        if not len(self._vertices):
            raise MeshError(f"{path.name} holds no mesh")

    def vertices(self) -> tuple[Ints, Floats]:
        """Where the coordinates of each vertex stand (n, 3, 2), and what they say (n, 3)."""
        places = self._columns(self._vertices, 1)
        try:
            return places, self._text.floats(places)
        except ValueError:
            raise self._damage(places, _NUMBER, "a vertex is not 3 numbers") from None

    def colours(self) -> Floats | None:
        """The three numbers (n, 3) that follow the coordinates, if all vertices have them."""
        if self._text.count[self._vertices].min() < 7:
            return None
        try:
            return self._text.floats(self._columns(self._vertices, 4))
        except ValueError:
            return None

    def normals(self) -> tuple[Ints, Floats]:
        """As `vertices`, of normals (k, 3); what is not three numbers (some programs write 1.#IND) is not a number."""
        places = self._columns(self._normals, 1)
        try:
            return places, self._text.floats(places)
        except ValueError:
            rows = [[self._content[a:b] for a, b in row] for row in places.tolist()]
            return places, np.array([_floats(row) for row in rows])

    def faces(self) -> Faces:
        """Errors: also for a corner that is no vertex."""
        counts = self._text.count[self._faces] - 1
        words = self._text.places[ranges(self._text.first[self._faces] + 1, counts)]
        vertex, normal = _fields(words, where(self._text.bytes, lambda block: block == _SLASH))
        try:
            vertices = self._text.integers(vertex)
        except ValueError:
            vertices = np.zeros(1, np.int64)
        if not vertices.all():  # OBJ counts from 1
            raise self._damage(words, _INDEX, "a face has a corner that is no vertex number")
        vertices = self._from_zero(vertices, self._vertices, counts)
        check_corners(self._path, vertices, len(self._vertices))
        return Faces(counts, vertices, self._normals_at(words, normal, counts))

    def rests(self, word: bytes) -> list[bytes]:
        """What follows a word that lines begin with, to their ends."""
        lines = self._text.lines(word)
        starts = self._text.places[self._text.first[lines], 1].tolist()
        return [_REST.match(self._text.content, start)[0].strip() for start in starts]  # type: ignore[index]

    def kinds(self) -> frozenset[str]:
        """What is in it, in the words of `asset.KINDS`."""
        words = self._text.count[self._vertices]
        also = {
            "polygons": (self._text.count[self._faces] > 4).any(),
            "vertex colours": (words >= 7).any(),
            "weights": (words == 5).any(),
            "comments": b"#" in self._content and _COMMENT.search(self._content),
        }
        kinds = {_KINDS.get(word, "other statements") for word in self._words()} - {""}
        return frozenset(kinds | {kind for kind, there in also.items() if there})

    def _words(self) -> set[bytes]:
        """Those that lines begin with."""
        common = {word: self._text.lines(word) for word in (b"v", b"vt", b"vn", b"f")}
        rest = np.ones(len(self._text.first), bool)
        rest[np.concatenate(list(common.values()))] = False
        spans = self._text.places[self._text.first[rest]].tolist()
        return {word for word, lines in common.items() if len(lines)} | {self._text.content[a:b] for a, b in spans}

    def _columns(self, lines: Ints, first: int) -> Ints:
        """Where three words of each line stand (k, 3, 2), from that numbered ``first`` on; empty beyond it."""
        columns, count = np.arange(first, first + 3), self._text.count[lines, None]
        spans = self._text.places[self._text.first[lines, None] + np.minimum(columns, count - 1)]
        return np.where((columns < count)[..., None], spans, spans[..., 1:])

    def _from_zero(self, indices: Ints, lines: Ints, counts: Ints) -> Ints:
        """Indices (c,) from 1, or from -1 back from the line of the face, as indices of ``lines``, from 0."""
        if indices.min(initial=0) < 0:
            before = np.repeat(np.searchsorted(lines, self._faces), counts)
            indices = np.where(indices < 0, indices + before + 1, indices)
        return indices - 1

    def _normals_at(self, words: Ints, spans: Ints, counts: Ints) -> Ints | None:
        """The normals (c,) that corners name in ``spans`` (c, 2) of their ``words``; -1 where that is none."""
        there = spans[:, 0] < spans[:, 1]
        if not len(self._normals) or not there.any():
            return None
        numbers = np.zeros(len(spans), np.int64)
        try:
            numbers[there] = self._text.integers(spans[there])
        except ValueError:
            raise self._damage(words, _INDEX, "a face has a corner that is no vertex number") from None
        numbers = self._from_zero(numbers, self._normals, counts)
        return np.where((numbers >= 0) & (numbers < len(self._normals)), numbers, -1)

    def _damage(self, places: Ints, pattern: re.Pattern[bytes], what: str) -> MeshError:
        """The error for the first word that is not as it should be; it names the line, if that can be told."""
        spans = ((a, b) for a, b in places.reshape(-1, 2).tolist() if not pattern.fullmatch(self._content, a, b))
        start = next(spans, (None,))[0]
        if start is None:
            return MeshError(f"{self._path.name}: {what}")
        ends = [self._content.count(end, 0, start) for end in (b"\n", b"\r", b"\r\n")]
        return MeshError(f"{self._path.name}, line {1 + ends[0] + ends[1] - ends[2]}: {what}")


def _joined(content: bytes) -> bytes:
    """An OBJ file with blanks for the ends of lines that go on, as long as it was."""
    if b"\\" not in content:
        return content
    return _CONTINUED.sub(lambda end: end[0] if end[0].startswith(b"#") else b" " * len(end[0]), content)


def _fields(words: Ints, slashes: Ints) -> tuple[Ints, Ints]:
    """Where in the words of corners (c, 2) the vertex stands, and where, after two slashes, the normal, if any."""
    if not len(slashes):
        return words, words[:, 1:].repeat(2, axis=1)
    start, end = words.T
    following = np.searchsorted(slashes, start)
    slashes = np.append(slashes, [np.iinfo(np.int64).max] * 2)
    first, second = (np.minimum(slashes[following + place], end) for place in (0, 1))
    return np.column_stack([start, first]), np.column_stack([np.minimum(second + 1, end), end])


def _floats(words: list[bytes]) -> list[float]:
    try:
        return [float(word) for word in words]
    except ValueError:
        return [np.nan] * len(words)
