"""Golden marks: meshes marked by earlier versions are still read. If one of these tests fails, old marks are lost.

scripts/make_golden_marks.py made them; a failure here is never mended by making them again.
"""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from o3dmark import PROFILES, Key, read_mesh

FOLDER = Path(__file__).parent / "golden" / "marks"
MANIFEST: dict[str, dict[str, Any]] = json.loads((FOLDER / "manifest.json").read_text())
FRAMES = {("volume", False), ("area", False), ("volume", True), ("area", True)}
CASES = {"robust", "sheet", "turned", "turned_sheet", "open", "soup", "cad", "bits8", "bits16"}
LATER = {"halved", "bulging", "mirrored", "smoothed"}
STRANGER = Key(bytes(range(1, 33)))


@pytest.mark.parametrize("name", MANIFEST)
def test_it_is_still_read(name: str, key: Key) -> None:
    golden, mesh = MANIFEST[name], read_mesh(FOLDER / name)
    log10_p = _read_bits(golden, mesh, key) if "bits" in golden else _read_message(golden, mesh, key)
    assert log10_p <= golden["log10_p_at_most"]


def test_another_key_reads_nothing() -> None:
    """On one small file: finding nothing takes every round there is."""
    name = "bulging.ply"
    reading = PROFILES[MANIFEST[name]["profile"]].extract(read_mesh(FOLDER / name), STRANGER)
    assert not reading.found


def test_every_profile_and_every_case_has_a_golden() -> None:
    assert {golden["profile"] for golden in MANIFEST.values()} == set(PROFILES)
    assert {(golden["frame"], golden["turned"]) for golden in MANIFEST.values() if golden["frame"]} == FRAMES
    assert {f"{name}.ply" for name in CASES | LATER} <= set(MANIFEST)


def test_the_manifest_lists_the_folder() -> None:
    files = {path.name for path in FOLDER.iterdir()}
    assert files == {*MANIFEST, "manifest.json"}
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) < 2_000_000


def _read_message(golden: dict[str, Any], mesh: Any, key: Key) -> float:
    """log10 of the p-value with which the message is read."""
    reading = PROFILES[golden["profile"]].extract(mesh, key)
    assert reading.message == golden["message"]
    return math.log10(reading.p_value)


def _read_bits(golden: dict[str, Any], mesh: Any, key: Key) -> float:
    """log10 of the p-value of bits that are all right."""
    bits = [int(sign) for sign in golden["bits"]]
    extraction = replace(PROFILES[golden["profile"]], n_bits=len(bits)).extract_bits(mesh, key)
    assert extraction.bits.tolist() == bits
    return math.log10(extraction.hypotheses) - len(bits) * math.log10(2.0)
