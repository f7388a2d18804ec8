"""The commands of campaigns: bench, report."""

from pathlib import Path
from typing import Annotated

import typer

from o3dmark.cli._arguments import Json
from o3dmark.cli._talk import print_result


def bench(
    spec: Annotated[str, typer.Argument(metavar="NAME|SPEC.toml", help="A campaign of o3dmark's, or a file.")],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="DIR", help="Where rows go; what is there is not repeated. By default, by its name."
        ),
    ] = None,
    meshes: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder of the campaign's real meshes.")] = None,
    only: Annotated[list[str] | None, typer.Option(metavar="MESH", help="This mesh, and others named so.")] = None,
    plugin: Annotated[
        list[Path] | None, typer.Option(metavar="FILE", help="Python file with own methods, attacks, metrics.")
    ] = None,
    workers: Annotated[int | None, typer.Option(metavar="N", help="Processes; by default one a core.")] = None,
    dask: Annotated[str | None, typer.Option(metavar="ADDRESS", help="A Dask scheduler, instead of processes.")] = None,
    compact: Annotated[
        bool, typer.Option("--compact", help="At the end, rows.csv in the place of rows.jsonl.")
    ] = False,
    summary: Annotated[bool, typer.Option("--summary", help="At the end, summary.csv: counts, and failures.")] = False,
    json: Json = False,
) -> None:
    """Run a campaign: every mesh marked by every method, attacked by everything, read. Interrupted, it can go on."""
    from o3dmark.cli._running import keep, run_campaign

    result = run_campaign(spec, out, meshes, tuple(only or ()), tuple(plugin or ()), workers, dask)
    print_result(result | keep(Path(result["output"]), compact=compact, summary=summary), json)


def report(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="What bench wrote to.")], json: Json = False
) -> None:
    """Write DIR/report.md and DIR/report.html: tables, curves, pictures, beside published figures if it names any."""
    from o3dmark.report import write_report

    markdown, page = write_report(directory)
    print_result({"markdown": str(markdown), "html": str(page)}, json)
