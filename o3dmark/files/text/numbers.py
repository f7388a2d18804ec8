"""Numbers among the words of a text: where they stand, and the edit that writes others in their place."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from o3dmark.arrays import Floats, Ints
from o3dmark.files._changes import differs
from o3dmark.files.text.notation import EXACT, Notation
from o3dmark.files.text.splicing import Edit
from o3dmark.files.text.words import Places, only

_IS_GAP = np.isin(np.arange(256), list(b" \t\n\v\f\r"))
_MOST_DECIMALS = 16  # before an exponent: enough for every float64
_BLOCK = 1 << 17  # bytes or words that are looked at together: they stay in a processor's cache, and take little room


def words(text: bytes) -> Places:
    """Where words begin and end (n, 2)."""
    data, edges, before = np.frombuffer(text, np.uint8), [np.empty(0, np.int64)], True
    for first in range(0, len(data), _BLOCK):
        gap = _IS_GAP[data[first : first + _BLOCK]]
        edges.append(np.flatnonzero(np.diff(gap, prepend=before)) + first)
        before = bool(gap[-1])
    edges.append(np.full(int(not before), len(data)))
    places: Places = np.empty(sum(map(len, edges)), np.int32 if len(data) < 1 << 31 else np.int64)
    np.concatenate(edges, out=places, casting="same_kind")
    return places.reshape(-1, 2)


def equal(text: bytes, places: Places, word: bytes) -> Ints:
    """Which words (n, 2) are ``word``, which is written in small letters, in whatever case (k,)."""
    found = np.flatnonzero(places[:, 1] - places[:, 0] == len(word))
    letters = np.frombuffer(text, np.uint8)
    for place, letter in enumerate(word):
        found = found[letters[places[found, 0] + place] | 0x20 == letter]
    return found


@dataclass(frozen=True, eq=False)
class Numbers:
    """Numbers in a text: the places (k, 2) of their words, ascending, and what they say (k,)."""

    text: bytes
    places: Places
    values: Floats

    @cached_property
    def _shown(self) -> bytes:
        return only(np.frombuffer(self.text, np.uint8), self.places)

    def notation(self, extent: float) -> Notation:
        """How to write positions about as large as these, of a diagonal ``extent``: with exponents if all have one."""
        plain = Notation.of(self._shown, extent)
        if plain.kind != "f" or self._exponents < len(self.values):
            return plain
        greatest = float(np.abs(self.values[np.isfinite(self.values)]).max(initial=0.0)) or 1.0
        needed = Notation.of(b"", extent).decimals + math.ceil(math.log10(greatest))
        return Notation(min(max(Notation.of(self._shown, 0.0).decimals, needed), _MOST_DECIMALS), "e")

    def edit(self, values: Floats, notation: Notation) -> Edit:
        """The words that do not say ``values`` (k,), and those that do.

        Among words with exponents one may say more than the notation does: what stands there gets all its digits.
        """
        changed = differs(values, self.values)
        new, pieces = values[changed], []
        finer = np.isin(new, self.values) if self._exponents else np.zeros(len(new), bool)
        for first in range(0, len(new), _BLOCK):
            chunk, exact = new[first : first + _BLOCK, None], np.flatnonzero(finer[first : first + _BLOCK])
            rows = notation.rows(chunk)
            for row, word in zip(exact.tolist(), EXACT.rows(chunk[exact]), strict=True):
                rows[row] = word
            pieces += [b"\n".join(rows)]
        return self.places[changed], b"\n".join(pieces)

    @cached_property
    def _exponents(self) -> int:
        return self._shown.count(b"e") + self._shown.count(b"E")
