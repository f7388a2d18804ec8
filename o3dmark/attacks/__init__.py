"""Attacks, what happens to a mesh on its way: seeded, composed left to right.

    Attack           mesh, rng              -> mesh

Every attack is a registered frozen dataclass, so "noise:amplitude=0.003" and Noise(amplitude=0.003) are the same.
"""

import abc
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np

from o3dmark.mesh.surface import MeshArrays, as_given, legacy_mesh
from o3dmark.registry import Registry

ATTACKS: "Registry[Attack]" = Registry("attack", __name__)

Rng = int | np.random.Generator | None
Shape = TypeVar("Shape")
"""A mesh of any kind: what comes out is of the kind that went in."""


@dataclass(frozen=True)
class Attack(abc.ABC):
    """One thing that happens to a mesh. Options are the fields; the input mesh is never changed."""

    name: ClassVar[str] = ""

    def __call__(self, mesh: Shape, rng: Rng = None) -> Shape:
        """The attacked copy of an Open3D triangle mesh, legacy or tensor; ``rng`` makes it repeatable.

        Errors: MeshError for what is no mesh, or cannot be attacked so.
        """
        shape = legacy_mesh(mesh) if isinstance(mesh, MeshArrays) else mesh
        done: Shape = as_given(mesh, self.attack(shape, np.random.default_rng(rng)))
        return done

    @abc.abstractmethod
    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        """What `__call__` does, with the randomness made ready."""


def attack_all(mesh: Shape, attacks: str | Attack | Iterable[str | Attack], rng: Rng = None) -> Shape:
    """Apply one attack or several, specs or objects, left to right with one source of randomness."""
    generator = np.random.default_rng(rng)
    for attack in [attacks] if isinstance(attacks, str | Attack) else attacks:
        mesh = ATTACKS.make(attack)(mesh, generator)
    return mesh


if TYPE_CHECKING:  # every registered class can be imported from here; a test says so
    from o3dmark.attacks.company import Dust as Dust
    from o3dmark.attacks.company import Inside as Inside
    from o3dmark.attacks.company import Pedestal as Pedestal
    from o3dmark.attacks.company import Plate as Plate
    from o3dmark.attacks.company import Scene as Scene
    from o3dmark.attacks.company import Speck as Speck
    from o3dmark.attacks.company import Twice as Twice
    from o3dmark.attacks.connectivity import Remesh as Remesh
    from o3dmark.attacks.connectivity import Simplify as Simplify
    from o3dmark.attacks.cropping import Crop as Crop
    from o3dmark.attacks.cropping import Holes as Holes
    from o3dmark.attacks.cropping import Paste as Paste
    from o3dmark.attacks.deformation import Bend as Bend
    from o3dmark.attacks.deformation import Twist as Twist
    from o3dmark.attacks.file import Float16 as Float16
    from o3dmark.attacks.file import Identity as Identity
    from o3dmark.attacks.file import Reformat as Reformat
    from o3dmark.attacks.file import Reorder as Reorder
    from o3dmark.attacks.file import Unweld as Unweld
    from o3dmark.attacks.file import Weld as Weld
    from o3dmark.attacks.geometry import Axes as Axes
    from o3dmark.attacks.geometry import Mirror as Mirror
    from o3dmark.attacks.geometry import Similarity as Similarity
    from o3dmark.attacks.geometry import Strain as Strain
    from o3dmark.attacks.geometry import Stretch as Stretch
    from o3dmark.attacks.geometry import Units as Units
    from o3dmark.attacks.noise import Noise as Noise
    from o3dmark.attacks.pipeline import Draco as Draco
    from o3dmark.attacks.pipeline import Meshopt as Meshopt
    from o3dmark.attacks.pipeline import MeshoptSimplify as MeshoptSimplify
    from o3dmark.attacks.pipeline import PrintScan as PrintScan
    from o3dmark.attacks.quantisation import Quantise as Quantise
    from o3dmark.attacks.reextraction import Poisson as Poisson
    from o3dmark.attacks.reextraction import Resample as Resample
    from o3dmark.attacks.reextraction import Rescan as Rescan
    from o3dmark.attacks.remarking import Remark as Remark
    from o3dmark.attacks.sculpting import Bilateral as Bilateral
    from o3dmark.attacks.sculpting import Bump as Bump
    from o3dmark.attacks.sculpting import Flatten as Flatten
    from o3dmark.attacks.sculpting import Half as Half
    from o3dmark.attacks.sculpting import Sharpen as Sharpen
    from o3dmark.attacks.sculpting import Warp as Warp
    from o3dmark.attacks.smoothing import HC as HC
    from o3dmark.attacks.smoothing import Smooth as Smooth
    from o3dmark.attacks.smoothing import Taubin as Taubin
    from o3dmark.attacks.subdivision import Subdivide as Subdivide
    from o3dmark.attacks.tearing import Crack as Crack
    from o3dmark.attacks.tearing import Soup as Soup


def __getattr__(name: str) -> Any:
    """A registered class by its own name: `from o3dmark.attacks import Soup`."""
    return ATTACKS.class_called(name)


__all__ = ["ATTACKS", "Attack", "Rng", "attack_all"]
