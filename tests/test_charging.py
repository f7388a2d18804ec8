"""Every reading tried is charged: what is chosen among many must be that much better than what stands alone."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from fixtures.shapes import icosphere
from o3dmark.coding.detection import detect
from o3dmark.coding.keys import Key
from o3dmark.mesh.surface import triangle_mesh
from o3dmark.methods import METHODS, Extraction, Method
from o3dmark.registry import describe
from o3dmark.watermark import Watermark

MESSAGE, N_BITS = "spot", 64
QUICK = {"shape-spectrum": "shape-spectrum:highest=6,rungs=6"}  # the same method with less to try


@dataclass(frozen=True)
class Told(Method):
    """Reads what it is told, whatever the mesh."""

    reading: Extraction | None = None

    def embed(self, mesh: Any, bits: ArrayLike, key: Key) -> Any:
        return mesh

    def extract(self, mesh: Any, n_bits: int, key: Key, *, reference: Any = None) -> Extraction:
        assert self.reading is not None
        return self.reading

    def capacity(self, mesh: Any) -> int:
        return N_BITS


def heard(key: Key, hypotheses: int, readings: int = 0) -> Watermark:
    """A watermark whose method heard MESSAGE, the best among so many readings; it keeps some of them."""
    soft = 2.0 * Watermark().code.encode(MESSAGE, N_BITS, key) - 1.0
    kept = np.tile(soft, (readings, 1)) if readings else None
    return Watermark(Told(Extraction(soft, hypotheses, readings=kept)), n_bits=N_BITS)


def test_reading_a_message_charges_all_hypotheses(key: Key) -> None:
    one, many = (heard(key, count).extract(None, key) for count in (1, 3465))
    assert one.message == many.message == MESSAGE
    assert many.p_value == pytest.approx(3465 * one.p_value)


def test_what_is_a_message_alone_is_none_among_enough_others(key: Key) -> None:
    """A wrong key yields a message no more often than the rate allows, however many readings were tried for it."""
    alone = heard(key, 1).extract(None, key).p_value
    enough = math.ceil(1e-4 / alone)
    assert heard(key, enough // 2).extract(None, key).found
    assert not heard(key, enough * 2).extract(None, key).found


@pytest.mark.parametrize("message", [None, MESSAGE])
def test_detection_charges_all_hypotheses(key: Key, message: str | None) -> None:
    one, many = (heard(key, count).detect(None, key, message) for count in (1, 3465))
    assert many.log10_p == pytest.approx(one.log10_p + math.log10(3465))
    assert many.hypotheses == 3465 * one.hypotheses


def test_known_bits_may_choose_among_the_readings_and_pay_for_all(key: Key) -> None:
    one, many = heard(key, 1).detect(None, key, MESSAGE), heard(key, 1, readings=5000).detect(None, key, MESSAGE)
    assert many.hypotheses == 5000
    assert many.log10_p == pytest.approx(one.log10_p + math.log10(5000))


def test_raw_bits_are_charged_alike(key: Key) -> None:
    bits = Watermark().code.encode(MESSAGE, N_BITS, key)
    for count in (1, 3465):
        extraction = heard(key, count).extract_bits(None, key)
        alone = detect(extraction.soft, bits).log10_p
        assert extraction.detect(bits).log10_p == pytest.approx(alone + math.log10(count))


@pytest.mark.parametrize("name", [name for name in METHODS if not METHODS.make(name).layers])  # layers: test_layered
def test_no_method_keeps_more_readings_than_it_counts(name: str, key: Key) -> None:
    """In vain, when all has been tried: the bits that were chosen are among those that were counted."""
    vertices, triangles = icosphere(3)
    egg = triangle_mesh((vertices + 0.25 * np.roll(vertices, 1, axis=1) ** 2) * [1.0, 1.3, 1.7], triangles)
    read = METHODS.make(QUICK.get(name, name)).extract(egg, 16, key)
    searches = any(option == "search" for option, *_ in describe(METHODS[name]))
    # what is shown whatever the bits is charged by itself
    assert read.hypotheses > 1000 or read.log10_p is not None or not searches
    if read.readings is not None:
        assert sum(len(readings) / charge for readings, charge in read.charged) <= 1.0
        assert read.hypotheses in {charge for _, charge in read.charged}
        assert np.abs(read.readings - read.soft).max(axis=1).min() < 1e-6
        assert len(np.unique(read.readings, axis=0)) > 0.9 * len(read.readings)
