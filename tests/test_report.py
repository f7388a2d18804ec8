"""The report says what the rows and the kept files say, in one file that loads nothing."""

import ast
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from html import escape
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import o3dmark.report
from fixtures.kept_folder import COMPARED, FIGURES, PLAIN, RUN, invented_rows, keep
from fixtures.paths import ROOT
from o3dmark.campaign import read_rows, summarise
from o3dmark.campaign.plan import Source
from o3dmark.campaign.row import Row
from o3dmark.errors import SpecError
from o3dmark.report import write_report
from o3dmark.report.content import TONES

KEPT = sorted(path.parent for path in (ROOT / "results").glob("*/campaign.json"))


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a campaign without published figures, and its report."""
    folder = keep(tmp_path_factory.mktemp("plain"), PLAIN)
    write_report(folder)
    return folder


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a campaign with published figures, and its report."""
    folder = keep(tmp_path_factory.mktemp("compared"), COMPARED)
    write_report(folder)
    return folder


def tables(folder: Path) -> dict[str, list[dict[str, str]]]:
    """The tables of report.md by the heading above them: rows as {column: cell}."""
    found: dict[str, list[dict[str, str]]] = {}
    heading, head = "", []
    for line in (folder / "report.md").read_text().splitlines():
        if line.startswith("#"):
            heading, head = line.lstrip("# "), []
        elif line.startswith("|") and not line.startswith("| ---"):
            cells = [cell.strip() for cell in line.strip("|").split(" | ")]
            if not head:
                head, found[heading] = cells, []
            elif set(line) - set("| -"):
                found[heading].append(dict(zip(head, cells, strict=True)))
    return found


def mean_of(folder: Path, field: str = "corr", **wanted: Any) -> float:
    """The mean of a field over the rows that are as wanted; controls only where they are."""
    wanted = {"control": ""} | wanted
    rows = [row for row in read_rows(folder) if all(getattr(row, name) == value for name, value in wanted.items())]
    values = [row.metrics[field] if field in row.metrics else getattr(row, field) for row in rows]
    return float(np.mean([value for value in values if value is not None]))


@pytest.mark.parametrize("label", PLAIN.methods)
def test_a_plain_report_shows_the_means_of_the_rows(plain: Path, label: str) -> None:
    found = tables(plain)
    glance = {row[""]: row for row in found["At a glance"]}[label]
    attacked = [mean_of(plain, label=label, condition=case.condition) for case in PLAIN.cases]
    assert glance["mean Corr, all attacks"] == f"{np.mean(attacked):.2f}"
    assert glance["MRMS · 10³"] == f"{1e3 * mean_of(plain, 'mrms', label=label, group='no attack'):.2f}"
    for case in PLAIN.cases:
        wanted = {"label": label, "group": case.group, "condition": case.condition}
        cell = {row["mean Corr"]: row for row in found[case.group.capitalize()]}[case.condition][label]
        assert cell.startswith(f"{mean_of(plain, **wanted):.2f} · BER {mean_of(plain, 'ber', **wanted):.3f}, messages ")
        row = {row["Corr"]: row for row in found[f"{case.group.capitalize()}: {label}"]}[case.condition]
        assert row["mean"] == f"{mean_of(plain, **wanted):.2f}"
        assert row["Vase"] == f"{mean_of(plain, **wanted, mesh='Vase'):.2f}"


def test_messages_are_counted_without_the_controls(plain: Path) -> None:
    messages = {row["after"]: row for row in tables(plain)["Messages"]}
    for group in ("no attack", "noise", "pipelines"):
        rows = [row for row in read_rows(plain) if (row.label, row.group, row.control) == ("first", group, "")]
        assert messages[group]["first"].startswith(f"{sum(row.message_ok for row in rows)} of {len(rows)} · ")


@pytest.mark.parametrize("name", ["report.md", "report.html"])
def test_a_plain_report_compares_with_nobody(plain: Path, name: str) -> None:
    text = (plain / name).read_text()
    assert "ublished" not in text
    assert "the paper" not in text
    assert 'class="tones"' not in text
    assert not any(text.count(f'class="{tone}') or text.count(f" {tone}") > 1 for tone in TONES)


def test_published_figures_stand_beside_ours_with_the_difference(compared: Path) -> None:
    table = {row["Corr"]: row for row in tables(compared)["Noise: first"]}
    ours = f"{mean_of(compared, label='first', mesh='Bimba', condition='0.50%'):.2f}"
    gap = f"{float(ours) - 0.79:+.2f}".replace("-", "−")
    assert table["0.50%"]["Bimba"] == f"{ours} · published 0.79 ({gap})"
    assert "published" not in table["0.50%"]["Bunny"]  # no such figure was printed
    assert "published 0.92" in table["0.1%"]["Bimba"]  # printed as 0.10%


