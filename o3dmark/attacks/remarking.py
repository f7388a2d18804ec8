"""Somebody else marks the mesh again."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from o3dmark.attacks import ATTACKS, Attack
from o3dmark.coding.keys import Key
from o3dmark.errors import SpecError
from o3dmark.profiles import PROFILES
from o3dmark.registry import option


@ATTACKS.register("remark")
@dataclass(frozen=True)
class Remark(Attack):
    """A second mark, of a random message under a random key.

    Source: Craver et al. 1998, Resolving rightful ownerships with invisible watermarking techniques. Errors: MeshError
    as when such a mark is embedded.
    """

    profile: str = option("robust-2026", "the profile of the second mark")
    n_bits: int = option(0, "how many bits it has; 0: as the profile says")

    def __post_init__(self) -> None:
        if self.n_bits < 0:
            raise ValueError(f"n_bits should be 0 or more, not {self.n_bits}")
        if self.profile not in PROFILES:
            raise SpecError(f"no profile is called {self.profile!r}; there are {', '.join(PROFILES)}")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        mark = PROFILES[self.profile]
        return mark.method.embed(mesh, rng.integers(0, 2, self.n_bits or mark.n_bits), Key(rng.bytes(32)))
