"""Tables of README and docs are made from rows alone, and say who computed them."""

import importlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import pytest

from fixtures.kept_folder import COMPARED, PLAIN, RUN, invented_rows, keep
from fixtures.paths import ROOT
from o3dmark.campaign.plan import Campaign, Source
from o3dmark.campaign.row import UNMARKED, WRONG_KEY, Row
from o3dmark.errors import SpecError

VASE = (Source("Vase", "vase"),)


@pytest.fixture
def tables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """The script, with a folder of results and a README of our own."""
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    module = importlib.import_module("tables")
    monkeypatch.setattr(module, "ROOT", tmp_path)
    monkeypatch.setattr(module, "RESULTS", tmp_path / "results")
    monkeypatch.setattr("sys.argv", ["tables.py"])
    module.results.cache_clear()
    yield module
    module.results.cache_clear()


def kept(tables: ModuleType, name: str, campaign: Campaign, rows: list[Row] | None = None) -> Path:
    return keep(tables.RESULTS / name, campaign, rows)


def lines(table: str) -> dict[str, list[str]]:
    """The lines of a table by their first cells."""
    cells = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in table.splitlines()]
    return {first: others for first, *others in cells}


def set_corr(**of_mesh: float) -> list[Row]:
    """Rows of the plain campaign in which every reading of a mesh has the same Corr."""
    return invented_rows(PLAIN, lambda row: replace(row, corr=of_mesh[row.mesh]))


def test_the_table_of_shape_spectrum_joins_both_campaigns_and_shows_their_bits(tables: ModuleType) -> None:
    kept(tables, "shape_spectrum", COMPARED, set_corr(Bimba=1.0, Vase=0.9999, Bunny=-0.25))
    small = replace(PLAIN, bits=(32,), seeds=(0,), meshes=VASE)
    kept(tables, "shape_spectrum_small", small, invented_rows(small, lambda row: replace(row, corr=0.5)))
    table = lines(tables.spectrum_table())
    assert table["mean Corr"] == ["Bimba", "Vase", "Bunny", "Vase", "published"]
    assert table["bits"] == ["64", "64", "64", "32", ""]
    assert table["keys"] == ["2", "2", "2", "1", ""]
    assert table["noise 0.50%"] == ["1.00", "0.99", "−0.25", "0.50", f"{(0.79 + 0.72) / 2:.2f}"]
    assert table["pipelines all at once"] == ["1.00", "0.99", "−0.25", "0.50", "–"]


def test_without_published_figures_there_is_no_such_column(tables: ModuleType) -> None:
    for name in tables.SPECTRUM:
        kept(tables, name, PLAIN)
    assert lines(tables.spectrum_table())["mean Corr"] == ["Bimba", "Vase", "Bunny"] * 2


def test_known_messages_are_counted_where_a_bit_is_wrong(tables: ModuleType) -> None:
    wrong = ("Vase", "0.50%")

    def change(row: Row) -> Row:
        errors = int((row.mesh, row.condition) == wrong and row.seed == 0)
        return replace(row, bit_errors=errors, corr=0.5, log10_p_best=(-9.0, -5.0)[row.seed])

    kept(tables, "shape_spectrum", PLAIN, invented_rows(PLAIN, change))
    kept(tables, "shape_spectrum_small", PLAIN, invented_rows(PLAIN, lambda row: replace(row, bit_errors=0)))
    _, _, *rows = tables.known_message_table().splitlines()
    assert rows == ["| Vase, 64 | noise 0.50% | 0.50 | 2 of 2 | 1 of 2 | −7.0 |"]


def test_fragments_stand_beside_their_controls(tables: ModuleType) -> None:
    figures = {"": (1.0, -17.0), WRONG_KEY: (0.125, -0.5), UNMARKED: (-0.125, -1.0)}

    def change(row: Row) -> Row:
        corr, log10_p = figures[row.control]
        return replace(row, corr=corr, log10_p=log10_p, bit_errors=0)

    campaign = replace(PLAIN, controls=("noise", "subdivision", "pipelines"))
    kept(tables, "informed_crop", campaign, invented_rows(campaign, change))
    assert lines(tables.informed_table())["noise 0.50%"] == ["6", "6", "1.00", "0.12", "−0.12", "0.1"]