def test_means_are_compared_over_the_meshes_that_both_have(compared: Path) -> None:
    overview = {row["mean Corr"]: row for row in tables(compared)["All methods in the published conditions"]}
    assert list(overview) == ["no attack", "noise 0.05%", "noise 0.1%", "noise 0.50%", "subdivision midpoint"]
    untouched = [mean_of(compared, label="first", condition="-", mesh=mesh) for mesh in ("Bimba", "Vase")]
    assert (overview["no attack"]["published"], overview["no attack"]["first"]) == ("–", f"{np.mean(untouched):.2f}")
    both = [mean_of(compared, label="first", condition="0.50%", mesh=mesh) for mesh in ("Bimba", "Vase")]
    assert overview["noise 0.50%"] == {
        "mean Corr": "noise 0.50%",
        "published": f"{(0.79 + 0.72) / 2:.2f}",
        "first": f"{np.mean(both):.2f}",
        "second": overview["noise 0.50%"]["second"],
    }
    assert (
        overview["noise 0.05%"]["first"] == f"{mean_of(compared, label='first', condition='0.05%', mesh='Bimba'):.2f}"
    )
    others = tables(compared)
    assert [row["mean Corr"] for row in others["Subdivision"]] == ["loop"]  # under attacks without published figures
    assert "Noise" not in others


def test_costs_are_compared_on_the_line_that_the_campaign_names(compared: Path) -> None:
    found = tables(compared)
    mrms = {row[""]: row for row in found["Saliency: first"]}["MRMS · 10³"]
    ours = 1e3 * mean_of(compared, "mrms", label="first", mesh="Bimba", group="no attack")
    assert mrms["Bimba"].startswith(f"{ours:.2f} · published 0.37 (")
    assert "published" not in mrms["Vase"] + "".join(found["second"][0].values())


def test_other_published_methods_stand_in_the_comparison_of_their_mesh(compared: Path) -> None:
    rows = {row["mean Corr"]: row for row in tables(compared)["Noise: Bunny"]}
    assert rows["Cho 2007, as published"] == {"mean Corr": "Cho 2007, as published", "0.1%": "0.72", "0.50%": "0.66"}
    assert "published 0.86" in rows["first"]["0.50%"]  # the first method of the file is the one compared with
    drawing = section_of(compared, "Comparison with published methods")
    for name in ("Cho 2007", "Hamidi 2019", "first", "second"):
        assert f">{name}</text>" in drawing
    costs = {row[""]: row for row in tables(compared)["Imperceptibility: Bunny"]}
    assert costs["Cho 2007, as published"]["MRMS · 10³"] == "3.17"


@pytest.mark.parametrize(
    "change",
    [
        lambda text: re.sub(r"Bimba|Bunny|Vase", "Somebody", text),
        lambda text: text.replace("%", " percent").replace("midpoint", "sqrt3").replace("saliency", "line"),
        lambda text: text.replace("noise", "hiss").replace("subdivision", "division").replace("impercep", "percep"),
    ],
    ids=["other meshes", "other conditions", "other tables"],
)
def test_nothing_is_compared_unless_table_condition_and_mesh_are_printed(
    tmp_path: Path, change: Callable[[str], str]
) -> None:
    changed = change(FIGURES.replace("imperceptibility comparison,", "another comparison,"))
    markdown, page = write_report(keep(tmp_path, replace(COMPARED, published=changed)))
    assert not re.search(r"published \d", markdown.read_text())
    assert 'class="tones"' not in page.read_text()


def test_the_legend_is_there_where_something_is_compared(compared: Path) -> None:
    page = (compared / "report.html").read_text()
    assert all(escape(text) in page for text in TONES.values())
    assert "Hamidi 2019; Cho 2007" in page


def test_the_tiles_are_of_the_campaigns_own_method(plain: Path) -> None:
    (tiles,) = tables(plain)[PLAIN.title]
    assert tiles["method"] == "second · shape-spectrum"
    corr = np.mean([mean_of(plain, label="second", condition=case.condition) for case in PLAIN.cases])
    assert tiles["mean Corr after attacks"] == f"{corr:.2f}"


