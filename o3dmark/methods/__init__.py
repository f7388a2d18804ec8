"""Watermarking methods: each is one file of this folder, found by being there.

Method.embed     mesh, bits, key        -> mesh
Method.extract   mesh, n_bits, key      -> Extraction: soft bits, and how many hypotheses were tried for them
"""

import abc
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from o3dmark.arrays import Floats
from o3dmark.coding.keys import Key
from o3dmark.registry import Registry

METHODS: "Registry[Method]" = Registry("method", __name__)


@dataclass(frozen=True, eq=False)
class Extraction:
    """What a method read: ``soft`` (n_bits,), positive for 1, negative for 0, the magnitude is the trust in it.

    ``hypotheses`` counts the readings (steps, smoothings, frames, ...) among which this one was chosen; every p-value
    is multiplied by it. ``note`` says in words which one it was. ``readings`` (h, n_bits) are the soft bits of all of
    them, where the method keeps them: whoever knows the bits can choose better than the method could.
    """

    soft: Floats
    hypotheses: int = 1
    note: str = ""
    readings: Floats | None = None

    @property
    def bits(self) -> NDArray[np.uint8]:
        """Hard decisions (n_bits,), 0 or 1."""
        return (self.soft > 0).astype(np.uint8)

    def nearest(self, bits: ArrayLike) -> "Extraction":
        """The reading that agrees best with ``bits`` (n_bits,), 0 or 1; all are charged."""
        if self.readings is None or not len(self.readings):
            return self
        agreement = self.readings @ (2.0 * np.asarray(bits, np.float64) - 1.0)
        best = self.readings[np.argmax(agreement / np.maximum(np.linalg.norm(self.readings, axis=1), 1e-12))]
        charged = max(self.hypotheses, len(self.readings))
        return Extraction(np.asarray(best, np.float64), charged, "the reading nearest to the known bits")


@dataclass(frozen=True)
class Method(abc.ABC):
    """A way to hide bits in a mesh. Options are the fields; a mesh, a key and bits are the data."""

    name: ClassVar[str] = ""
    claims: ClassVar[tuple[str, ...]] = ()  # attacks that 16 bits must survive: the contract tests

    @property
    def informed(self) -> bool:
        """Whether extraction needs the cover mesh as its reference."""
        return False

    @property
    def takes_reference(self) -> bool:
        """Whether extraction can use the cover mesh as its reference."""
        return self.informed

    @abc.abstractmethod
    def embed(self, mesh: Any, bits: ArrayLike, key: Key) -> Any:
        """A copy of ``mesh`` (Open3D triangle mesh) that carries ``bits`` (n,).

        Errors: MeshError for a mesh that cannot carry a mark, CapacityError (says how many fit) for too many bits.
        """

    @abc.abstractmethod
    def extract(self, mesh: Any, n_bits: int, key: Key, *, reference: Any = None) -> Extraction:
        """Read ``n_bits`` soft bits. ``reference``, the cover mesh, is for methods that take one; others refuse it."""

    @abc.abstractmethod
    def capacity(self, mesh: Any) -> int:
        """The number of bits that ``mesh`` can carry at most."""


__all__ = ["METHODS", "Extraction", "Method"]
