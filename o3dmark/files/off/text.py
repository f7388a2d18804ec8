"""An OFF file as arrays: vertices, their normals and colours, and faces, and where in the file they stand."""

import bisect
import re
from array import array
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from o3dmark.arrays import Floats
from o3dmark.errors import MeshError
from o3dmark.files.text.polygons import check_corners, check_size, fewer
from o3dmark.files.text.words import Places, Text, blocks, mask

_KIND = re.compile(rb"((?:ST|C|N|4)*)(OFF)(\d*)", re.I)  # a count may stick to it
_COUNT = re.compile(rb"\d{1,18}")
_LONGEST = 40  # bytes of a word in the head
_FACE = "a face is not a number of corners and as many vertices"


@dataclass(frozen=True, eq=False)
class OffText:
    """places (n, 3, 2) of the coordinates, and positions (n, 3); those of normals, and colours (n, 3), if it has any.

    counts (f,): how many corners each face has; corners (c,): the vertices of all. kinds: what else is in it.
    """

    places: Places
    positions: Floats
    normal_places: Places
    normals: Floats | None
    colours: Floats | None
    counts: Places
    corners: Places
    kinds: frozenset[str]


@dataclass(frozen=True)
class _Head:
    """What the head of an OFF file announces: letters before OFF, counts, and the number of the first word after it."""

    letters: str
    vertices: int
    faces: int
    word: int

    @property
    def first_colour(self) -> int:
        return 6 if "N" in self.letters else 3

    @property
    def least(self) -> int:
        """Numbers of a vertex, at least: some programs write three of a colour."""
        return self.first_colour + (3 if "C" in self.letters else 0)

    @property
    def width(self) -> int:
        """Numbers of a vertex by the book."""
        return self.first_colour + (4 if "C" in self.letters else 0) + (2 if "ST" in self.letters else 0)


@dataclass(frozen=True, eq=False)
class _Layout:
    """The number of the first word of each vertex (n,) and of each face (f,), and how many corners that has (f,).

    more: whether words follow the vertices of any face; and the numbers of any vertex that its head does not announce.
    """

    vertices: Places
    faces: Places
    counts: Places
    more: tuple[bool, bool]


def parsed(path: Path, content: bytes) -> OffText:
    """The content of an OFF file. Errors: MeshError for another kind of file, or a damaged one."""
    text = Text(content)
    head = _head(path, text)
    check_size(path, 6 * head.vertices + 2 * head.faces, len(content))
    layout = _layout(path, text, head)
    places = [text.places[layout.vertices[:, None] + np.arange(first, first + 3)] for first in range(0, head.least, 3)]
    try:
        columns = [text.floats(place) for place in places]
    except ValueError:
        raise _no_vertex(path, head) from None
    corners = _corners(path, text, layout, head.vertices)
    normal = "N" in head.letters
    kinds = {
        "polygons": (layout.counts > 3).any(),
        "lines": (layout.counts == 2).any(),
        "points": (layout.counts == 1).any(),
        "normals": normal,
        "texture coordinates": "ST" in head.letters,
        "vertex colours": "C" in head.letters or layout.more[1],
        "face colours": layout.more[0],
        "comments": b"#" in content,
    }
    return OffText(
        places=places[0],
        positions=columns[0],
        normal_places=places[1] if normal else places[0][:0],
        normals=columns[1] if normal else None,
        colours=columns[-1] if "C" in head.letters else None,
        counts=layout.counts,
        corners=corners,
        kinds=frozenset(kind for kind, there in kinds.items() if there),
    )


