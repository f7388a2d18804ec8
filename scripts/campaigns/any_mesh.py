"""Which meshes shape-spectrum takes, and what it reads from them at half the benchmark's strengths: a CSV row a mesh.

    .venv/bin/python scripts/campaigns/any_mesh.py FOLDER... --out results/any_mesh.csv

Every mesh file of the folders, the smallest first, whatever it is like: holes, several pieces, mixed winding, thin
sheets, symmetry, non-manifold edges. A mesh is marked once (64 raw bits, 32 below 4 000 vertices) and the columns named
after attacks hold Corr, 1 - 2 errors / bits; or ``refused`` says why it cannot be marked. Rows that are there are kept.
"""

import argparse
import csv
import time
from pathlib import Path
from typing import Any

import numpy as np

from o3dmark import METHODS, METRICS, Key, O3dmarkError, attack_all, read_mesh
from o3dmark.files import FORMATS

ATTACKS = {
    "none": [],
    "similarity": ["similarity"],
    "noise 0.25 %": ["noise:amplitude=0.0025"],
    "umbrella 0.1 x 25": ["smooth:iterations=25"],
    "9 bit": ["quantise:bits=9"],
    "midpoint": ["subdivide:scheme=midpoint"],
    "simplify 40 %": ["simplify:ratio=0.4"],
}
FIELDS = ("mesh", "vertices", "refused", "bits", "mrms", "embed_s", *ATTACKS)
KEY, SEED = Key.from_passphrase("any mesh"), 0


def row(path: Path) -> dict[str, Any]:
    """What there is to say of one file."""
    found: dict[str, Any] = {"mesh": path.name}
    try:
        cover = read_mesh(path)
        found["vertices"] = len(cover.vertices)
        small = found["vertices"] < 4000
        found["bits"] = 32 if small else 64
        method = METHODS.make({"name": "shape-spectrum"} | ({"mrms": 7.7e-4} if small else {}))
        bits = np.random.default_rng(SEED).integers(0, 2, found["bits"])
        start = time.perf_counter()
        marked = method.embed(cover, bits, KEY)
        found["embed_s"] = round(time.perf_counter() - start, 1)
        found["mrms"] = f"{METRICS.make('mrms:samples=50000')(cover, marked):.3g}"
    except O3dmarkError as error:
        return found | {"refused": f"{type(error).__name__}: {error}"}
    for name, attacks in ATTACKS.items():
        try:
            read = method.extract(attack_all(marked, attacks, SEED), len(bits), KEY)
            found[name] = round(1.0 - 2.0 * float(np.mean(read.bits != bits)), 3)
        except O3dmarkError as error:  # the attack has no such meshes
            found[name] = type(error).__name__
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    files = [path for folder in options.folders for path in folder.iterdir() if path.suffix.lower() in FORMATS]
    new = not options.out.exists()
    done = set() if new else {found["mesh"] for found in csv.DictReader(options.out.open())}
    with options.out.open("a", newline="") as file:
        writer = csv.DictWriter(file, FIELDS)
        if new:
            writer.writeheader()
        for path in sorted(files, key=lambda path: path.stat().st_size):
            if path.name not in done:
                writer.writerow(row(path))
                file.flush()


if __name__ == "__main__":
    main()
