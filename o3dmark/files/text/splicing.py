"""Other words in the place of some words of a text, and every other byte as it is."""

import re
from typing import TypeAlias

import numpy as np

from o3dmark.arrays import Bools, Floats, Ints
from o3dmark.files.asset import Part
from o3dmark.files.text.notation import EXACT, Notation, extent_of
from o3dmark.files.text.words import Bytes, Places, Text, blocks, mask, only
from o3dmark.mesh import geometry

Edit: TypeAlias = tuple[Places, bytes]
"""Places (k, 2) of words, and a text of k words that are to stand there."""

_PIECE = 1 << 20  # bytes that are edited together: little memory, which stays in the processor's cache
_SPACE = re.compile(rb"[\x00- ]")
_TURNED = 1e-12  # of a normal: what turning it by nothing may cost


def moved_rows(content: bytes, places: Places, part: Part, after: Floats) -> Edit:
    """The vertices of a part, which stand at places (n, 3, 2), written again where they move to ``after`` (n, 3).

    A vertex that moves to just where another stays gets all its digits: rounded, it would not be there.
    """
    before = part.vertices
    moves = ~((before == after) | (np.isnan(before) & np.isnan(after))).all(axis=1)
    notation = Notation.of(_text_of(content, places), _extent(part))
    return _edit(places, after, moves, notation, _meet(after, moves))


def turned_rows(content: bytes, places: Places, before: Floats, after: Floats) -> Edit:
    """Normals (k, 3) written again at their places (k, 3, 2), where their own digits can tell the difference."""
    notation = Notation.of(_text_of(content, places), 0.0)
    least = np.maximum(
        _TURNED * np.abs(before).max(axis=1), 0.0 if notation.kind == "g" else 0.5 * 10.0**-notation.decimals
    )
    with np.errstate(invalid="ignore"):
        turns = np.abs(after - before).max(axis=1) > least  # never where they are not numbers
    return _edit(places, after, turns, notation, np.zeros(len(after), bool))


def spliced(content: bytes, *edits: Edit) -> bytes:
    """A text after some edits, no two of which have a place in common."""
    pieces, done = [], 0
    words = [(places, np.frombuffer(new, np.uint8), Text(new).places) for places, new in edits if len(places)]
    while done < len(content):
        space = _SPACE.search(content, done + _PIECE)
        start, done = done, space.start() if space else len(content)
        here = []
        for places, new, of_new in words:
            first, last = np.searchsorted(places[:, 0], [start, done])
            here.append((places[first:last] - start, new, of_new[first:last]))
        pieces.append(_piece(np.frombuffer(content, np.uint8)[start:done], here))
    return b"".join(pieces)


def _piece(content: Bytes, edits: list[tuple[Places, Bytes, Places]]) -> bytes:
    """A text with words (k,) of others, given by those and their places there (k, 2), at places (k, 2) of its own."""
    growths = [_growth(old, new) for old, _, new in edits]
    result = np.empty(len(content) + sum(growth[-1] for growth in growths), np.uint8)
    kept, gone = np.ones(len(result), bool), np.zeros(len(content), bool)
    for old, text, new in edits:
        if not len(old):
            continue
        start = old[:, 0] + sum(
            growth[np.searchsorted(other[:, 0], old[:, 0])]
            for (other, _, _), growth in zip(edits, growths, strict=True)
        )
        here = mask(len(result), np.column_stack([start, start + new[:, 1] - new[:, 0]]))
        result[here] = text[new[0, 0] : new[-1, 1]][mask(new[-1, 1] - new[0, 0], new - new[0, 0])]
        kept &= ~here
        gone |= mask(len(content), old)
    result[kept] = content[~gone]
    return result.tobytes()


def _growth(old: Places, new: Places) -> Ints:
    """By how much a text has grown before each of some words (k + 1,), and after the last, when others replace them."""
    return np.append(0, np.cumsum((new[:, 1] - new[:, 0]) - (old[:, 1] - old[:, 0]), dtype=np.int64))


def _edit(places: Places, values: Floats, chosen: Bools, notation: Notation, exact: Bools) -> Edit:
    """Those rows of values (n, 3) that are chosen, written at their places (n, 3, 2); ``exact``: with all digits."""
    lines = []
    for block in blocks(len(values)):
        rows = np.flatnonzero(chosen[block]) + block.start
        written = notation.rows(values[rows])
        for row in np.flatnonzero(exact[rows]):
            written[row : row + 1] = EXACT.rows(values[rows[row], None])
        lines.append(b"\n".join(written))
    return places[chosen].reshape(-1, 2), b"\n".join(lines)


def _meet(positions: Floats, moves: Bools) -> Bools:
    """True (n,) for vertices that move to just where another stays."""
    if moves.all() or not moves.any():
        return np.zeros(len(moves), bool)
    place = geometry.weld(positions)[1]
    return moves & np.isin(place, place[~moves])


def _text_of(content: bytes, places: Places) -> bytes:
    return only(np.frombuffer(content, np.uint8), places)


def _extent(part: Part) -> float:
    """Of the vertices that triangles use."""
    return extent_of(part.vertices[geometry.used_vertices(part.triangles)])
