"""Own methods and attacks, in worker processes too; and what `o3dmark bench` says and prints."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from fixtures.small_campaign import TOML, campaign
from o3dmark.attacks import ATTACKS
from o3dmark.campaign import Plugin, load, read_rows, run_job
from o3dmark.campaign.plugins import load_plugins
from o3dmark.cli import main
from o3dmark.errors import SpecError

pytestmark = pytest.mark.usefixtures("own_registries")
MINE = """
from dataclasses import dataclass
from o3dmark.attacks import ATTACKS, Attack

@ATTACKS.register("mine")
@dataclass(frozen=True)
class Mine(Attack):
    def attack(self, mesh, rng):
        return type(mesh)(mesh)
"""


def bench(folder: Path, *words: object) -> tuple[int, Any, str]:
    """Exit code, JSON and stderr of `o3dmark bench` in a process of its own, in a folder."""
    line = [sys.executable, "-m", "o3dmark", "bench", *map(str, words), "--json"]
    done = subprocess.run(line, cwd=folder, capture_output=True, text=True, check=False)
    return done.returncode, json.loads(done.stdout or "null"), done.stderr


def test_plug_ins_work_from_any_folder_and_in_workers(tmp_path: Path) -> None:
    (tmp_path / "specs" / "own").mkdir(parents=True)
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "specs" / "own" / "mine.py").write_text(MINE)
    plugins = ["--plugin", "../specs/own/mine.py"]
    text = TOML.replace('["crop:share=0.1", "reorder"]', '"mine"').replace("[0, 5]", "1")
    campaign(tmp_path / "specs", text, plugins=[tmp_path / "specs" / "own" / "mine.py"])  # writes the files
    spec = tmp_path / "specs" / "campaign.toml"
    code, result, _ = bench(
        tmp_path / "elsewhere", spec, *plugins, "--workers", 1, "--only", "ring", "--compact", "--summary"
    )
    folder = tmp_path / "elsewhere" / "campaign"  # by the campaign's name, in the working directory
    assert code == 0
    assert result.pop("seconds") > 0
    assert result == {
        "output": "campaign",
        "jobs": 2,
        "new_rows": 8,
        "failures": 0,
        "summary": "campaign/summary.csv",
        "compact": "campaign/rows.csv",
    }
    rows = list(read_rows(folder))
    assert {row.failure for row in rows} == {None}
    assert {row.method for row in rows} == {"toy", "toy:needs=true"}
    assert {row.bit_errors for row in rows if row.attack == "mine"} == {0}
    (only,) = load(folder).runs
    assert only.command == "o3dmark bench campaign.toml --only ring --plugin ../specs/own/mine.py"
    assert str(tmp_path) not in (folder / "campaign.json").read_text()


def test_the_campaigns_of_the_package_are_found_from_anywhere(tmp_path: Path) -> None:
    code, result, _ = bench(tmp_path, "quick", "--only", "Nobody")
    assert (code, result["error"]) == (2, "SpecError")
    assert result["message"] == "--only: 'Nobody' is none of Flower, Vase, Bimba"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["quik"], "did you mean 'quick'"),
        (["nowhere.toml"], "cannot read the campaign nowhere.toml"),
        (["any_mesh"], "files: no mesh file"),
        (["shape_spectrum"], "needs the folder of its real meshes: --meshes"),
        (["quick", "--plugin", "nowhere.py"], "cannot read the plug-in nowhere.py"),
        (["etc.toml"], "files: no mesh file"),
        (["quick", "--workers", "2", "--dask", "tcp://x:1"], "either --workers or --dask"),
        (["quick", "--workers", "0"], "--workers should be 1 or more"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any, words: list[str], complaint: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("etc.toml").write_text('files = ["/etc/*.ply"]\n[methods]\na = "saliency-scs"\n')
    for json_too in ([], ["--json"]):
        with pytest.raises(SystemExit) as leave:
            main(["bench", *words, *json_too])
        assert leave.value.code == 2
        out, err = capsys.readouterr()
        text = json.loads(out)["message"] if json_too else err
        assert complaint in text
        assert len(text.strip().splitlines()) == 1


def test_another_content_is_another_job(tmp_path: Path) -> None:
    before = next(campaign(tmp_path).jobs())
    (tmp_path / "note.py").write_text("NOTE = 1\n")
    one = next(campaign(tmp_path, TOML.replace('"toy.py"', '"toy.py", "note.py"')).jobs())
    (tmp_path / "note.py").write_text("NOTE = 2\n")
    other = next(campaign(tmp_path, TOML.replace('"toy.py"', '"toy.py", "note.py"')).jobs())
    assert len({before.id, one.id, other.id}) == 3


def test_a_plug_in_that_has_changed_is_not_measured_with(tmp_path: Path) -> None:
    (tmp_path / "late.py").write_text("x = 1\n")
    job = next(campaign(tmp_path, TOML.replace('"toy.py"', '"toy.py", "late.py"')).jobs())
    del sys.modules[f"o3dmark_plugin_{job.plugins[1].digest[:16]}"]  # as in a worker that starts now
    (tmp_path / "late.py").write_text("x = 2\n")
    failures = {row.failure for row in run_job(job).rows}
    assert failures == {"marking: SpecError: late.py is not the plug-in that the campaign was planned with"}


@pytest.mark.parametrize(
    ("name", "text", "complaint"),
    [
        ("a.py", "1 / 0", "the plug-in a.py fails: ZeroDivisionError"),
        ("b.py", "def", "the plug-in b.py fails: SyntaxError"),
        ("c.txt", "x = 1", "the plug-in c.txt is no Python file"),
        ("d.py", MINE.replace("mine", "noise"), "the plug-in d.py fails: ValueError: two classes want the attack name"),
    ],
)
def test_a_plug_in_that_fails_is_named(tmp_path: Path, name: str, text: str, complaint: str) -> None:
    assert "noise" in ATTACKS
    (tmp_path / name).write_text(text)
    for _ in range(2):  # a half-loaded one is not taken for one that works
        with pytest.raises(SpecError, match=complaint):
            load_plugins([Plugin.of(tmp_path / name)])
