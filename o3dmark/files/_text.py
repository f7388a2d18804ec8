"""Text as numbers: where its words and lines are, what the words say, and other words in their place."""

import math
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from o3dmark.arrays import AnyArray, Bools, Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.files.asset import Part
from o3dmark.mesh import geometry

Bytes: TypeAlias = NDArray[np.uint8]
Places: TypeAlias = NDArray[np.signedinteger]
"""Where words start and end in a text (..., 2); four bytes a number where these are enough."""

Edit: TypeAlias = tuple[Places, bytes]
"""Places (k, 2), ascending, and a text of k words that are to stand there."""

_FINEST = 1e-8  # of the diagonal: like float32's own steps at the rim of a mesh about the origin
_LONGEST = 15  # decimals; numbers that need more are written with all digits that they have
_TURNED = 1e-12  # of a normal: what turning it by nothing may cost
_SPACE, _HASH, _LF, _CR = 32, 35, 10, 13
_BOM = b"\xef\xbb\xbf"
_BLOCK = 1 << 17  # bytes, or words, that are looked at together, so that they stay in a processor's cache


class Text:
    """The words of a text, and its lines; what follows a "#" on a line is no word, nor is a byte order mark.

    content: the text, and bytes (s,): the same without comments. places (w, 2) of words. For each line that has words:
    ``first`` (l,), the number of its first, and ``count`` (l,), how many they are. Lines end with LF, CRLF or CR.
    """

    def __init__(self, content: bytes) -> None:
        self.content = content = b"   " + content[len(_BOM) :] if content.startswith(_BOM) else content
        text = np.frombuffer(content, np.uint8)
        ends = where(text, lambda block: (block == _LF) | (block == _CR))
        self.bytes = _without_comments(text, ends) if b"#" in content else text
        self.places = _words(self.bytes)
        first = np.append(0, np.searchsorted(self.places[:, 0], ends))
        count = np.diff(first, append=len(self.places))
        self.first, self.count = first[count > 0], count[count > 0]
        self._starts, ends = self.places[self.first].T
        self._lengths = ends - self._starts  # of the words that lines begin with

    def lines(self, word: bytes) -> Ints:
        """The lines (k,) that begin with a word."""
        lines = np.flatnonzero(self._lengths == len(word))
        for place, byte in enumerate(word):
            lines = lines[self.bytes[self._starts[lines] + place] == byte]
        return lines

    def floats(self, places: Places) -> Floats:
        """What stands at places (..., 2), ascending. Errors: ValueError where that is no number."""
        return self._numbers(places, np.float64)

    def integers(self, places: Places) -> Ints:
        """As `floats`; what needs more than 64 bits becomes the largest that they hold."""
        return self._numbers(places, np.int64)

    def _numbers(self, places: Places, dtype: type[np.generic]) -> AnyArray:
        words = places.reshape(-1, 2)
        values = np.empty(len(words), dtype)
        for start in range(0, len(words), _BLOCK):
            block = slice(start, start + _BLOCK)
            numbers = _parsed(only(self.bytes, words[block]), dtype)
            if len(numbers) != len(words[block]):  # as where "1-2" is taken for two
                raise ValueError
            values[block] = numbers
        return values.reshape(places.shape[:-1])


def floats(path: Path, text: bytes, what: str, width: int = 3) -> Floats:
    """All numbers of a text, in rows of ``width`` (n, width), each the float64 next to what is written.

    Errors: MeshError, which calls the numbers ``what``, where other words stand or a row is not whole.
    """
    try:
        values = _parsed(text, np.float64)
    except ValueError:
        raise MeshError(f"{path.name}: {what} are not all numbers") from None
    if len(values) % width:
        raise MeshError(f"{path.name}: {what} are not {width} numbers each")
    return values.reshape(-1, width)


def where(text: Bytes, condition: Callable[[Bytes], Bools]) -> Places:
    """Where in a text (s,) a condition on its bytes holds (k,)."""
    blocks = [np.flatnonzero(condition(text[at : at + _BLOCK])) + at for at in range(0, len(text), _BLOCK)]
    return _places(blocks, len(text))


def only(text: Bytes, places: Places) -> bytes:
    """A text with blanks for all but places (..., 2), ascending; from the start of the first to the end of the last."""
    words = places.reshape(-1, 2)
    words = words[words[:, 0] < words[:, 1]]
    if not len(words):
        return b""
    start, end = words[0, 0], words[-1, 1]
    return np.where(_mask(end - start, words - start), text[start:end], np.uint8(_SPACE)).tobytes()


def spliced(content: bytes, *edits: Edit) -> bytes:
    """A text with other words at some places, and every other byte as it is."""
    words = [np.frombuffer(new, np.uint8) for _, new in edits]
    old, lengths = np.concatenate([places for places, _ in edits]), np.concatenate([_lengths(new) for new in words])
    growth = lengths - (old[:, 1] - old[:, 0])
    order, shift = np.argsort(old[:, 0]), np.empty(len(old), np.int64)
    shift[order] = np.cumsum(growth[order]) - growth[order]
    start = old[:, 0] + shift
    result = np.empty(len(content) + growth.sum(), np.uint8)
    rest, done = np.ones(len(result), bool), 0
    for (places, _), new in zip(edits, words, strict=True):
        here = slice(done, done := done + len(places))
        mask = _mask(len(result), np.column_stack([start[here], start[here] + lengths[here]]))
        result[mask] = new[new > _SPACE]
        rest &= ~mask
    result[rest] = np.frombuffer(content, np.uint8)[~_mask(len(content), old)]
    return result.tobytes()


