"""Binary STL: a header of 80 bytes, a count, and facets of 50 bytes each."""

import numpy as np

from o3dmark.arrays import Floats
from o3dmark.errors import MeshError
from o3dmark.files._changes import differs
from o3dmark.files.asset import float_steps

_HEAD = 84  # bytes, with the count
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


class BinaryFacets:
    """The facets of a binary STL file: their ``normals`` (m, 3) and ``corners`` (3 m, 3). What follows them stays."""

    def __init__(self, name: str, content: bytes) -> None:
        if not fits(content):
            count = int.from_bytes(content[80:_HEAD], "little")
            takes = f", and announces {count} facets, which take {_HEAD + 50 * count}" if len(content) >= _HEAD else ""
            raise MeshError(f"{name} is truncated, or no STL file: it has {len(content)} bytes{takes}")
        self._content = content
        self._facets = np.frombuffer(content, _FACET, int.from_bytes(content[80:_HEAD], "little"), _HEAD)
        with np.errstate(invalid="ignore"):  # of what is no number
            self.normals = self._facets["normal"].astype(np.float64)
            self.corners = self._facets["corners"].astype(np.float64).reshape(-1, 3)

    @property
    def steps(self) -> Floats:
        return float_steps(self.corners)

    @property
    def contents(self) -> frozenset[str]:
        """Whether the header says something, and attribute words, which some programs take for colours."""
        header = {"header"} if self._content[:80].strip(b"\0 \t\r\n") else set[str]()
        return frozenset(header | ({"attribute words"} if self._facets["attribute"].any() else set()))

    @staticmethod
    def rounded(values: Floats) -> Floats:
        """The numbers next to ``values`` that can stand in the file."""
        with np.errstate(over="ignore"):
            return values.astype(np.float32).astype(np.float64)

    def written(self, normals: Floats, corners: Floats) -> bytes:
        """The file with other numbers; where they are equal to its own, with these."""
        facets = self._facets.copy()
        for field, old, new in (("normal", self.normals, normals), ("corners", self.corners, corners)):
            shape = facets[field].shape
            changed = differs(new, old).reshape(shape)
            np.copyto(facets[field], new.reshape(shape), casting="same_kind", where=changed)
        end = _HEAD + facets.nbytes
        return b"".join((self._content[:_HEAD], facets.data, self._content[end:]))


def fits(content: bytes) -> bool:
    """Whether a file has room for as many facets as it announces, if it is a binary one."""
    return len(content) >= _HEAD and _HEAD + 50 * int.from_bytes(content[80:_HEAD], "little") <= len(content)
