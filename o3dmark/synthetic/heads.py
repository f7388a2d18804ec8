"""Two heads that look along z: the bust of a child with her hair in a knot, and a classical head."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from o3dmark.registry import option
from o3dmark.synthetic import SHAPES, Sculpture
from o3dmark.synthetic.field import (
    Field,
    ball,
    blend,
    both,
    carve,
    common,
    ellipsoid,
    emboss,
    half_space,
    noise,
    placed,
    scaled,
    strands,
    sway,
    tube,
)


@SHAPES.register("bimba")
@dataclass(frozen=True)
class Bimba(Sculpture):
    """A child's bust: braided knot, fringe, bare neck and a pleated bodice."""

    vertices: int = option(8857, "how many vertices")
    detail: ClassVar[int] = 40000

    def solid(self, rng: np.random.Generator) -> Field:
        face = scaled(_face(rng, cheek=0.145, nose=0.9), (1.0, 0.94, 1.0))
        head = blend(0.03, face, *both(_ear), *self._hair(rng))
        head = placed(head, (0.0, 0.39, 0.08), (rng.uniform(2, 9), rng.uniform(-18, -8), rng.uniform(-8, -3)), 0.95)
        neck = tube((0.0, 0.2, 0.0, 0.2), (0.01, -0.15, -0.04, 0.19), (0.0, -0.4, -0.06, 0.24))
        chest = blend(
            0.2,
            ellipsoid((0.0, -0.72, -0.05), (0.48, 0.42, 0.32)),
            *both(lambda s: ellipsoid((0.42 * s, -0.62 + 0.03 * s, -0.06), (0.24, 0.2, 0.2))),
        )
        skin = blend(0.18, neck, chest)
        pleats = strands((0.0, -0.2, -0.05), (0.0, 1.0, 0.1), 34, 0.012, noise(rng, 0.9, 0.5))
        hem = emboss(
            tube((-0.4, -0.42, 0.1, 0.05), (0.0, -0.6, 0.32, 0.05), (0.4, -0.42, 0.1, 0.05)), noise(rng, 0.006, 0.1)
        )
        dress = emboss(lambda p: chest(p) - 0.025, pleats)
        dress = common(0.03, dress, half_space((0.0, -0.58, 0.3), (0.0, 1.0, 0.6)))
        bust = blend(0.02, blend(0.06, skin, head), dress, hem)
        foot = half_space((0.0, -1.02, 0.0), (0.05, -1.0, 0.04))
        bust = emboss(common(0.04, bust, foot), noise(rng, 0.004, 0.25), noise(rng, 0.001, 0.06))
        return sway(scaled(bust, (1.06, 1.0, 0.94)), rng, 0.05)

    @staticmethod
    def _hair(rng: np.random.Generator) -> tuple[Field, ...]:
        wave = noise(rng, 1.6, 0.35)
        cap = carve(
            0.06, ellipsoid((0.0, 0.17, -0.1), (0.46, 0.44, 0.5)), ellipsoid((0.03, -0.22, 0.5), (0.4, 0.56, 0.52))
        )
        nape = ellipsoid((0.0, -0.1, -0.34), (0.3, 0.26, 0.2))
        combed = strands((0.0, 0.2, -0.3), (0.1, 0.25, -1.0), 30, 0.013, wave)
        knot = emboss(
            ellipsoid((0.06, 0.28, -0.66), (0.2, 0.21, 0.19)),
            strands((0.06, 0.28, -0.66), (0.5, 0.2, -1), 9, 0.018, wave),
        )
        braid = tube(
            (-0.43, 0.12, 0.02, 0.05),
            (-0.32, 0.46, 0.08, 0.06),
            (0.0, 0.62, 0.1, 0.065),
            (0.32, 0.46, 0.08, 0.06),
            (0.43, 0.12, 0.02, 0.05),
        )
        braid = emboss(
            braid, lambda p: 0.013 * np.sin(20.0 * np.arctan2(p[:, 0], p[:, 1] - 0.1) + 22.0 * (p[:, 2] - 0.1))
        )
        return emboss(blend(0.1, cap, nape), combed), knot, braid


