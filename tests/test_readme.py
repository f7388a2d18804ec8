"""README is true: its Python runs, its commands exist, its tables say what the code says."""

import re
import shlex
from pathlib import Path
from typing import Any

import pytest

from fixtures.paths import ROOT

README = (ROOT / "README.md").read_text()
PYTHON = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
LINES = re.findall(r"^    (o3dmark .*)$", README, re.MULTILINE)
COMMANDS = [line for line in LINES if line.split()[1] not in ("bench", "report")]  # these take minutes; test_campaign


def test_the_tour_runs_and_prints_what_it_says(capsys: pytest.CaptureFixture[str]) -> None:
    exec(compile(PYTHON[0], "README.md", "exec"), {})
    message, present, mrms = capsys.readouterr().out.splitlines()
    assert message.startswith("mine ")
    assert float(message.split()[1]) < 1e-4
    assert present == "True"
    assert float(mrms) <= 6e-4


def test_the_example_of_a_method_is_one() -> None:
    from o3dmark.methods import METHODS, Method

    try:
        names: dict[str, Any] = {}
        exec(compile(PYTHON[1], "README.md", "exec"), names)
        assert issubclass(METHODS["my-method"], Method)
        assert METHODS.make("my-method:strength=0.002").strength == 0.002  # type: ignore[attr-defined]
    finally:
        METHODS._classes.pop("my-method", None)


def test_the_commands_work_in_their_order(tmp_path: Path, monkeypatch: Any, capsys: Any) -> None:
    from o3dmark.cli import main

    monkeypatch.chdir(tmp_path)
    lines = ["o3dmark synth bimba bust.ply", *COMMANDS]
    assert len(lines) > 7
    for line in lines:
        with pytest.raises(SystemExit) as leave:
            main(shlex.split(line)[1:])
        assert leave.value.code == 0, line
    assert "mine" in capsys.readouterr().out


def test_every_command_and_option_is_named() -> None:
    import typer.main

    from o3dmark.cli import app

    for name, command in typer.main.get_command(app).commands.items():  # type: ignore[attr-defined]
        row = next((line for line in README.splitlines() if line.startswith(f"| `{name} ")), "")
        assert row, f"README has no row for {name}"
        for parameter in command.params:
            if parameter.param_type_name == "option" and parameter.name not in ("help", "json"):
                assert max(parameter.opts, key=len) in row, f"{name} {parameter.name}"


def tables() -> list[tuple[Path, str]]:
    """The tables that a script writes: file, name."""
    files = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    return [(path, name) for path in files for name in re.findall(r"<!-- table: ([\w -]+) -->", path.read_text())]


@pytest.mark.parametrize(("path", "name"), tables(), ids=lambda value: getattr(value, "stem", value))
def test_the_tables_are_fresh(path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    import tables

    for folder in tables.OF_RESULTS.get(name, (None, ()))[1]:
        if not (
            tables.RESULTS / folder / "campaign.json"
        ).exists():  # once it is, the table's link to its rows must lead there
            pytest.skip(f"results/{folder} is not kept yet")
    fresh = f"<!-- table: {name} -->\n{tables.table_of(name, path)}<!-- end -->"
    assert fresh in path.read_text(), "run scripts/tables.py"


def test_its_links_lead_somewhere() -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert (ROOT / target).exists(), target
    for name in ("demo", "test", "setup"):
        assert (ROOT / "scripts" / name).stat().st_mode & 0o111
