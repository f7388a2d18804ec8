"""A flower, a vase and a cup."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from o3dmark.registry import option
from o3dmark.synthetic import SHAPES, Sculpture
from o3dmark.synthetic.field import (
    Field,
    ball,
    blade,
    blend,
    carve,
    common,
    ellipsoid,
    emboss,
    flute,
    half_space,
    noise,
    placed,
    revolve,
    scaled,
    strands,
    sway,
    tube,
    within,
)


@SHAPES.register("flower")
@dataclass(frozen=True)
class Flower(Sculpture):
    """Petals around a seed head on a bent stem with two leaves."""

    vertices: int = option(2523, "how many vertices")

    def solid(self, rng: np.random.Generator) -> Field:
        petals = []
        for turn in np.linspace(0.0, 360.0, 7, endpoint=False) + rng.uniform(-5.0, 5.0, 7):
            size = (rng.uniform(0.17, 0.19), 0.04, length := rng.uniform(0.37, 0.45))
            way = np.array([np.sin(np.radians(turn)), 0.3, np.cos(np.radians(turn))])
            petals.append(blade(way * (0.12 + 0.8 * length), size, (rng.uniform(-26, -14), turn, 0), -0.45, 0.9))
        disc = ellipsoid((0.0, 0.07, 0.0), (0.24, 0.12, 0.23))
        calyx = ellipsoid((0.0, 0.06, 0.0), (0.31, 0.09, 0.31))
        seeds = within(ellipsoid((0.0, 0.15, 0.0), (0.2, 0.2, 0.2)), 0.03, noise(rng, 0.008, 0.1))
        head = placed(emboss(blend(0.04, disc, calyx, *petals), seeds), (0.05, 0.35, 0.12), (58.0, 18.0, 0.0), 0.9)
        stem = tube(
            (0.05, 0.35, 0.12, 0.06),
            (0.0, 0.2, -0.14, 0.052),
            (-0.04, -0.12, -0.25, 0.05),
            (-0.06, -0.55, -0.12, 0.055),
            (0.0, -1.0, 0.05, 0.07),
        )
        leaf = placed(blade((0, 0, 0.31), (0.17, 0.04, 0.34), bend=-0.4), (-0.06, -0.56, -0.12), (-22.0, 70.0, -50.0))
        other = placed(blade((0, 0, 0.28), (0.15, 0.04, 0.31), bend=-0.4), (-0.05, -0.72, -0.04), (-32.0, 285.0, 45.0))
        return emboss(sway(blend(0.06, head, stem, leaf, other), rng, 0.05), noise(rng, 0.003, 0.25))


@SHAPES.register("vase")
@dataclass(frozen=True)
class Vase(Sculpture):
    """A hollow vase with twisted flutes, thrown a little out of the round."""

    vertices: int = option(2527, "how many vertices")
    detail: ClassVar[int] = 50000

    def solid(self, rng: np.random.Generator) -> Field:
        swell = rng.uniform(0.95, 1.1)
        wall = revolve(
            tube(
                (0.0, -0.93, 0.0, 0.06),
                (0.27, -0.95, 0.0, 0.06),
                (0.25, -0.8, 0.0, 0.058),
                (0.42 * swell, -0.45, 0.0, 0.058),
                (0.56 * swell, 0.0, 0.0, 0.058),
                (0.42 * swell, 0.42, 0.0, 0.058),
                (0.22, 0.66, 0.0, 0.058),
                (0.24, 0.82, 0.0, 0.058),
                (0.38, 0.97, 0.0, 0.045),
                smooth=4,
            )
        )
        twist = noise(rng, 0.5, 1.5)
        belly = ellipsoid((0.0, -0.1, 0.0), (0.8, 0.52, 0.8))
        flutes = within(belly, 0.12, strands((0, 0, 0), (0, 1, 0), 11, 0.022, lambda p: 6.0 * p[:, 1] + twist(p)))
        return sway(scaled(emboss(flute(wall, flutes), noise(rng, 0.005, 0.3)), (1.0, 1.0, 0.84)), rng, 0.1)


@SHAPES.register("cup")
@dataclass(frozen=True)
class Cup(Sculpture):
    """A mug with an ear: genus 1."""

    vertices: int = option(9076, "how many vertices")
    genus: ClassVar[int] = 1

    def solid(self, rng: np.random.Generator) -> Field:
        outside = tube((0.0, -0.9, 0.0, 0.5), (0.0, -0.3, 0.0, 0.58), (0.0, 0.2, 0.0, 0.55), (0.0, 0.9, 0.0, 0.66))
        body = common(0.1, outside, half_space((0.0, -0.75, 0.0), (0.0, -1.0, 0.0)))
        foot = revolve(tube((0.0, -0.76, 0.0, 0.04), (0.36, -0.76, 0.0, 0.06)))
        ear = tube(
            (0.5, 0.42, 0.0, 0.085),
            (0.82, 0.5, 0.03, 0.075),
            (1.05, 0.22, 0.06, 0.07),
            (0.96, -0.18, 0.06, 0.07),
            (0.72, -0.42, 0.02, 0.075),
            (0.5, -0.48, 0.0, 0.09),
            smooth=4,
        )
        thumb = ball(0.93, 0.56, 0.05, 0.07)
        hollow = tube((0.0, -0.2, 0.0, 0.44), (0.0, 0.2, 0.0, 0.45), (0.0, 0.9, 0.0, 0.56), (0.0, 1.4, 0.0, 0.65))
        rim = half_space((0.0, 0.72, 0.0), (0.03, 1.0, 0.02))
        twigs = strands((0.0, 0.0, 0.0), (0.1, 1.0, 0.2), 9, 0.016, noise(rng, 3.0, 0.7))
        band = common(0.05, half_space((0, 0.35, 0), (0, 1, 0)), half_space((0, -0.45, 0), (0, -1, 0)))
        band = common(0.05, band, lambda p: 0.5 - np.hypot(p[:, 0], p[:, 2]), lambda p: p[:, 0] - 0.42)
        buds = noise(rng, 0.012, 0.22)
        relief = within(band, 0.06, lambda p: twigs(p) + buds(p))
        outer = emboss(blend(0.12, body, foot, ear, thumb), relief)
        mug = common(0.06, carve(0.05, outer, hollow), rim)
        return sway(emboss(scaled(mug, (1.0, 1.0, 0.94)), noise(rng, 0.003, 0.2)), rng, 0.035)
