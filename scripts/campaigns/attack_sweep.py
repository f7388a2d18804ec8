"""Every attack on every mesh: does it give a valid mesh, or refuse with a reason? One CSV row a (mesh, attack).

    .venv/bin/python scripts/campaigns/attack_sweep.py FOLDER... --out results/attack_sweep.csv

Attacks are all registered ones by default, and every variant that an option names (noise kinds, smoothing weights,
subdivision schemes, file formats, ...). The smallest files below the folders come first; rows that the output holds
already are not measured again. ``outcome`` is

    ok         triangles, all with indices in range, finite vertices, and the input mesh as it was before
    refused    a MeshError or BackendError; ``reason`` is its first sentence
    failed     anything else, a crash of the process or a timeout included

A file that cannot be read has one row, of the attack "read". Each mesh has a child process, so that a crash is a row.
"""

import argparse
import csv
import multiprocessing
import re
import time
from collections.abc import Iterator
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

import numpy as np

from o3dmark.attacks import ATTACKS
from o3dmark.errors import BackendError, MeshError
from o3dmark.files import FORMATS, read_mesh
from o3dmark.mesh.surface import mesh_arrays
from o3dmark.registry import describe, spec_of

STRENGTHS = ("simplify:ratio=0.975", "draco:bits=14", "crop:share=0.5")  # that the benchmark or a format names
FIELDS = ("mesh", "vertices", "triangles", "attack", "outcome", "vertices_out", "triangles_out", "seconds", "reason")
SEED = 1


def specs() -> list[str]:
    """Every attack by default, then with each option that is a choice or a switch set otherwise."""
    found = [*ATTACKS, *STRENGTHS]
    for name in ATTACKS:
        hints = get_type_hints(ATTACKS[name])
        for option, _, default, _ in describe(ATTACKS[name]):
            choices = get_args(hints[option]) if get_origin(hints[option]) is Literal else ()
            choices = (True, False) if hints[option] is bool else choices
            found += [spec_of(ATTACKS.make({"name": name, option: c})) for c in choices if c != default]
    return found


def files_below(folders: list[Path]) -> list[Path]:
    """The mesh files in the folders and the folders in them, the smallest first."""
    found = {path for folder in folders for path in folder.rglob("*") if path.suffix.lower() in FORMATS}
    return sorted(found, key=lambda path: (path.stat().st_size, path.name))


def rows(path: Path, wanted: list[str], limit: float) -> Iterator[dict[str, Any]]:
    """A row for each of the wanted attacks; after a crash or a timeout another child goes on with the rest."""
    while wanted:
        receiver, sender = multiprocessing.Pipe(duplex=False)
        child = multiprocessing.get_context("spawn").Process(target=_measure, args=(path, wanted, sender), daemon=True)
        child.start()
        sender.close()
        read = _received(receiver, child, limit)
        if read["outcome"] != "ok":
            yield {"mesh": path.name, "attack": "read"} | read
            return
        lost = False
        while wanted and not lost:
            spec, *wanted = wanted
            row = _received(receiver, child, limit)
            lost = "seconds" not in row
            yield {"mesh": path.name, "attack": spec} | read | row
        child.join()


def _received(receiver: Connection, child: Any, limit: float) -> dict[str, Any]:
    """What the child sends next; a failure, and no child, if that does not come."""
    try:
        if receiver.poll(limit):
            return dict(receiver.recv())
        child.kill()
        child.join()
        reason = f"timeout after {limit:g} s"
    except EOFError:
        child.join()
        reason = f"the process ended with exit code {child.exitcode}"
    return {"outcome": "failed", "reason": reason}


def _measure(path: Path, wanted: list[str], sender: Connection) -> None:
    """In the child: send what comes of reading, then of each attack."""
    start = time.perf_counter()
    try:
        mesh = read_mesh(path)
    except Exception as error:
        sender.send(_refusal(error, path) | {"seconds": round(time.perf_counter() - start, 2)})
        return
    sender.send({"outcome": "ok", "vertices": len(mesh.vertices), "triangles": len(mesh.triangles)})
    for spec in wanted:
        start = time.perf_counter()
        try:
            result = _attacked(mesh, spec)
        except Exception as error:
            result = _refusal(error, path)
        sender.send(result | {"seconds": round(time.perf_counter() - start, 2)})


def _attacked(mesh: Any, spec: str) -> dict[str, Any]:
    before = *mesh_arrays(mesh), np.array(mesh.vertex_colors), np.array(mesh.triangle_uvs)
    vertices, triangles = mesh_arrays(ATTACKS.make(spec)(mesh, SEED))
    after = *mesh_arrays(mesh), np.array(mesh.vertex_colors), np.array(mesh.triangle_uvs)
    flaws = {
        "the input was changed": not all(map(np.array_equal, before, after)),
        "no triangle": not len(triangles),
        "a vertex is not finite": not np.isfinite(vertices).all(),
        "an index is out of range": len(triangles) and not 0 <= triangles.min() <= triangles.max() < len(vertices),
    }
    reason = ", ".join(flaw for flaw, is_so in flaws.items() if is_so)
    counts = {"vertices_out": len(vertices), "triangles_out": len(triangles)}
    return {"outcome": "failed" if reason else "ok", "reason": reason, **counts}


def _refusal(error: Exception, path: Path) -> dict[str, Any]:
    on_purpose = isinstance(error, MeshError | BackendError)
    text = str(error).replace(str(path), path.name)
    sentence = re.split(r"(?<=[.;?!])\s|\n", text)[0].rstrip(";")
    kind = "" if on_purpose else f"{type(error).__name__}: "
    return {"outcome": "refused" if on_purpose else "failed", "reason": kind + sentence}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--attacks", nargs="+", help="instead of all")
    parser.add_argument("--limit", type=float, default=600.0, help="seconds for one attack")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    done = set()
    if options.out.exists():
        with options.out.open(newline="") as file:
            done = {(row["mesh"], row["attack"]) for row in csv.DictReader(file)}
    with options.out.open("a", newline="") as file:
        writer = csv.DictWriter(file, FIELDS, extrasaction="ignore", lineterminator="\n")
        if not done:
            writer.writeheader()
        for path in files_below(options.folders):
            unreadable = (path.name, "read") in done
            wanted = [spec for spec in options.attacks or specs() if (path.name, spec) not in done]
            for row in rows(path, wanted, options.limit) if not unreadable else ():
                writer.writerow(row)
                file.flush()


if __name__ == "__main__":
    main()
