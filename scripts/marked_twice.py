"""Is a mark still there after somebody else marked the mesh again? results/marked_twice/rows.csv, a row a key.

    python scripts/marked_twice.py --meshes FOLDER [MESH...]     what is not there yet

Each mesh is marked with a message under one key, and the result with another message under another key, with the same
profile. A row says whether the first message is read, log10 of the p-value by which who knows it finds it, and the MSDM
of the first mark. Interrupted, it can be run again.
"""

import argparse
from pathlib import Path

from kept_rows import about, append, rows

from o3dmark.coding.keys import Key
from o3dmark.files import read_mesh
from o3dmark.metrics import METRICS
from o3dmark.profiles import PROFILES

ROWS = Path(__file__).parent.parent / "results" / "marked_twice" / "rows.csv"
MESHES = {name: f"paper/{name}.ply" for name in ("bimba", "ant", "cup", "bunny", "horse_48485", "venus_50002")}
NAMES = ("robust-2026", "slender-2026", "contested-2026")
SEEDS = (0, 1, 2)
FIELDS = ("mesh", "profile", "seed", "read", "log10_p", "msdm", "date")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("meshes", nargs="*", metavar="MESH", help=", ".join(MESHES))
    parser.add_argument("--meshes", dest="folder", type=Path, required=True, help="the folder of real meshes")
    options = parser.parse_args()
    done = {(row["mesh"], row["profile"], row["seed"]) for row in rows(ROWS)}
    for name in options.meshes or MESHES:
        for profile in NAMES:
            for seed in SEEDS:
                if (name, profile, str(seed)) not in done:
                    append(ROWS, FIELDS, measured(name, options.folder, profile, seed))


def measured(name: str, folder: Path, profile: str, seed: int) -> tuple[object, ...]:
    """The row of a mesh, a profile and a seed."""
    mark = PROFILES[profile]
    cover, owner, other = read_mesh(folder / MESHES[name]), Key(bytes([seed] * 32)), Key(bytes([seed + 100] * 32))
    marked = mark.embed(cover, "mine", owner)
    again = mark.embed(marked, "evil", other)
    read = mark.extract(again, owner)
    log10_p = mark.test(read.extraction, owner, "mine").log10_p
    msdm = float(METRICS.make("msdm")(cover, marked))
    return name, profile, seed, int(read.message == "mine"), f"{log10_p:.2f}", f"{msdm:.3f}", about()["date"]


if __name__ == "__main__":
    main()
