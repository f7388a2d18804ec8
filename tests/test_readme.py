"""README and docs are true: their code runs, their commands exist, their tables say what the code says."""

import importlib
import re
import shlex
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from fixtures.paths import ROOT
from o3dmark import cli
from o3dmark.campaign import spec_file

README = ROOT / "README.md"
DOCS = [*sorted((ROOT / "docs").rglob("*.md")), ROOT / "CONTRIBUTING.md", ROOT / "examples" / "README.md"]
PAGES = [README, *DOCS]
FENCED = re.compile(r"^```(\w+)(?: (\S+))?\n(.*?)^```", re.DOTALL | re.MULTILINE)  # language, file name, text
OWN = "mine"  # the campaign that docs/campaigns.md shows in full


def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def code(page: Path, language: str) -> list[str]:
    """The blocks of code that are no file."""
    return [text for kind, name, text in FENCED.findall(text_of(page)) if kind == language and not name]


def commands(page: Path) -> list[str]:
    """The lines that call o3dmark, but for the campaigns of the package, which take minutes (see test_campaign)."""
    lines = re.findall(r"^    (o3dmark .*)$", text_of(page), re.MULTILINE)
    return [line for line in lines if line.split()[1] not in ("bench", "report") or line.split()[2].startswith(OWN)]


def run(line: str) -> None:
    with pytest.raises(SystemExit) as leave:
        cli.main(shlex.split(line)[1:])
    assert leave.value.code == 0, line


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which README's commands were run in their order."""
    there = tmp_path_factory.mktemp("readme")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(there)
        (there / "buyers.csv").write_text("b1\nb2\nb3\n")
        for line in commands(README):
            run(line)
    return there


def test_readme_is_short() -> None:
    assert len(text_of(README).splitlines()) <= 130


def test_the_tour_runs_and_prints_what_it_says(capsys: pytest.CaptureFixture[str]) -> None:
    exec(compile(code(README, "python")[0], "README.md", "exec"), {})
    assert capsys.readouterr().out.splitlines() == ["mine", "True"]


EXTENDING = ROOT / "docs" / "extending.md"


def test_the_example_of_a_method_is_one() -> None:
    from o3dmark.methods import METHODS, Method

    try:
        names: dict[str, Any] = {}
        exec(compile(code(EXTENDING, "python")[0], "extending.md", "exec"), names)
        assert issubclass(METHODS["my-method"], Method)
        assert METHODS.make("my-method:strength=0.002").strength == 0.002  # type: ignore[attr-defined]
    finally:
        METHODS._classes.pop("my-method", None)


@pytest.mark.slow
def test_the_example_of_the_page_of_clouds_works() -> None:
    exec(compile(code(ROOT / "docs" / "clouds.md", "python")[0], "clouds.md", "exec"), {})


def test_the_examples_of_an_attack_and_a_metric_work() -> None:
    from o3dmark.attacks import ATTACKS
    from o3dmark.metrics import METRICS

    try:
        exec(compile(code(EXTENDING, "python")[1], "extending.md", "exec"), {})
    finally:
        ATTACKS._classes.pop("swell", None)
        METRICS._classes.pop("growth", None)


def test_readme_s_commands_work_in_their_order(folder: Path) -> None:
    assert len(commands(README)) == 9
    assert {"owner.key", "marked.ply", "attacked.ply", "look.png", "leak.stl"} <= {
        path.name for path in folder.iterdir()
    }


