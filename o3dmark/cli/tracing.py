"""The commands of copies that look at meshes: issue, trace."""

import json as json_text
import shlex
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from o3dmark.cli._arguments import AnyScale, Json, Mirrored, Overwrite, Verbose
from o3dmark.cli._talk import print_answer, print_result, printable, say, since
from o3dmark.cli.owner import NBits, Profile
from o3dmark.errors import MeshError, O3dmarkError

if TYPE_CHECKING:
    from o3dmark.copies import Copy, Named, Trace, Tracer
    from o3dmark.evidence import Evidence

_TOLD = ("p_value", "matches", "runner_up", "candidates", "part")
_MISSING_SHOWN = 5  # names of copies that are elsewhere


def issue(
    asset: Annotated[Path, typer.Argument(metavar="ASSET", help="The unmarked file.")],
    to: Annotated[Path, typer.Option("--to", metavar="BUYERS.csv", help='Names: column "name", or the first one.')],
    key: Annotated[Path, typer.Option("--key", metavar="FILE", help="The owner's key file; see keygen.")],
    ledger: Annotated[Path, typer.Option("--ledger", metavar="DB", help="Where copies are entered; made if need be.")],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Where the copies go.")] = Path("copies"),
    profile: Profile = None,
    n_bits: NBits = None,
    workers: Annotated[int | None, typer.Option(metavar="N", help="Processes; by default one a core.")] = None,
    dask: Annotated[str | None, typer.Option(metavar="ADDRESS", help="A Dask scheduler, instead of processes.")] = None,
    json: Json = False,
) -> None:
    """Make a marked copy for each buyer, and enter it in the ledger. Interrupted, it goes on where it stood."""
    from o3dmark.cli._running import bar, executor
    from o3dmark.coding.keys import Key
    from o3dmark.copies import Ledger, issue, read_buyers

    started, secret, names = time.perf_counter(), Key.load(key), read_buyers(to)
    made: list[Copy] = []
    elsewhere: tuple[str, ...] = ()
    with Ledger(ledger, writable=True) as opened, executor(workers, dask) as (pool, size), bar() as shown:
        task = shown.add_task(asset.name, total=len(names))
        steps = issue(
            asset,
            names,
            secret,
            opened,
            out,
            profile=profile,
            n_bits=n_bits,
            executor=pool,
            in_flight=2 * size,
        )
        for step in steps:
            made += [step.copy] if step.copy else []
            elsewhere = step.elsewhere
            shown.update(task, completed=step.done)
    report = {"output": [str(out / copy.file) for copy in made], "copies": len(names), "new": len(made)}
    print_result(report | {"elsewhere": elsewhere, "ledger": str(ledger), "seconds": since(started)}, json)
    if elsewhere:
        listed = ", ".join(map(printable, elsewhere[:_MISSING_SHOWN])) + (
            ", ..." if len(elsewhere) > _MISSING_SHOWN else ""
        )
        say(f"issued before, and no longer where they were written: {listed}")


