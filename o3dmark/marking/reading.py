"""Reading a received file: the views of it one after the other until one speaks, every one of them charged."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from o3dmark.coding.detection import Detection
from o3dmark.coding.keys import Key
from o3dmark.errors import MeshError
from o3dmark.marking.views import views
from o3dmark.methods import Extraction
from o3dmark.watermark import Reading, Watermark


@dataclass(frozen=True)
class PartReading:
    """What was read, and in which part of the file."""

    part: str
    reading: Reading


@dataclass(frozen=True)
class PartDetection:
    """Whether the mark is there, and in which part of the file."""

    part: str
    detection: Detection


def extract(
    received: Any, watermark: Watermark, key: Key, *, reference: Any = None, false_positive_rate: float = 1e-4
) -> PartReading:
    """Read the message of an `Asset`, mesh or point cloud; the most certain reading of its views.

    A wrong key yields a message no more often than ``false_positive_rate``, whatever the number of views.
    Errors: MeshError when no view can be read at all.
    """
    best: PartReading | None = None
    for part, extraction in _extractions(received, watermark, key, reference):
        reading = watermark.decode(extraction, key, false_positive_rate=false_positive_rate)
        if best is None or reading.decoded.log10_p < best.reading.decoded.log10_p:
            best = PartReading(part, reading)
        if best.reading.found:
            break
    assert best is not None
    return best


def detect(
    received: Any,
    watermark: Watermark,
    key: Key,
    message: str | None = None,
    *,
    reference: Any = None,
    false_positive_rate: float = 1e-6,
) -> PartDetection:
    """Is the mark in an `Asset`, mesh or point cloud? As `Watermark.detect`, in the part that shows it best.

    Where no part does, the answer is that of one that shows another message, if any.
    """
    best: PartDetection | None = None
    for part, extraction in _extractions(received, watermark, key, reference):
        found = watermark.test(extraction, key, message, false_positive_rate=false_positive_rate)
        if best is None or _telling(found) < _telling(best.detection):
            best = PartDetection(part, found)
        if best.detection.present:
            break
    assert best is not None
    return best


def _telling(detection: Detection) -> tuple[bool, bool, float]:
    """The less the more a detection tells."""
    return not detection.present, detection.other is None, detection.log10_p


def _extractions(received: Any, watermark: Watermark, key: Key, reference: Any) -> Iterator[tuple[str, Extraction]]:
    """(part, extraction) of each view that can be read, charged for all views. Errors: MeshError when none can."""
    looked_at = views(received)
    error: MeshError | None = None
    read = False
    for view in looked_at:
        try:
            extraction = watermark.extract_bits(view.shape, key, reference=reference)
        except MeshError as refusal:
            error = error or refusal
            continue
        read = True
        yield view.part, charged(extraction, len(looked_at))
    if not read:
        raise error or MeshError("there is nothing to read")


def charged(extraction: Extraction, views: int) -> Extraction:
    """An extraction that was chosen among those of so many views."""
    tried = max(extraction.hypotheses, 0 if extraction.readings is None else len(extraction.readings))
    return replace(extraction, hypotheses=tried * views)
