"""Make again what README and docs quote: campaigns, their reports, tables, the pictures that explain the marks.

    scripts/remake --meshes FOLDER             all campaigns that are quoted
    scripts/remake --meshes FOLDER paper quick only these
    scripts/remake --list                      what there is, how long it took, who quotes it

FOLDER holds the real meshes, as `o3dmark bench --meshes` takes it. Rows go to results/NAME; what is there is not made
again, so an interrupted run goes on, unless --fresh asks for all of it. Exit code 1 when something could not be made.
"""

import argparse
import os
import re
import shutil
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path

import explain_motion
import explain_patches
import explain_shape_spectrum
import tables

from o3dmark.campaign import load, read_rows, spec_file
from o3dmark.cli import main as o3dmark
from o3dmark.errors import SpecError

ROOT = Path(__file__).parent.parent
SUMMARISED = ("attack_sweep",)  # too many rows to keep: counts and failures stay
PICTURE, MOTION, PATCHES = "docs/shape_spectrum.png", "docs/motion.png", "docs/patches.png"


def main() -> int:
    options = _options()
    os.chdir(ROOT)  # so that the command that results tell has no folder of this machine
    if options.list:
        print("\n".join(map(described, options.names or campaigns())))
        return 0
    names = options.names or quoted()
    if options.meshes is None and (real := [name for name in names if takes_meshes(name)]):
        print(f"--meshes FOLDER is needed for the real meshes of {', '.join(real)}", file=sys.stderr)
        return 2
    failed = [name for name in names if not remade(name, options.meshes, options.workers, options.fresh)]
    if not options.names:
        explain_shape_spectrum.main(Path(PICTURE), None)
        explain_motion.main(Path(MOTION))
        explain_patches.main(Path(PATCHES))
    stale = tables.main([])
    print(
        f"made: {len(names) - len(failed)} of {len(names)} campaigns; not: {', '.join(failed) or '-'}", file=sys.stderr
    )
    return int(bool(failed or stale))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="scripts/remake", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="a campaign; by default all that are quoted")
    parser.add_argument("--meshes", type=lambda text: Path(text).resolve(), metavar="FOLDER", help="the real meshes")
    parser.add_argument("--workers", metavar="N", help="processes; by default one a core")
    parser.add_argument("--fresh", action="store_true", help="remove what is there of these campaigns, and begin anew")
    parser.add_argument("--list", action="store_true", help="say what there is, and make nothing")
    options = parser.parse_args()
    if unknown := [name for name in options.names if name not in campaigns()]:
        parser.error(f"no campaign is called {', '.join(unknown)}; there is {', '.join(campaigns())}")
    return options


def remade(name: str, meshes: Path | None, workers: str | None, fresh: bool) -> bool:
    """Run what a campaign's folder lacks, and write its report; whether that went well."""
    out = f"results/{name}"
    if fresh:
        shutil.rmtree(out, ignore_errors=True)
    summarised = name in SUMMARISED
    given = ["--meshes", str(meshes)] if takes_meshes(name) and meshes is not None else []
    given += ["--workers", workers] if workers else []
    print(described(name), file=sys.stderr)
    steps = [["bench", name, "--out", out, *given, "--summary" if summarised else "--compact"], ["report", out]]
    return all(_did(step) for step in steps)


def _did(words: Sequence[str]) -> bool:
    try:
        o3dmark(words)
    except SystemExit as end:
        if end.code == 130:  # an interrupt is for all of it
            raise
        return end.code == 0


def campaigns() -> list[str]:
    """All campaigns of the package."""
    return sorted(path.stem for path in spec_file.SPECS.glob("*.toml"))


def quoted() -> list[str]:
    """Those that README or docs quote."""
    return [name for name in campaigns() if quotes(name)]


def quotes(name: str) -> list[str]:
    """The pages that have a table made of a campaign's rows, or a link to its folder."""
    made = {table for table, (_, folders) in tables.OF_RESULTS.items() if name in folders}
    found = []
    for page in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        text = page.read_text(encoding="utf-8")
        shown = set(re.findall(r"<!-- table: ([\w -]+) -->", text))
        if shown & made or re.search(rf"\]\((\.\./)*results/{name}/", text):
            found.append(page.relative_to(ROOT).as_posix())
    return found


def takes_meshes(name: str) -> bool:
    """Whether a campaign can use real meshes: what is quoted was then measured on them."""
    spec = tomllib.loads(spec_file.find_spec(name).read_text(encoding="utf-8"))
    return bool({"real", "files"} & spec.keys())


def described(name: str) -> str:
    """A line for a campaign: how long it took last time, who quotes it."""
    pages = ", ".join(quotes(name)) or "nobody"
    return f"{name:24} {took(ROOT / 'results' / name):44} quoted by {pages}"


def took(folder: Path) -> str:
    """How long a campaign took, as its runs say, or else what its rows took together."""
    try:
        runs = load(folder).runs
    except SpecError:
        return "not made yet"
    when = max((run.started[:10] for run in runs), default="")
    known = [run.seconds for run in runs if run.seconds is not None]
    if known and len(known) == len(runs):
        return f"{_spoken(sum(known))}, {when}"
    rows = list(read_rows(folder))
    spent = sum(row.seconds or 0.0 for row in rows) + sum({row.job: row.embed_seconds or 0.0 for row in rows}.values())
    return f"not known, {_spoken(spent)} of it marking and reading, {when}" if rows else "not known"


def _spoken(seconds: float) -> str:
    return (
        f"{seconds:.0f} s"
        if seconds < 120
        else f"{seconds / 60:.0f} min"
        if seconds < 7200
        else f"{seconds / 3600:.1f} h"
    )


if __name__ == "__main__":
    sys.exit(main())
