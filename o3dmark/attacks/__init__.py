"""Attacks, what happens to a mesh on its way: seeded, composed left to right.

    Attack           mesh, rng              -> mesh

Every attack is a registered frozen dataclass, so "noise:amplitude=0.003" and Noise(amplitude=0.003) are the same.
"""

import abc
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from o3dmark.registry import Registry

ATTACKS: "Registry[Attack]" = Registry("attack", __name__)

Rng = int | np.random.Generator | None


@dataclass(frozen=True)
class Attack(abc.ABC):
    """One thing that happens to a mesh. Options are the fields; the input mesh is never changed."""

    name: ClassVar[str] = ""

    def __call__(self, mesh: Any, rng: Rng = None) -> Any:
        """The attacked copy of an Open3D TriangleMesh; ``rng`` (int, Generator or None) makes it repeatable."""
        return self.attack(mesh, np.random.default_rng(rng))

    @abc.abstractmethod
    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        """What `__call__` does, with the randomness made ready."""


def attack_all(mesh: Any, attacks: Iterable[str | Attack], rng: Rng = None) -> Any:
    """Apply attacks, given as specs or objects, left to right with one source of randomness."""
    generator = np.random.default_rng(rng)
    for attack in attacks:
        mesh = ATTACKS.make(attack)(mesh, generator)
    return mesh


__all__ = ["ATTACKS", "Attack", "Rng", "attack_all"]
