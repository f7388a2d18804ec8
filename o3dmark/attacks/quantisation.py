"""Coordinates rounded to the levels of a grid."""

# ruff: noqa: ARG002 - attacks without randomness take an rng too

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from o3dmark.attacks import ATTACKS, Attack
from o3dmark.attacks._carry import checked_arrays, moved
from o3dmark.registry import option


@ATTACKS.register("quantise")
@dataclass(frozen=True)
class Quantise(Attack):
    """Every coordinate moved to the nearest level of a uniform grid that starts at the bounding box's lower corner.

    axis    the step is each axis's own extent / 2^bits (the benchmark)
    cube    one step for all axes, the longest extent / 2^bits

    The grid has 2^bits + 1 levels, both ends of the box included; a coordinate moves by half a step at most.
    Source: Wang et al. 2010, A benchmark for 3D mesh watermarking, "vertex coordinates quantization", 7 to 11 bits.
    """

    bits: int = option(9, "bits a coordinate, 1 to 52")
    grid: Literal["axis", "cube"] = option("axis", "a step for each axis, or one for all")

    def __post_init__(self) -> None:
        if not 1 <= self.bits <= 52:
            raise ValueError(f"bits should be 1 to 52, not {self.bits}")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, _ = checked_arrays(mesh)
        low, extent = vertices.min(axis=0), np.ptp(vertices, axis=0)
        step = (extent if self.grid == "axis" else np.full(3, extent.max())) / 2.0**self.bits
        flat = step == 0.0
        level = np.round((vertices - low) / np.where(flat, 1.0, step))
        return moved(mesh, np.where(flat, vertices, low + level * step))
