"""Running a campaign: the jobs that the folder lacks, over an executor, appended as they finish."""

import signal
import time
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass, replace
from os import getpid
from pathlib import Path

from o3dmark.campaign.folder import Kept, Run, load, save, told_of_methods
from o3dmark.campaign.job import Outcome, failed, run_job
from o3dmark.campaign.ledger import Ledger
from o3dmark.campaign.pictures import save_pictures
from o3dmark.campaign.plan import Campaign, Job
from o3dmark.campaign.pool import ProcessPool, process_pool
from o3dmark.campaign.row import PLAN, Row
from o3dmark.errors import BackendError


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
    order in the file does. ``command`` is for the report's header. Meshes that the folder knows stay, whichever the
    campaign has now. A job that kills its process, of a `process_pool`, has failed. Errors: SpecError and BackendError
    as in `Ledger`; BackendError when another executor breaks.
    """
    jobs, kept = list(campaign.jobs()), Kept(campaign, (), told_of_methods(campaign))
    if (Path(directory) / PLAN).exists():
        before = load(directory)
        kept = replace(kept, campaign=campaign.with_meshes_of(before.campaign), runs=before.runs)
    with Ledger(directory, kept.campaign.jobs()) as ledger:
        save(directory, kept)
        missing = [job for job in jobs if job.id not in ledger.done]
        done, this, started = len(jobs) - len(missing), Run.now(command), time.monotonic()
        yield Progress(done, len(jobs))
        results = _in_turn(missing) if executor is None else _submitted(missing, executor, in_flight)
        for job, outcome in results:
            this = replace(this, seconds=round(time.monotonic() - started, 3))
            save(directory, replace(kept, runs=(*kept.runs, this)))
            save_pictures(directory, outcome.pictures, [mesh.name for mesh in kept.campaign.meshes])
            ledger.append(outcome.rows)
            done += 1
            yield Progress(done, len(jobs), job, outcome.rows)


def _in_turn(jobs: Iterable[Job]) -> Iterator[tuple[Job, Outcome]]:
    return ((job, run_job(job)) for job in jobs)


def _submitted(jobs: Iterable[Job], executor: Executor, in_flight: int) -> Iterator[tuple[Job, Outcome]]:
    waiting, running = deque(jobs), dict[Future[Outcome], Job]()
    try:
        while waiting or running:
            try:
                while waiting and len(running) < in_flight:
                    running[executor.submit(run_job, waiting[0])] = waiting[0]
                    waiting.popleft()
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    outcome = _outcome(running[future], future)
                    yield running.pop(future), outcome
            except BrokenExecutor as error:
                yield from _after_a_death(executor, running, error)
                running.clear()
    finally:
        for future in running:
            future.cancel()


def _outcome(job: Job, future: Future[Outcome]) -> Outcome:
    try:
        return future.result()
    except BrokenExecutor:
        raise
    except Exception as error:  # a job that no worker of a cluster survives, for one
        return failed(job, f"{type(error).__name__}: {error}")


def _after_a_death(
    executor: Executor, running: dict[Future[Outcome], Job], error: BrokenExecutor
) -> Iterator[tuple[Job, Outcome]]:
    """The outcomes of the jobs in flight when a process died: one of them may be the reason, so each runs alone."""
    names = ", ".join(sorted({f"{job.mesh.name} with {job.label}" for job in running.values()}))
    if not isinstance(executor, ProcessPool) or not running:
        raise BackendError(
            f"the workers died ({error or 'no reason given'}) while these were at work: {names or 'none'}. What is"
            " finished is kept: run the same command again"
        ) from None
    executor.renew()
    with process_pool(1) as lone:
        for future, job in running.items():
            finished = future.done() and not future.cancelled() and future.exception() is None
            yield job, future.result() if finished else _alone(lone, job)


def _alone(lone: ProcessPool, job: Job) -> Outcome:
    """The outcome of a job in a process of its own. Errors: BackendError when none can be started at all."""
    try:
        lone.submit(getpid).result()
    except BrokenExecutor as error:
        raise BackendError(f"no worker process can be started: {error}") from None
    try:
        return _outcome(job, lone.submit(run_job, job))
    except BrokenExecutor:
        how = "".join(map(_ending, lone.endings()))
        lone.renew()
        return failed(job, f"the process ended{how}")


def _ending(code: int) -> str:
    """An exit code in words."""
    return f" with exit code {code}" if code > 0 else f" by {signal.Signals(-code).name}"
