"""A campaign's rows depend on the campaign alone: not on the executor, nor on how often it was interrupted."""

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import pytest

from fixtures.small_campaign import TOML, campaign, comparable, ring
from o3dmark.campaign import Campaign, Ledger, Outcome, load, process_pool, read_rows, run
from o3dmark.campaign.folder import commit
from o3dmark.errors import BackendError, SpecError
from o3dmark.files import write_mesh

pytestmark = pytest.mark.usefixtures("own_registries")
CRASH = '''
import os, signal
from dataclasses import dataclass
from o3dmark.attacks import ATTACKS, Attack

@ATTACKS.register("crash")
@dataclass(frozen=True)
class Crash(Attack):
    """Ends its process when it sees a large mesh."""
    def attack(self, mesh, rng):
        if len(mesh.vertices) > 850:
            os.kill(os.getpid(), signal.SIGKILL)
        return type(mesh)(mesh)
'''


@pytest.fixture(scope="module")
def whole(own_registries: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the small campaign, run in one go."""
    folder = tmp_path_factory.mktemp("whole")
    assert [event.done for event in run(campaign(folder), folder / "out", command="o3dmark bench")] == [0, 1, 2, 3, 4]
    return folder / "out"


def test_interrupted_and_resumed_gives_the_same_rows(tmp_path: Path, whole: Path) -> None:
    plan = campaign(tmp_path)
    events = run(plan, tmp_path / "out")
    next(events), next(events)
    events.close()  # as an interrupt does
    with (tmp_path / "out" / "rows.jsonl").open("a") as file:  # as a kill in the midst of a write does
        lost = (whole / "rows.jsonl").read_text().splitlines(keepends=True)[-6:]
        file.write("".join(lost)[:-9])
    again = list(run(plan, tmp_path / "out"))
    assert again[0].done == 1
    assert len(again) == 1 + 3
    assert comparable(read_rows(tmp_path / "out")) == comparable(read_rows(whole))
    assert [event.done for event in run(plan, tmp_path / "out")] == [4]  # nothing is repeated


def test_killed_and_resumed_gives_the_same_rows(tmp_path: Path, whole: Path) -> None:
    plan = campaign(tmp_path)
    words = [sys.executable, "-m", "o3dmark", "bench", "campaign.toml", "--out", "out", "--workers", "1"]
    process = subprocess.Popen(words, cwd=tmp_path, start_new_session=True)
    rows, end = tmp_path / "out" / "rows.jsonl", time.monotonic() + 100
    while time.monotonic() < end and process.poll() is None and not (rows.exists() and rows.stat().st_size):
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert rows.stat().st_size
    assert list(run(plan, tmp_path / "out"))[-1].done == 4
    assert comparable(read_rows(tmp_path / "out")) == comparable(read_rows(whole))


def test_whatever_prefix_is_on_the_disk_whole_jobs_are_kept(tmp_path: Path, whole: Path) -> None:
    jobs = list(campaign(tmp_path).jobs())
    data = (whole / "rows.jsonl").read_bytes()
    ends = {0, *(len(b"".join(data.splitlines(keepends=True)[: 4 * n])) for n in range(5))}
    for cut in {*range(0, len(data), 197), *ends, *(end - 1 for end in ends if end), len(data) - 2}:
        (tmp_path / "rows.jsonl").write_bytes(data[:cut])
        with Ledger(tmp_path, jobs) as ledger:
            assert len(ledger.done) == sum(0 < end <= cut for end in ends)
        kept = (tmp_path / "rows.jsonl").read_bytes()
        assert kept == data[: max(end for end in ends if end <= cut)]


@pytest.mark.parametrize("kind", ["threads", "processes"])
def test_any_executor_gives_the_same_rows(tmp_path: Path, whole: Path, kind: str) -> None:
    with ThreadPoolExecutor(3) if kind == "threads" else process_pool(1) as executor:
        events = list(run(campaign(tmp_path), tmp_path / "out", executor, in_flight=3))
    assert [event.done for event in events] == [0, 1, 2, 3, 4]
    assert comparable(read_rows(tmp_path / "out")) == comparable(read_rows(whole))


@pytest.mark.filterwarnings("ignore")  # of Dask and what it stands on
def test_dask_gives_the_same_rows(tmp_path: Path, whole: Path) -> None:
    distributed = pytest.importorskip("distributed")
    from o3dmark.campaign import dask_cluster

    options = {"n_workers": 1, "threads_per_worker": 2, "processes": False, "dashboard_address": None}
    with distributed.LocalCluster(**options) as cluster, dask_cluster(cluster.scheduler_address) as (executor, size):
        assert size == 2
        list(run(campaign(tmp_path), tmp_path / "out", executor))
    assert comparable(read_rows(tmp_path / "out")) == comparable(read_rows(whole))


def test_the_job_that_kills_its_process_has_failed_and_the_others_go_on(tmp_path: Path) -> None:
    (tmp_path / "crash.py").write_text(CRASH)
    write_mesh(tmp_path / "small.ply", ring(30))
    text = TOML.replace('"toy.py"', '"toy.py", "crash.py"').replace('"ring.ply"', '"ring.ply"\nSmall = "small.ply"')
    text = text.replace('two = "toy:needs=true"', "").replace("[0, 5]", "1")
    plan = campaign(tmp_path, text.replace('["crop:share=0.1", "reorder"]', '"crash"'))
    with process_pool(1) as pool:
        events = list(run(plan, tmp_path / "out", pool, in_flight=2))
    assert [event.done for event in events] == [0, 1, 2]
    rows = list(read_rows(tmp_path / "out"))
    assert len(rows) == 8
    assert {(row.mesh, row.failure) for row in rows} == {("Ring", "the process ended by SIGKILL"), ("Small", None)}
    assert {row.outcome for row in rows} == {"ok", "failed"}


class Mortal(Executor):
    """Somebody's executor: it does the first job and dies of the next."""

    def __init__(self) -> None:
        self.submitted = 0

    def submit(self, call: Any, /, *arguments: Any, **options: Any) -> Future[Any]:
        self.submitted += 1
        future: Future[Any] = Future()
        if self.submitted == 1:
            future.set_result(call(*arguments))
        else:
            future.set_exception(BrokenProcessPool("killed"))
        return future


def test_another_executor_that_dies_ends_the_run_and_what_is_finished_is_kept(tmp_path: Path) -> None:
    with pytest.raises(BackendError, match="Ring with two"):
        list(run(campaign(tmp_path), tmp_path / "out", Mortal(), in_flight=1))
    assert len(list(read_rows(tmp_path / "out"))) == 4


def test_no_more_than_so_many_jobs_are_in_flight(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Counting(ThreadPoolExecutor):
        waiting = most = 0

        def submit(self, call: Any, /, *arguments: Any, **options: Any) -> Future[Any]:
            self.waiting += 1
            self.most = max(self.most, self.waiting)
            return super().submit(call, *arguments, **options)

    monkeypatch.setattr("o3dmark.campaign.execution.run_job", lambda _: Outcome(()))
    with Counting(1) as executor:
        for event in run(campaign(tmp_path), tmp_path, executor, in_flight=2):
            executor.waiting -= event.job is not None
    assert executor.most == 2


def test_a_folder_belongs_to_one_campaign_and_one_process(tmp_path: Path, whole: Path) -> None:
    jobs = list(campaign(tmp_path).jobs())
    with Ledger(whole, jobs), pytest.raises(BackendError, match="another process"):
        Ledger(whole, jobs)
    with pytest.raises(SpecError, match="not in this campaign"):
        Ledger(whole, jobs[1:])
    assert len(list(read_rows(whole))) == 16
    with pytest.raises(SpecError, match="holds no campaign"):
        load(tmp_path)


def test_a_folder_tells_of_its_campaign_and_methods_without_the_machine_s_folders(tmp_path: Path, whole: Path) -> None:
    plan, kept = campaign(tmp_path), load(whole)
    assert [job.id for job in kept.campaign.jobs()] == [job.id for job in plan.jobs()]
    assert Campaign.from_dict(json.loads(json.dumps(plan.to_dict()))) == kept.campaign
    assert kept.methods["two"] == {
        "spec": "toy:needs=true",
        "says": "The parity of the first vertices' x coordinates.",
        "needs": "key alone (blind)",
        "options": "needs = 1 ()",
    }
    assert str(whole.parent) not in (whole / "campaign.json").read_text()


def test_every_run_that_computed_rows_is_told_of(tmp_path: Path, whole: Path) -> None:
    plan = campaign(tmp_path)
    assert next(run(plan, tmp_path / "out", command="looked only")).done == 0
    assert load(tmp_path / "out").runs == ()
    events = run(plan, tmp_path / "out", command="first")
    next(events), next(events)
    events.close()
    for command in ("second", "third"):  # the third finds nothing to do
        list(run(plan, tmp_path / "out", command=command))
    runs = load(tmp_path / "out").runs
    assert [each.command for each in runs] == ["first", "second"]
    (only,) = load(whole).runs
    assert dataclasses.asdict(only).keys() == {
        "command",
        "started",
        "version",
        "commit",
        "machine",
        "python",
        "seconds",
    }
    assert all(each.seconds is not None and 0 < each.seconds < 600 for each in (*runs, only))
    assert only.commit == commit()


def test_the_commit_is_the_package_s_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def git(*words: str) -> str:
        identity = ["-c", "user.name=a", "-c", "user.email=a@b"]
        return subprocess.run(
            ["git", *identity, *words], cwd=tmp_path, check=True, capture_output=True, text=True
        ).stdout

    package = tmp_path / "venv" / "o3dmark"
    package.mkdir(parents=True)
    (package / "_version.py").write_text("1")
    monkeypatch.setattr("o3dmark.campaign.folder._PACKAGE", package)
    git("init")
    git("commit", "--allow-empty", "-m", "somebody's project")
    assert commit() is None  # the package lies in it, as in a virtual environment, and is no part of it
    git("add", "venv")
    git("commit", "-m", "the package")
    assert commit() == git("rev-parse", "--short", "HEAD").strip()
    (tmp_path / "rows.csv").write_text("results are no change of the program")
    assert "+" not in str(commit())
    (package / "_version.py").write_text("2")
    assert commit() == git("rev-parse", "--short", "HEAD").strip() + "+changes"


def test_meshes_can_be_measured_one_after_the_other(tmp_path: Path) -> None:
    text = TOML.replace('"ring.ply"', '"ring.ply"\nAgain = "ring.ply"')
    list(run(campaign(tmp_path, text), tmp_path / "all"))
    for name in ("again", "RING"):
        list(run(campaign(tmp_path, text, only=[name]), tmp_path / "out"))
        assert {row.mesh for row in read_rows(tmp_path / "out")} == {"Again", "Ring"} - (
            {"Ring"} if name == "again" else set()
        )
    assert comparable(read_rows(tmp_path / "out")) == comparable(read_rows(tmp_path / "all"))
    assert {mesh.name for mesh in load(tmp_path / "out").campaign.meshes} == {"Again", "Ring"}
    with pytest.raises(SpecError, match="--only: 'wing' is none of Ring, Again"):
        campaign(tmp_path, text, only=["wing"])
