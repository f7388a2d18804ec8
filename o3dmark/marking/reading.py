"""Reading a received file: its parts one after the other until one speaks, every one of them charged.

First each part at first sight, which reads what was not disturbed, then each with a search. Where nobody says which
profile it was, all are tried, the default first: half of the evidence asked for is its, the others share the rest.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple

from o3dmark.coding.detection import Detection
from o3dmark.coding.keys import Key
from o3dmark.errors import MeshError, SpecError
from o3dmark.marking.views import View, views
from o3dmark.mesh.patch import Patch
from o3dmark.methods import NO_DEEPER, Depth, Extraction, Method
from o3dmark.profiles import DEFAULT_PROFILE, PROFILES, separate
from o3dmark.watermark import Reading, Watermark


@dataclass(frozen=True)
class PartReading:
    """What was read, in which part of the file, and under which profile, if that was not said.

    patches: those of the surface that spoke, in the file's unit and coordinates; none where it spoke as a whole.
    """

    part: str
    reading: Reading
    profile: str | None = None
    patches: tuple[Patch, ...] = ()


@dataclass(frozen=True)
class PartDetection:
    """Whether the mark is there, in which part of the file, and under which profile, if that was not said.

    patches: as in `PartReading`.
    """

    part: str
    detection: Detection
    profile: str | None = None
    patches: tuple[Patch, ...] = ()


class _Seen(NamedTuple):
    """What a part of the file shows to a watermark, all that is tried charged."""

    part: str
    watermark: Watermark
    profile: str | None
    extraction: Extraction
    patches: tuple[Patch, ...]


def extract(
    received: Any,
    watermark: Watermark | None,
    key: Key,
    *,
    reference: Any = None,
    false_positive_rate: float = 1e-4,
    depth: Depth = NO_DEEPER,
) -> PartReading:
    """Read the message of an `Asset`, mesh or point cloud; the most certain reading of its parts.

    ``watermark`` None: all profiles are tried. ``depth``: what else is looked for, where a method can. A wrong key
    yields a message no more often than ``false_positive_rate``, whatever the number of parts and profiles. Errors:
    MeshError when nothing can be read at all.
    """
    best: PartReading | None = None
    for part, mark, profile, extraction, patches in _all_seen(received, watermark, key, reference, depth):
        reading = mark.decode(extraction, key, false_positive_rate=false_positive_rate)
        if best is None or reading.decoded.log10_p < best.reading.decoded.log10_p:
            best = PartReading(part, reading, profile, patches)
        if best.reading.found:
            break
    assert best is not None
    return best


def detect(
    received: Any,
    watermark: Watermark | None,
    key: Key,
    message: str | None = None,
    *,
    reference: Any = None,
    false_positive_rate: float = 1e-6,
    depth: Depth = NO_DEEPER,
) -> PartDetection:
    """Is the mark in an `Asset`, mesh or point cloud? As `Watermark.detect`, in the part that shows it best.

    ``watermark`` None: all profiles are tried that can hold the message. ``depth``: as in `extract`. Where no part
    shows it, the answer is that of one that shows another message, if any. Errors: as `extract`; SpecError when no
    profile holds the message.
    """
    best: PartDetection | None = None
    wrong: SpecError | None = None
    for part, mark, profile, extraction, patches in _all_seen(received, watermark, key, reference, depth):
        try:
            found = mark.test(extraction, key, message, false_positive_rate=false_positive_rate)
        except SpecError as error:
            if profile is None:
                raise
            wrong = error
            continue
        if best is None or _telling(found) < _telling(best.detection):
            best = PartDetection(part, found, profile, patches)
        if best.detection.present:
            break
    if best is None:
        assert wrong is not None
        raise wrong
    return best


def _telling(detection: Detection) -> tuple[bool, bool, float]:
    """The less the more a detection tells."""
    return not detection.present, detection.other is None, detection.log10_p


def _all_seen(received: Any, watermark: Watermark | None, key: Key, reference: Any, depth: Depth) -> Iterator[_Seen]:
    """What can be read, the likeliest first. Errors: MeshError when nothing can."""
    names = [None] if watermark is not None else _profiles(reference)
    known: dict[bool, list[View]] = {}
    observed: dict[tuple[int, Method], Any] = {}
    error: MeshError | None = None
    read = False

    @cache
    def look_for(name: str | None) -> _Look:
        mark = PROFILES[str(name)] if watermark is None else watermark
        return _Look(name, replace(mark, method=mark.method.searching(depth)))

    for quick in (True, False) if reference is None else (False,):
        for look in map(look_for, names):  # one after the other: the first may speak, and the others take long to load
            if quick and look.watermark.method.quick is look.watermark.method:
                continue
            method = look.watermark.method
            if method.finds_pieces not in known:  # pieces cost more than a first sight of the whole
                known[method.finds_pieces] = views(received, method)
            looked_at = known[method.finds_pieces]
            for number, view in enumerate(looked_at):
                try:
                    extraction = look.extraction(number, view, key, reference, observed, quick=quick)
                except MeshError as refusal:
                    error = error or refusal
                    continue
                read = True
                charge = len(looked_at) * look.passes(reference) * _charge(look.profile, len(names))
                part = ": ".join(filter(None, [view.part, extraction.part]))
                patches = view.patches(extraction)
                yield _Seen(part, look.watermark, look.profile, extraction.times(charge), patches)
    if not read:
        raise error or MeshError("there is nothing to read")


@dataclass(frozen=True, eq=False)
class _Look:
    """A watermark to look for."""

    profile: str | None
    watermark: Watermark

    def extraction(
        self, number: int, view: View, key: Key, reference: Any, observed: dict[tuple[int, Method], Any], *, quick: bool
    ) -> Extraction:
        """What a view shows; ``observed`` keeps what it shows whatever the key and the profile."""
        method = self.watermark.method.quick if quick else self.watermark.method
        place = number, method.sight
        if place not in observed:
            observed[place] = method.sight.observe(view.shape)
        return method.extract(observed[place], self.watermark.n_bits, key, reference=reference)

    def passes(self, reference: Any) -> int:
        """How often the views are looked at: also at first sight, where the method knows the difference."""
        return 1 if reference is not None or self.watermark.method.quick is self.watermark.method else 2


def _profiles(reference: Any) -> list[str | None]:
    """All profiles that read marks of their own, the default first; beside a reference those that can use it."""
    return [name for name in separate() if reference is None or PROFILES[name].method.takes_reference]


def _charge(profile: str | None, count: int) -> int:
    """By how much p-values grow because ``count`` profiles are tried."""
    if count == 1:
        return 1
    return 2 if profile == DEFAULT_PROFILE else 2 * (count - 1)
