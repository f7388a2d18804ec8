"""Independent programs look at marked files: the table of what they found is results/proof/proof.csv.

    python scripts/proof/prove.py                        all proofs, with the models of models.py
    python scripts/proof/prove.py --only readers FILE... one proof, with files of your own

complaints   Khronos' validator has no complaint about a marked glTF that it had not about the original
published    the mark is read from what gltfpack and gltf-transform make of a marked file
compressed   a file that was compressed before it was marked is read by others, and the mark in what they make of it
readers      trimesh and assimp read the original and the moved file alike, in every format
pictures     three.js draws a textured, skinned, animated file before and after: docs/gltf_before_after.png

A program that is not here is named, and what needs it left out. Exit code 1 when a comparison failed.
"""

import argparse
import csv
import datetime
import json
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import programs
from pictures import drawn, likeness, shows, side_by_side
from programs import HERE, ROOT, FailedError, MissingError
from samples import GLTF, samples

from o3dmark import Key, O3dmarkError
from o3dmark.arrays import Floats
from o3dmark.files import destination, open_asset
from o3dmark.mesh import geometry

KEY = Key(bytes(range(32)))  # public: that of the golden marks
MESSAGE = "mine"
TABLE = ROOT / "results" / "proof" / "proof.csv"
PICTURE = ROOT / "docs" / "gltf_before_after.png"
_TRANSFORM = ("@gltf-transform/cli", "gltf-transform")
PUBLISHED: dict[str, tuple[str, ...]] = {  # what publishers do to a file: package, command, options
    "gltfpack": ("gltfpack", "gltfpack", "-i", "{source}", "-o", "{output}"),
    "gltfpack -cc": ("gltfpack", "gltfpack", "-cc", "-i", "{source}", "-o", "{output}"),
    **{
        f"gltf-transform optimize --compress {kind}": (
            *_TRANSFORM,
            "optimize",
            "{source}",
            "{output}",
            "--compress",
            kind,
        )
        for kind in ("false", "quantize", "meshopt", "draco")
    },
}
ROUTES = PUBLISHED | {
    f"gltf-transform {word}": (*_TRANSFORM, word, "{source}", "{output}") for word in ("draco", "copy")
}
COMPRESSED = ("gltfpack -cc", "gltf-transform draco")
DECODED = "gltf-transform optimize --compress false"
FEWEST = 1000  # vertices: smaller ones are moved as a mark would
TIMES = (0.0, 0.8)  # seconds of the animation
SHIFT = 1e-3  # of the diagonal: as large as a strong mark
DIFFERENCE, SIMILARITY = 0.005, 0.98  # of pictures that look the same: at most, at least


@dataclass(frozen=True)
class Row:
    """What one program found about one file; ``log10_p`` of a mark that was read."""

    proof: str
    file: str
    program: str
    version: str
    passed: bool
    found: str
    log10_p: float | None = None


def complaints(file: Path, folder: Path) -> Iterator[Row]:
    """Whether Khronos' validator complains about the changed file, but not about the original."""
    version = programs.node("gltf-validator")
    output = marked(file, folder) if holds_a_mark(file) else moved(file, folder)[0]
    before, after = json.loads(programs.run("node", HERE / "validate.mjs", file, output))
    new = {tuple(issue[:2]) for issue in after} - {tuple(issue[:2]) for issue in before}
    found = "; ".join(" at ".join(issue) for issue in sorted(new)) or f"the same {len(before)} issues"
    yield Row("complaints", file.name, "gltf-validator", version, not new, found)


def published(file: Path, folder: Path) -> Iterator[Row]:
    """Whether the mark is read from what publishers' programs make of the marked file."""
    source = marked(file, folder)
    for route in PUBLISHED:
        yield attempt("published", file, route, partial(_read_after, source, route, folder))


def compressed(file: Path, folder: Path) -> Iterator[Row]:
    """Whether a file that was compressed, and then marked, is sound to the validator and to another decoder."""
    for route in COMPRESSED:
        small = _markable(sent(file, route, folder), folder)
        yield from complaints(small, folder)
        source = marked(small, folder)
        yield attempt("compressed", small, DECODED, partial(_read_after, source, DECODED, folder))


