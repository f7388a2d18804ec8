"""STL as text: solids, with or without names, and what stands between "facet" and "endfacet"."""

import re
from pathlib import Path

import numpy as np

from o3dmark.arrays import Bools, Floats
from o3dmark.errors import MeshError
from o3dmark.files._text import Places, floats, only, spliced
from o3dmark.files._words import Numbers, equal, extent_of, words

_BOM = b"\xef\xbb\xbf"
_IS_SOLID = re.compile(rb"(?:%b)?\s*solid(?!\S)" % _BOM, re.I)
_LINE_END = re.compile(rb"[\r\n]")


class TextFacets:
    """The facets of all solids of a text: their ``normals`` (m, 3) and ``corners`` (3 m, 3)."""

    steps = np.zeros(3)

    def __init__(self, path: Path, content: bytes) -> None:
        text = content if not content.startswith(_BOM) else b"   " + content[len(_BOM) :]
        places = words(text)
        self._names, named = _solids(text, places)
        places = _numbers(path.name, text, places[~named])
        shown = only(np.frombuffer(text, np.uint8), places)
        values = floats(path, _with_nan(shown, places - places[:1, :1, :1]), "normals and vertices", width=12)
        self._content = content
        self._normals, self._corners = (
            Numbers(content, places[:, side].reshape(-1, 2), values[:, side].ravel())
            for side in (slice(0, 3), slice(3, 12))
        )
        self.normals, self.corners = (side.values.reshape(-1, 3) for side in (self._normals, self._corners))

    @property
    def contents(self) -> frozenset[str]:
        """Whether solids have names, and whether there are several."""
        named = {"names"} if any(self._names) else set[str]()
        return frozenset(named | ({"several meshes"} if len(self._names) > 1 else set()))

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


def _solids(text: bytes, places: Places) -> tuple[list[bytes], Bools]:
    """The names of solids, and which words (w,) are on lines that begin or end one: a name may be of any words."""
    starts, named = np.ascontiguousarray(places[:, 0]), np.zeros(len(places), bool)
    begins, ends = (equal(text, places, word) for word in (b"solid", b"endsolid"))
    names, done = [], 0
    for word in np.sort(np.concatenate([begins, ends])).tolist():
        start, end = places[word].tolist()
        if start < done or (word and not _LINE_END.search(text, int(places[word - 1, 1]), start)):
            continue  # a part of a name
        line_end = _LINE_END.search(text, end)
        done = line_end.start() if line_end else len(text)
        named[word : np.searchsorted(starts, done)] = True
        if end - start == len(b"solid"):
            names.append(text[end:done].strip())
    return names, named


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
