"""A campaign's rows depend on the campaign alone: not on the executor, nor on how often it was interrupted."""

import dataclasses
import itertools
import json
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fixtures.paths import GOLDEN
from o3dmark.campaign import Campaign, Ledger, load, process_pool, read_rows, run, run_job, trial
from o3dmark.campaign import job as job_module
from o3dmark.coding.keys import Key
from o3dmark.errors import BackendError, SpecError
from o3dmark.files import write_mesh
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays, triangle_mesh

CONTRACT = (
    *("mesh", "method", "attack", "seed", "n_bits", "bit_errors", "corr", "message_ok", "p_value"),
    *("mrms", "hausdorff", "msdm", "seconds", "version", "failure"),
)
TIMES = ("seconds", "embed_seconds")
TOML = """
title = "small"
bits = 16
seeds = [0, 5]
wrong_keys = 1
metrics = ["mrms:samples=2000"]
[meshes]
Ring = "ring.ply"
[methods]
informed = "saliency-scs:sync=informed,search=false,sigma=1"
sphere = "saliency-scs:search=false,sigma=1"
[attacks.noise]
"0.05%" = "noise:amplitude=0.0005"
[attacks.cropping]
"10%, shuffled" = ["crop:share=0.1", "reorder"]
"""


def ring() -> TriangleMesh:
    """A rough torus of 900 vertices: enough for 16 bits, and quick."""
    torus = TriangleMesh.create_torus(1.0, 0.4, 45, 20)
    vertices, triangles = mesh_arrays(torus)
    rough = np.random.default_rng(1).uniform(-0.03, 0.03, vertices.shape)
    return triangle_mesh(vertices * [1.0, 0.8, 1.3] + rough, triangles)


def campaign(tmp_path: Path, text: str = TOML, **options: Any) -> Campaign:
    path = tmp_path / "campaign.toml"
    path.write_text(text)
    write_mesh(tmp_path / "ring.ply", ring())
    return Campaign.read(path, **options)


