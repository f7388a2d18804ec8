"""Four animals that look along x, with y upward, each in a pose of its own."""

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
    both,
    carve,
    common,
    ellipsoid,
    emboss,
    half_space,
    noise,
    placed,
    strands,
    sway,
    tube,
)


@SHAPES.register("ant")
@dataclass(frozen=True)
class Ant(Sculpture):
    """Head, thorax and ringed abdomen, six legs and two antennae."""

    vertices: int = option(7654, "how many vertices")

    def solid(self, rng: np.random.Generator) -> Field:
        head = blend(
            0.05,
            ellipsoid((0.66, 0.1, 0.0), (0.22, 0.17, 0.21), (0, rng.uniform(-12, 12), -15)),
            *both(lambda s: ball(0.7, 0.17, 0.17 * s, 0.06)),
            *both(
                lambda s: tube(
                    (0.8, 0.0, 0.11 * s, 0.045), (0.93, -0.06, 0.09 * s, 0.035), (0.99, -0.08, 0.055 * s, 0.022)
                )
            ),
        )
        antennae = both(
            lambda s: tube(
                (0.78, 0.2, 0.08 * s, 0.032),
                (0.88, 0.5, 0.2 * s + 0.04, 0.03),
                (1.1, 0.52 + rng.uniform(-0.1, 0.1), 0.3 * s, 0.03),
                (1.3, 0.38 + rng.uniform(-0.1, 0.1), 0.34 * s, 0.036),
            )
        )
        thorax = blend(
            0.06,
            ellipsoid((0.27, 0.1, 0.0), (0.2, 0.14, 0.14), (0, 0, 12)),
            ellipsoid((0.02, 0.04, 0.0), (0.16, 0.11, 0.12)),
            tube((-0.24, 0.0, 0.0, 0.05), (0.27, 0.1, 0.0, 0.07), (0.6, 0.1, 0.0, 0.07)),
            ellipsoid((-0.2, 0.07, 0.0), (0.05, 0.1, 0.07)),
        )
        gaster = placed(
            ellipsoid((0.0, 0.0, 0.0), (0.4, 0.26, 0.28)), (-0.64, 0.06, 0.0), (0, rng.uniform(-14, 14), 14)
        )
        rings = emboss(gaster, lambda p: 0.012 * np.sin(42.0 * p[:, 0] + 3.0 * p[:, 1]))
        legs = [self._leg(rng, side, row) for side in (-1, 1) for row in range(3)]
        body = blend(0.05, head, thorax, rings, *antennae, *legs)
        return emboss(sway(body, rng, 0.04), noise(rng, 0.003, 0.12))

    @staticmethod
    def _leg(rng: np.random.Generator, side: int, row: int) -> Field:
        hip, lean = 0.33 - 0.15 * row, (0.42, -0.12, -0.6)[row] + rng.uniform(-0.16, 0.16)
        rise = 0.3 + rng.uniform(-0.06, 0.06)
        return tube(
            (hip, 0.0, 0.08 * side, 0.06),
            (hip + 0.4 * lean, rise, 0.38 * side, 0.042),
            (hip + 0.5 * lean, rise - 0.02, 0.44 * side, 0.042),
            (hip + lean, -0.34, 0.66 * side, 0.032),
            (hip + 1.25 * lean, -0.45, 0.8 * side, 0.036),
            smooth=2,
        )


