"""Controls: how many p-values are small, beside how many may be."""

import math
from dataclasses import replace
from pathlib import Path

from fixtures.kept_folder import PLAIN, invented_rows, keep
from o3dmark.campaign.row import UNMARKED, WRONG_KEY, Row
from o3dmark.report.content import Table
from o3dmark.report.controls import control_section
from o3dmark.report.data import Results


def numbered(rows: list[Row]) -> list[Row]:
    """Readings under wrong keys whose k-th uncharged p-value is k / n, ten times that when charged; Corr 0."""
    controls = [row for row in rows if (row.label, row.control) == ("first", WRONG_KEY)]
    changed = {
        id(row): replace(
            row,
            corr=0.0,
            bit_errors=32,
            ber=0.5,
            message_read=False,
            log10_p_uncharged=math.log10(k / len(controls)),
            log10_p=min(0.0, math.log10(10 * k / len(controls))),
        )
        for k, row in enumerate(controls, start=1)
    }
    return [changed.get(id(row), row) for row in rows]


def tables_of(folder: Path) -> dict[str, Table]:
    (section,) = control_section(Results.load(folder))
    return {block.title: block for block in section.blocks if isinstance(block, Table)}


def test_small_p_values_are_counted_beside_the_number_allowed(tmp_path: Path) -> None:
    campaign = replace(PLAIN, wrong_keys=50, unmarked=0)  # 300 readings of each method
    read, small = tables_of(keep(tmp_path, campaign, numbered(invented_rows(campaign)))).values()
    first = dict(zip(read.head, read.rows[0], strict=True))
    assert [cell.text for cell in first.values()] == ["first", "300", "0.00", "0.500", "0 of 300"]
    assert first["messages read"].remark == "0–1 %"
    lines = {row[1].text: row for row in small.rows if row[0].text == "first"}
    assert list(lines) == [
        "known bits, hypotheses not charged",
        "known bits, hypotheses charged",
        "known bits choose among all readings, all charged",  # no message, so no p-value of one
    ]
    uncharged, charged, _ = lines.values()
    assert [(cell.text, cell.remark) for cell in uncharged[2:]] == [
        ("300", ""),
        ("30", "30 allowed"),
        ("3", "3 allowed"),
        ("0", "0.3 allowed"),
    ]
    assert [cell.text for cell in charged[2:]] == ["300", "3", "0", "0"]


def test_each_kind_of_control_has_its_own_tables(tmp_path: Path) -> None:
    tables = tables_of(keep(tmp_path, PLAIN))
    titles = ("Marked meshes read with wrong keys", "Unmarked meshes")
    assert list(tables) == [title + end for title in titles for end in ("", ": small p-values")]
    assert [row[1].text for row in tables["Unmarked meshes"].rows] == ["6", "6"]  # 3 meshes, 2 seeds, 1 key


def test_controls_of_attacked_meshes_count_too_and_nowhere_else(tmp_path: Path) -> None:
    campaign = replace(PLAIN, controls=("noise",))
    results = Results.load(keep(tmp_path, campaign))
    first = results.entries[0]
    assert len(results.controls(first, WRONG_KEY)) == 6 * (2 + 3)
    assert len(results.controls(first, UNMARKED)) == 6 * (1 + 3)
    assert len(results.of(first, "noise")) == 6 * 3


def test_a_campaign_without_controls_has_no_such_section(tmp_path: Path) -> None:
    campaign = replace(PLAIN, wrong_keys=0, unmarked=0)
    assert list(control_section(Results.load(keep(tmp_path, campaign)))) == []
