"""The choice among readings: the most significant, and of two nearly as good the one with the likelier step."""

from collections.abc import Iterator

import numpy as np
import pytest

from o3dmark.coding.keys import Key
from o3dmark.methods import Extraction
from o3dmark.methods.shape_spectrum.decoder import Decoder
from o3dmark.methods.shape_spectrum.fit import log10_p
from o3dmark.methods.shape_spectrum.hypotheses import Measurement
from o3dmark.methods.shape_spectrum.projections import Projections
from o3dmark.methods.shape_spectrum.search import Round
from o3dmark.solid.spectrum import Band

BITS = np.random.default_rng(0).integers(0, 2, 32)
STEPS = 2.0 ** -np.arange(0.0, 8.0, 0.5)  # half an octave apart


@pytest.fixture(scope="module")
def projections(key: Key) -> Projections:
    return Projections.of(key, Band(2.0, 3.0, 6.0), 32)


class Hearsay:
    """Hypotheses of one round, which are measured as one is told: values (K,) and what to call them."""

    deformed: tuple[()] = ()

    def __init__(self, **values: np.ndarray) -> None:
        self.values = values

    def __iter__(self) -> Iterator[Round]:
        yield Round([self], fit=False, area_diagonal_ratio=2.0)  # type: ignore[list-item]

    def measurements(self, _: Projections) -> Iterator[Measurement]:
        for view, values in self.values.items():
            yield Measurement(values, np.zeros((len(values), 8)), np.eye(8), view)


def written(projections: Projections, step: float, noise: float = 0.0) -> np.ndarray:
    """Values (K,) that carry BITS at a step, with noise in steps."""
    rng = np.random.default_rng(1)
    whole = rng.integers(-3, 4, len(BITS)) + BITS / 2.0 + noise * rng.standard_normal(len(BITS))
    return step * (whole + projections.dither)


def read(projections: Projections, **values: np.ndarray) -> Extraction:
    """With a surface of ratio 2, a step of 2 x 1/2 = 1 is expected."""
    return Decoder(projections, STEPS, len(BITS), 0.5).read(Hearsay(**values))  # type: ignore[arg-type]


def evidence(projections: Projections, values: np.ndarray, step: float) -> float:
    return float(log10_p((values / step - projections.dither)[None], len(BITS))[0])


def test_a_step_far_from_the_expected_needs_better_evidence(projections: Projections) -> None:
    """Two decades for every octave but the first: five octaves off, the better reading loses, and half as far it wins.

    Without that, the smallest steps, to which any value is near, would outdo a mark that was disturbed.
    """
    disturbed = written(projections, 1.0, 0.08)
    for octaves, winner in ((5, "near"), (2, "far")):
        far = 2.0**-octaves
        clearer = written(projections, far, 0.06)
        lead = evidence(projections, disturbed, 1.0) - evidence(projections, clearer, far)
        assert 2.0 * (2 - 1) < lead < 2.0 * (5 - 1)
        reading = read(projections, near=disturbed, far=clearer)
        assert reading.view == winner
        assert reading.step == (1.0 if winner == "near" else far)
        assert np.array_equal(reading.bits, BITS)


def test_within_an_octave_all_steps_are_alike(projections: Projections) -> None:
    slightly, exact = written(projections, 1.0, 0.03), written(projections, 0.5)
    assert read(projections, near=slightly, far=exact).view == "far"


def test_every_measurement_at_every_step_is_a_reading(projections: Projections) -> None:
    reading = read(projections, near=written(projections, 1.0), far=np.zeros(32))
    assert reading.readings is not None
    assert reading.hypotheses == 2 * len(STEPS) / 0.8  # the rest is for deformations, of which there are none here
    assert len(reading.readings) == 2 * len(STEPS)