def test_the_tile_says_when_the_campaigns_own_method_has_no_reading(tmp_path: Path) -> None:
    write_report(keep(tmp_path, PLAIN, [row for row in invented_rows(PLAIN) if row.label == "first"]))
    assert tables(tmp_path)[PLAIN.title] == [{"method": "second · no reading yet"}]


def test_the_head_says_who_computed_the_rows(tmp_path: Path) -> None:
    later = RUN | {"command": "o3dmark bench small --only Vase", "commit": None}
    text = write_report(keep(tmp_path, PLAIN, runs=(RUN, later)))[0].read_text()
    assert "- run 1: o3dmark bench small --out small, 2026-11-27 10:00 UTC, o3dmark 0.2.0 (commit abc1234), " in text
    assert "- run 2: o3dmark bench small --only Vase, 2026-11-27 10:00 UTC, o3dmark 0.2.0 (no commit), " in text


def test_methods_are_described_as_the_campaign_kept_it(plain: Path) -> None:
    methods = {row[""]: row for row in tables(plain)["The methods"]}
    assert methods["first"]["how it works"] == "What first does."
    assert methods["second"]["its reader needs"] == "key alone (blind)"


def test_several_numbers_of_bits_are_several_entrys(tmp_path: Path) -> None:
    write_report(keep(tmp_path, replace(PLAIN, bits=(16, 64))))
    names = [row[""] for row in tables(tmp_path)["At a glance"]]
    assert names == ["first, 16 bits", "first, 64 bits", "second, 16 bits", "second, 64 bits"]
    assert tables(tmp_path)[PLAIN.title][0]["method"] == "second, 16 bits · shape-spectrum"


def test_tables_of_other_methods_than_the_campaigns_own_are_folded(plain: Path) -> None:
    page = (plain / "report.html").read_text()
    assert "<h3>Noise: second</h3>" in page
    assert "<summary>Noise: first</summary>" in page


@pytest.mark.parametrize("kind", ["plain", "compared"])
def test_the_page_has_the_same_tables_as_the_markdown(kind: str, request: pytest.FixtureRequest) -> None:
    folder = request.getfixturevalue(kind)
    page = (folder / "report.html").read_text()
    for heading, rows in tables(folder).items():
        for row in rows:
            for cell in row.values():
                text, _, remark = escape(cell).partition(" · ")
                assert text in page, (heading, row)
                assert remark.partition(" · ")[0] in page, (heading, row)


class Balance(HTMLParser):
    """Counts what is open; a document ends with nothing open."""

    VOID = frozenset({"meta", "img", "br", "link"})

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: set[str] = set()
        self.links: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.add(tag)
        self.links += [str(value) for name, value in attrs if name in ("src", "href", "xlink:href", "srcset", "data")]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.add(tag)


@pytest.mark.parametrize("kind", ["plain", "compared"])
def test_the_page_is_whole_and_loads_nothing(kind: str, request: pytest.FixtureRequest) -> None:
    page = (request.getfixturevalue(kind) / "report.html").read_text()
    parser = Balance()
    parser.feed(page)
    assert parser.open == []
    assert {"svg", "table", "details"} <= parser.seen
    assert not {"script", "link", "iframe"} & parser.seen
    assert all(link.startswith(("#", "data:")) for link in parser.links)
    assert "http" not in page
    assert not re.search(r"url\((?!#)", page)
    assert "@import" not in page


def test_figures_take_their_ink_from_the_page(compared: Path) -> None:
    page = (compared / "report.html").read_text()
    assert page.count("<svg") == 5  # noise, subdivision, detection, false positives, comparison on the bunny
    assert "currentColor" in page
    assert "#010203" not in page


def test_failures_are_shown_and_counted_nowhere_else(tmp_path: Path) -> None:
    def failing(row: Row) -> Row:
        nothing = dict.fromkeys(("bit_errors", "ber", "corr", "message_ok", "message_read", "log10_p", "seconds"))
        if (row.label, row.mesh) != ("first", "Vase"):
            return row
        return replace(row, **nothing, metrics={}, failure="marking: MeshError: bad luck")  # type: ignore[arg-type]

    write_report(keep(tmp_path, PLAIN, invented_rows(PLAIN, failing)))
    (failure,) = tables(tmp_path)["Failures"]
    assert failure == {
        "method": "first",
        "mesh": "Vase",
        "at": "marking",
        "reason": "marking: MeshError: bad luck",
        "rows": "20",
    }
    messages = {row["after"]: row for row in tables(tmp_path)["Messages"]}
    assert " of 4 " in messages["no attack"]["first"]
    assert " of 6 " in messages["no attack"]["second"]