@dataclass(frozen=True)
class Notation:
    """How numbers are written: decimals, decimals before an exponent, or digits in all."""

    decimals: int
    kind: Literal["f", "e", "g"] = "f"

    @classmethod
    def of(cls, text: bytes, diagonal: float) -> "Notation":
        """The one that keeps the longest fraction in ``text`` and tells apart what lies 1e-8 of the diagonal apart."""
        decimals = 0
        while decimals <= _LONGEST and re.search(rb"\.\d{%d}" % (decimals + 1), text):
            decimals += 1
        if 0.0 < diagonal < math.inf:
            decimals = max(decimals, math.ceil(-math.log10(_FINEST) - math.log10(diagonal)))
        return cls(decimals) if decimals <= _LONGEST else EXACT

    def rows(self, values: Floats) -> list[bytes]:
        """Numbers (n, d) as n lines without their ends, a space between two."""
        if not len(values):
            return []
        number = f"%.{self.decimals}{self.kind}"
        line = " ".join([number] * values.shape[1]) + "\n"
        return ((line * len(values)) % tuple(values.ravel().tolist())).encode("ascii").splitlines()


EXACT = Notation(17, "g")


def moved_rows(content: bytes, places: Places, part: Part, after: Floats) -> Edit:
    """The vertices of a part, which stand at places (n, 3, 2), written again where they move to ``after`` (n, 3).

    A vertex that moves to just where another stays gets all its digits: rounded, it would not be there.
    """
    before = part.vertices
    moves = ~((before == after) | (np.isnan(before) & np.isnan(after))).all(axis=1)
    rows = Notation.of(only(np.frombuffer(content, np.uint8), places), _diagonal(part)).rows(after[moves])
    if not moves.all():
        place = geometry.weld(after)[1]
        for row in np.flatnonzero(np.isin(place[moves], place[~moves])):
            rows[row] = EXACT.rows(after[moves][row : row + 1])[0]
    return places[moves].reshape(-1, 2), b"\n".join(rows)


def turned_rows(content: bytes, places: Places, before: Floats, after: Floats) -> Edit:
    """Normals (k, 3) written again at their places (k, 3, 2), where their own digits can tell the difference."""
    notation = Notation.of(only(np.frombuffer(content, np.uint8), places), 0.0)
    least = np.maximum(
        _TURNED * np.abs(before).max(axis=1), 0.0 if notation.kind == "g" else 0.5 * 10.0**-notation.decimals
    )
    turns = np.abs(after - before).max(axis=1) > least  # never where they are not numbers
    return places[turns].reshape(-1, 2), b"\n".join(notation.rows(after[turns]))


def _diagonal(part: Part) -> float:
    """Of the vertices that triangles use."""
    used = part.vertices[geometry.used_vertices(part.triangles)]
    used = used[np.isfinite(used).all(axis=1)]
    return geometry.diagonal(used) if len(used) else 0.0


def _without_comments(text: Bytes, ends: Places) -> Bytes:
    """A copy with blanks from the first "#" of each line to its end; ``ends``: where lines end."""
    start = where(text, lambda block: block == _HASH)
    line, first = np.unique(np.searchsorted(ends, start), return_index=True)
    comments = np.column_stack([start[first], np.append(ends, len(text))[line]])
    return np.where(_mask(len(text), comments), np.uint8(_SPACE), text)


def _words(text: Bytes) -> Places:
    """Where words (w, 2) start and end: whatever is above a space."""
    edges, before = [], np.False_
    for at in range(0, len(text), _BLOCK):
        solid = text[at : at + _BLOCK] > _SPACE
        edges.append(np.flatnonzero(np.diff(solid, prepend=before)) + at)
        before = solid[-1]
    return _places([*edges, np.full(int(before), len(text))], len(text)).reshape(-1, 2)


def _places(blocks: list[Ints], size: int) -> Places:
    dtype = np.int32 if size < 1 << 31 else np.int64
    return np.concatenate([np.empty(0, dtype), *(block.astype(dtype) for block in blocks)])


def _lengths(text: Bytes) -> Ints:
    places = _words(text)
    return places[:, 1] - places[:, 0]


def _mask(size: int, places: Places) -> Bools:
    """True (size,) within places (k, 2), no two of which overlap."""
    edges = np.zeros(size + 1, np.int8)
    edges[places[:, 0]] += 1
    edges[places[:, 1]] -= 1
    return np.cumsum(edges[:-1], dtype=np.int8).view(bool)


def _parsed(text: bytes, dtype: type[np.generic]) -> AnyArray:
    """All numbers of a text. Errors: ValueError for other words."""
    if not text.strip():
        return np.empty(0, dtype)
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # numpy's way, once, to say that it stopped before the end
        try:
            return np.fromstring(text, dtype, sep=" ")
        except DeprecationWarning:
            raise ValueError from None
