"""How often a wrong key, or an unmarked mesh, looks marked: p-values counted against what they claim.

    python scripts/false_positives.py OUT.jsonl MESH... [--method SPEC] [--keys N] [--unmarked]

Marks each MESH once (or, with --unmarked, leaves it alone) and reads it with N wrong keys, for a known and for an
unknown message. A line of OUT.jsonl a mesh says how many p-values fell to 10^-1, 10^-2, ... or below; the numbers
should be N times that, or fewer.
"""

import argparse
import hashlib
import json
from collections.abc import Callable
from datetime import date
from pathlib import Path
from typing import Any

from o3dmark import METHODS, Key, Watermark, read_mesh
from o3dmark.coding.detection import detect, wilson_interval
from o3dmark.methods import Extraction
from o3dmark.methods.shape_spectrum.method import ShapeSpectrum
from o3dmark.registry import spec_of

MESSAGE = "mine"
LEVELS = (0.1, 0.01, 0.001, 0.0001)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("meshes", nargs="+", type=Path)
    parser.add_argument("--method", default="saliency-scs")
    parser.add_argument("--keys", type=int, default=10_000)
    parser.add_argument("--unmarked", action="store_true")
    options = parser.parse_args()
    mark = Watermark(METHODS.make(options.method))
    for path in options.meshes:
        mesh = read_mesh(path)
        if not options.unmarked:
            mesh = mark.embed(mesh, MESSAGE, Key(hashlib.sha256(b"owner").digest()))
        result = {"mesh": path.stem, "marked": not options.unmarked, "method": spec_of(mark.method)}
        with options.out.open("a") as file:
            file.write(json.dumps(result | counted(mark, mesh, options.keys)) + "\n")


def counted(mark: Watermark, mesh: Any, keys: int) -> dict[str, Any]:
    """What ``keys`` strangers' keys read from a mesh."""
    read = reader(mark, mesh)
    log10_p: dict[str, list[float]] = {
        "known message": [],
        "known message, best of all readings": [],
        "known message, tries not charged": [],
        "unknown message": [],
    }
    hypotheses = set()
    for number in range(keys):
        key = Key(hashlib.sha256(f"stranger {number}".encode()).digest())
        extraction = read(key)
        hypotheses.add(extraction.hypotheses)
        expected = mark.code.encode(MESSAGE, mark.n_bits, key)
        log10_p["known message"].append(detect(extraction.soft, expected, hypotheses=extraction.hypotheses).log10_p)
        nearest = extraction.nearest(expected)
        log10_p["known message, best of all readings"].append(
            detect(nearest.soft, expected, hypotheses=nearest.hypotheses).log10_p
        )
        log10_p["known message, tries not charged"].append(detect(extraction.soft, expected).log10_p)
        blind = mark.code.decode(extraction.soft, key, hypotheses=extraction.hypotheses)
        log10_p["unknown message"].append(blind.log10_p)
    return {
        "keys": keys,
        "hypotheses": sorted(hypotheses),
        "date": date.today().isoformat(),
        "least_log10_p": {test: min(values) for test, values in log10_p.items()},
        "at_or_below": {
            test: {f"{level:g}": count(values, level, keys) for level in LEVELS} for test, values in log10_p.items()
        },
    }


def reader(mark: Watermark, mesh: Any) -> Callable[[Key], Extraction]:
    """Reads a mesh with one key after the other; what does not depend on the key is worked out once, if it can be."""
    if isinstance(mark.method, ShapeSpectrum):
        method, sights = mark.method, mark.method.observe(mesh)
        return lambda key: method.decoder(mark.n_bits, key).read(sights)
    return lambda key: mark.extract_bits(mesh, key)


def count(log10_p: list[float], level: float, trials: int) -> dict[str, object]:
    """How many p-values are at most ``level``, with the 95 % Wilson interval of their rate."""
    found = sum(10**value <= level for value in log10_p)
    low, high = wilson_interval(found, trials)
    return {"count": found, "expected_at_most": level * trials, "low": round(low, 6), "high": round(high, 6)}


if __name__ == "__main__":
    main()
