"""The commands of campaigns: bench, report."""

from pathlib import Path
from typing import Annotated

import typer

from o3dmark.cli._arguments import Json
from o3dmark.cli._talk import print_result


def bench(
    spec: Annotated[Path, typer.Argument(metavar="SPEC.toml", help="The campaign; see scripts/campaigns.")],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Where rows go; what is there is not repeated.")],
    workers: Annotated[int | None, typer.Option(metavar="N", help="Processes; by default one a core.")] = None,
    dask: Annotated[str | None, typer.Option(metavar="ADDRESS", help="A Dask scheduler, instead of processes.")] = None,
    meshes: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder of the campaign's real meshes.")] = None,
    json: Json = False,
) -> None:
    """Run a campaign: every mesh marked by every method, attacked by everything, read. Interrupted, it can go on."""
    from o3dmark.cli._running import run_campaign

    words = [f"o3dmark bench {spec} --out {out}"] + ([] if meshes is None else [f"--meshes {meshes}"])
    print_result(run_campaign(spec, out, workers, dask, meshes, " ".join(words)), json)


def report(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="What bench wrote to.")], json: Json = False
) -> None:
    """Write DIR/report.md and DIR/report.html: tables beside the paper's, curves, pictures."""
    from o3dmark.report import write_report

    markdown, page = write_report(directory)
    print_result({"markdown": str(markdown), "html": str(page)}, json)