def _markable(file: Path, folder: Path) -> Path:
    """The file, or what the program that its refusal names makes of it. Errors: FailedError for other refusals."""
    try:
        marked(file, folder)
    except FailedError as refusal:
        if "`gltf-transform copy" not in str(refusal):
            raise
        return sent(file, "gltf-transform copy", folder)
    return file


def attempt(proof: str, file: Path, route: str, tried: Callable[[], tuple[bool, str, float | None]]) -> Row:
    """The row of what was tried with a program of a route; one that failed where the program did."""
    version = programs.node(ROUTES[route][0])
    try:
        return Row(proof, file.name, route, version, *tried())
    except FailedError as failure:
        return Row(proof, file.name, route, version, False, str(failure))


def _read_after(source: Path, route: str, folder: Path) -> tuple[bool, str, float | None]:
    output = sent(source, route, folder)
    read, log10_p = extracted(output, folder)
    return read == MESSAGE, f"{read!r} in {output.stat().st_size / source.stat().st_size:.2f} of its size", log10_p


def sent(file: Path, route: str, folder: Path) -> Path:
    """What the programs of a route make of a file. Errors: FailedError."""
    package, command, *options = ROUTES[route]
    output = folder / f"{file.stem} {route}.glb".replace(" ", "_")
    programs.run(programs.script(package, command), *(word.format(source=file, output=output) for word in options))
    return output


def readers(file: Path, folder: Path) -> Iterator[Row]:
    """Whether other readers see the same in the original and in the moved file, but for the motion."""
    output, largest = moved(file, folder)
    for package in ("trimesh", "assimp_py"):
        if package == "assimp_py" and b"KHR_mesh_quantization" in file.read_bytes():
            continue  # it takes pairs of 16-bit numbers for float32
        version = programs.python(package)
        seen = json.loads(programs.run(sys.executable, HERE / "readers.py", package, file, output))
        yield Row("readers", file.name, package, version, *_alike(seen, largest))


def _alike(seen: dict[str, Any], largest: float) -> tuple[bool, str]:
    """Whether a reader saw the same twice, with a motion that may be ``largest`` for a coordinate; and what it saw."""
    if "refusals" in seen:
        both = len(seen["refusals"]) == 2
        return both, f"refuses {'both' if both else 'one'}: {seen['refusals'][0]}"
    same = seen["before"] == seen["after"] and len(set(seen["materials"])) == 1 and bool(seen["before"])
    limit = 1.001 * largest + 2 * float(np.spacing(np.float32(seen["largest"])))
    if not same or not 0.5 * largest < seen["motion"] <= limit:
        return False, json.dumps(seen)
    vertices, faces = np.sum(seen["before"], axis=0)
    counts = f"{len(seen['before'])} meshes, {vertices} vertices, {faces} faces, {seen['materials'][0]} materials"
    return True, f"{counts}, moved by {seen['motion']:.1e} of {largest:.1e}"


def pictures(file: Path, folder: Path) -> Iterator[Row]:
    """Whether three.js draws the same before and after, at two times; writes both side by side."""
    rows, versions = drawn([file, marked(file, folder)], TIMES, folder)
    if not all(shows(picture).mean() > 0.1 for row in rows for picture in row):
        raise FailedError("the pictures show next to nothing")
    for time, before, after in zip(TIMES, *rows, strict=True):
        alike = likeness(before, after)
        same = alike.difference <= DIFFERENCE and alike.similarity >= SIMILARITY
        found = f"at {time} s: mean difference {alike.difference:.5f}, similarity {alike.similarity:.4f}"
        yield Row("pictures", file.name, "three", versions, same, found)
    moves = likeness(*rows[0])
    found = f"between the times: mean difference {moves.difference:.5f}, similarity {moves.similarity:.4f}"
    yield Row("pictures", file.name, "three", versions, moves.similarity < SIMILARITY, found)
    side_by_side([picture for pair in zip(*rows, strict=True) for picture in pair], folder / PICTURE.name)


PROOFS: dict[str, Callable[[Path, Path], Iterator[Row]]] = {
    proof.__name__: proof for proof in (complaints, published, compressed, readers, pictures)
}


def marked(file: Path, folder: Path) -> Path:
    """The file with the mark, as the command line writes it; made once a folder. Errors: FailedError."""
    output = folder / "marked" / file.name
    if not output.exists():
        output.parent.mkdir(exist_ok=True)
        o3dmark("embed", file, output, "--key", _key(folder), "--message", MESSAGE)
    return output


