"""STL as text: solids, with or without names, and what stands between "facet" and "endfacet"."""

import re
from pathlib import Path

import numpy as np

from o3dmark.arrays import Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.files._text import floats
from o3dmark.files._words import Numbers, equal, extent_of, only, replaced, words

_SOLID = re.compile(rb"(?:\A(?:\xef\xbb\xbf)?\s*|(?<=[\r\n])[ \t]*)(end[ \t]?)?solid(?!\S)([^\r\n]*)", re.I)
_IS_SOLID = re.compile(rb"(?:\xef\xbb\xbf)?\s*solid(?!\S)", re.I)


class TextFacets:
    """The facets of all solids of a text: their ``normals`` (m, 3) and ``corners`` (3 m, 3)."""

    steps = np.zeros(3)

    def __init__(self, path: Path, content: bytes) -> None:
        solids = list(_SOLID.finditer(content))
        self._names = [solid[2].strip() for solid in solids if not solid[1]]
        text = bytearray(content)
        for solid in solids:  # whose names may be any words
            text[slice(*solid.span())] = b" " * len(solid[0])
        starts, ends = words(bytes(text))
        places = _places(path.name, bytes(text), starts, ends)
        starts, ends = starts[places], ends[places]
        shown = only(content, starts.ravel(), ends.ravel())
        values = floats(path, _with_nan(shown, starts, ends), "normals and vertices", width=12)
        self._content = content
        self._normals = Numbers(content, starts[:, :3].ravel(), ends[:, :3].ravel(), values[:, :3].ravel())
        self._corners = Numbers(content, starts[:, 3:].ravel(), ends[:, 3:].ravel(), values[:, 3:].ravel())
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
        changes = [
            self._normals.changes(normals.ravel(), self._normals.notation(1.0)),
            self._corners.changes(corners.ravel(), self._corners.notation(extent_of(self.corners))),
        ]
        return replaced(self._content, changes)


def is_text(content: bytes) -> bool:
    """Whether it begins like STL as text, as some binary files do too."""
    return bool(_IS_SOLID.match(content)) and b"\0" not in content[:512]


def _places(name: str, text: bytes, starts: Ints, ends: Ints) -> Ints:
    """Which words are the twelve numbers of each facet (m, 12): its normal, then its corners.

    Errors: MeshError where facets are not whole.
    """
    facets, corners, loops = (
        np.flatnonzero(equal(text, starts, ends, word)) for word in (b"facet", b"vertex", b"endloop")
    )
    normals = facets + 1
    whole = len(corners) == 3 * len(facets) == 3 * len(loops)
    if whole and len(facets):
        every = np.concatenate([facets[:, None], corners.reshape(-1, 3), loops[:, None]], axis=1).ravel()
        whole = bool((np.diff(every) > 0).all() and (np.diff(np.append(corners, loops[-1])) > 3).all())
        whole = whole and bool(equal(text, starts[normals], ends[normals], b"normal").all())
    if not whole:
        raise MeshError(
            f"{name} is truncated or damaged: {len(facets)} facets begin in it, with {len(corners)} vertices instead of"
            f" {3 * len(facets)}, and {len(loops)} loops end"
        )
    numbers = np.arange(1, 4)
    return np.concatenate(
        [normals[:, None] + numbers, (corners[:, None] + numbers).reshape(-1, 9)], axis=1, dtype=np.int64
    )


def _with_nan(text: bytes, starts: Ints, ends: Ints) -> bytes:
    """The text with "nan" where old compilers wrote "-1.#IND" and the like, as normals of facets without an area."""
    if b"#" not in text:
        return text
    marked = np.flatnonzero(np.frombuffer(text, np.uint8) == ord("#"))
    which = np.unique(np.searchsorted(starts.ravel(), marked, "right") - 1)
    known = bytearray(text)
    for start, end in zip(starts.ravel()[which].tolist(), ends.ravel()[which].tolist(), strict=True):
        known[start:end] = b"nan".ljust(end - start)
    return bytes(known)