def trace(
    suspect: Annotated[list[Path], typer.Argument(metavar="SUSPECT...", help="Files, folders, ZIP or tar archives.")],
    ledger: Annotated[list[Path], typer.Option("--ledger", metavar="DB", help="Where copies were entered.")],
    key: Annotated[list[Path], typer.Option("--key", metavar="FILE", help="An owner's key file.")],
    reference: Annotated[
        Path | None, typer.Option("--reference", metavar="ASSET", help="The unmarked file, for fragments.")
    ] = None,
    fpr: Annotated[float, typer.Option(help="How often somebody innocent may be named.")] = 1e-6,
    any_scale: AnyScale = False,
    mirrored: Mirrored = False,
    report: Annotated[
        Path | None, typer.Option("--report", metavar="HTML", help="A page of evidence, for others to read.")
    ] = None,
    files: Annotated[
        Path | None, typer.Option(metavar="DIR", help="The folder of the copies, for the page's pictures.")
    ] = None,
    overwrite: Overwrite = False,
    verbose: Verbose = False,
    json: Json = False,
) -> None:
    """Whose copy is it? Exit code 0 when one is named, 1 when none is. With --json a line for each suspect."""
    from o3dmark.cli._running import bar
    from o3dmark.coding.keys import Key
    from o3dmark.copies import Ledger, Tracer, suspects
    from o3dmark.files import check_free, open_asset
    from o3dmark.methods import Depth

    if report is not None:
        check_free(report, *suspect, *ledger, *key, overwrite=overwrite)
    keys = [Key.load(each) for each in key]
    copies: list[Copy] = []
    for path in ledger:
        with Ledger(path) as opened:
            copies += opened.copies()
    cover = None if reference is None else open_asset(reference)
    answers: list[Trace | None] = []
    evidence = None if report is None else _evidence(files)
    with bar() as shown:
        task = shown.add_task("copies made again", total=None, visible=False)
        tracer = Tracer.of(
            copies,
            keys,
            reference=cover,
            false_positive_rate=fpr,
            depth=Depth(mirrored=mirrored, any_scale=any_scale),
            progress=lambda done, of: shown.update(task, completed=done, total=of, visible=True),
        )
        _check_reference(tracer)
        for name, file in suspects(suspect):
            answers.append(answer := _answer(name, file, tracer, json=json, verbose=verbose))
            shown.update(task, visible=False)
            if evidence is not None and answer is not None and isinstance(file, Path):
                evidence.add(_shown(name), file, answer)
    if not answers:
        raise MeshError(f"there is no mesh and no point cloud in {', '.join(map(str, suspect))}")
    if evidence is not None and report is not None:
        evidence.write(report, ledger, shlex.join(["o3dmark", *map(_shown, sys.argv[1:])]))
    if not any(answer.found for answer in answers if answer is not None):
        raise typer.Exit(3 if None in answers else 1)


def _evidence(files: Path | None) -> "Evidence":
    from o3dmark.evidence import Evidence  # and with it all that draws

    return Evidence(files)


def _shown(name: str) -> str:
    """A path as others may read it: of one that starts at the root, its last part."""
    return Path(name).name if Path(name).is_absolute() else name


def _answer(name: str, file: "Path | MeshError", tracer: "Tracer", *, json: bool, verbose: bool) -> "Trace | None":
    """Print what one suspect is; None for what cannot be read."""
    from o3dmark.copies.words import sentence
    from o3dmark.files import open_shape

    started = time.perf_counter()
    try:
        if isinstance(file, MeshError):
            raise file
        found = tracer.trace(open_shape(file))
    except O3dmarkError as error:
        if json:
            print(json_text.dumps({"file": name, "found": False, "error": type(error).__name__, "message": str(error)}))
        else:
            say(f"{printable(name)}: {printable(str(error))}")
        return None
    result = {"file": name} | dict(_fields(found)) | {"seconds": since(started)}
    print_answer(f"{name}: {sentence(found)}", result, _TOLD, json, verbose)
    return found


def _fields(found: "Trace") -> Iterator[tuple[str, Any]]:
    """The fields of the line of a suspect."""
    from o3dmark.mesh.patch import layer

    yield "found", found.found
    yield "copy", found.best.copy.name if found.best and found.found else None
    yield "copies", [named.copy.name for named in found.named]
    yield "p_value", found.best.p_value if found.best else 1.0
    yield "log10_p", found.best.log10_p if found.best else 0.0
    yield "matches", found.best.matches if found.best and found.best.agreement else None
    yield "n_bits", found.best.copy.n_bits if found.best else None
    yield "runner_up", _named(found.runner_up)
    yield "candidates", found.candidates
    yield "source", found.best.copy.source if found.best and found.found else None
    yield "part", found.part
    yield "patches", [patch.to_dict() for patch in found.patches]
    yield "layer", layer(found.patches)
    yield "informed", found.informed


def _named(named: "Named | None") -> dict[str, Any] | None:
    return None if named is None else {"copy": named.copy.name, "p_value": named.p_value}


def _check_reference(tracer: "Tracer") -> None:
    """Errors: MeshError for a reference that is a copy itself: it would make an innocent file speak."""
    if tracer.reference is None:
        return
    from dataclasses import replace

    from o3dmark.coding.words import one_in

    marked = replace(tracer, reference=None).trace(tracer.reference)
    if marked.found and marked.best is not None:
        raise MeshError(
            f"the reference is marked itself: it is the copy of {marked.best.copy.name!r} (the chance that this is a"
            f" mistake is {one_in(marked.best.log10_p)}); give the unmarked file"
        )