def extracted(file: Path, folder: Path) -> tuple[str | None, float | None]:
    """The message that the command line reads in a file, and the logarithm of its p-value. Errors: FailedError."""
    said = json.loads(o3dmark("extract", file, "--key", _key(folder), "--json", may_end_with=(0, 1)))
    return said["message"], said["log10_p"]


def o3dmark(*words: object, may_end_with: tuple[int, ...] = (0,)) -> str:
    path = {"PYTHONPATH": str(ROOT)}
    return programs.run(sys.executable, "-m", "o3dmark", *words, variables=path, may_end_with=may_end_with)


def moved(file: Path, folder: Path) -> tuple[Path, float]:
    """The file with a smooth motion of all its parts, and the largest change of a coordinate."""
    asset = open_asset(file)
    new = {n: _wave(part.vertices) for n, part in enumerate(asset.parts) if len(part.vertices) and not part.fixed}
    (folder / "moved").mkdir(exist_ok=True)
    target = destination(asset, folder / "moved" / file.name, overwrite=True)
    target.write(asset.with_positions(new, target.names))
    written = open_asset(target.path)
    changes = [np.abs(written.parts[n].vertices - asset.parts[n].vertices).max() for n in new]
    return target.path, float(max(changes, default=0.0))


def _wave(vertices: Floats) -> Floats:
    extent = geometry.diagonal(vertices) or 1.0
    return vertices + SHIFT * extent * np.sin(5.0 * vertices[:, [1, 2, 0]] / extent + 1.0)


def _key(folder: Path) -> Path:
    path = folder / "public.key"
    if not path.exists():
        KEY.save(path)
    return path


def fits(proof: str, file: Path) -> bool:
    """Whether a proof is about such a file."""
    if file.suffix.lower() not in GLTF:
        return proof == "readers"
    if proof == "pictures":
        return holds_a_mark(file) and "animations" in open_asset(file).contents
    return proof not in ("published", "compressed") or holds_a_mark(file)


def holds_a_mark(file: Path) -> bool:
    return any(len(part.vertices) >= FEWEST for part in open_asset(file).parts)


def rows_of(proof: str, file: Path, folder: Path) -> Iterator[Row]:
    """The rows of one proof about one file; one that says why where a program failed. Errors: MissingError."""
    try:
        yield from PROOFS[proof](file, folder)
    except (FailedError, O3dmarkError) as error:
        yield Row(proof, file.name, "", "", False, str(error))


def save(rows: Sequence[Row], path: Path, commit: str) -> None:
    """Write rows as CSV, with the commit and the day."""
    about = {"commit": commit, "date": datetime.date.today().isoformat()}
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        table = csv.DictWriter(file, [*(field.name for field in fields(Row)), *about], lineterminator="\n")
        table.writeheader()
        table.writerows(asdict(row) | about for row in rows)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE", help="by default the models of models.py")
    parser.add_argument("--only", choices=PROOFS, metavar="PROOF", help="one of " + ", ".join(PROOFS))
    options = parser.parse_args()
    proofs = [options.only] if options.only else list(PROOFS)
    commit = programs.run("git", "-C", ROOT, "describe", "--always", "--dirty", "--exclude=*").strip()
    rows: list[Row] = []
    missing: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        for number, file in enumerate(options.files or samples(Path(folder))):
            here = Path(folder) / str(number)
            here.mkdir()
            for proof in (proof for proof in proofs if proof not in missing and fits(proof, file)):
                try:
                    for row in rows_of(proof, file, here):
                        print(
                            "ok    " if row.passed else "FAILED",
                            row.proof,
                            row.file,
                            row.program,
                            row.found,
                            flush=True,
                        )
                        rows.append(row)
                except MissingError as reason:
                    missing[proof] = str(reason)
                    print(f"left out: {proof}: {reason}", file=sys.stderr)
            if not options.files and (here / PICTURE.name).exists():
                shutil.copy(here / PICTURE.name, PICTURE)
    if not (options.files or options.only or missing):
        save(rows, TABLE, commit)
    return int(not all(row.passed for row in rows))


if __name__ == "__main__":
    sys.exit(main())