@SHAPES.register("venus")
@dataclass(frozen=True)
class Venus(Sculpture):
    """A classical head with parted, waving hair, broken off at the neck."""

    vertices: int = option(100759, "how many vertices")
    detail: ClassVar[int] = 60000

    def solid(self, rng: np.random.Generator) -> Field:
        face = scaled(_face(rng, cheek=0.12, nose=1.0), (0.95, 1.06, 1.0))
        head = blend(0.025, face, *self._hair(rng))
        head = placed(head, (0.0, 0.22, 0.05), (rng.uniform(-4, 4), rng.uniform(8, 16), rng.uniform(3, 8)), 1.3)
        neck = blend(
            0.1,
            tube((0.0, 0.0, -0.1, 0.3), (-0.03, -0.5, -0.16, 0.27), (-0.04, -1.0, -0.12, 0.33)),
            tube((0.3, -0.25, -0.1, 0.07), (0.12, -0.7, 0.1, 0.07), (0.0, -1.0, 0.2, 0.08)),
            tube((-0.32, -0.25, -0.1, 0.06), (-0.2, -0.7, 0.06, 0.06), (-0.1, -1.0, 0.18, 0.07)),
        )
        marble = blend(0.08, head, neck)
        fracture = noise(rng, 0.02, 0.3)
        broken = half_space((0.0, -0.88, 0.0), (0.1, -1.0, 0.15))
        marble = common(0.03, marble, lambda p: broken(p) + fracture(p))
        weather = [noise(rng, 0.005, 0.25), noise(rng, 0.0013, 0.07), noise(rng, 0.0005, 0.025)]
        return sway(emboss(marble, *weather), rng, 0.03)

    @staticmethod
    def _hair(rng: np.random.Generator) -> tuple[Field, ...]:
        slow, fine = noise(rng, 1.5, 0.4), noise(rng, 1.5, 0.3)
        cap = carve(
            0.05, ellipsoid((0.0, 0.18, -0.1), (0.47, 0.45, 0.52)), ellipsoid((0.0, -0.25, 0.5), (0.36, 0.6, 0.5))
        )
        parting = tube((0.0, 0.48, 0.3, 0.02), (0.0, 0.62, 0.1, 0.02), (0.0, 0.66, -0.2, 0.015))
        waves = both(
            lambda s: tube(
                (0.02 * s, 0.42, 0.34, 0.06),
                (0.2 * s, 0.36, 0.32, 0.09),
                (0.36 * s, 0.2, 0.17, 0.1),
                (0.42 * s, 0.0, 0.0, 0.1),
                (0.38 * s, -0.16, -0.2, 0.1),
                (0.2 * s, -0.22, -0.42, 0.1),
            )
        )
        locks = strands((0.0, 0.0, 0.0), (1.0, 0.1, 0.0), 22, 0.016, slow)
        threads = strands((0.0, 0.0, 0.0), (1.0, 0.1, 0.0), 75, 0.004, fine)
        knot = emboss(
            ellipsoid((0.0, -0.08, -0.6), (0.2, 0.19, 0.2)),
            strands((0.0, -0.08, -0.6), (0.3, 0.3, -1), 11, 0.016, fine),
        )
        nape = ellipsoid((0.0, -0.08, -0.28), (0.36, 0.28, 0.3))
        temples = both(lambda s: ellipsoid((0.34 * s, -0.02, -0.06), (0.1, 0.22, 0.18)))
        hair = emboss(blend(0.06, cap, nape, *temples, *waves), locks, threads)
        return carve(0.03, hair, parting), knot


