"""How well mixtures of copies are traced: rows in results/collusion/rows.csv, a row a mixture.

    python scripts/collusion.py --meshes FOLDER [MESH...]     what is not there yet
    python scripts/collusion.py --meshes FOLDER --simulated 10000    innocents among mixtures of the copies' own vectors
    python scripts/collusion.py --meshes FOLDER --blind       two copies, mixed and read without the cover: blind.csv
    python scripts/collusion.py --crowd 10000                 means of some of so many vectors: crowd.json

Fifty copies of each mesh; 2 to 10 of them mixed in each way, as they are and after something mild; beside the cover it
is asked who took part. Each row says how many of these, and of the others, are named at 1e-6. --simulated mixes the
vectors of bimba's copies at random and counts innocents who are named. --crowd takes vectors of random directions,
like those of real copies, and says of how many means somebody who took part is named. Interrupted, it can be run again.
"""

import argparse
import csv
import itertools
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from kept_rows import about, append, rows

from o3dmark.attacks import attack_all
from o3dmark.coding.collusion import Mixture, Seen
from o3dmark.coding.identities import codewords, nearest
from o3dmark.coding.keys import Key
from o3dmark.files import read_mesh
from o3dmark.mesh.surface import Surface, mesh_arrays, triangle_mesh
from o3dmark.methods import silent
from o3dmark.profiles import PROFILES

ROOT = Path(__file__).parent.parent
ROWS = ROOT / "results" / "collusion" / "rows.csv"
MESHES = {name: f"paper/{name}.ply" for name in ("bimba", "cup", "bunny", "horse_48485")}
COPIES, TRIALS, RATE = 50, 2, 1e-6
MEANS = 100  # of a crowd, for each size
BLIND = MESHES | {name: f"paper/{name}.ply" for name in ("venus_50002", "venus_100759_derived")}
BLIND = {name: path for name, path in BLIND.items() if name not in ("bimba", "cup")}  # 30 000 vertices and more
PAIRS, PASSES = 6, 3  # as `copies.tracing` charges
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
    parser.add_argument("--crowd", type=int, metavar="N", help="vectors of random directions")
    parser.add_argument("--blind", action="store_true", help="without the cover")
    options = parser.parse_args()
    if options.crowd:
        (ROWS.parent / "crowd.json").write_text(json.dumps(crowd(options.crowd), indent=2) + "\n")
        return
    if options.folder is None:
        parser.error("--meshes says where the real meshes are")
    if options.blind:
        blind(options.folder)
        return
    if options.simulated:
        print(simulated(options.folder, options.simulated))
        return
    for name in options.meshes or MESHES:
        measure(name, options.folder)


def measure(name: str, folder: Path) -> None:
    """Append the rows of a mesh that are not there yet."""
    done = {(row["mesh"], row["how"], row["colluders"], row["after"], row["trial"]) for row in rows(ROWS)}
    waiting = [case for case in cases() if (name, *map(str, case)) not in done]
    if not waiting:
        return
    method = PROFILES["robust-2026"].method
    cover = read_mesh(folder / MESHES[name])
    words = codewords(KEY, [f"buyer {number}" for number in range(COPIES)], 64)
    remade = method.remade(cover, words, KEY)
    triangles = remade.cover.surface.triangles
    prepared = method.prepare(cover, words.shape[1], KEY)
    copies = np.array([Surface.of(method.embed(prepared, word, KEY)).vertices for word in words])
    for how, size, after, trial in waiting:
        rng = np.random.default_rng([trial, size])
        some = rng.permutation(COPIES)[:size]
        mesh = attack_all(triangle_mesh(mixed(how, copies[some], rng), triangles), [after], trial)
        log10_p = method.mixture(mesh, remade).log10_p(COPIES)
        guilty, others = log10_p[some], np.delete(log10_p, some)
        values = (name, len(mesh_arrays(cover)[0]), COPIES, how, size, after, trial)
        told = (np.sum(guilty <= np.log10(RATE)), np.sum(others <= np.log10(RATE)), guilty.min(), others.min())
        append(
            ROWS,
            (*FIELDS, *ABOUT),
            (*values, *told[:2], *(f"{number:.2f}" for number in told[2:]), *about().values()),
        )


def simulated(folder: Path, count: int) -> dict[str, object]:
    """Mixtures of the vectors that bimba's copies really have: how many innocents are named at which rate."""
    method = PROFILES["robust-2026"].method
    cover = read_mesh(folder / MESHES["bimba"])
    words = codewords(KEY, [f"buyer {number}" for number in range(COPIES)], 64)
    remade = method.remade(cover, words, KEY)
    vectors = remade.vectors(silent)
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


def blind(folder: Path) -> None:
    """For pairs of copies, mixed: log10 of the p-value of the likelier of the two, as a trace reads at first sight.

    All readings charged, and one candidate: of N, add log10 N.
    """
    method = replace(PROFILES["robust-2026"].method, search=False)
    table = [("mesh", "n_bits", "how", "pair", "log10_p", *ABOUT)]
    for name, n_bits in itertools.product(BLIND, (64, 128)):
        words = codewords(KEY, [f"buyer {number}" for number in range(2 * PAIRS)], n_bits)
        prepared = method.prepare(read_mesh(folder / BLIND[name]), n_bits, KEY)
        copies = np.array([Surface.of(method.embed(prepared, word, KEY)).vertices for word in words])
        for pair, how in itertools.product(range(PAIRS), ("mean", "any", "least", "pieces")):
            both = [2 * pair, 2 * pair + 1]
            mix = triangle_mesh(mixed(how, copies[both], np.random.default_rng(pair)), prepared.cover.surface.triangles)
            read = method.extract(mix, n_bits, KEY)
            readings = read.soft[None] if read.readings is None else read.readings
            charged = max(read.hypotheses, len(readings)) * PASSES
            best = min(nearest(readings, words[[each]], charged)[0].log10_p for each in both)
            table.append((name, n_bits, how, pair, f"{best:.2f}", *about().values()))
    with (ROWS.parent / "blind.csv").open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(table)


def crowd(copies: int) -> dict[str, object]:
    """Means of a few among many copies, disturbed a little: how often somebody who took part is named at 1e-6."""
    named, innocents = {}, 0
    for n_bits, size in itertools.product((64, 128), SIZES):
        rng = np.random.default_rng([n_bits, size])
        vectors, found = rng.standard_normal((copies, n_bits)), 0
        for _ in range(MEANS):
            some = rng.permutation(copies)[:size]
            mix = vectors[some].mean(axis=0) + 0.05 * rng.standard_normal(n_bits) / np.sqrt(size)
            log10_p = Mixture((Seen(mix, vectors),)).log10_p(copies)
            found += bool(log10_p[some].min() <= np.log10(RATE))
            innocents += int(np.sum(np.delete(log10_p, some) <= np.log10(RATE)))
        named[f"{n_bits} bits, {size} copies"] = f"{found} of {MEANS}"
    return {"copies": copies, "a colluder named at 1e-6": named, "innocents named": innocents, **about()}


if __name__ == "__main__":
    main()
