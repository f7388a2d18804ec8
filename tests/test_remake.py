"""One command makes again what README and docs quote."""

import importlib
from pathlib import Path
from types import ModuleType

import pytest

from fixtures.paths import ROOT
from fixtures.small_campaign import campaign
from o3dmark.campaign import load, read_rows, spec_file

pytestmark = pytest.mark.usefixtures("own_registries")


@pytest.fixture
def remake(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The script, with a repository of our own: one campaign that a page quotes, and one that none does."""
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    module = importlib.import_module("remake")
    for folder in ("docs", "results", "specs"):
        (tmp_path / folder).mkdir()
    campaign(tmp_path / "specs")
    (tmp_path / "specs" / "other.toml").write_text('[real]\nA = "a.ply"\n[methods]\na = "saliency-scs"\n')
    (tmp_path / "README.md").write_text("# Nothing\n")
    (tmp_path / "docs" / "page.md").write_text(
        "[rows](../results/campaign/rows.csv)\n<!-- table: codes -->\n<!-- end -->\n"
    )
    for owner in (module, module.tables):
        monkeypatch.setattr(owner, "ROOT", tmp_path)
    monkeypatch.setattr(module.tables, "RESULTS", tmp_path / "results")
    monkeypatch.setattr(spec_file, "SPECS", tmp_path / "specs")
    monkeypatch.chdir(tmp_path)
    return module


def call(remake: ModuleType, monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    monkeypatch.setattr("sys.argv", ["remake", *words])
    return int(remake.main())


def test_what_is_there_is_kept_and_the_rest_is_made(
    remake: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "results" / "campaign"
    for _ in range(2):
        assert call(remake, monkeypatch, "campaign", "--workers", "1") == 0
    assert sorted(path.name for path in out.iterdir() if path.suffix in (".csv", ".jsonl", ".md")) == [
        "report.md",
        "rows.csv",
    ]
    assert len(list(read_rows(out))) == sum(len(job.readings) for job in load(out).campaign.jobs())
    (run,) = load(out).runs  # the second time there was nothing to do
    assert run.command == "o3dmark bench campaign --out results/campaign"
    assert "| `random` |" in (tmp_path / "docs" / "page.md").read_text()

    capsys.readouterr()
    assert call(remake, monkeypatch, "--list") == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first.split()[:3] == ["campaign", f"{run.seconds:.0f}", "s,"]
    assert first.endswith("quoted by docs/page.md")
    assert second.split()[:4] == ["other", "not", "made", "yet"]
    assert second.endswith("quoted by nobody")


def test_only_what_is_quoted_is_made_without_names(remake: ModuleType) -> None:
    assert remake.campaigns() == ["campaign", "other"]
    assert remake.quoted() == ["campaign"]


def test_tables_quote_the_campaigns_that_they_are_made_of(remake: ModuleType, tmp_path: Path) -> None:
    (tmp_path / "README.md").write_text("<!-- table: slender results -->\n<!-- end -->\n")
    assert remake.quotes("slender_small") == ["README.md"]
    assert remake.quotes("invisible") == []


def test_real_meshes_and_known_names_are_asked_for(
    remake: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(remake, monkeypatch, "other") == 2
    assert "--meshes FOLDER is needed for the real meshes of other" in capsys.readouterr().err
    with pytest.raises(SystemExit) as leave:
        call(remake, monkeypatch, "none")
    assert leave.value.code == 2


def test_a_campaign_that_fails_is_told_and_the_others_go_on(
    remake: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    done = []
    monkeypatch.setattr(remake, "remade", lambda name, *_: done.append(name) or name != "other")
    assert call(remake, monkeypatch, "other", "campaign", "--meshes", str(tmp_path)) == 1
    assert done == ["other", "campaign"]
    assert "made: 1 of 2 campaigns; not: other" in capsys.readouterr().err
    assert remake._did(["report", str(tmp_path / "nowhere")]) is False


def test_the_time_is_told_by_the_rows_where_runs_do_not_know_it(remake: ModuleType, tmp_path: Path) -> None:
    from fixtures.kept_folder import PLAIN, keep

    readings = sum(len(job.readings) for job in PLAIN.jobs())
    jobs = len(list(PLAIN.jobs()))
    text = remake.took(keep(tmp_path / "results" / "old", PLAIN))
    assert text == f"not known, {0.5 * readings + jobs:.0f} s of it marking and reading, 2026-11-27"


def test_the_real_pages_quote_campaigns_that_exist(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    remake = importlib.import_module("remake")
    assert {"paper", "shape_spectrum", "attack_sweep"} <= set(remake.quoted())
    made_of = {folder for _, folders in remake.tables.OF_RESULTS.values() for folder in folders}
    assert made_of <= set(remake.campaigns())
