"""How often a wrong key, or an unmarked mesh, looks marked: p-values counted against what they claim.

    python scripts/false_positives.py OUT.json MESH [--method SPEC] [--keys N] [--unmarked]

Marks MESH once (or, with --unmarked, leaves it alone) and reads it with N wrong keys, for a known and for an unknown
message. Every line of OUT.json says how many p-values fell to 10^-1, 10^-2, ... or below; the numbers should be N
times that, or fewer.
"""

import argparse
import hashlib
import json
from datetime import date
from pathlib import Path

from o3dmark import METHODS, Key, Watermark, read_mesh
from o3dmark.detection import detect, wilson_interval
from o3dmark.registry import spec_of

LEVELS = (0.1, 0.01, 0.001, 0.0001)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("mesh", type=Path)
    parser.add_argument("--method", default="saliency-scs")
    parser.add_argument("--keys", type=int, default=10_000)
    parser.add_argument("--unmarked", action="store_true")
    options = parser.parse_args()
    mark, message = Watermark(METHODS.make(options.method)), "mine"
    mesh = read_mesh(options.mesh)
    if not options.unmarked:
        mesh = mark.embed(mesh, message, Key(hashlib.sha256(b"owner").digest()))
    log10_p: dict[str, list[float]] = {"known message": [], "unknown message": []}
    hypotheses = set()
    for number in range(options.keys):
        key = Key(hashlib.sha256(f"stranger {number}".encode()).digest())
        extraction = mark.extract_bits(mesh, key)
        hypotheses.add(extraction.hypotheses)
        expected = mark.code.encode(message, mark.n_bits, key)
        log10_p["known message"].append(detect(extraction.soft, expected, hypotheses=extraction.hypotheses).log10_p)
        blind = mark.code.decode(extraction.soft, key, hypotheses=extraction.hypotheses)
        log10_p["unknown message"].append(blind.log10_p)
    result = {
        "mesh": options.mesh.stem,
        "marked": not options.unmarked,
        "method": spec_of(mark.method),
        "keys": options.keys,
        "hypotheses": sorted(hypotheses),
        "date": date.today().isoformat(),
        "least_log10_p": {test: min(values) for test, values in log10_p.items()},
        "at_or_below": {
            test: {f"{level:g}": count(values, level, options.keys) for level in LEVELS}
            for test, values in log10_p.items()
        },
    }
    with options.out.open("a") as file:
        file.write(json.dumps(result) + "\n")


def count(log10_p: list[float], level: float, trials: int) -> dict[str, object]:
    """How many p-values are at most ``level``, with the 95 % Wilson interval of their rate."""
    found = sum(10**value <= level for value in log10_p)
    low, high = wilson_interval(found, trials)
    return {"count": found, "expected_at_most": level * trials, "low": round(low, 6), "high": round(high, 6)}


if __name__ == "__main__":
    main()