def comparable(rows: Iterator[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows without their timing, in an order that depends on nothing else."""
    kept = [{name: value for name, value in row.items() if name not in TIMES} for row in rows]
    return sorted(kept, key=json.dumps)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the small campaign, run in one go."""
    folder = tmp_path_factory.mktemp("whole")
    assert [event.done for event in run(campaign(folder), folder / "out")] == [0, 1, 2, 3, 4]
    return folder / "out"


def test_every_reading_is_a_row_with_the_fields_of_the_contract(whole: Path) -> None:
    rows = list(read_rows(whole))
    assert len(rows) == 2 * 2 * (1 + 2 + 1)
    assert len({(row["label"], row["seed"], row["group"], row["condition"]) for row in rows}) == len(rows)
    for row in rows:
        assert set(CONTRACT) <= row.keys()
        assert row["failure"] is None
        assert row["message_ok"] is None  # 16 bits carry no message
        assert 0 <= row["bit_errors"] <= 16
        assert 0 < row["mrms"] <= 6e-4
        assert row["hausdorff"] is None is row["msdm"]  # not asked for
    read = {row["group"]: row["corr"] for row in rows if row["label"] == "informed"}
    assert read["no attack"] == read["noise"] == 1.0
    strangers = [row["bit_errors"] for row in rows if row["group"] == "wrong key"]
    assert 2 <= np.mean(strangers) <= 14


def test_a_row_is_what_the_watermark_says(tmp_path: Path) -> None:
    job = next(campaign(tmp_path).jobs())
    marked, row = trial(job), run_job(job)[0]
    read = marked.watermark.extract_bits(marked.marked, marked.key, reference=marked.cover)
    assert row["bit_errors"] == np.count_nonzero(read.bits != marked.expected(marked.key, job.seed))
    assert row["hypotheses"] == read.hypotheses
    with pytest.raises(AssertionError):
        np.testing.assert_array_equal(np.asarray(marked.cover.vertices), np.asarray(marked.marked.vertices))


def test_bits_that_carry_a_message_are_decoded(tmp_path: Path) -> None:
    text = TOML.replace("bits = 16", "bits = 32").replace("seeds = [0, 5]", "seeds = [3]")
    job = next(campaign(tmp_path, text).jobs())
    rows = {row["group"]: row for row in run_job(dataclasses.replace(job, cases=()))}
    assert rows["no attack"]["message_ok"] is True
    assert rows["no attack"]["message_p_value"] < 1e-4
    assert rows["wrong key"]["message_ok"] is False is rows["wrong key"]["message_read"]


def test_interrupted_and_resumed_gives_the_same_rows(tmp_path: Path, whole: Path) -> None:
    plan = campaign(tmp_path)
    events = run(plan, tmp_path / "out")
    next(events), next(events)
    events.close()  # as an interrupt does
    rows = (tmp_path / "out" / "rows.jsonl").read_text()
    with (tmp_path / "out" / "rows.jsonl").open("a") as file:  # as a kill in the midst of a write does
        lost = (whole / "rows.jsonl").read_text().splitlines(keepends=True)[-6:]
        file.write("".join(lost)[:-9])
    again = list(run(plan, tmp_path / "out"))
    assert again[0].done == 1, rows
    assert len(again) == 1 + 3
    assert comparable(read_rows(tmp_path / "out")) == comparable(read_rows(whole))
    assert [event.done for event in run(plan, tmp_path / "out")] == [4]  # nothing is repeated


def test_whatever_prefix_is_on_the_disk_whole_jobs_are_kept(tmp_path: Path, whole: Path) -> None:
    jobs = list(campaign(tmp_path).jobs())
    data = (whole / "rows.jsonl").read_bytes()
    ends = {0, *(len(b"".join(data.splitlines(keepends=True)[: 4 * n])) for n in range(5))}
    for cut in {*range(0, len(data), 97), *ends, *(end - 1 for end in ends if end), len(data) - 2}:
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


def test_a_failing_attack_is_a_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(mesh: Any, attacks: Any, rng: Any) -> Any:
        if attacks:
            raise RuntimeError("out of luck")
        return mesh

    monkeypatch.setattr(job_module, "attack_all", broken)
    rows = run_job(next(campaign(tmp_path).jobs()))
    assert Counter(row["failure"] for row in rows) == {None: 2, "RuntimeError: out of luck": 2}
    assert all(set(CONTRACT) <= row.keys() for row in rows)
    assert {row["corr"] for row in rows if row["failure"]} == {None}
    assert all(row["mrms"] > 0 for row in rows)


def test_a_mesh_that_cannot_be_marked_fails_in_every_row(tmp_path: Path) -> None:
    job = next(campaign(tmp_path, TOML.replace("bits = 16", "bits = 4000")).jobs())
    rows = run_job(job)
    assert len(rows) == len(job.readings)
    assert all(row["failure"].startswith("marking: CapacityError: 4000 bits") for row in rows)


def test_a_file_that_has_changed_is_not_measured(tmp_path: Path) -> None:
    job = next(campaign(tmp_path).jobs())
    write_mesh(tmp_path / "ring.ply", TriangleMesh.create_sphere(1.0, 25))
    assert all("is not the file" in row["failure"] for row in run_job(job))


class Mortal(Executor):
    """Its workers do the first job and die of the next."""

    def __init__(self) -> None:
        self.submitted = 0

    def submit(self, call: Any, /, *arguments: Any, **options: Any) -> Future[Any]:
        self.submitted += 1
        future: Future[Any] = Future()
        if self.submitted == 1:
            future.set_result([{"job": arguments[0].id, "failure": None}])
        else:
            future.set_exception(BrokenProcessPool("killed"))
        return future


def test_a_dead_worker_ends_the_run_and_keeps_what_is_finished(tmp_path: Path) -> None:
    with pytest.raises(BackendError, match="Ring with sphere"):
        list(run(campaign(tmp_path), tmp_path, Mortal(), in_flight=1))
    assert len(list(read_rows(tmp_path))) == 1


def test_no_more_than_so_many_jobs_are_in_flight(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Counting(ThreadPoolExecutor):
        waiting = most = 0

        def submit(self, call: Any, /, *arguments: Any, **options: Any) -> Future[Any]:
            self.waiting += 1
            self.most = max(self.most, self.waiting)
            return super().submit(call, *arguments, **options)

    monkeypatch.setattr("o3dmark.campaign.execution.run_job", lambda job: [{"job": job.id}])
    with Counting(1) as executor:
        for event in run(campaign(tmp_path), tmp_path, executor, in_flight=2):
            executor.waiting -= event.job is not None
    assert executor.most == 2


def test_the_hash_names_the_content_and_not_the_folder(tmp_path: Path) -> None:
    first, *others = campaign(tmp_path).jobs()
    assert first.id == next(campaign(tmp_path).jobs()).id
    assert len({first.id, *(job.id for job in others)}) == 1 + len(others)
    moved = dataclasses.replace(first.mesh, source="/elsewhere/ring.ply")
    assert dataclasses.replace(first, mesh=moved).id == first.id
    changes: list[dict[str, Any]] = [{"seed": 9}, {"n_bits": 17}, {"wrong_keys": 0}, {"cases": first.cases[:1]}]
    changes += [{"mesh": dataclasses.replace(first.mesh, digest="0")}, {"metrics": ()}, {"method": "shape-spectrum"}]
    assert len({dataclasses.replace(first, **change).id for change in changes} | {first.id}) == 1 + len(changes)


def test_a_hash_stays_what_it_was() -> None:
    """Written by the first version: rows kept since then must not be measured again."""
    from o3dmark.campaign import Case, Job, Source

    cases = (Case("noise", "0.05%", ("noise:amplitude=0.0005",)),)
    job = Job(Source("Bimba", "bimba"), "a", "saliency-scs", 64, "random", 0, cases, 2, ("mrms",))
    assert job.id == "1e1e4f94142baa3a"


def test_a_campaign_survives_json_and_its_folder_tells_of_it(tmp_path: Path, whole: Path) -> None:
    plan = campaign(tmp_path)
    assert Campaign.from_dict(json.loads(json.dumps(plan.to_dict()))) == plan
    kept, about = load(whole)
    assert [mesh.digest for mesh in kept.meshes] == [mesh.digest for mesh in plan.meshes]
    assert list(kept.jobs())[3].id == list(plan.jobs())[3].id
    assert about.keys() >= {"command", "started", "version", "machine"}


def test_a_folder_belongs_to_one_campaign_and_one_process(tmp_path: Path, whole: Path) -> None:
    jobs = list(campaign(tmp_path).jobs())
    with Ledger(whole, jobs), pytest.raises(BackendError, match="another process"):
        Ledger(whole, jobs)
    with pytest.raises(SpecError, match="not in this campaign"):
        Ledger(whole, jobs[1:])
    assert len(list(read_rows(whole))) == 16
    with pytest.raises(SpecError, match="holds no campaign"):
        load(tmp_path)


def test_real_meshes_replace_their_stand_ins(tmp_path: Path) -> None:
    text = TOML.replace("ring.ply", "vase") + '[real]\nRing = "spot.ply"\n'
    assert [mesh.public for mesh in campaign(tmp_path, text).meshes] == ["vase"]
    (mesh,) = campaign(tmp_path, text, real=GOLDEN).meshes
    assert (mesh.name, mesh.public, len(mesh.digest)) == ("Ring", "spot.ply", 64)
    assert str(GOLDEN) not in json.dumps(dataclasses.asdict(mesh) | {"source": mesh.public})


def test_globs_name_meshes_by_their_files(tmp_path: Path) -> None:
    (tmp_path / "scans").mkdir()
    for name in ("b", "a"):
        write_mesh(tmp_path / "scans" / f"{name}.ply", ring())
    plan = campaign(tmp_path, f'files = ["scans/*.ply"]\n{TOML}')
    assert [mesh.name for mesh in plan.meshes] == ["Ring", "a", "b"]


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("bits = 16", "bits = 0", "bits: "),
        ("bits = 16", 'bits = "many"', "bits: "),
        ("bits = 16", "bitz = 16", "bitz: .*did you mean 'bits'"),
        ("seeds = [0, 5]", "seeds = [1, 1]", "seeds: .*twice"),
        ("seeds = [0, 5]", "seeds = 0.5", "seeds: "),
        ("wrong_keys = 1", "wrong_keys = -1", "wrong_keys: "),
        ('["mrms:samples=2000"]', '["mrmz"]', "metrics: .*mrms"),
        ('["mrms:samples=2000"]', '["mrms", "mrms:samples=9"]', "metrics: .*twice"),
        ('["mrms:samples=2000"]', '"mrms"', "metrics: should be a list"),
        ("ring.ply", "none.ply", "meshes.Ring: cannot read"),
        ('"ring.ply"', '"sput"', "meshes.Ring: no shape is called 'sput'"),
        ("saliency-scs:sync=informed", "magic:a=1", "methods.informed: no method is called 'magic'"),
        ("sync=informed", "sync=other", "methods.informed: "),
        ("noise:amplitude=0.0005", "noise:size=1", "attacks.noise.0.05%: .*no option 'size'"),
        ('["crop:share=0.1", "reorder"]', "7", "attacks.cropping.10%, shuffled: "),
        ("[attacks.noise]", '[attacks."no attack"]', "attacks.no attack: "),
        ("[meshes]", '[imperceptibility]\nx = "y"\n[meshes]', "imperceptibility.x: 'y' is none of informed, sphere"),
        ("[meshes]", '[gallery]\nattacks = ["noise/9%"]\n[meshes]', "gallery.attacks: 'noise/9%'"),
        ("[meshes]", "[gallery]\nsize = 3\n[meshes]", "gallery.size: no such key"),
        ("[meshes]", "[shapes]", "shapes: no such key"),
        ("[meshes]", 'code = "x"\n[meshes]', "code: no code is called 'x'"),
        ('title = "small"', "title = small", "cannot read the campaign"),
    ],
)
def test_mistakes_in_the_file_are_named(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    assert old in TOML
    with pytest.raises(SpecError, match=complaint):
        campaign(tmp_path, TOML.replace(old, new))


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"nowhere\.toml"):
        Campaign.read(tmp_path / "nowhere.toml")


@pytest.mark.parametrize("name", ["quick", "paper", "stress"])
def test_the_campaigns_of_the_repo_are_sound(name: str) -> None:
    path = Path(__file__).parent.parent / "scripts" / "campaigns" / f"{name}.toml"
    plan = Campaign.read(path)
    assert not any(mesh.digest for mesh in plan.meshes), "synthetic meshes only"
    assert len({job.id for job in plan.jobs()}) == len(plan.meshes) * len(plan.methods) * len(plan.seeds)


def test_keys_of_campaigns_differ() -> None:
    keys = [job_module.key_of(label) for label in ("seed 0", "seed 1", "stranger 1 of seed 0")]
    assert all(isinstance(key, Key) for key in keys)
    assert all(one != other for one, other in itertools.combinations(keys, 2))
