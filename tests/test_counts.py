"""Tables that count readings count them."""

import importlib
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import pytest

from fixtures.kept_folder import COMPARED, PLAIN, invented_rows, keep
from fixtures.paths import ROOT
from o3dmark.campaign import summarise
from o3dmark.campaign.plan import UNTOUCHED, Case
from o3dmark.campaign.row import UNMARKED, WRONG_KEY, Row
from o3dmark.errors import SpecError
from o3dmark.report.data import Results

CROPPED = replace(PLAIN, cases=(*PLAIN.cases, Case("cropping", "10%", ("crop:share=0.1",))))


@pytest.fixture
def counts(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    return importlib.import_module("counts")


def test_messages_after_cropping_are_not_counted(counts: ModuleType, tmp_path: Path) -> None:
    def change(row: Row) -> Row:
        read = row.group == "cropping" or (row.label == "second" and row.condition != "loop")
        return replace(row, message_ok=read, message_read=row.mesh == "Vase")

    keep(tmp_path, CROPPED, invented_rows(CROPPED, change))
    head, lines = counts.messages(Results.load(tmp_path))
    assert len(head) == 3
    # 3 meshes, 2 seeds, 6 conditions but cropping, one of which is never read; 2 wrong keys a marked mesh
    assert lines == [["first", "0 of 36", "4 of 12"], ["second", "30 of 36", "4 of 12"]]


def test_small_p_values_stand_beside_the_number_allowed(counts: ModuleType, tmp_path: Path) -> None:
    def change(row: Row) -> Row:
        p = {0: -1.0, 1: -2.5}[row.seed]
        return replace(row, log10_p_best=p, log10_p_message=None, log10_p_uncharged=0.0, hypotheses=10 + row.seed)

    keep(tmp_path, PLAIN, invented_rows(PLAIN, change))
    _, lines = counts.wrong_keys([Results.load(tmp_path)])
    assert lines[0] == ["first", WRONG_KEY, "message known", "10 to 11", "12"] + [
        f"{count} ({allowed} allowed)" for count, allowed in ((12, "1.2"), (6, "0.12"), (0, "0.012"))
    ]
    assert [line[:3] for line in lines[1:4]] == [
        ["first", WRONG_KEY, "message known, hypotheses not charged"],
        ["first", UNMARKED, "message known"],
        ["first", UNMARKED, "message known, hypotheses not charged"],
    ]
    assert lines[1][-3:] == ["0 (1.2 allowed)", "0 (0.12 allowed)", "0 (0.012 allowed)"]
    assert lines[2][4] == "6"


def test_meshes_that_are_refused_or_misread_are_named(counts: ModuleType, tmp_path: Path) -> None:
    campaign = replace(
        PLAIN, methods={"first": PLAIN.methods["first"]}, main="first", seeds=(0,), cases=PLAIN.cases[:1]
    )

    def change(row: Row) -> Row:
        if row.mesh == "Bunny":
            return replace(row, failure="marking: MeshError: too round", bit_errors=None)
        return replace(row, bit_errors=int(row.mesh == "Vase" and row.group != UNTOUCHED))

    keep(tmp_path, campaign, invented_rows(campaign, change))
    _, lines = counts.any_mesh(Results.load(tmp_path))
    assert lines == [
        ["marked", "2 of 3", ""],
        ["refused", "1", "MeshError"],
        ["no attack", "2 of 2", ""],
        ["0.05%", "1 of 2", "Vase"],
    ]


def test_the_sweep_is_told_from_its_summary_alone(counts: ModuleType, tmp_path: Path) -> None:
    campaign = replace(PLAIN, methods={"first": PLAIN.methods["first"]}, main="first", wrong_keys=0, unmarked=0)

    def change(row: Row) -> Row:
        refused = (row.condition, row.mesh) == ("loop", "Vase")
        return replace(row, failure="attack: MeshError: no" if refused else None)

    with pytest.raises(SpecError, match="has no summary"):
        counts.attack_sweep(tmp_path)
    keep(tmp_path, campaign, invented_rows(campaign, change))
    summarise(tmp_path)
    (tmp_path / "rows.jsonl").unlink()
    _, lines = counts.attack_sweep(tmp_path)
    assert lines == [["all 6", "34", "2", "0"], ["subdivide:scheme=loop", "4", "2", "0"]]


def test_readme_s_table_has_the_strongest_condition_of_each_published_table(
    counts: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tables = importlib.import_module("tables")
    monkeypatch.setattr(tables, "RESULTS", tmp_path)
    tables.results.cache_clear()
    keep(tmp_path / "paper", COMPARED, invented_rows(COMPARED, lambda row: replace(row, corr=0.5)))
    names = [line.split(" | ")[0].strip("| ") for line in tables.summary_table().splitlines()]
    assert names == ["mean Corr", "---", "no attack", "noise 0.50%", "subdivision midpoint"]
    assert "| second |" in tables.summary_table()
    assert "first" not in tables.summary_table()
    tables.results.cache_clear()


def test_every_campaign_of_the_package_is_described(counts: ModuleType) -> None:
    tables = importlib.import_module("tables")
    rows = {line.split("`")[1]: line.rsplit("| ", 1)[1] for line in tables.campaigns_table().splitlines()[2:]}
    specs = ROOT / "o3dmark" / "campaign" / "specs"
    assert rows.keys() == {path.stem for path in specs.glob("*.toml")}
    assert (rows["quick"], rows["paper"], rows["slender"], rows["any_mesh"]) == (
        "synthetic |",
        "either |",
        "real |",
        "real |",
    )
    assert all(len(line.split(" | ")[1]) > 20 for line in tables.campaigns_table().splitlines()[2:])


def test_edits_are_counted_blindly_and_beside_the_cover(counts: ModuleType, tmp_path: Path) -> None:
    alone = replace(PLAIN, methods={"first": PLAIN.methods["first"]}, main="first", wrong_keys=0, unmarked=0)
    few, rest = replace(alone, cases=alone.cases[:1]), replace(alone, cases=alone.cases[1:2])
    blindly = []
    for name, campaign in (("few", few), ("rest", rest)):

        def change(row: Row, name: str = name) -> Row:
            read = name == "few" and row.mesh != "Vase"
            return replace(row, message_ok=read, log10_p_best=-6.0 if read else -5.9)

        keep(tmp_path / name, campaign, invented_rows(campaign, change))
        blindly.append(Results.load(tmp_path / name))
    keep(tmp_path / "beside", few, invented_rows(few, lambda row: replace(row, message_ok=row.seed == 0)))
    _, lines = counts.edits(blindly, [Results.load(tmp_path / "beside")])
    assert [line[0] for line in lines] == ["no attack", few.cases[0].condition, rest.cases[0].condition]
    assert lines[1][1:] == ["4 of 6", "4 of 6", "Vase 2", "3 of 6"]
    assert lines[2][1:3] == ["0 of 6", "0 of 6"]
    assert lines[2][4] == "–"


def test_two_ways_to_move_stand_in_one_cell(counts: ModuleType, tmp_path: Path) -> None:
    names = ("msdm", "planes", "bending", "reflection", "max_displacement", "mrms")
    campaign = replace(PLAIN, metrics=names, wrong_keys=0, unmarked=0)

    def change(row: Row) -> Row:
        value = {"first": 0.25, "second": 0.125}[row.label]
        errors = int(row.mesh == "Vase" and row.label == "second" and row.condition == "loop")
        return replace(row, metrics=dict.fromkeys(names, value), step=value / 10, bit_errors=errors)

    keep(tmp_path, campaign, invented_rows(campaign, change))
    head, lines = counts.motions(Results.load(tmp_path), before="first", after="second")
    assert len(lines) == len(campaign.meshes)
    cells = dict(zip(head, next(line for line in lines if line[0] == "Vase"), strict=True))
    assert cells["MSDM"] == "0.250 → 0.125"
    assert cells["farthest · 10³"] == "250.0 → 125.0"
    assert cells["step · 10³"] == "25.0 → 12.5"
    assert cells["every bit read after attacks"] == "12 → 10 of 12"


def test_what_holds_a_mark_back_stands_method_by_method(counts: ModuleType, tmp_path: Path) -> None:
    campaign = replace(PLAIN, metrics=("jnd", "mrms"), wrong_keys=0, unmarked=0)

    def change(row: Row) -> Row:
        if (row.mesh, row.label) == ("Vase", "second"):
            return replace(row, metrics={}, failure="marking: MeshError: no")
        errors = int(row.label == "first" and row.condition == "loop")
        return replace(row, metrics={"jnd": 0.5, "mrms": 1e-3}, bit_errors=errors)

    keep(tmp_path, campaign, invented_rows(campaign, change))
    head, lines = counts.held_back(Results.load(tmp_path))
    assert [name.split(": ")[-1] for name in head] == ["mesh", *["jnd", "MRMS · 10³", "every bit read"] * 2]
    vase = next(line for line in lines if line[0] == "Vase")
    assert vase[1:] == ["0.50", "1.00", "10 of 12", "refused", "–", "–"]


def test_second_marks_are_counted_by_profile_and_mesh(counts: ModuleType, tmp_path: Path) -> None:
    rows = tmp_path / "rows.csv"
    lines = ["mesh,profile,seed,read,log10_p,msdm,date"]
    lines += ["a,old,0,1,-7.00,0.10,2026-01-01", "a,old,1,0,-6.00,0.20,2026-01-01", "b,old,0,0,-5.99,0.30,2026-01-01"]
    lines += ["a,new,0,1,-9.00,0.10,2026-01-01"]
    rows.write_text("\n".join(lines) + "\n")
    head, table = counts.marked_twice(rows)
    assert head == ["profile", "a", "b", "MSDM of one mark"]
    assert table == [["`old`", "1, 2 of 2", "0, 0 of 1", "0.10 to 0.30"], ["`new`", "1, 1 of 1", "–", "0.10 to 0.10"]]
