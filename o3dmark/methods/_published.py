"""What the methods of the literature have in common: one strength, bits dealt by a key, a blind reader."""

import abc
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from o3dmark.arrays import Bits, Floats, Ints
from o3dmark.coding.keys import Key
from o3dmark.errors import CapacityError, MeshError
from o3dmark.mesh.surface import Surface, with_vertices
from o3dmark.methods import Extraction, Method
from o3dmark.methods._distortion import with_mrms, within_mrms
from o3dmark.registry import option
from o3dmark.threads import one_thread


@dataclass(frozen=True, eq=False)
class Deal:
    """Which of n carriers has which bit, ``bit`` (n,), and which hold the opposite, ``inverted`` (n,), 0 or 1.

    The publications have no key. A permutation keeps the places secret; the inversions make every bit that is read
    under a wrong key a fair coin, as p-values take it to be.
    """

    bit: Ints
    inverted: Bits

    @classmethod
    def of(cls, name: str, n_bits: int, key: Key) -> "Deal":
        """Of a method by its ``name``."""
        return cls(key.stream(f"{name}/order").permutation(n_bits), key.stream(f"{name}/coins").bits(n_bits))

    def written(self, message: Bits) -> Bits:
        """What each carrier holds (n,)."""
        return message[self.bit] ^ self.inverted

    def read(self, soft: Floats) -> Floats:
        """The message's soft bits (n,) from those of the carriers (n,)."""
        found = np.empty(len(soft))
        found[self.bit] = np.where(self.inverted == 1, -soft, soft)
        return found


@dataclass(frozen=True)
class PublishedMethod(Method):
    """A method with one strength: its published one, or one at which the mark has the distortion ``mrms``."""

    mrms: float | None = option(
        None, "distortion to embed at, over the bounding-box diagonal; none: published strength"
    )

    least: ClassVar[float] = 1e-4  # of the strengths that are tried for a distortion
    largest: ClassVar[float] = 1.0

    def __post_init__(self) -> None:
        if self.mrms is not None and self.mrms <= 0:
            raise ValueError(f"mrms must be positive, not {self.mrms}")
        if not self.least <= self.strength <= self.largest:
            raise ValueError(f"the strength must lie in [{self.least:g}, {self.largest:g}], not {self.strength:g}")

    @property
    def limits(self) -> dict[str, float]:
        """See `Method.limits`: none at the published strength."""
        return {} if self.mrms is None else {"mrms": self.mrms}

    @property
    @abc.abstractmethod
    def strength(self) -> float:
        """The published strength; distortion grows with it."""

    @property
    def ladder(self) -> Floats | None:
        """The strengths to choose among for a distortion, ascending, where the reader must know them; None: any."""
        return None

    @abc.abstractmethod
    def writer(self, surface: Surface, message: Bits, key: Key) -> Callable[[float], Floats]:
        """The vertices (n, 3) that carry ``message`` (n_bits,), as a function of the strength."""

    @abc.abstractmethod
    def read(self, seen: Any, n_bits: int, key: Key) -> Extraction:
        """What a mesh says that was observed."""

    @one_thread()
    def embed(self, mesh: Any, bits: ArrayLike, key: Key) -> Any:
        """See `Method.embed`. Errors: MeshError too where no strength has the distortion ``mrms``."""
        surface = Surface.of(mesh)
        message = np.asarray(bits, np.uint8).ravel()
        if len(message) > (fits := self.capacity(surface)):
            raise CapacityError(len(message), fits)
        moved = self.writer(surface, message, key)
        if self.mrms is None:
            vertices = moved(self.strength)
        elif (ladder := self.ladder) is not None:
            vertices = within_mrms(surface, moved, self.mrms, ladder)
        else:
            vertices = with_mrms(surface, moved, self.mrms, self.strength, self.least, self.largest)
        return with_vertices(mesh, surface, vertices)

    @one_thread()
    def extract(self, mesh: Any, n_bits: int, key: Key, *, reference: Any = None) -> Extraction:
        """See `Method.extract`."""
        if reference is not None:
            raise MeshError(f"{self.name} is blind and takes no reference")
        return self.read(self.observe(mesh), n_bits, key)

    def observe(self, mesh: Any) -> Any:
        """See `Method.observe`."""
        return Surface.of(mesh)
