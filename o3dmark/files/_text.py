"""Numbers in text files: read all at once, and written with as many digits as are needed and no fewer than were there."""

import math
import re
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from o3dmark.arrays import Floats
from o3dmark.errors import MeshError

_FINEST = 1e-8  # of the diagonal: like float32's own steps at the rim of a mesh about the origin
_LONGEST = 15  # decimals; numbers that need more are written with an exponent
_DECIMALS = re.compile(rb"\.(\d*)")


def floats(path: Path, text: bytes, what: str, width: int = 3) -> Floats:
    """All numbers of a text, in rows of ``width`` (n, width), each the float64 next to what is written.

    Errors: MeshError, which calls the numbers ``what``, where other words stand or a row is not whole.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # numpy's way to say that it stopped before the end
        try:
            values = np.fromstring(text, np.float64, sep=" ") if text.strip() else np.empty(0)
        except (DeprecationWarning, ValueError):
            raise MeshError(f"{path.name}: {what} are not all numbers") from None
    if len(values) % width:
        raise MeshError(f"{path.name}: {what} are not {width} numbers each")
    return values.reshape(-1, width)


@dataclass(frozen=True)
class Notation:
    """How numbers are written: with so many decimals, or with an exponent after so many of them."""

    decimals: int
    exponent: bool = False

    @classmethod
    def of(cls, text: bytes, diagonal: float) -> "Notation":
        """The one that keeps the longest fraction in ``text`` and tells apart what lies 1e-8 of the diagonal apart."""
        decimals = max((len(digits) for digits in _DECIMALS.findall(text)), default=0)
        if diagonal > 0.0:
            decimals = max(decimals, math.ceil(-math.log10(_FINEST * diagonal)))
        return cls(decimals) if decimals <= _LONGEST else cls(16, exponent=True)

    def rows(self, values: Floats) -> list[bytes]:
        """Numbers (n, d) as n lines without their ends, a space between two."""
        if not len(values):
            return []
        number = f"%.{self.decimals}{'e' if self.exponent else 'f'}"
        line = " ".join([number] * values.shape[1]) + "\n"
        return ((line * len(values)) % tuple(values.ravel().tolist())).encode("ascii").splitlines()
