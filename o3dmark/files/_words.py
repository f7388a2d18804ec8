"""The words of a text: where they stand, and numbers in the place of some of them."""

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from o3dmark.arrays import Bools, Floats, Ints
from o3dmark.files._changes import differs
from o3dmark.files._text import Notation
from o3dmark.mesh import geometry

GAPS = b" \t\n\v\f\r"
_IS_GAP = np.isin(np.arange(256), list(GAPS))
_MOST_DIGITS = 16  # after the first: enough for every float64
_CHUNK = 1 << 16  # words that are Python objects at a time


def words(text: bytes) -> tuple[Ints, Ints]:
    """Where each word begins (n,) and ends (n,)."""
    gap = np.ones(len(text) + 2, bool)
    gap[1:-1] = _IS_GAP[np.frombuffer(text, np.uint8)]
    edges = np.flatnonzero(gap[1:] != gap[:-1])
    return edges[::2], edges[1::2]


def only(text: bytes, starts: Ints, ends: Ints) -> bytes:
    """The text with nothing but the words of these places, and blanks for all others."""
    step = np.zeros(len(text) + 1, np.int8)
    step[starts] = 1
    step[ends] -= 1
    inside = np.cumsum(step[:-1], dtype=np.int8).view(bool)
    return np.where(inside, np.frombuffer(text, np.uint8), np.uint8(32)).tobytes()


def equal(text: bytes, starts: Ints, ends: Ints, word: bytes) -> Bools:
    """Which words (n,) are ``word``, written in small letters, in whatever case."""
    found = ends - starts == len(word)
    letters = np.frombuffer(text, np.uint8)
    for place, letter in enumerate(word):  # at the end of the text the words are shorter, and found is already False
        found[found] = letters[starts[found] + place] | 0x20 == letter
    return found


def replaced(text: bytes, changes: Iterable[tuple[Ints, Ints, NDArray[np.bytes_]]]) -> bytes:
    """The text with other words (k,) where those that begin and end there (k,) stood, for each of some changes."""
    starts, ends, numerals = (np.concatenate(arrays) for arrays in zip(*changes, strict=True))
    order = np.argsort(starts)
    result, done = bytearray(), 0
    for first in range(0, len(order), _CHUNK):
        chunk = order[first : first + _CHUNK]
        begin, end = starts[chunk].tolist(), ends[chunk].tolist()
        gaps = [text[a:b] for a, b in zip([done, *end[:-1]], begin, strict=True)]
        result += b"".join(itertools.chain.from_iterable(zip(gaps, numerals[chunk].tolist(), strict=True)))
        done = end[-1]
    result += text[done:]
    return bytes(result)


@dataclass(frozen=True, eq=False)
class Numbers:
    """Numbers in a text: where their words begin (k,) and end (k,), and what they say (k,)."""

    text: bytes
    starts: Ints
    ends: Ints
    values: Floats

    def notation(self, extent: float) -> Notation:
        """How to write positions about as large as these, of a diagonal ``extent``: with exponents if all have one."""
        text = only(self.text, self.starts, self.ends)
        greatest = float(np.abs(self.values[np.isfinite(self.values)]).max(initial=0.0))
        plain = Notation.of(text, extent)
        if not greatest or plain.kind != "f" or text.lower().count(b"e") < len(self.values):
            return plain
        needed = Notation.of(b"", extent).decimals + math.ceil(math.log10(greatest))
        return Notation(min(max(Notation.of(text, 0.0).decimals, needed), _MOST_DIGITS), "e")

    def changes(self, values: Floats, notation: Notation) -> tuple[Ints, Ints, NDArray[np.bytes_]]:
        """Where words begin (m,) and end (m,) that do not say ``values`` (k,), and those (m,) that do."""
        changed = differs(values, self.values)
        return self.starts[changed], self.ends[changed], self._words(values[changed], notation)

    def _words(self, values: Floats, notation: Notation) -> NDArray[np.bytes_]:
        """Numbers (m,) as words (m,): one that the text has by its own word, for the text may be finer."""
        chunks = [notation.rows(values[first : first + _CHUNK, None]) for first in range(0, len(values), _CHUNK)]
        words = np.concatenate([np.empty(0, "S1"), *(np.array(chunk, "S") for chunk in chunks)])
        order = np.argsort(self.values)
        at = order[np.minimum(np.searchsorted(self.values, values, sorter=order), len(order) - 1)]
        known = np.flatnonzero(self.values[at] == values)
        there = [
            self.text[a:b] for a, b in zip(self.starts[at[known]].tolist(), self.ends[at[known]].tolist(), strict=True)
        ]
        longest = max(map(len, there), default=0)
        words = words.astype(f"S{max(words.itemsize, longest)}", copy=False)
        words[known] = there
        return words


def extent_of(vertices: Floats) -> float:
    """The diagonal of the box about vertices (n, 3), as far as they are finite."""
    finite = vertices[np.isfinite(vertices).all(axis=1)]
    greatest = float(np.abs(finite).max(initial=0.0)) or 1.0  # whose square may be infinite
    return geometry.diagonal(finite / greatest) * greatest if len(finite) else 0.0
