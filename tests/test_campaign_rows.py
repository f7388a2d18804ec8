"""The record of a reading, and the files that hold it: nothing is lost on the way to the disk and back."""

import csv
import dataclasses
import io
import json
import os
import sys
from pathlib import Path

import pytest

from fixtures.small_campaign import TOML, campaign, comparable
from o3dmark.campaign import Row, compact, describe_fields, load, read_rows, run, summarise
from o3dmark.campaign.row import text_of
from o3dmark.errors import BackendError, SpecError

pytestmark = pytest.mark.usefixtures("own_registries")
CONTRACT = (  # of DESIGN.md: what others rely on
    *("mesh", "method", "attack", "seed", "n_bits", "bit_errors", "corr", "message_ok", "p_value"),
    *("mrms", "hausdorff", "msdm", "seconds", "version", "failure"),
)
TEXT = TOML.replace('["mrms:samples=2000"]', '["mrms:samples=2000", "rms_displacement"]').replace("[0, 5]", "1") + (
    '[attacks.refused]\n"all" = ["crop:share=0.99", "crop:share=0.99", "crop:share=0.99"]\n'
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the rows of two jobs, one reading of each refused."""
    list(run(campaign(tmp_path, TEXT), tmp_path / "out"))
    return tmp_path / "out"


def test_every_field_is_told_of() -> None:
    told = describe_fields()
    assert list(told) == [field.name for field in dataclasses.fields(Row)]
    assert all(len(text) > 8 for text in told.values())
    assert len(set(told.values())) == len(told)


def test_a_row_on_the_disk_has_the_fields_of_the_contract(folder: Path) -> None:
    lines = [json.loads(line) for line in (folder / "rows.jsonl").read_text().splitlines()]
    assert len(lines) == 2 * 5
    for line in lines:
        assert set(CONTRACT) <= line.keys()
        assert line["hausdorff"] is None is line["msdm"]  # not asked for
        assert line["rms_displacement"] >= 0
        failed = line["failure"] is not None
        assert failed == (line["group"] == "refused") == (line["p_value"] is None)
        assert failed or line["p_value"] == pytest.approx(10 ** line["log10_p"])
    assert [Row.from_dict(line) for line in lines] == list(read_rows(folder))


def test_what_is_no_row_is_said_with_its_line(tmp_path: Path, folder: Path) -> None:
    good = (folder / "rows.jsonl").read_text().splitlines()[0]
    old = {name: value for name, value in json.loads(good).items() if name != "control"}
    for bad in ("{", json.dumps(old), json.dumps(json.loads(good) | {"note": "as received"}), "[]", "7"):
        (tmp_path / "rows.jsonl").write_text(f"{good}\n{bad}\n")
        with pytest.raises(SpecError, match=r"rows.jsonl, line 2: not a row"):
            list(read_rows(tmp_path))
    (tmp_path / "rows.jsonl").write_text(f"{good}\n{good[:50]}")
    assert len(list(read_rows(tmp_path))) == 1


def test_a_compact_folder_holds_the_same_rows(folder: Path) -> None:
    rows = list(read_rows(folder))
    table = compact(folder)
    assert list(read_rows(folder)) == rows
    assert not (folder / "rows.jsonl").exists()
    content = json.loads((folder / "campaign.json").read_text())
    columns = table.read_text().splitlines()[0].split(",")
    assert {"log10_p", "group", "failure", "label"} <= set(columns)
    assert {"mesh", "version", "n_bits", "hausdorff", "mrms"} <= content["constant"].keys()
    assert not set(columns) & content["constant"].keys()
    assert compact(folder) == table  # again does no harm
    assert list(read_rows(folder)) == rows
    assert load(folder).campaign.title == "small"


def test_every_kind_of_value_survives_a_table(folder: Path) -> None:
    rows = list(read_rows(folder))
    kinds = {"message_ok": True, "smoothing": "umbrella", "passes": 7, "step": 1e-17 / 3, "failure": 'a "b",\nc'}
    other = {"message_ok": False, "smoothing": None, "passes": None, "step": 0.1 + 0.2, "failure": None}
    changed = [dataclasses.replace(row, **(kinds if k % 2 else other)) for k, row in enumerate(rows)]
    changed[0] = dataclasses.replace(changed[0], message_ok=None, control="unmarked")
    (folder / "rows.jsonl").write_text("".join(json.dumps(row.to_dict()) + "\n" for row in changed))
    compact(folder)
    assert list(read_rows(folder)) == changed


def test_rows_are_kept_in_the_campaign_s_order(folder: Path) -> None:
    rows = list(read_rows(folder))
    lines = (folder / "rows.jsonl").read_text().splitlines(keepends=True)
    (folder / "rows.jsonl").write_text("".join(lines[5:] + lines[:5]))
    compact(folder)
    assert list(read_rows(folder)) == rows


def test_a_compact_folder_can_go_on(tmp_path: Path, folder: Path) -> None:
    rows = list(read_rows(folder))
    compact(folder)
    more = campaign(tmp_path, TEXT.replace("seeds = 1", "seeds = 2"))
    assert [event.done for event in run(more, folder)] == [2, 3, 4]
    assert not (folder / "rows.csv").exists()
    assert list(read_rows(folder))[: len(rows)] == rows
    assert len(list(read_rows(folder))) == 2 * len(rows)
    assert "constant" not in json.loads((folder / "campaign.json").read_text())


def test_the_lines_stay_unless_the_table_is_whole(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = comparable(read_rows(folder))
    module = sys.modules[compact.__module__]
    monkeypatch.setattr(module, "text_of", lambda value: text_of(value).replace("noise", "nose"))
    with pytest.raises((BackendError, SpecError)):
        compact(folder)
    assert comparable(read_rows(folder)) == before
    monkeypatch.undo()
    monkeypatch.setattr(os, "unlink", lambda *_: pytest.fail("nothing may go before the table is there"))
    monkeypatch.setattr(module, "_write", lambda *_: (_ for _ in ()).throw(OSError("disk full")))
    with pytest.raises(OSError, match="disk full"):
        compact(folder)
    monkeypatch.undo()
    assert comparable(read_rows(folder)) == before


def test_a_folder_without_rows_is_not_compacted(tmp_path: Path) -> None:
    next(run(campaign(tmp_path), tmp_path / "out"))
    for keep in (compact, summarise):
        with pytest.raises(SpecError, match="no rows yet"):
            keep(tmp_path / "out")


def test_a_summary_counts_and_tells_failures_in_full(folder: Path) -> None:
    rows = list(read_rows(folder))
    lines = list(csv.DictReader(io.StringIO(summarise(folder).read_text(), newline="")))
    assert len(lines) == 2 * 5
    assert sum(int(line["ok"]) for line in lines) == sum(row.outcome == "ok" for row in rows) == 8
    (refused,) = (line for line in lines if line["group"] == "refused" and line["label"] == "one")
    assert (refused["ok"], refused["refused"], refused["failed"]) == ("0", "1", "0")
    reason = next(row.failure for row in rows if row.failure)
    assert refused["reasons"] == f"Ring, seed 0: {reason}"
    assert refused["attack"] == "crop:share=0.99 crop:share=0.99 crop:share=0.99"


@pytest.mark.parametrize(
    ("failure", "outcome"),
    [
        (None, "ok"),
        ("attack: MeshError: no", "refused"),
        ("marking: CapacityError: no", "refused"),
        ("reading: BackendError: no", "refused"),
        ("attack: BadResultError: noise: no triangle", "failed"),
        ("attack: ValueError: a MeshError: no", "failed"),
        ("the process ended by SIGSEGV", "failed"),
    ],
)
def test_outcomes(folder: Path, failure: str | None, outcome: str) -> None:
    row = next(read_rows(folder))
    assert dataclasses.replace(row, failure=failure).outcome == outcome
