"""Running a campaign: the jobs that the folder lacks, over an executor, appended as they finish."""

import datetime
import json
import os
import platform
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from o3dmark._version import __version__
from o3dmark.campaign.job import Row, failed_rows, run_job
from o3dmark.campaign.ledger import Ledger
from o3dmark.campaign.plan import Campaign, Job
from o3dmark.errors import BackendError, SpecError
from o3dmark.files import replacing

PLAN = "campaign.json"


@dataclass(frozen=True)
class Progress:
    """``done`` of ``total`` jobs are in the folder; the last one just now, with these rows (none at the start)."""

    done: int
    total: int
    job: Job | None = None
    rows: tuple[Row, ...] = ()


def run(
    campaign: Campaign,
    directory: str | Path,
    executor: Executor | None = None,
    *,
    in_flight: int = 8,
    command: str = "",
) -> Iterator[Progress]:
    """Do what the folder lacks of a campaign: first where it stands, then an event for each job that is finished.

    ``executor``: where jobs run; none: here, one after the other. No more than ``in_flight`` are handed over at a time,
    so memory does not grow with the campaign. Rows do not depend on any of these, nor on earlier interruptions; their
    order in the file does. ``command`` is for the report's header.
    Errors: SpecError and BackendError as in `Ledger`; BackendError when the executor's processes die.
    """
    jobs = list(campaign.jobs())
    with Ledger(directory, jobs) as ledger:
        _save_plan(campaign, Path(directory), command)
        missing, done = [job for job in jobs if job.id not in ledger.done], len(ledger.done)
        yield Progress(done, len(jobs))
        results = _in_turn(missing) if executor is None else _submitted(missing, executor, in_flight)
        for job, rows in results:
            ledger.append(rows)
            done += 1
            yield Progress(done, len(jobs), job, tuple(rows))


def load(directory: str | Path) -> tuple[Campaign, dict[str, Any]]:
    """The campaign that a folder holds the rows of, and what is known of its run. Errors: SpecError when none is."""
    path = Path(directory) / PLAN
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return Campaign.from_dict(content["campaign"]), content["about"]
    except OSError:
        raise SpecError(
            f"{directory} holds no campaign; `o3dmark bench SPEC.toml --out {directory}` makes one"
        ) from None
    except (ValueError, KeyError, TypeError) as error:
        raise SpecError(f"{path} is damaged: {error}") from None


def about(command: str = "") -> dict[str, Any]:
    """What a reader of the results wants to know of the run: when, by which version, on what kind of machine."""
    return {
        "command": command,
        "started": datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "version": __version__,
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores",
        "python": platform.python_version(),
    }


def _save_plan(campaign: Campaign, directory: Path, command: str) -> None:
    known = about(command)
    if (directory / PLAN).exists():
        known |= {name: load(directory)[1].get(name) for name in ("started", "command")}
    with replacing(directory / PLAN) as draft:
        draft.write_text(json.dumps({"about": known, "campaign": campaign.to_dict()}, indent=1), encoding="utf-8")


def _in_turn(jobs: Iterable[Job]) -> Iterator[tuple[Job, list[Row]]]:
    return ((job, run_job(job)) for job in jobs)


def _submitted(jobs: Iterable[Job], executor: Executor, in_flight: int) -> Iterator[tuple[Job, list[Row]]]:
    waiting, running = iter(jobs), dict[Future[list[Row]], Job]()
    try:
        while True:
            while len(running) < in_flight and (job := next(waiting, None)):
                running[executor.submit(run_job, job)] = job
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                rows = _rows(running[future], future)
                yield running.pop(future), rows
    except BrokenExecutor as error:
        names = ", ".join(sorted({f"{job.mesh.name} with {job.label}" for job in running.values()}))
        raise BackendError(
            f"a worker process died ({error or 'no reason given'}), perhaps for want of memory, while these were at"
            f" work: {names}. What is finished is kept: run the same command again, with fewer workers"
        ) from None
    finally:
        for future in running:
            future.cancel()


def _rows(job: Job, future: Future[list[Row]]) -> list[Row]:
    try:
        return future.result()
    except BrokenExecutor:
        raise
    except Exception as error:  # a job that no worker of a cluster survives, for one
        return failed_rows(job, error)