def test_the_commands_of_the_methods_page_work_after_readme_s(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    lines = commands(ROOT / "docs" / "methods.md")
    assert len(lines) == 2
    for line in lines:
        run(line)
    assert "mine" in capsys.readouterr().out


def test_the_campaign_of_the_docs_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from o3dmark.attacks import ATTACKS
    from o3dmark.campaign import load, read_rows

    page = ROOT / "docs" / "campaigns.md"
    monkeypatch.chdir(tmp_path)
    for _, name, text in FENCED.findall(text_of(page)):
        if name:
            (tmp_path / name).write_text(text, encoding="utf-8")
    lines = commands(page)
    assert [line.split()[1] for line in lines] == ["bench", "report"]
    try:
        for line in lines:
            run(line)
    finally:
        ATTACKS._classes.pop("shear", None)
    rows = list(read_rows(OWN))
    assert len(rows) == sum(len(job.readings) for job in load(OWN).campaign.jobs())
    assert [row.failure for row in rows if row.failure] == []
    assert "Somebody 2020" in (tmp_path / OWN / "report.md").read_text(encoding="utf-8")


@pytest.fixture
def ledger(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The ledger of docs/copies.md, made by its last block; the working folder holds it and the files of its copy."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "copies" / "bust").mkdir(parents=True)
    (tmp_path / "copies" / "bust" / "7.glb").write_text("b")
    exec(compile(code(ROOT / "docs" / "copies.md", "python")[-1], "copies.md", "exec"), {})
    return tmp_path / "copies.db"


def test_the_commands_of_the_copies_page_work(ledger: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for line in commands(ROOT / "docs" / "copies.md"):
        if line.split()[1] == "ledger":  # README's and tests/test_copies.py have the others
            run(line)
    assert "buyer 7, Rome" in capsys.readouterr().out


def test_the_copies_page_s_lines_verify_a_ledger_without_o3dmark(
    ledger: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = compile(code(ROOT / "docs" / "copies.md", "python")[0], "copies.md", "exec")
    capsys.readouterr()
    run("o3dmark ledger commit copies.db")
    head = capsys.readouterr().out
    exec(lines, {})
    assert capsys.readouterr().out == head
    with closing(sqlite3.connect(ledger)) as connection, connection:
        connection.execute("UPDATE copies SET name = 'buyer 8, Rome'")
    with pytest.raises(AssertionError, match="row 1 does not fit"):
        exec(lines, {})


def test_the_commands_and_the_code_of_the_pictures_page_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = ROOT / "docs" / "pictures.md"
    monkeypatch.chdir(tmp_path)
    for line in commands(page):
        run(line)
    exec(compile(code(page, "python")[0], "pictures.md", "exec"), {})
    assert {"look.html", "larger.png", "own.html", "larger-own.png"} <= {path.name for path in tmp_path.iterdir()}


def test_other_pages_show_no_command_that_is_not_run() -> None:
    shown = {page.name for page in PAGES if commands(page)}
    assert shown == {"README.md", "methods.md", "campaigns.md", "copies.md", "pictures.md"}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_campaigns_and_campaign_files_are_there(page: Path) -> None:
    for line in re.findall(r"^    o3dmark bench (\S+)", text_of(page), re.MULTILINE):
        assert line == f"{OWN}.toml" or spec_file.find_spec(line).exists()


def test_every_command_and_option_is_named() -> None:
    reference = text_of(ROOT / "docs" / "reference.md").splitlines()
    for name, command in cli.commands().items():
        row = next((line for line in reference if line.startswith(f"| `{name} ")), "")
        assert row, f"docs/reference.md has no row for {name}"
        for parameter in command.params:
            if parameter.param_type_name == "option" and parameter.name not in ("help", "json"):
                assert max(parameter.opts, key=len) in row, f"{name} {parameter.name}"


def test_every_key_of_a_campaign_s_file_is_explained() -> None:
    page = text_of(ROOT / "docs" / "campaigns.md").partition("## The TOML file")[2].partition("###")[0]
    named = set(re.findall(r"^\| `\[?(\w+)(?:\.TABLE)?\]?` \|", page, re.MULTILINE))
    assert named == set(spec_file._KEYS)


def test_what_the_changelog_says_has_moved_is_there_and_no_longer_where_it_was() -> None:
    def there(name: str) -> bool:
        module, _, attribute = name.rpartition(".")
        try:
            return hasattr(importlib.import_module(module), attribute)
        except ModuleNotFoundError:
            return False

    moved = re.findall(
        r"^\| `(o3dmark\S+)`.* \| `(o3dmark\S+)` \|$", text_of(ROOT / "docs" / "changelog.md"), re.MULTILINE
    )
    assert len(moved) > 20
    assert [new for _, new in moved if not there(new)] == []
    assert [old for old, _ in moved if there(old)] == []


def tables() -> list[tuple[Path, str]]:
    """The tables that a script writes: file, name."""
    return [(page, name) for page in PAGES for name in re.findall(r"<!-- table: ([\w -]+) -->", text_of(page))]


@pytest.mark.parametrize(("path", "name"), tables(), ids=lambda value: getattr(value, "stem", value))
def test_the_tables_are_fresh(path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    module = importlib.import_module("tables")
    for folder in module.OF_RESULTS.get(name, (None, ()))[1]:
        if not (module.RESULTS / folder / "campaign.json").exists():  # once it is, the table has to be made of its rows
            pytest.skip(f"results/{folder} is not kept yet")
    fresh = f"<!-- table: {name} -->\n{module.table_of(name, path)}<!-- end -->"
    assert fresh in text_of(path), "run scripts/tables.py"


def test_every_table_that_is_made_is_shown_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    module = importlib.import_module("tables")
    assert sorted(name for _, name in tables()) == sorted([*module.OF_CODE, *module.OF_RESULTS])


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    prose = FENCED.sub("", text_of(page))
    headings = re.findall(r"^#+ (.*)$", prose, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def broken(page: Path) -> list[str]:
    """The links of a page, to files and headings of the repository, that lead nowhere."""
    found = []
    for target in re.findall(r"\]\(([^)\s]+)\)", FENCED.sub("", text_of(page))):
        name, _, anchor = target.partition("#")
        path = page.parent / name if name else page
        if re.match(r"[a-z]+:", target):
            continue
        if not path.exists() or (anchor and anchor not in anchors(path)):
            found.append(target)
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_no_link_is_broken(page: Path) -> None:
    assert broken(page) == []


def test_a_broken_link_is_seen(tmp_path: Path) -> None:
    (tmp_path / "there.md").write_text("# One heading, two words\n")
    page = tmp_path / "page.md"
    page.write_text(
        "[a](there.md) [b](there.md#one-heading-two-words) [c](not.md) [d](there.md#none) [e](https://x.y)\n"
    )
    assert broken(page) == ["not.md", "there.md#none"]


def test_every_page_is_reached_from_readme() -> None:
    reached, left = {README}, [README]
    while left:
        page = left.pop()
        for name in re.findall(r"\]\(([^)#\s]+\.md)", text_of(page)):
            target = (page.parent / name).resolve()
            if target in DOCS and target not in reached:
                reached.add(target)
                left.append(target)
    assert set(DOCS) <= reached


def test_scripts_that_are_named_are_there() -> None:
    pages = [text_of(page) for page in PAGES if page.name != "changelog.md"]  # which names what is gone
    for name in {name for text in pages for name in re.findall(r"\bscripts/\w[\w.]+", text)}:
        assert (ROOT / name).exists(), name
    for name in ("demo", "test", "setup", "remake"):
        assert (ROOT / "scripts" / name).stat().st_mode & 0o111
