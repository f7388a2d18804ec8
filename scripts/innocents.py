"""Are innocents named? Real readings of copies, laid on the codewords of a thousand who have none: results/innocents.

    python scripts/innocents.py --meshes FOLDER      what is not there yet; 2 000 readings
    python scripts/innocents.py --count              how many p-values are as small as each rate

Fifty copies of each of four meshes, after each of ten attacks. A row says log10 of the p-value of the copy itself and
of the likeliest innocent, all thousand candidates and all readings charged. Interrupted, it can be run again.
"""

import argparse
from pathlib import Path

import numpy as np
from kept_rows import about, append, rows

from o3dmark.attacks import attack_all
from o3dmark.coding.identities import codeword, codewords, nearest
from o3dmark.coding.keys import Key
from o3dmark.files import read_mesh
from o3dmark.profiles import PROFILES

ROOT = Path(__file__).parent.parent
ROWS = ROOT / "results" / "innocents" / "rows.csv"
MESHES = {
    name: f"{folder}/{name}.ply"
    for name, folder in (("bimba", "paper"), ("cup", "paper"), ("ant", "paper"), ("cat_7949", "extra"))
}
ATTACKS = (
    "identity",
    "noise:amplitude=0.001",
    "noise:amplitude=0.005",
    "quantise:bits=9",
    "quantise:bits=7",
    "smooth:iterations=30",
    "simplify:ratio=0.5",
    "simplify:ratio=0.9",
    "subdivide",
    "crop:share=0.1",
)
COPIES, INNOCENTS = 50, 1000
KEY = Key(bytes(range(32)))  # public
FIELDS = ("mesh", "copy", "attack", "hypotheses", "log10_p", "innocent", "innocent_uncharged", "commit", "date")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--meshes", type=Path, metavar="FOLDER", help="the real meshes")
    parser.add_argument("--count", action="store_true", help="only count what is there")
    options = parser.parse_args()
    if options.count:
        print(counted())
    elif options.meshes is None:
        parser.error("--meshes says where the real meshes are")
    else:
        for name in MESHES:
            measure(name, options.meshes)


def measure(name: str, folder: Path) -> None:
    """Append the rows of a mesh that are not there yet."""
    mark, cover = PROFILES["robust-2026"], read_mesh(folder / MESHES[name])
    prepared = mark.prepare(cover, KEY)
    others = codewords(KEY, [f"innocent {number}" for number in range(INNOCENTS)], mark.n_bits)
    done = {(row["mesh"], row["copy"], row["attack"]) for row in rows(ROWS)}
    for number in range(COPIES):
        waiting = [attack for attack in ATTACKS if (name, str(number), attack) not in done]
        if not waiting:
            continue
        word = codeword(KEY, f"buyer {number}", mark.n_bits)
        marked = mark.embed_bits(prepared, word, KEY)
        for attack in waiting:
            read = mark.extract_bits(attack_all(marked, [attack], number), KEY)
            readings = read.soft[None] if read.readings is None else read.readings
            charged = max(read.hypotheses, len(readings))
            own = nearest(readings, word[None], charged)[0].log10_p
            best, alone = (nearest(readings, others, n)[0].log10_p for n in (charged * INNOCENTS, 1))
            told = (f"{number:.3f}" for number in (own, best, alone))
            append(ROWS, FIELDS, (name, number, attack, charged, *told, *about().values()))


def counted() -> dict[str, object]:
    """The number of readings in which an innocent's p-value, all charged, is at or below each rate; and the copies'."""
    innocent = np.array([float(row["innocent"]) for row in rows(ROWS)])
    own = np.array([float(row["log10_p"]) for row in rows(ROWS)])
    levels = {f"1e-{level}": int(np.sum(innocent <= -level)) for level in (1, 2, 3, 6)}
    return {"readings": len(own), "innocents at": levels, "copies named at 1e-6": int(np.sum(own <= -6))}


if __name__ == "__main__":
    main()
