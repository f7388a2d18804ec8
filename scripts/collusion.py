"""How well mixtures of copies are traced: rows in results/collusion/rows.csv, a row a mixture.

    python scripts/collusion.py --meshes FOLDER [MESH...]     what is not there yet
    python scripts/collusion.py --simulated 10000             innocents among mixtures of the copies' own vectors

Fifty copies of each mesh; 2 to 10 of them mixed in each way, as they are and after something mild; beside the cover it
is asked who took part. Each row says how many of these, and of the others, are named at 1e-6. --simulated mixes the
vectors of bimba's copies at random and counts innocents who are named. Interrupted, it can be run again.
"""

import argparse
import csv
import datetime
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from o3dmark.attacks import attack_all
from o3dmark.coding.collusion import Mixture, Seen
from o3dmark.coding.identities import codewords
from o3dmark.coding.keys import Key
from o3dmark.files import read_mesh
from o3dmark.mesh.surface import mesh_arrays, triangle_mesh
from o3dmark.profiles import PROFILES

ROOT = Path(__file__).parent.parent
ROWS = ROOT / "results" / "collusion" / "rows.csv"
MESHES = {name: f"paper/{name}.ply" for name in ("bimba", "cup", "bunny", "horse_48485")}
COPIES, TRIALS, RATE = 50, 2, 1e-6
SIZES = (2, 3, 5, 10)
AFTER = ("identity", "noise:amplitude=0.0005", "quantise:bits=14")
KEY = Key(bytes(range(32)))  # public
FIELDS = (
    "mesh",
    "vertices",
    "copies",
    "how",
    "colluders",
    "after",
    "trial",
    "named",
    "innocents",
    "log10_p",
    "innocent",
)
ABOUT = ("commit", "date")


def mixed(how: str, copies: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """One mesh's vertices (n, 3) of those of copies (k, n, 3)."""
    n = copies.shape[1]
    if how == "pieces":  # slabs, as many as there are copies, each from one
        along = copies[0] @ rng.standard_normal(3)
        slab = np.searchsorted(np.quantile(along, np.arange(1, len(copies)) / len(copies)), along)
        return copies[slab, np.arange(n)]
    ways = {
        "mean": lambda: copies.mean(axis=0),
        "median": lambda: np.median(copies, axis=0),
        "least": lambda: copies.min(axis=0),
        "greatest": lambda: copies.max(axis=0),
        "any": lambda: copies[rng.integers(len(copies), size=n), np.arange(n)],
        "a + b - c": lambda: copies[0] + copies[1] - copies[2],
    }
    return np.asarray(ways[how]())


def cases() -> Iterator[tuple[str, int, str, int]]:
    """(how, colluders, after, trial) of all rows of a mesh."""
    for how in ("mean", "median", "least", "greatest", "any", "pieces", "a + b - c"):
        for size in (3,) if how == "a + b - c" else SIZES:
            for after in AFTER:
                for trial in range(TRIALS):
                    yield how, size, after, trial


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("meshes", nargs="*", metavar="MESH", help=", ".join(MESHES))
    parser.add_argument("--meshes", dest="folder", type=Path, help="the folder of real meshes")
    parser.add_argument("--simulated", type=int, metavar="N", help="mixtures of vectors")
    options = parser.parse_args()
    if options.folder is None:
        parser.error("--meshes says where the real meshes are")
    if options.simulated:
        print(simulated(options.folder, options.simulated))
        return
    for name in options.meshes or MESHES:
        measure(name, options.folder)


def measure(name: str, folder: Path) -> None:
    """Append the rows of a mesh that are not there yet."""
    done = {(row["mesh"], row["how"], row["colluders"], row["after"], row["trial"]) for row in rows()}
    waiting = [case for case in cases() if (name, *map(str, case)) not in done]
    if not waiting:
        return
    method = PROFILES["robust-2026"].method
    cover = read_mesh(folder / MESHES[name])
    words = codewords(KEY, [f"buyer {number}" for number in range(COPIES)], 64)
    remade = method.remade(cover, words, KEY)
    triangles, copies = remade.cover.surface.triangles, np.array(remade.copies)
    for how, size, after, trial in waiting:
        rng = np.random.default_rng([trial, size])
        some = rng.permutation(COPIES)[:size]
        mesh = attack_all(triangle_mesh(mixed(how, copies[some], rng), triangles), [after], trial)
        log10_p = method.mixture(mesh, remade).log10_p(COPIES)
        guilty, others = log10_p[some], np.delete(log10_p, some)
        values = (name, len(mesh_arrays(cover)[0]), COPIES, how, size, after, trial)
        told = (np.sum(guilty <= np.log10(RATE)), np.sum(others <= np.log10(RATE)), guilty.min(), others.min())
        append((*values, *told[:2], *(f"{number:.2f}" for number in told[2:])))


def simulated(folder: Path, count: int) -> dict[str, object]:
    """Mixtures of the vectors that bimba's copies really have: how many innocents are named at which rate."""
    method = PROFILES["robust-2026"].method
    cover = read_mesh(folder / MESHES["bimba"])
    words = codewords(KEY, [f"buyer {number}" for number in range(COPIES)], 64)
    remade = method.remade(cover, words, KEY)
    vectors = method.mixture(cover, remade).patches[0].copies
    rng, least, found = np.random.default_rng(0), [], 0
    for _ in range(count):
        size = int(rng.integers(2, 11))
        some = rng.permutation(COPIES)[:size]
        weights = np.array([1.0, 1.0, -1.0]) if size == 3 and rng.random() < 0.5 else rng.dirichlet(np.ones(size))
        mix = weights @ vectors[some]
        mix = mix + rng.choice([0.0, 0.1, 0.5]) * np.linalg.norm(mix) / 8.0 * rng.standard_normal(len(mix))
        log10_p = Mixture((Seen(mix, vectors),)).log10_p(COPIES)
        found += bool(log10_p[some].min() <= np.log10(RATE))
        least.append(np.delete(log10_p, some).min())
    counts = {f"1e-{level}": int(np.sum(np.array(least) <= -level)) for level in (1, 2, 3, 4, 6)}
    return {"mixtures": count, "a colluder named at 1e-6": found, "an innocent at": counts, **about()}


def rows() -> list[dict[str, str]]:
    if not ROWS.exists():
        return []
    with ROWS.open(newline="") as file:
        return list(csv.DictReader(file))


def append(values: tuple[object, ...]) -> None:
    ROWS.parent.mkdir(parents=True, exist_ok=True)
    new = not ROWS.exists()
    with ROWS.open("a", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        if new:
            table.writerow([*FIELDS, *ABOUT])
        table.writerow([*values, *about().values()])


def about() -> dict[str, str]:
    git = ["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"]
    commit = subprocess.run(git, capture_output=True, text=True, check=False).stdout.strip()
    return {"commit": commit, "date": datetime.date.today().isoformat()}


if __name__ == "__main__":
    main()
