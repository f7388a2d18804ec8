"""Campaigns at the command line: which executor, and the bar that says how long it will take."""

import os
import shlex
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from o3dmark.errors import SpecError


def run_campaign(
    name: str,
    out: Path | None,
    meshes: Path | None,
    only: tuple[str, ...],
    plugins: tuple[Path, ...],
    workers: int | None,
    dask: str | None,
) -> dict[str, Any]:
    """Run what ``out`` lacks of the campaign of that name or file; what `bench` prints at the end."""
    from o3dmark.campaign import find_spec, read_campaign, run

    started, rows, failures, done = time.perf_counter(), 0, 0, 0
    spec = find_spec(name)
    campaign = read_campaign(spec, meshes, only=only, plugins=plugins)
    options = [("--out", out), ("--meshes", meshes), *(("--only", each) for each in only)]
    command, out = _command(name, options + [("--plugin", each) for each in plugins]), out or Path(spec.stem)
    with executor(workers, dask) as (pool, size), bar() as shown:
        task = shown.add_task(campaign.title, total=None)
        for event in run(campaign, out, pool, in_flight=2 * size, command=command):
            rows, done = rows + len(event.rows), event.done
            failures += sum(row.failure is not None for row in event.rows)
            shown.update(task, total=event.total, completed=event.done, description=_doing(campaign.title, event.job))
    seconds = round(time.perf_counter() - started, 1)
    return {"output": str(out), "jobs": done, "new_rows": rows, "failures": failures, "seconds": seconds}


def keep(out: Path, *, compact: bool, summary: bool) -> dict[str, str]:
    """Bring a folder into the form that is kept; the files that were written."""
    from o3dmark import campaign

    written = {"summary": str(campaign.summarise(out))} if summary else {}
    return written | ({"compact": str(campaign.compact(out))} if compact else {})


def _command(name: str, options: list[tuple[str, str | Path | None]]) -> str:
    """What was typed, as a report may quote it: of a path that starts at the root, its last part."""
    words = ["o3dmark", "bench", _shown(name)]
    for option, value in options:
        words += [] if value is None else [option, _shown(value)]
    return shlex.join(words)


def _shown(value: str | Path) -> str:
    return Path(value).name if Path(value).is_absolute() else str(value)


@contextmanager
def executor(workers: int | None, dask: str | None) -> Iterator[tuple[Any, int]]:
    """The executor and how many jobs it runs at a time."""
    from o3dmark.campaign import dask_cluster, process_pool

    if dask is not None:
        if workers is not None:
            raise SpecError("give either --workers or --dask: a cluster has the workers that it has")
        with dask_cluster(dask) as cluster:
            yield cluster
        return
    size = os.cpu_count() or 1 if workers is None else workers
    if size < 1:
        raise SpecError(f"--workers should be 1 or more, not {size}")
    with process_pool(size) as pool:
        yield pool, size


def bar() -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    console = Console(stderr=True)
    return Progress(*columns, TimeRemainingColumn(), console=console, transient=True, disable=not sys.stderr.isatty())


def _doing(title: str, job: Any) -> str:
    return title if job is None else f"{title}: {job.mesh.name}, {job.label}"
