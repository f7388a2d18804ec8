"""Running a campaign: the jobs that the folder lacks, over an executor, appended as they finish."""

from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass
from pathlib import Path

from o3dmark.campaign.folder import Run, load, save
from o3dmark.campaign.job import Outcome, failed, run_job
from o3dmark.campaign.ledger import Ledger
from o3dmark.campaign.plan import Campaign, Job
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
    order in the file does. ``command`` is for the report's header. Meshes that the folder has rows of stay, whichever
    the campaign has now. Errors: SpecError and BackendError as in `Ledger`; BackendError when the executor's processes
    die.
    """
    jobs, known, runs = list(campaign.jobs()), campaign, list[Run]()
    if (Path(directory) / PLAN).exists():
        before, runs = load(directory)
        known = campaign.with_meshes_of(before)
    with Ledger(directory, known.jobs()) as ledger:
        save(directory, known, runs)
        missing = [job for job in jobs if job.id not in ledger.done]
        done, this = len(jobs) - len(missing), Run.now(command)
        yield Progress(done, len(jobs))
        results = _in_turn(missing) if executor is None else _submitted(missing, executor, in_flight)
        for job, outcome in results:
            if this not in runs:
                runs.append(this)
                save(directory, known, runs)
            ledger.append(outcome.rows)
            done += 1
            yield Progress(done, len(jobs), job, outcome.rows)


def _in_turn(jobs: Iterable[Job]) -> Iterator[tuple[Job, Outcome]]:
    return ((job, run_job(job)) for job in jobs)


def _submitted(jobs: Iterable[Job], executor: Executor, in_flight: int) -> Iterator[tuple[Job, Outcome]]:
    waiting, running = iter(jobs), dict[Future[Outcome], Job]()
    try:
        while True:
            while len(running) < in_flight and (job := next(waiting, None)):
                running[executor.submit(run_job, job)] = job
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                outcome = _outcome(running[future], future)
                yield running.pop(future), outcome
    except BrokenExecutor as error:
        names = ", ".join(sorted({f"{job.mesh.name} with {job.label}" for job in running.values()}))
        raise BackendError(
            f"a worker process died ({error or 'no reason given'}), perhaps for want of memory, while these were at"
            f" work: {names}. What is finished is kept: run the same command again, with fewer workers"
        ) from None
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
