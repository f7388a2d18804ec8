"""Text as numbers: where its words and lines are, what the words say, and other words in their place."""

import math
import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from o3dmark.arrays import AnyArray, Bools, Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.files.asset import Part
from o3dmark.mesh import geometry

Bytes: TypeAlias = NDArray[np.uint8]
Edit: TypeAlias = tuple[Ints, bytes]
"""Places (k, 2), ascending, and a text of k words that are to stand there."""

_FINEST = 1e-8  # of the diagonal: like float32's own steps at the rim of a mesh about the origin
_LONGEST = 15  # decimals; numbers that need more are written with all digits that they have
_TURNED = 1e-12  # of a normal: what turning it by nothing may cost
_SPACE, _HASH, _LF, _CR = 32, 35, 10, 13
_BOM = b"\xef\xbb\xbf"


class Text:
    """The words of a text, and its lines; what follows a "#" on a line is no word, nor is a byte order mark.

    content: the text, and bytes (s,): the same without comments.
    spans (w, 2): where each word starts and ends, in bytes. For each line that has words: ``first`` (l,), the number of
    its first, and ``count`` (l,), how many they are. Lines end with LF, CRLF or CR.
    """

    def __init__(self, content: bytes) -> None:
        self.content = content = b"   " + content[len(_BOM) :] if content.startswith(_BOM) else content
        text = np.frombuffer(content, np.uint8)
        ends = np.flatnonzero((text == _LF) | (text == _CR) if b"\r" in content else text == _LF)
        self.bytes = _without_comments(text, ends) if b"#" in content else text
        self.spans = _spans(self.bytes)
        first = np.searchsorted(self.spans[:, 0], np.append(0, ends))
        count = np.diff(first, append=len(self.spans))
        self.first, self.count = first[count > 0], count[count > 0]

    def lines(self, word: bytes) -> Ints:
        """The lines (k,) that begin with a word."""
        start, end = self.spans[self.first].T
        lines = np.flatnonzero(end - start == len(word))
        for place, byte in enumerate(word):
            lines = lines[self.bytes[start[lines] + place] == byte]
        return lines

    def floats(self, spans: Ints) -> Floats:
        """What each of spans (..., 2), ascending, says. Errors: ValueError where it is no number."""
        return _numbers(only(self.bytes, spans), np.float64, spans.shape[:-1])

    def integers(self, spans: Ints) -> Ints:
        """As `floats`; what needs more than 64 bits becomes the largest that they hold."""
        return _numbers(only(self.bytes, spans), np.int64, spans.shape[:-1])


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


def only(text: Bytes, spans: Ints) -> bytes:
    """A text with blanks for all but spans (..., 2), ascending; without what is before the first and after the last."""
    spans = spans.reshape(-1, 2)
    spans = spans[spans[:, 0] < spans[:, 1]]
    if not len(spans):
        return b""
    start, end = spans[0, 0], spans[-1, 1]
    return np.where(_mask(end - start, spans - start), text[start:end], np.uint8(_SPACE)).tobytes()


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
    """How numbers are written: with so many decimals or, if ``exact``, with all digits that tell them apart."""

    decimals: int
    exact: bool = False

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
        number = "%.17g" if self.exact else f"%.{self.decimals}f"
        line = " ".join([number] * values.shape[1]) + "\n"
        return ((line * len(values)) % tuple(values.ravel().tolist())).encode("ascii").splitlines()


EXACT = Notation(17, exact=True)


def moved_rows(content: bytes, places: Ints, part: Part, after: Floats) -> Edit:
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


def turned_rows(content: bytes, places: Ints, before: Floats, after: Floats) -> Edit:
    """Normals (k, 3) written again at their places (k, 3, 2), where their own digits can tell the difference."""
    notation = Notation.of(only(np.frombuffer(content, np.uint8), places), 0.0)
    least = np.maximum(_TURNED * np.abs(before).max(axis=1), 0.0 if notation.exact else 0.5 * 10.0**-notation.decimals)
    turns = np.abs(after - before).max(axis=1) > least  # never where they are not numbers
    return places[turns].reshape(-1, 2), b"\n".join(notation.rows(after[turns]))


def _diagonal(part: Part) -> float:
    """Of the vertices that triangles use."""
    used = part.vertices[geometry.used_vertices(part.triangles)]
    used = used[np.isfinite(used).all(axis=1)]
    return geometry.diagonal(used) if len(used) else 0.0


def _without_comments(text: Bytes, ends: Ints) -> Bytes:
    """A copy with blanks from the first "#" of each line to its end; ``ends``: where lines end."""
    start = np.flatnonzero(text == _HASH)
    line, first = np.unique(np.searchsorted(ends, start), return_index=True)
    spans = np.column_stack([start[first], np.append(ends, len(text))[line]])
    return np.where(_mask(len(text), spans), np.uint8(_SPACE), text)


def _spans(text: Bytes) -> Ints:
    """Where words (w, 2) start and end: whatever is above a space."""
    solid = np.zeros(len(text) + 2, bool)
    np.greater(text, _SPACE, out=solid[1:-1])
    return np.flatnonzero(solid[1:] != solid[:-1]).reshape(-1, 2)


def _lengths(text: Bytes) -> Ints:
    spans = _spans(text)
    return spans[:, 1] - spans[:, 0]


def _mask(size: int, spans: Ints) -> Bools:
    """True (size,) within spans (..., 2), no two of which overlap."""
    edges = np.zeros(size + 1, np.int8)
    start, end = spans.reshape(-1, 2).T
    edges[start] += 1
    edges[end] -= 1
    return np.cumsum(edges[:-1], dtype=np.int8).view(bool)


def _numbers(text: bytes, dtype: type[np.generic], shape: tuple[int, ...]) -> AnyArray:
    values = _parsed(text, dtype)
    if len(values) != math.prod(shape):  # as where "1-2" is taken for two
        raise ValueError
    return values.reshape(shape)


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