def _face(rng: np.random.Generator, cheek: float, nose: float) -> Field:
    """Skull, features and ears about the origin, about 0.45 in radius; ``cheek`` and ``nose`` are sizes."""
    skull = blend(
        0.12,
        ellipsoid((0.0, 0.14, -0.08), (0.41, 0.42, 0.46)),
        ellipsoid((0.0, -0.17, 0.11), (0.29, 0.35, 0.3)),
        *both(lambda s: ellipsoid((0.17 * s, -0.13, 0.25), (cheek, cheek, 0.12))),
        ball(0.0, -0.43, 0.28, 0.09),
    )
    brows = both(
        lambda s: tube((0.05 * s, 0.1, 0.38, 0.035), (0.17 * s, 0.14, 0.36, 0.035), (0.29 * s, 0.07, 0.23, 0.03))
    )
    sockets = both(lambda s: ellipsoid((0.155 * s, 0.02, 0.46), (0.1, 0.065, 0.1)))
    skull = carve(0.08, blend(0.06, skull, *brows), *sockets)
    face = blend(0.035, skull, _nose(nose))
    face = carve(0.02, face, *both(lambda s: ellipsoid((0.038 * s, -0.2, 0.44 * nose), (0.018, 0.022, 0.028))))
    return blend(0.01, carve(0.012, blend(0.025, face, *_lips()), _mouth()), *both(lambda s: _eye(s, rng)))


def _nose(size: float) -> Field:
    return blend(
        0.03,
        tube((0.0, 0.1, 0.36, 0.03), (0.0, -0.03, 0.425 * size, 0.04), (0.0, -0.13, 0.485 * size, 0.052)),
        *both(lambda s: ellipsoid((0.05 * s, -0.15, 0.43 * size), (0.045, 0.038, 0.06))),
    )


def _lips() -> tuple[Field, Field]:
    upper = tube(
        (-0.125, -0.292, 0.362, 0.011),
        (-0.045, -0.264, 0.4, 0.022),
        (0.0, -0.272, 0.402, 0.018),
        (0.045, -0.264, 0.4, 0.022),
        (0.125, -0.288, 0.362, 0.011),
    )
    lower = tube((-0.115, -0.3, 0.362, 0.011), (0.0, -0.324, 0.388, 0.03), (0.115, -0.296, 0.362, 0.011))
    return upper, lower


def _mouth() -> Field:
    return tube(
        (-0.14, -0.293, 0.372, 0.008),
        (-0.06, -0.291, 0.408, 0.01),
        (0.0, -0.297, 0.416, 0.01),
        (0.06, -0.29, 0.408, 0.01),
        (0.14, -0.288, 0.372, 0.008),
    )


def _eye(side: int, rng: np.random.Generator) -> Field:
    ball_ = ellipsoid((0.155 * side, 0.012, 0.295), (0.08, 0.058, 0.075))
    droop = rng.uniform(-0.006, 0.006)
    upper = tube(
        (0.065 * side, 0.0, 0.36, 0.014),
        (0.11 * side, 0.045, 0.36, 0.018),
        (0.17 * side, 0.055 + droop, 0.35, 0.02),
        (0.25 * side, 0.005, 0.308, 0.015),
    )
    lower = tube(
        (0.065 * side, 0.0, 0.36, 0.012), (0.15 * side, -0.04, 0.358, 0.014), (0.25 * side, 0.005, 0.308, 0.012)
    )
    return blend(0.01, ball_, upper, lower)


def _ear(side: int) -> Field:
    rim = tube(
        (0.38 * side, 0.02, 0.04, 0.022),
        (0.42 * side, 0.12, 0.0, 0.028),
        (0.45 * side, 0.1, -0.1, 0.03),
        (0.43 * side, -0.03, -0.11, 0.028),
        (0.39 * side, -0.14, -0.03, 0.035),
    )
    return blend(0.03, rim, ellipsoid((0.39 * side, 0.0, -0.03), (0.04, 0.12, 0.08)))