def test_saliency_scs_has_the_most_bits_by_mesh_and_the_least_corr_of_the_fewest(tables: ModuleType) -> None:
    campaign = replace(PLAIN, bits=(16, 64), main="first")

    def change(row: Row) -> Row:
        return replace(row, corr=0.5 if row.n_bits == 64 else 1.0 - (row.mesh == "Bunny") * (row.seed == 1) / 4)

    kept(tables, "saliency_scs", campaign, invented_rows(campaign, change))
    table = lines(tables.saliency_scs_table())
    assert table["mean Corr"] == ["Bimba, 64 bits", "Vase, 64 bits", "Bunny, 64 bits", "least of all, 16 bits"]
    assert table["noise 0.50%"] == ["0.50", "0.50", "0.50", "0.75"]


def test_the_table_of_the_paper_is_that_of_the_report(tables: ModuleType) -> None:
    kept(tables, "paper", COMPARED, set_corr(Bimba=1.0, Vase=0.5, Bunny=-1.0))
    table = lines(tables.campaign_table())
    assert table["noise 0.50%"] == [f"{(0.79 + 0.72) / 2:.2f}", "0.75", "0.75"]
    assert table["noise 0.05%"] == ["1.00", "1.00", "1.00"]


def test_a_line_says_who_computed_the_rows(tables: ModuleType, tmp_path: Path) -> None:
    later = RUN | {"command": "o3dmark bench small --only Vase", "started": "2026-11-29 09:00 UTC"}
    keep(tables.RESULTS / "paper", PLAIN, runs=(RUN, later, later))
    assert tables.made_by("paper", tmp_path / "docs" / "deep" / "paper.md") == (
        "Measured by `o3dmark bench small --out small`, `o3dmark bench small --only Vase` on 2026-11-27 to 2026-11-29"
        " (o3dmark 0.2.0, commit abc1234; Linux x86_64, 2 cores, Python 3.11.7):"
        " [rows](../../results/paper/rows.jsonl).\n"
    )


def test_tables_are_written_wherever_they_are_wanted(tables: ModuleType, tmp_path: Path) -> None:
    kept(tables, "paper", COMPARED)
    (tmp_path / "docs").mkdir()
    readme, page = tmp_path / "README.md", tmp_path / "docs" / "page.md"
    readme.write_text("a\n<!-- table: codes -->\nold\n<!-- end -->\nb\n<!-- table: rows -->\n<!-- end -->\n")
    page.write_text("c\n<!-- table: campaign results -->\n<!-- end -->\nd\n")
    assert tables.main() == 0
    assert readme.read_text().startswith("a\n<!-- table: codes -->\n| name |")
    assert "old" not in readme.read_text()
    assert "\n<!-- end -->\nb\n" in readme.read_text()
    assert "| `log10_p_best` |" in readme.read_text()
    assert "| noise 0.50% |" in page.read_text()
    assert "[rows](../results/paper/rows.jsonl)" in page.read_text()


def test_check_says_what_is_stale_and_writes_nothing(
    tables: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "README.md").write_text("<!-- table: codes -->\nold\n<!-- end -->\n")
    monkeypatch.setattr("sys.argv", ["tables.py", "--check"])
    assert tables.main() == 1
    assert capsys.readouterr().out == "README.md: stale\n"
    assert "old" in (tmp_path / "README.md").read_text()


def test_results_that_are_not_kept_leave_their_table_and_say_so(
    tables: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = "<!-- table: campaign results -->\nold\n<!-- end -->\n"
    (tmp_path / "README.md").write_text(text + "<!-- table: codes -->\n<!-- end -->\n")
    assert tables.main() == 1
    assert "campaign results: " in capsys.readouterr().err
    assert (tmp_path / "README.md").read_text().startswith(text)
    assert "| `random` |" in (tmp_path / "README.md").read_text()
    with pytest.raises(SpecError, match="holds no campaign"):
        tables.table_of("campaign results", tmp_path / "README.md")


def test_a_table_that_nothing_makes_is_refused(tables: ModuleType, tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="no table is called 'colours'"):
        tables.rewritten("<!-- table: colours -->\n<!-- end -->", tmp_path / "README.md", {})