def test_an_unfinished_campaign_says_so(tmp_path: Path) -> None:
    write_report(keep(tmp_path, PLAIN, [row for row in invented_rows(PLAIN) if row.mesh != "Bunny"]))
    assert "of 8 jobs (of 12: unfinished)" in (tmp_path / "report.md").read_text()


def test_many_meshes_stand_in_lines(tmp_path: Path) -> None:
    campaign = replace(PLAIN, meshes=tuple(Source(f"mesh {count}", "vase") for count in range(30)))
    write_report(keep(tmp_path, campaign))
    table = {row["Corr"]: row for row in tables(tmp_path)["Noise: first"]}
    assert list(table) == [*(mesh.name for mesh in campaign.meshes), "mean"]
    assert list(table["mean"]) == ["Corr", "0.05%", "0.1%", "0.50%"]
    assert table["mesh 7"]["0.1%"] == f"{mean_of(tmp_path, label='first', mesh='mesh 7', condition='0.1%'):.2f}"
    assert table["mean"]["0.1%"] == f"{mean_of(tmp_path, label='first', condition='0.1%'):.2f}"


def test_a_campaign_of_controls_alone_has_a_report(tmp_path: Path) -> None:
    write_report(keep(tmp_path, replace(PLAIN, cases=(), gallery=None)))
    found = tables(tmp_path)
    assert "mean Corr after attacks" not in found[PLAIN.title][0]
    assert "Unmarked meshes" in found
    assert (tmp_path / "report.html").read_text().count("<svg") == 1  # false positives


def test_where_only_a_summary_is_kept_the_report_shows_it(tmp_path: Path) -> None:
    keep(tmp_path, PLAIN)
    summarise(tmp_path)
    before = tables_after_report(tmp_path)
    assert "What happened" not in before
    rows = invented_rows(PLAIN, lambda row: replace(row, failure="attack: MeshError: bad <luck>" if row.seed else None))
    summarise(keep(tmp_path, PLAIN, rows))
    (tmp_path / "rows.jsonl").unlink()
    found = tables_after_report(tmp_path)
    line = next(row for row in found["Noise"] if (row["condition"], row["method"]) == ("0.1%", "second"))
    assert (line["ok"], line["refused"], line["failed"]) == ("3", "3", "0")
    assert line["reasons"].startswith("Bimba, seed 1: attack: MeshError: bad &lt;luck&gt;; Vase, seed 1: ")
    assert [row["condition"] for row in found["Wrong key"]][:1] == ["1 wrong key"]


def test_a_summary_that_is_none_is_refused(tmp_path: Path) -> None:
    keep(tmp_path, PLAIN, [])
    (tmp_path / "summary.csv").write_text("group,ok\nnoise,3\n")
    with pytest.raises(SpecError, match="no summary"):
        write_report(tmp_path)


def tables_after_report(folder: Path) -> dict[str, list[dict[str, str]]]:
    write_report(folder)
    return tables(folder)


def test_no_rows_no_report(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="holds no campaign"):
        write_report(tmp_path)
    with pytest.raises(SpecError, match="no rows yet"):
        write_report(keep(tmp_path, PLAIN, []))


def test_a_report_changes_nothing_but_itself(plain: Path) -> None:
    before = {path.name: path.read_bytes() for path in plain.iterdir()}
    write_report(plain)
    assert {path.name: path.read_bytes() for path in plain.iterdir()} == before


def test_results_are_kept() -> None:
    assert {"paper", "shape_spectrum", "false_positives"} <= {folder.name for folder in KEPT}


@pytest.mark.parametrize("folder", KEPT, ids=lambda folder: folder.name)
def test_every_kept_folder_has_a_report(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder, tmp_path / "copy")
    markdown, page = write_report(tmp_path / "copy")
    assert markdown.stat().st_size > 1000
    assert page.stat().st_size > 10000


def test_the_report_measures_nothing() -> None:
    """It imports no room in which meshes are marked, attacked, read, measured or drawn."""
    allowed = {"arrays", "errors", "files", "campaign", "report"}
    for file in Path(o3dmark.report.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [name.name for name in node.names] if isinstance(node, ast.Import) else []
            for name in names:
                room = name.split(".")[1] if name.startswith("o3dmark.") else None
                assert room is None or room in allowed, f"{file.name} imports {name}"


def section_of(folder: Path, title: str) -> str:
    """The HTML of one section of the report."""
    page = (folder / "report.html").read_text()
    start = page.index(f"<h2>{title}</h2>")
    return page[start : page.index("</section>", start)]
