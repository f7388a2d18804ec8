"""What shape-spectrum reads from fragments when the unmarked cover is at hand: meshes x keys x crops, one CSV row each.

    .venv/bin/python scripts/campaigns/informed_crop.py MESH... --keys 2 --out results/informed_crop.csv

Raw bits, no payload code; ``corr`` is 1 - 2 errors / bits and ``log10_p`` the chance of as good an agreement by luck,
all hypotheses charged. Beside every reading stand two that ought to say nothing: the same fragment read with a wrong
key, and the unmarked cover cropped and moved in the same way. The reader is given fragment, cover and key, no more.
Rows that the output holds already are not measured again.
"""

import argparse
import csv
import time
from pathlib import Path
from typing import Any

import numpy as np

from o3dmark.attacks import attack_all
from o3dmark.coding.detection import detect
from o3dmark.coding.keys import Key
from o3dmark.files import read_mesh
from o3dmark.methods import METHODS

MOVED = "similarity:smallest=0.2,largest=5"
TABLE = {
    **{f"crop {share:g} %": [f"crop:share={share / 100}", MOVED] for share in (10, 30, 50, 70)},
    "crop 50 %, noise 0.3 %": ["crop:share=0.5", "noise:amplitude=0.003", MOVED],
    "simplify 50 %": ["simplify:ratio=0.5", MOVED],
}
FIELDS = (
    *("mesh", "vertices", "bits", "seed", "attack", "corr", "errors", "log10_p", "wrong_key_corr", "wrong_key_log10_p"),
    *("unmarked_corr", "unmarked_log10_p", "hypotheses", "seconds", "note"),
)
N_BITS = 64


def row(method: Any, cover: Any, marked: Any, seed: int, attack: str) -> dict[str, Any]:
    """The figures of one attack."""
    key, bits = sent(seed)
    wrong = Key.from_passphrase(f"somebody else {seed}")
    fragment = attack_all(marked, TABLE[attack], rng=seed)
    start = time.perf_counter()
    read, figures = reading(method, fragment, cover, key, bits)
    seconds = round(time.perf_counter() - start, 1)
    _, wrong_figures = reading(method, fragment, cover, wrong, bits)
    _, unmarked_figures = reading(method, attack_all(cover, TABLE[attack], rng=seed), cover, key, bits)
    return {
        "errors": int(np.count_nonzero(read.bits != bits)),
        **figures,
        **{f"wrong_key_{name}": value for name, value in wrong_figures.items()},
        **{f"unmarked_{name}": value for name, value in unmarked_figures.items()},
        "hypotheses": read.hypotheses,
        "seconds": seconds,
        "note": read.note,
    }


def reading(method: Any, fragment: Any, cover: Any, key: Key, bits: np.ndarray) -> tuple[Any, dict[str, float]]:
    """What a key reads from a fragment, and how well it agrees with ``bits``."""
    read = method.extract(fragment, len(bits), key, reference=cover)
    found = detect(read.soft, bits, hypotheses=read.hypotheses)
    return read, {"corr": 2.0 * found.matches / len(bits) - 1.0, "log10_p": round(found.log10_p, 2)}


def sent(seed: int) -> tuple[Key, np.ndarray]:
    """The key and the bits that a seed stands for."""
    return Key.from_passphrase(f"informed {seed}"), np.random.default_rng(seed).integers(0, 2, N_BITS)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="+", type=Path)
    parser.add_argument("--keys", type=int, default=2, help="number of keys and messages")
    parser.add_argument("--attacks", nargs="+", choices=list(TABLE), default=list(TABLE))
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    new, done = not options.out.exists(), set()
    if not new:
        with options.out.open() as file:
            done = {(line["mesh"], line["seed"], line["attack"]) for line in csv.DictReader(file)}
    method = METHODS.make("shape-spectrum")
    with options.out.open("a", newline="") as file:
        writer = csv.DictWriter(file, FIELDS)
        if new:
            writer.writeheader()
        for seed, path in ((seed, path) for seed in range(options.keys) for path in options.meshes):
            wanted = [name for name in options.attacks if (path.stem, str(seed), name) not in done]
            if not wanted:
                continue
            cover, (key, bits) = read_mesh(path), sent(seed)
            marked = method.embed(cover, bits, key)
            common = {"mesh": path.stem, "vertices": len(cover.vertices), "bits": N_BITS, "seed": seed}
            for attack in wanted:
                writer.writerow(common | {"attack": attack} | row(method, cover, marked, seed, attack))
                file.flush()


if __name__ == "__main__":
    main()
