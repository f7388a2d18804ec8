"""The examples run, and say what they should; those that draw or measure much are slow."""

import runpy
import shutil
import sys
from pathlib import Path

import pytest

from fixtures.paths import GOLDEN, ROOT

EXAMPLES = ROOT / "examples"
PROGRAMS = sorted(path.stem for path in EXAMPLES.glob("*.py"))


def run(name: str, *words: object) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", [name, *map(str, words)])
        runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")


def test_a_leak_is_traced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run("tracing", GOLDEN / "spot.ply", "--out", tmp_path)
    assert capsys.readouterr().out.splitlines()[-1] == "leaked by: studio south"


def test_the_pipeline_marks_what_it_can_and_names_what_it_cannot(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "in").mkdir()
    shutil.copyfile(GOLDEN / "spot.ply", tmp_path / "in" / "spot.ply")
    (tmp_path / "in" / "notes.txt").write_text("no mesh")
    (tmp_path / "in" / "flat.off").write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    run("pipeline", tmp_path / "in", "--out", tmp_path / "out")
    out = capsys.readouterr().out
    assert "spot.ply Reading('mine', p=" in out
    assert "flat.off: left as it is:" in out
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"owner.key", "spot.ply"}


@pytest.mark.slow
def test_pictures_are_drawn(tmp_path: Path) -> None:
    run("pictures", GOLDEN / "spot.ply", "--out", tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {
        "saliency.png",
        "displacement.png",
        "sheet.png",
        "turntable.gif",
    }


@pytest.mark.slow
def test_a_mark_is_read_from_points(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run("point_cloud", "--out", tmp_path)
    assert "Reading('mine', p=" in capsys.readouterr().out
    assert (tmp_path / "scan.ply").exists()


@pytest.mark.slow
def test_one_s_own_method_gets_a_report(tmp_path: Path) -> None:
    run("own_method", "--out", tmp_path)
    assert "toy" in (tmp_path / "rows" / "report.md").read_text()


def test_every_example_is_named_and_tested() -> None:
    page, tests = (EXAMPLES / "README.md").read_text(), Path(__file__).read_text()
    for name in PROGRAMS:
        assert f"({name}.py)" in page
        assert f'run("{name}"' in tests or name == "own_plugin"
