"""STL as text: solids, with or without names, and what stands between "facet" and "endfacet"."""

import re
from pathlib import Path

import numpy as np

from o3dmark.arrays import Bools, Floats
from o3dmark.errors import MeshError
from o3dmark.files.text.notation import extent_of, floats
from o3dmark.files.text.numbers import Numbers, equal, words
from o3dmark.files.text.splicing import spliced
from o3dmark.files.text.words import Places, only, where

_BOM = b"\xef\xbb\xbf"
_IS_SOLID = re.compile(rb"(?:%b)?\s*solid(?!\S)" % _BOM, re.I)


class TextFacets:
    """The facets of all solids of a text: their ``normals`` (m, 3) and ``corners`` (3 m, 3).

    ``contents``: whether solids have names, and whether there are several.
    """

    steps = np.zeros(3)

    def __init__(self, path: Path, content: bytes) -> None:
        text = content if not content.startswith(_BOM) else b"   " + content[len(_BOM) :]
        places = words(text)
        solids, named, on_their_lines = _solids(text, places)
        self.contents = frozenset(["names"] * named + ["several meshes"] * (solids > 1))
        places = _numbers(path.name, text, places[~on_their_lines])
        shown = only(np.frombuffer(text, np.uint8), places)
        values = floats(path, _with_nan(shown, places - places[:1, :1, :1]), "normals and vertices", width=12)
        self._content = content
        self._normals, self._corners = (
            Numbers(content, places[:, side].reshape(-1, 2), values[:, side].ravel())
            for side in (slice(0, 3), slice(3, 12))
        )
        self.normals, self.corners = (side.values.reshape(-1, 3) for side in (self._normals, self._corners))

    @staticmethod
    def rounded(values: Floats) -> Floats:
        """The numbers next to ``values`` that can stand in the file: they themselves."""
        return values

    def written(self, normals: Floats, corners: Floats) -> bytes:
        """The text with other numbers; where they are equal to its own, with these, to the last character."""
        extent = extent_of(self.corners) or extent_of(corners)
        return spliced(
            self._content,
            self._normals.edit(normals.ravel(), self._normals.notation(1.0)),
            self._corners.edit(corners.ravel(), self._corners.notation(extent)),
        )


def is_text(content: bytes) -> bool:
    """Whether it begins like STL as text, as some binary files do too."""
    return bool(_IS_SOLID.match(content)) and b"\0" not in content[:512]


def _solids(text: bytes, places: Places) -> tuple[int, bool, Bools]:
    """How many solids begin, whether one has a name, and which words (w,) are on lines that begin or end one.

    A name may be of any words.
    """
    starts, line_ends = places[:, 0], where(np.frombuffer(text, np.uint8), lambda data: (data == 10) | (data == 13))
    begins = equal(text, places, b"solid")
    first = np.sort(np.concatenate([begins, equal(text, places, b"endsolid")]))
    line = np.searchsorted(line_ends, starts[first])
    before = np.searchsorted(line_ends, starts[first - 1])  # of the first word the line of the last, or its own
    first, line = (array[(line != before) | (first == 0)] for array in (first, line))
    after = np.searchsorted(starts, np.append(line_ends, len(text))[line])
    step = np.zeros(len(places) + 1, np.int8)
    step[first] += 1
    step[after] -= 1
    starting = np.isin(first, begins)
    named = bool((after - first)[starting].max(initial=1) > 1)
    return int(starting.sum()), named, np.cumsum(step[:-1], dtype=np.int8).view(bool)


def _numbers(name: str, text: bytes, places: Places) -> Places:
    """Where the twelve numbers of each facet stand (m, 12, 2): its normal, then its corners.

    Errors: MeshError where facets are not whole.
    """
    facets, corners, loops = (equal(text, places, word) for word in (b"facet", b"vertex", b"endloop"))
    whole = len(corners) == 3 * len(facets) == 3 * len(loops)
    if whole and len(facets):
        every = np.concatenate([facets[:, None], corners.reshape(-1, 3), loops[:, None]], axis=1).ravel()
        whole = bool((np.diff(every) > 0).all() and (np.diff(np.append(corners, loops[-1])) > 3).all())
        whole = whole and len(equal(text, places[facets + 1], b"normal")) == len(facets)
    if not whole:
        raise MeshError(
            f"{name} is truncated or damaged: {len(facets)} facets begin in it, with {len(corners)} vertices instead of"
            f" {3 * len(facets)}, and {len(loops)} loops end"
        )
    first = np.concatenate([facets[:, None] + 1, corners.reshape(-1, 3)], axis=1)
    return places[first[:, :, None] + np.arange(1, 4)].reshape(-1, 12, 2)


def _with_nan(shown: bytes, places: Places) -> bytes:
    """Numbers with "nan" where old compilers wrote "-1.#IND" and the like, as normals of facets without an area."""
    if b"#" not in shown:
        return shown
    starts, ends = places.reshape(-1, 2).T
    marked = np.flatnonzero(np.frombuffer(shown, np.uint8) == ord("#"))
    which = np.unique(np.searchsorted(starts, marked, "right") - 1)
    known = bytearray(shown)
    for start, end in zip(starts[which].tolist(), ends[which].tolist(), strict=True):
        known[start:end] = b"nan".ljust(end - start)[: end - start]
    return bytes(known)