def _head(path: Path, text: Text) -> _Head:
    words = [text.bytes[start : min(end, start + _LONGEST)].tobytes() for start, end in text.places[:4]]
    kind = _KIND.fullmatch(words[0]) if words else None
    if kind is None:
        raise MeshError(f"{path.name} does not begin like an OFF file")
    letters, off, glued = kind.groups()
    if b"4" in letters or (letters.endswith(b"n") and off == b"OFF"):  # "noff" has normals
        called = (letters + off).decode()
        raise MeshError(
            f"{path.name} is a {called} file, of more than three dimensions; only those of three can be used"
        )
    if words[1:2] == [b"BINARY"]:
        raise MeshError(f"{path.name} is a binary OFF file; save it as text, or in another format")
    counts = ([glued] if glued else []) + words[1:]
    if len(counts) < 2 or not all(_COUNT.fullmatch(count) for count in counts[:2]):
        raise MeshError(
            f"{path.name} does not begin like an OFF file: its name, and how many vertices and faces it has"
        )
    word = 2 if glued else 3
    edges = word < len(text.places) and word not in text.first and _COUNT.fullmatch(counts[2])
    return _Head(letters.decode().upper(), int(counts[0]), int(counts[1]), word + bool(edges))


def _layout(path: Path, text: Text, head: _Head) -> _Layout:
    """A vertex a line, and a face; or else as Geomview reads: only what follows a face ends with the line."""
    first = text.first[np.searchsorted(text.first, head.word) :]
    if first[0] > head.word:
        first = np.append(np.array([head.word], first.dtype), first)
    if len(first) > 2 and first[1] - first[0] == 1 and first[2] - first[1] >= 3:  # how many edges, on its own line
        first = first[1:]
    try:
        return _by_lines(path, text, head, first)
    except MeshError:
        layout = _by_words(text, head, first)
        if layout is None:
            raise
        return layout


def _by_lines(path: Path, text: Text, head: _Head, first: Places) -> _Layout:
    n, m = head.vertices, head.faces
    if len(first) - 1 < n + m:
        raise fewer(path, (n, m), (min(len(first) - 1, n), max(len(first) - 1 - n, 0)))
    count, faces = np.diff(first[: n + m + 1]), first[n : n + m]
    if n and count[:n].min() < head.least:
        raise _no_vertex(path, head)
    try:
        sizes = text.integers(text.places[faces])
    except ValueError:
        raise MeshError(f"{path.name}: {_FACE}") from None
    if ((sizes < 0) | (sizes >= count[n:])).any():
        raise MeshError(f"{path.name}: {_FACE}")
    more = bool((count[n:] - 1 > sizes).any()), bool((count[:n] > head.width).any())
    return _Layout(first[:n], faces, sizes.astype(first.dtype), more)


def _by_words(text: Text, head: _Head, first: Places) -> _Layout | None:
    """None where the vertices do not end with a line, or the faces with the file: then something is missing."""
    n_words, more = len(text.places), False
    word = int(first[0]) + head.vertices * head.width
    vertices = np.arange(int(first[0]), word, head.width, dtype=first.dtype) if word <= n_words else first[:0]
    lines, places = first.data, text.places.ravel().data
    line = bisect.bisect_left(lines, word)
    faces, sizes = array(first.dtype.char), array(first.dtype.char)
    while word < n_words and lines[line] == word and len(faces) < head.faces:
        size = text.bytes[places[2 * word] : min(places[2 * word + 1], places[2 * word] + _LONGEST)].tobytes()
        if not _COUNT.fullmatch(size) or int(size) >= n_words - word:
            return None
        faces.append(word)
        sizes.append(int(size))
        after = word + 1 + int(size)
        line = bisect.bisect_left(lines, after, line)
        word = lines[line]
        more = more or word > after
    if word != n_words or len(faces) < head.faces:
        return None
    return _Layout(vertices, np.array(faces), np.array(sizes), (more, False))


def _corners(path: Path, text: Text, layout: _Layout, n_vertices: int) -> Places:
    """The vertices (c,) of all corners, one face after another."""
    chosen = mask(len(text.places), np.column_stack([layout.faces + 1, layout.faces + 1 + layout.counts]))
    corners, done = np.empty(layout.counts.sum(dtype=np.int64), layout.counts.dtype), 0
    for block in blocks(len(chosen)):
        try:
            numbers = text.integers(text.places[block][chosen[block]])
        except ValueError:
            raise MeshError(f"{path.name}: {_FACE}") from None
        check_corners(path, numbers, n_vertices)
        corners[done : done + len(numbers)] = numbers
        done += len(numbers)
    return corners


def _no_vertex(path: Path, head: _Head) -> MeshError:
    return MeshError(f"{path.name}: a vertex is not {head.least} numbers")
