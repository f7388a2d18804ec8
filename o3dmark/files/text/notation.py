"""Numbers in text files: read all at once, and written with as many digits as are needed, but never with fewer."""

import math
import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from o3dmark.arrays import AnyArray, Floats
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry

_FINEST = 1e-8  # of the diagonal: like float32's own steps at the rim of a mesh about the origin
_LEAST_EXTENT = 1e-290  # with room for factors
_LONGEST = 15  # decimals; numbers that need more are written with all digits that they have


def floats(path: Path, text: bytes, what: str, width: int = 3) -> Floats:
    """All numbers of a text, in rows of ``width`` (n, width), each the float64 next to what is written.

    Errors: MeshError, which calls the numbers ``what``, where other words stand or a row is not whole.
    """
    try:
        values = parsed(text, np.float64)
    except ValueError:
        raise MeshError(f"{path.name}: {what} are not all numbers") from None
    if len(values) % width:
        raise MeshError(f"{path.name}: {what} are not {width} numbers each")
    return values.reshape(-1, width)


def parsed(text: bytes, dtype: type[np.generic]) -> AnyArray:
    """All numbers of a text (n,), each the one next to what is written. Errors: ValueError for other words."""
    if not text.strip():
        return np.empty(0, dtype)
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # numpy's way, once, to say that it stopped before the end
        try:
            return np.fromstring(text, dtype, sep=" ")
        except DeprecationWarning:
            raise ValueError from None


@dataclass(frozen=True)
class Notation:
    """How numbers are written: decimals, decimals before an exponent, or digits in all."""

    decimals: int
    kind: Literal["f", "e", "g"] = "f"

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
        number = f"%.{self.decimals}{self.kind}"
        line = " ".join([number] * values.shape[1]) + "\n"
        return ((line * len(values)) % tuple(values.ravel().tolist())).encode("ascii").splitlines()


EXACT = Notation(17, "g")


def extent_of(vertices: Floats) -> float:
    """The diagonal of the box about vertices (n, 3), as far as they are finite; 0 where all are one."""
    finite = vertices[np.isfinite(vertices).all(axis=1)]
    greatest = float(np.abs(finite).max(initial=0.0)) or 1.0  # whose square may be infinite
    extent = geometry.diagonal(finite / greatest) * greatest if len(finite) else 0.0
    return min(max(extent, _LEAST_EXTENT), 1.0 / _LEAST_EXTENT) if extent else 0.0
