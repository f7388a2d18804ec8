"""Measure saliency-scs on the benchmark's attacks: one row for each mesh, synchronisation, payload, seed and attack.

    python scripts/measure_scs.py OUT.csv MESH... [--method SPEC]... [--bits N]... [--seeds N]

Rows go to OUT.csv; the figures in README's table come from it.
"""

import argparse
import csv
import hashlib
import sys
import time
from pathlib import Path

import numpy as np

from o3dmark.attacks import attack_all
from o3dmark.coding.keys import Key
from o3dmark.files import read_mesh
from o3dmark.methods import METHODS
from o3dmark.metrics.correlation import bit_errors, correlation
from o3dmark.metrics.distance import surface_distance

ATTACKS = [
    "identity",
    "reorder",
    "similarity",
    *(f"noise:amplitude={amplitude}" for amplitude in (0.0005, 0.001, 0.003, 0.005)),
    *(f"quantise:bits={bits}" for bits in (11, 10, 9, 8, 7)),
    *(f"smooth:iterations={iterations}" for iterations in (5, 10, 30, 50)),
    *(f"subdivide:scheme={scheme}" for scheme in ("loop", "midpoint", "sqrt3")),
]
COLUMNS = """
    mesh vertices method n_bits seed mrms hausdorff attack corr bit_errors hypotheses note embed_s extract_s
""".split()  # noqa: SIM905


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("meshes", type=Path, nargs="+")
    parser.add_argument("--method", action="append")
    parser.add_argument("--bits", type=int, action="append")
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args()
    with options.out.open("w", newline="") as file:
        rows = csv.DictWriter(file, COLUMNS)
        rows.writeheader()
        for path in options.meshes:
            for spec in options.method or ["saliency-scs"]:
                for n_bits in options.bits or [16, 64]:
                    for seed in range(options.seeds):
                        rows.writerows(measure(path, spec, n_bits, seed))
                        file.flush()


def measure(path: Path, spec: str, n_bits: int, seed: int) -> list[dict[str, object]]:
    """Mark one mesh once, attack it by everything, read each."""
    cover, method = read_mesh(path), METHODS.make(spec)
    key = Key(hashlib.sha256(f"measure {seed}".encode()).digest())
    bits = np.random.default_rng(seed).integers(0, 2, n_bits)
    started = time.perf_counter()
    marked = method.embed(cover, bits, key)
    embedding, distance = time.perf_counter() - started, surface_distance(cover, marked)
    common = {
        "mesh": path.stem,
        "vertices": len(cover.vertices),
        "method": spec,
        "n_bits": n_bits,
        "seed": seed,
        "mrms": f"{distance.mrms:.4g}",
        "hausdorff": f"{distance.hausdorff:.4g}",
        "embed_s": f"{embedding:.2f}",
    }
    rows = []
    for attack in ATTACKS:
        attacked = attack_all(marked, [attack], seed)
        started = time.perf_counter()
        read = method.extract(attacked, n_bits, key, reference=cover if method.informed else None)
        taken = time.perf_counter() - started
        rows.append(
            common
            | {
                "attack": attack,
                "corr": f"{correlation(bits, read.bits):.3f}",
                "bit_errors": bit_errors(bits, read.bits).errors,
                "hypotheses": read.hypotheses,
                "note": read.note,
                "extract_s": f"{taken:.2f}",
            }
        )
        print(path.stem, spec, n_bits, seed, attack, rows[-1]["corr"], read.note, f"{taken:.1f} s", file=sys.stderr)
    return rows


if __name__ == "__main__":
    main()
