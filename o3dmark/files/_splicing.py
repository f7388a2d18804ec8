"""Other words in the place of some words of a text, and every other byte as it is."""

from typing import TypeAlias

import numpy as np

from o3dmark.arrays import Bools, Floats, Ints
from o3dmark.files._text import EXACT, Notation
from o3dmark.files._words import Places, Text, blocks, mask, only
from o3dmark.files.asset import Part
from o3dmark.mesh import geometry

Edit: TypeAlias = tuple[Places, bytes]
"""Places (k, 2) of words, and a text of k words that are to stand there."""

_TURNED = 1e-12  # of a normal: what turning it by nothing may cost


def moved_rows(content: bytes, places: Places, part: Part, after: Floats) -> Edit:
    """The vertices of a part, which stand at places (n, 3, 2), written again where they move to ``after`` (n, 3).

    A vertex that moves to just where another stays gets all its digits: rounded, it would not be there.
    """
    before = part.vertices
    moves = ~((before == after) | (np.isnan(before) & np.isnan(after))).all(axis=1)
    notation = Notation.of(_text_of(content, places), _diagonal(part))
    return _edit(places, after, moves, notation, _meet(after, moves))


def turned_rows(content: bytes, places: Places, before: Floats, after: Floats) -> Edit:
    """Normals (k, 3) written again at their places (k, 3, 2), where their own digits can tell the difference."""
    notation = Notation.of(_text_of(content, places), 0.0)
    least = np.maximum(_TURNED * np.abs(before).max(axis=1), 0.0 if notation.exact else 0.5 * 10.0**-notation.decimals)
    turns = np.abs(after - before).max(axis=1) > least  # never where they are not numbers
    return _edit(places, after, turns, notation, np.zeros(len(after), bool))


def spliced(content: bytes, *edits: Edit) -> bytes:
    """A text after some edits, no two of which have a place in common."""
    edits = tuple(edit for edit in edits if len(edit[0]))
    words = [Text(new) for _, new in edits]
    growths = [_growth(places, text.places) for (places, _), text in zip(edits, words, strict=True)]
    result = np.empty(len(content) + sum(growth[-1] for growth in growths), np.uint8)
    kept = np.ones(len(result), bool)
    old = np.zeros(len(content), bool)
    for (places, _), text in zip(edits, words, strict=True):
        shifts = [
            grown[np.searchsorted(other[:, 0], places[:, 0])] for (other, _), grown in zip(edits, growths, strict=True)
        ]
        start = places[:, 0] + sum(shifts)
        new = mask(len(result), np.column_stack([start, start + text.places[:, 1] - text.places[:, 0]]))
        result[new] = text.bytes[mask(len(text.bytes), text.places)]
        kept &= ~new
        old |= mask(len(content), places)
    result[kept] = np.frombuffer(content, np.uint8)[~old]
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


def _diagonal(part: Part) -> float:
    """Of the vertices that triangles use."""
    used = part.vertices[geometry.used_vertices(part.triangles)]
    used = used[np.isfinite(used).all(axis=1)]
    return geometry.diagonal(used) if len(used) else 0.0