@SHAPES.register("cat")
@dataclass(frozen=True)
class Cat(Sculpture):
    """A cat on the prowl, tail raised."""

    vertices: int = option(3534, "how many vertices")

    def solid(self, rng: np.random.Generator) -> Field:
        trunk = tube((-0.52, 0.14, 0.0, 0.22), (-0.15, 0.1, 0.03, 0.24), (0.2, 0.1, 0.02, 0.23), (0.42, 0.18, 0.0, 0.2))
        neck = tube((0.4, 0.2, 0.0, 0.19), (0.62, 0.42, 0.0, 0.14))
        head = placed(self._head(), (0.7, 0.52, 0.03), (rng.uniform(-8, 8), rng.uniform(-40, -20), rng.uniform(-4, 8)))
        legs = []
        for side in (-1, 1):
            fore, hind = side * 0.16 + rng.uniform(-0.04, 0.04), -side * 0.17 + rng.uniform(-0.04, 0.04)
            legs.append(
                tube(
                    (0.38, 0.1, 0.11 * side, 0.13),
                    (0.34 + 0.4 * fore, -0.2, 0.14 * side, 0.09),
                    (0.38 + fore, -0.52, 0.13 * side, 0.064),
                    (0.42 + fore, -0.78, 0.13 * side, 0.062),
                )
            )
            legs.append(
                tube(
                    (-0.5, 0.1, 0.12 * side, 0.18),
                    (-0.38 + 0.5 * hind, -0.18, 0.16 * side, 0.12),
                    (-0.6 + hind, -0.48, 0.14 * side, 0.062),
                    (-0.54 + hind, -0.78, 0.14 * side, 0.06),
                )
            )
            legs.append(ellipsoid((0.47 + fore, -0.8, 0.13 * side), (0.11, 0.06, 0.075)))
            legs.append(ellipsoid((-0.48 + hind, -0.8, 0.14 * side), (0.12, 0.06, 0.075)))
        tail = tube(
            (-0.66, 0.22, 0.0, 0.085),
            (-0.92, 0.3, 0.05, 0.062),
            (-1.08, 0.6, 0.1, 0.058),
            (-1.0, 0.92, 0.05, 0.055),
            (-0.8, 1.02, rng.uniform(-0.15, 0.15), 0.05),
        )
        body = blend(0.12, blend(0.08, trunk, *legs), neck, tail)
        return emboss(sway(blend(0.06, body, head), rng, 0.04), noise(rng, 0.004, 0.3), noise(rng, 0.0015, 0.1))

    @staticmethod
    def _head() -> Field:
        skull = blend(
            0.07,
            ellipsoid((0.0, 0.0, 0.0), (0.22, 0.2, 0.22)),
            *both(lambda s: ellipsoid((0.07, -0.07, 0.11 * s), (0.12, 0.1, 0.1))),
            *both(lambda s: ellipsoid((0.21, -0.07, 0.045 * s), (0.07, 0.06, 0.065))),
            ellipsoid((0.17, -0.13, 0.0), (0.07, 0.05, 0.06)),
        )
        ears = both(lambda s: tube((-0.02, 0.12, 0.12 * s, 0.09), (-0.04, 0.34, 0.19 * s, 0.022), smooth=1))
        dents = both(lambda s: tube((0.08, 0.17, 0.14 * s, 0.045), (0.04, 0.3, 0.185 * s, 0.012), smooth=1))
        sockets = both(lambda s: ball(0.23, 0.04, 0.1 * s, 0.045))
        eyes = both(lambda s: ball(0.165, 0.035, 0.095 * s, 0.05))
        nose = ellipsoid((0.275, -0.03, 0.0), (0.03, 0.025, 0.035))
        return blend(0.015, carve(0.03, blend(0.04, skull, *ears), *dents, *sockets), *eyes, nose)


@SHAPES.register("bunny")
@dataclass(frozen=True)
class Bunny(Sculpture):
    """A furry rabbit at rest, ears laid back, head turned."""

    vertices: int = option(34835, "how many vertices")

    def solid(self, rng: np.random.Generator) -> Field:
        trunk = blend(
            0.2,
            ellipsoid((-0.2, -0.22, 0.0), (0.6, 0.5, 0.44), (0, 0, -8)),
            ellipsoid((0.3, -0.12, 0.0), (0.3, 0.42, 0.32), (0, 0, 15)),
        )
        haunches = both(lambda s: ellipsoid((-0.32, -0.4 + 0.03 * s, 0.34 * s), (0.35, 0.33, 0.2), (0, 0, -15 * s)))
        feet = both(
            lambda s: tube((-0.35, -0.7, 0.38 * s, 0.1), (0.02, -0.73, 0.42 * s, 0.1), (0.12, -0.73, 0.42 * s, 0.08))
        )
        paws = both(
            lambda s: tube(
                (0.4, -0.2, 0.17 * s, 0.15), (0.47, -0.55, 0.17 * s, 0.1), (0.58 + 0.05 * s, -0.74, 0.18 * s, 0.085)
            )
        )
        tail = emboss(ball(-0.83, -0.32, 0.05, 0.15), noise(rng, 0.012, 0.1))
        torso = blend(0.07, trunk, *haunches, *feet, *paws, tail)
        head = placed(self._head(), (0.5, 0.4, 0.0), (0, rng.uniform(-32, -15), rng.uniform(-8, 4)))
        fur = [noise(rng, 0.01, 0.3), noise(rng, 0.004, 0.1), noise(rng, 0.0018, 0.045)]
        ears = [self._ear(side, rng) for side in (-1, 1)]
        return sway(blend(0.06, emboss(blend(0.12, torso, head), *fur), *ears), rng, 0.05)

    @staticmethod
    def _head() -> Field:
        skull = blend(
            0.1,
            ellipsoid((0.0, 0.0, 0.0), (0.3, 0.25, 0.23), (0, 0, -20)),
            ellipsoid((0.2, -0.09, 0.0), (0.16, 0.13, 0.13), (0, 0, -20)),
            *both(lambda s: ellipsoid((0.1, -0.12, 0.12 * s), (0.13, 0.11, 0.1))),
        )
        mouth = tube((0.25, -0.2, 0.12, 0.012), (0.36, -0.17, 0.0, 0.014), (0.25, -0.2, -0.12, 0.012))
        cleft = tube((0.37, -0.07, 0.0, 0.012), (0.375, -0.17, 0.0, 0.012), smooth=1)
        sockets = both(lambda s: ellipsoid((0.13, 0.06, 0.245 * s), (0.09, 0.07, 0.07)))
        eyes = both(lambda s: ellipsoid((0.13, 0.055, 0.175 * s), (0.068, 0.06, 0.06)))
        lids = both(
            lambda s: tube((0.2, 0.06, 0.19 * s, 0.01), (0.13, 0.122, 0.205 * s, 0.014), (0.05, 0.06, 0.215 * s, 0.01))
        )
        nose = ellipsoid((0.36, -0.04, 0.0), (0.035, 0.03, 0.05))
        face = blend(0.02, carve(0.05, skull, *sockets), *eyes, *lids, nose)
        return carve(0.02, face, mouth, cleft)

    @staticmethod
    def _ear(side: int, rng: np.random.Generator) -> Field:
        shell = blade((0.0, 0.0, 0.42), (0.15, 0.05, 0.46), bend=0.15, taper=0.2)
        hollow = blade((0.0, 0.07, 0.44), (0.1, 0.05, 0.36), bend=0.15, taper=0.2)
        ear = emboss(carve(0.03, shell, hollow), noise(rng, 0.002, 0.1))
        turn = -36 + 9 * side + rng.uniform(-6, 6), -86 + 24 * side + rng.uniform(-6, 6), 25 * side
        return placed(ear, (0.42, 0.52, 0.1 * side - 0.02), turn)


