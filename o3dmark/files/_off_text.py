"""An OFF file as arrays: vertices, their normals and colours, and faces, and where in the file they stand."""

import bisect
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from o3dmark.arrays import Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.files._parsing import check_corners, check_size, fewer, ranges
from o3dmark.files._text import Text

_HEAD = re.compile(  # a third count, of the edges, may follow on the line of the second
    rb"\s*(?P<letters>(?:ST|C|N|4)*)(?P<off>OFF)"
    rb"(?:\s+(?P<binary>BINARY)\b|\s*(?P<vertices>\d{1,18})\s+(?P<faces>\d{1,18})(?:[ \t]+\d+)?(?!\S))",
    re.I,
)
_FACE = "a face is not a number of corners and as many vertices"


@dataclass(frozen=True, eq=False)
class OffText:
    """places (n, 3, 2) of the coordinates, and positions (n, 3); those of normals, and colours (n, 3), if it has any.

    counts (f,): how many corners each face has; corners (c,): the vertices of all. kinds: what else is in it.
    """

    places: Ints
    positions: Floats
    normal_places: Ints
    normals: Floats | None
    colours: Floats | None
    counts: Ints
    corners: Ints
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

    vertices: Ints
    faces: Ints
    counts: Ints
    more: tuple[bool, bool]


def parsed(path: Path, content: bytes) -> OffText:
    """The content of an OFF file. Errors: MeshError for another kind of file, or a damaged one."""
    text = Text(content)
    head = _head(path, text)
    check_size(path, 6 * head.vertices + 2 * head.faces, len(content))
    layout = _layout(path, text, head)
    corner_places = text.places[ranges(layout.faces + 1, layout.counts)]
    places = [text.places[layout.vertices[:, None] + np.arange(first, first + 3)] for first in range(0, head.least, 3)]
    try:
        columns = [text.floats(place) for place in places]
    except ValueError:
        raise _no_vertex(path, head) from None
    try:
        corners = text.integers(corner_places)
    except ValueError:
        raise MeshError(f"{path.name}: {_FACE}") from None
    check_corners(path, corners, head.vertices)
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
    found = _HEAD.match(text.bytes)
    if found is None:
        raise MeshError(f"{path.name} does not begin like an OFF file")
    letters = found["letters"]
    if b"4" in letters or (letters.endswith(b"n") and found["off"] == b"OFF"):  # "noff" has normals
        kind = (letters + found["off"]).decode()
        raise MeshError(f"{path.name} is a {kind} file, of more than three dimensions; only those of three can be used")
    if found["binary"]:
        raise MeshError(f"{path.name} is a binary OFF file; save it as text, or in another format")
    word = int(np.searchsorted(text.places[:, 0], found.end()))
    return _Head(letters.decode().upper(), int(found["vertices"]), int(found["faces"]), word)


def _layout(path: Path, text: Text, head: _Head) -> _Layout:
    """A vertex a line, and a face; or else as Geomview reads: only what follows a face ends with the line."""
    first = np.union1d(head.word, text.first[text.first > head.word])
    count = np.diff(first, append=len(text.places))
    if len(first) > 1 and count[0] == 1 and count[1] >= 3:  # the number of edges, on a line of its own
        first, count = first[1:], count[1:]
    try:
        return _by_lines(path, text, head, first, count)
    except MeshError:
        layout = _by_words(text, head, first.tolist())
        if layout is None:
            raise
        return layout


def _by_lines(path: Path, text: Text, head: _Head, first: Ints, count: Ints) -> _Layout:
    n, m = head.vertices, head.faces
    if len(first) < n + m:
        raise fewer(path, (n, m), (min(len(first), n), max(len(first) - n, 0)))
    if n and count[:n].min() < head.least:
        raise _no_vertex(path, head)
    faces = first[n : n + m]
    try:
        sizes = text.integers(text.places[faces])
    except ValueError:
        raise MeshError(f"{path.name}: {_FACE}") from None
    further = count[n : n + m] - 1 - sizes
    if ((sizes < 0) | (further < 0)).any():
        raise MeshError(f"{path.name}: {_FACE}")
    return _Layout(first[:n], faces, sizes, ((further > 0).any(), (count[:n] > head.width).any()))


def _by_words(text: Text, head: _Head, first: list[int]) -> _Layout | None:
    """None where the vertices do not end with a line, or the faces with the file: then something is missing."""
    content, n_words = text.bytes.tobytes(), len(text.places)
    word = first[0] + head.vertices * head.width
    vertices = np.arange(first[0], word, head.width)
    first.append(n_words)
    if word > n_words or first[bisect.bisect_left(first, word)] != word:
        return None
    faces, sizes, more = [], [], False
    while len(faces) < head.faces:
        start, end = text.places[word] if word < n_words else (0, 0)
        size = content[start:end]
        if not size.isdigit() or int(size[:18]) >= n_words - word:
            return None
        faces.append(word)
        sizes.append(int(size))
        after = word + sizes[-1] + 1
        word = first[bisect.bisect_left(first, after)]
        more = more or word > after
    return _Layout(vertices, np.array(faces), np.array(sizes), (more, False)) if word == n_words else None


def _no_vertex(path: Path, head: _Head) -> MeshError:
    return MeshError(f"{path.name}: a vertex is not {head.least} numbers")
