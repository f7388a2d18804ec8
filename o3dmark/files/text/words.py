"""The words and lines of a text: where they are, and what numbers they say.

Block by block: a large file takes little more memory than what comes out of it, and what is looked at together stays in
the processor's cache.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from o3dmark.arrays import AnyArray, Bools, Floats, Ints
from o3dmark.files.text.notation import parsed

Bytes: TypeAlias = NDArray[np.uint8]
Places: TypeAlias = NDArray[np.signedinteger[Any]]
"""Where words start and end in a text (..., 2), ascending; four bytes a number where these are enough."""

_SPACE, _HASH, _LF, _CR = 32, 35, 10, 13
_BOM = b"\xef\xbb\xbf"
_BLOCK = 1 << 17  # bytes, words or lines


class Text:
    """The words of a text, and its lines, which end with LF, CRLF or CR.

    bytes (s,); places (w, 2) of words; first (l + 1,): for each line that has words the number of its first, and at
    last that of all words. What follows a "#" on a line is no word, nor is a byte order mark.
    """

    def __init__(self, content: bytes) -> None:
        self.bytes = np.frombuffer(content, np.uint8)
        scan = _Scan(len(_BOM) if content.startswith(_BOM) else 0)
        edges, first = zip(*(scan.block(self.bytes, block) for block in blocks(len(content))), strict=True)
        self.places = _joined([*edges, scan.last_edge(self.bytes)], len(content)).reshape(-1, 2)
        self.first = np.append(_joined(first, len(content)), len(self.places)).astype(self.places.dtype)

    def counts(self, lines: Places) -> Places:
        """How many words each of some lines (k,) has."""
        return self.first[lines + 1] - self.first[lines]

    def lines(self, *words: bytes) -> list[Places]:
        """For each word the lines (k,) that begin with it."""
        found: list[list[Places]] = [[] for _ in words]
        for block in blocks(len(self.first) - 1):
            start, end = self.places[self.first[:-1][block]].T
            for word, lines in zip(words, found, strict=True):
                here = np.flatnonzero(end - start == len(word))
                for place, byte in enumerate(word):
                    here = here[self.bytes[start[here] + place] == byte]
                lines.append((here + block.start).astype(self.first.dtype))
        return [_joined(lines, len(self.bytes)) for lines in found]

    def columns(self, lines: Places, first: int) -> Places:
        """The places of three words of each line (k, 3, 2), from that numbered ``first`` on; empty beyond its end."""
        places = np.empty((len(lines), 3, 2), self.places.dtype)
        columns = np.arange(first, first + 3)
        for block in blocks(len(lines)):
            count = self.counts(lines[block])[:, None]
            words = self.places[self.first[lines[block], None] + np.minimum(columns, count - 1)]
            places[block] = np.where((columns < count)[..., None], words, words[..., 1:])
        return places

    def floats(self, places: Places) -> Floats:
        """What stands at places (..., 2). Errors: ValueError where that is no number."""
        return self._numbers(places, np.float64)

    def integers(self, places: Places) -> Ints:
        """As `floats`; what needs more than 64 bits becomes the largest that they hold."""
        return self._numbers(places, np.int64)

    def _numbers(self, places: Places, dtype: type[np.generic]) -> AnyArray:
        words = places.reshape(-1, 2)
        values = np.empty(len(words), dtype)
        for block in blocks(len(words)):
            numbers = parsed(only(self.bytes, words[block]), dtype)
            if len(numbers) != len(words[block]):  # as where "1-2" is taken for two
                raise ValueError
            values[block] = numbers
        return values.reshape(places.shape[:-1])


class _Scan:
    """A text looked through from its start, a block after the other; ``head``: bytes at its start that are no words."""

    def __init__(self, head: int) -> None:
        self._head = head
        self._solid = self._comment = False  # of the byte before the block
        self._fresh = True  # whether its line has no word yet
        self._n_words = 0

    def block(self, text: Bytes, block: slice) -> tuple[Places, Places]:
        """Where words start and end in a block of a text, and the numbers of those that are the first of their line."""
        here = text[block]
        solid, ends = here > _SPACE, (here == _LF) | (here == _CR)
        solid[: max(self._head - block.start, 0)] = False
        self._leave_comments(solid, ends, here == _HASH)
        edges = np.flatnonzero(np.diff(solid, prepend=self._solid))
        starts, line_ends = edges[int(self._solid) :: 2], np.flatnonzero(ends)
        line = np.searchsorted(line_ends, starts)  # within the block; the first of them may have begun before it
        first = self._n_words + np.flatnonzero(np.diff(line, prepend=-1 if self._fresh else 0))
        self._solid = bool(solid[-1])
        self._fresh = line[-1] < len(line_ends) if len(line) else self._fresh or len(line_ends) > 0
        self._n_words += len(starts)
        dtype = _place_type(len(text))
        return (edges + block.start).astype(dtype), first.astype(dtype)

    def last_edge(self, text: Bytes) -> Places:
        """The end of a word that ends with the text, if one does."""
        return np.full(int(self._solid), len(text), _place_type(len(text)))

    def _leave_comments(self, solid: Bools, ends: Bools, hashes: Bools) -> None:
        if not self._comment and not hashes.any():
            return
        events = np.where(ends | hashes, np.arange(len(ends)), -1)
        last = np.maximum.accumulate(events)
        comment = np.where(last >= 0, hashes[last], self._comment)
        solid &= ~comment
        self._comment = bool(comment[-1])


def blocks(size: int) -> Iterator[slice]:
    """Slices that make up a sequence, each of the size that is looked at together."""
    return (slice(start, min(start + _BLOCK, size)) for start in range(0, size, _BLOCK))


def where(text: Bytes, condition: Callable[[Bytes], Bools]) -> Places:
    """Where in a text (s,) a condition on its bytes holds (k,)."""
    return _joined([np.flatnonzero(condition(text[block])) + block.start for block in blocks(len(text))], len(text))


def only(text: Bytes, places: Places) -> bytes:
    """A text with blanks for all but places (..., 2), from the start of the first of these to the end of the last."""
    words = places.reshape(-1, 2)
    words = words[words[:, 0] < words[:, 1]]
    if not len(words):
        return b""
    start, end = words[0, 0], words[-1, 1]
    return np.where(mask(end - start, words - start), text[start:end], np.uint8(_SPACE)).tobytes()


def mask(size: int, places: Places) -> Bools:
    """True (size,) within places (k, 2), no two of which overlap."""
    edges = np.zeros(size + 1, np.int8)
    edges[places[:, 0]] += 1
    edges[places[:, 1]] -= 1
    return np.cumsum(edges[:-1], dtype=np.int8).view(bool)


def _joined(parts: Iterable[AnyArray], size: int) -> Places:
    """Parts as one array, of the type that is enough for places in a text of this size."""
    return np.concatenate([np.empty(0, _place_type(size)), *parts])


def _place_type(size: int) -> type[np.signedinteger[Any]]:
    return np.int32 if size < 1 << 31 else np.int64