@SHAPES.register("horse")
@dataclass(frozen=True)
class Horse(Sculpture):
    """A horse at a walk, one foreleg raised, with mane and tail."""

    vertices: int = option(112642, "how many vertices")
    detail: ClassVar[int] = 60000

    def solid(self, rng: np.random.Generator) -> Field:
        barrel = blend(
            0.12,
            tube((-0.45, 0.2, 0.0, 0.25), (-0.1, 0.13, 0.0, 0.27), (0.25, 0.15, 0.0, 0.26), (0.42, 0.22, 0.0, 0.22)),
            *both(lambda s: ellipsoid((-0.5, 0.2, 0.1 * s), (0.23, 0.25, 0.16))),
            *both(lambda s: ellipsoid((0.4, 0.16, 0.12 * s), (0.14, 0.24, 0.13), (0, 0, -20))),
            *both(lambda s: ellipsoid((0.52, 0.1, 0.08 * s), (0.1, 0.13, 0.09))),
            ellipsoid((0.28, 0.4, 0.0), (0.2, 0.07, 0.08)),
        )
        neck = blend(
            0.08,
            tube((0.42, 0.24, 0.0, 0.2), (0.6, 0.48, 0.0, 0.15), (0.75, 0.75, 0.0, 0.115), (0.83, 0.86, 0.0, 0.1)),
            tube((0.32, 0.38, 0.0, 0.12), (0.5, 0.62, 0.0, 0.09), (0.68, 0.86, 0.0, 0.075)),
        )
        legs = [leg for side in (-1, 1) for leg in self._legs(rng, side)]
        body = blend(0.05, blend(0.09, barrel, *legs), neck)
        head = placed(self._head(), (0.84, 0.88, 0.0), (rng.uniform(-6, 6), rng.uniform(-16, 16), rng.uniform(-6, 6)))
        muscles = [noise(rng, 0.009, 0.3), noise(rng, 0.0025, 0.11), noise(rng, 0.0007, 0.035)]
        hair = self._hair(rng)
        return sway(blend(0.02, emboss(blend(0.04, body, head), *muscles), *hair), rng, 0.04)

    @staticmethod
    def _legs(rng: np.random.Generator, side: int) -> tuple[Field, ...]:
        z, fore, hind = 0.13 * side, rng.uniform(0.02, 0.1), -0.12 * side + rng.uniform(-0.04, 0.04)
        if side > 0:  # the raised one
            front = [(0.42, 0.02, z, 0.13), (0.5, -0.22, z, 0.09), (0.72, -0.4, z, 0.065), (0.64, -0.64, z, 0.045)]
            hoof = (0.6, -0.72, z), (-0.5, -1.0, 0.0)
        else:
            front = [
                (0.4, 0.02, z, 0.13),
                (0.34, -0.2, z, 0.09),
                (0.36 - fore, -0.52, z, 0.066),
                (0.36 - fore, -0.8, z, 0.045),
            ]
            hoof = (0.4 - fore, -0.91, z), (0.1, -1.0, 0.0)
        x = -0.52 + hind
        back = [
            (-0.5, 0.12, z, 0.19),
            (-0.42 + 0.4 * hind, -0.16, 1.15 * z, 0.13),
            (x - 0.12, -0.46, z, 0.07),
            (x - 0.05, -0.8, z, 0.047),
        ]
        return (
            Horse._leg(front, *hoof),
            Horse._leg(back, (x, -0.91, z), (0.1, -1.0, 0.0)),
            ball(*front[2][:3], 0.074),
            ellipsoid((x - 0.13, -0.45, z), (0.08, 0.095, 0.06)),
        )

    @staticmethod
    def _leg(knots: list[tuple[float, float, float, float]], hoof: tuple[float, ...], down: tuple[float, ...]) -> Field:
        foot, way = np.array(hoof), np.array(down) / np.linalg.norm(down)
        sole = foot + 0.085 * way
        horn = common(
            0.02, tube((*foot - 0.02 * way, 0.055), (*foot + 0.15 * way, 0.1), smooth=1), half_space(sole, way)
        )
        return blend(0.03, tube(*knots, (*foot, 0.05)), ball(*knots[3][:3], 0.056), horn)

    @staticmethod
    def _head() -> Field:
        skull = blend(
            0.06,
            tube(
                (-0.02, 0.0, 0.0, 0.12), (0.16, -0.1, 0.0, 0.105), (0.33, -0.24, 0.0, 0.075), (0.43, -0.34, 0.0, 0.078)
            ),
            *both(lambda s: ellipsoid((0.06, -0.1, 0.055 * s), (0.13, 0.12, 0.055), (0, 0, -25))),
            *both(lambda s: ellipsoid((0.12, -0.03, 0.08 * s), (0.09, 0.035, 0.035), (0, 0, -35))),
        )
        lips = blend(
            0.02, ellipsoid((0.44, -0.4, 0.0), (0.05, 0.045, 0.06)), ellipsoid((0.38, -0.41, 0.0), (0.05, 0.035, 0.05))
        )
        nostrils = both(lambda s: ellipsoid((0.45, -0.312, 0.083 * s), (0.03, 0.017, 0.022), (0, 0, 50)))
        slit = [(0.34, -0.385, 0.072, 0.008), (0.44, -0.41, 0.06, 0.008), (0.487, -0.42, 0.0, 0.008)]
        mouth = tube(*slit, *((x, y, -z, r) for x, y, z, r in slit[1::-1]))
        sockets = both(lambda s: ellipsoid((0.13, -0.06, 0.13 * s), (0.05, 0.035, 0.04), (0, 0, -30)))
        eyes = both(lambda s: ball(0.13, -0.06, 0.085 * s, 0.034))
        ears = both(
            lambda s: tube(
                (-0.04, 0.08, 0.06 * s, 0.045), (-0.02, 0.18, 0.08 * s, 0.042), (0.02, 0.28, 0.075 * s, 0.012)
            )
        )
        dents = both(lambda s: tube((0.007, 0.1, 0.11 * s, 0.016), (0.032, 0.24, 0.085 * s, 0.014), smooth=1))
        face = carve(0.02, blend(0.03, skull, lips), *nostrils, *sockets, mouth)
        return blend(0.012, face, *eyes, carve(0.015, blend(0.02, *ears), *dents))

    @staticmethod
    def _hair(rng: np.random.Generator) -> tuple[Field, Field]:
        fall = 0.03 + 0.03 * rng.uniform()
        mane = tube(
            (0.84, 1.02, 0.03, 0.035),
            (0.68, 0.93, fall, 0.06),
            (0.52, 0.72, 0.05 + fall, 0.075),
            (0.36, 0.5, 0.04 + fall, 0.06),
            (0.24, 0.42, 0.02, 0.03),
        )
        wave = noise(rng, 0.8, 0.3)
        mane = emboss(mane, lambda p: 0.009 * np.sin(75.0 * (0.75 * p[:, 0] + 0.6 * p[:, 1]) + wave(p)))
        tail = tube(
            (-0.66, 0.36, 0.0, 0.05),
            (-0.8, 0.34, 0.0, 0.06),
            (-0.95, 0.12, 0.02, 0.085),
            (-1.03, -0.2, 0.06, 0.095),
            (-1.05, -0.5, 0.08, 0.06),
            (-1.1, -0.68, 0.1, 0.02),
        )
        return mane, emboss(tail, strands((-1.0, -0.1, 0.05), (0.12, 1.0, -0.08), 13, 0.008, noise(rng, 1.0, 0.5)))
