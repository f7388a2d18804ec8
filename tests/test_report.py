"""The report says what the rows say, beside what the paper says, in one file that loads nothing."""

import base64
import json
import re
from html import escape
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from o3dmark.arrays import Floats
from o3dmark.attacks import attack_all
from o3dmark.campaign import Campaign, Ledger, failed_rows, job, read_rows, run, trial
from o3dmark.errors import SpecError
from o3dmark.files import write_mesh
from o3dmark.mesh.surface import TriangleMesh
from o3dmark.report import gallery, write_report
from o3dmark.report.content import TONES, compared, number, signed, tone_of
from o3dmark.report.data import interval, strength
from o3dmark.report.drawing import axes_for
from o3dmark.report.paper import PAPER
from o3dmark.report.rank import counterparts, rank_correlation
from o3dmark.synthetic import make

TOML = """
title = "a <small> campaign"
bits = 32
seeds = 2
wrong_keys = 2
[meshes]
Bimba = "ball.ply"
Bunny = "ball.ply"
"Horse & <b>rider</b>" = "ball.ply"
[methods]
first = "saliency-scs:search=false,sigma=1"
second = "saliency-scs:search=false,share=1,sigma=1"
[attacks.noise]
"0.05%" = "noise:amplitude=0.0005"
"0.1%" = "noise:amplitude=0.001"
"0.50%" = "noise:amplitude=0.005"
[attacks.subdivision]
loop = "subdivide:scheme=loop"
midpoint = "subdivide:scheme=midpoint"
[attacks.pipelines]
"all at once" = ["reorder", "noise:amplitude=0.001"]
[imperceptibility]
saliency = "first"
"no saliency" = "second"
[gallery]
meshes = ["Bimba"]
attacks = ["noise/0.50%", "subdivision/loop"]
"""


RANKS = "Rank correlation of saliency with the cover's"


def ball() -> TriangleMesh:
    return TriangleMesh.create_sphere(1.0, 22)


def plan_in(folder: Path, text: str = TOML) -> Campaign:
    write_mesh(folder / "ball.ply", ball())
    (folder / "campaign.toml").write_text(text)
    return Campaign.read(folder / "campaign.toml")


def invented(plan: Campaign, out: Path, leave_out: int = 0) -> None:
    """A folder with rows as a campaign leaves them, with figures from a seeded generator; the last has failed."""
    next(run(plan, out))  # writes the plan
    rng, jobs = np.random.default_rng(0), list(plan.jobs())
    with Ledger(out, jobs) as ledger:
        for each in jobs[: len(jobs) - leave_out]:
            rows = failed_rows(each, ValueError("bad luck"))
            cost = {
                "mrms": rng.uniform(3e-4, 7e-4),
                "hausdorff": rng.uniform(1e-3, 5e-3),
                "msdm": rng.uniform(0.1, 0.5),
            }
            for row in rows if each is not jobs[-1] else []:
                row |= cost | {"failure": None, "vertices": 1000, "seconds": 0.5, "corr": rng.uniform(0.2, 1.0)}
                row |= {"p_value": rng.uniform(), "p_uncharged": rng.uniform(), "message_ok": bool(rng.random() < 0.5)}
                row["message_read"] = row["message_ok"]
            ledger.append(rows)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with invented rows and the report of them, without pictures."""
    folder = tmp_path_factory.mktemp("report")
    invented(plan_in(folder), folder / "out")
    write_report(folder / "out", pictures=False)
    return folder / "out"


def tables(markdown: str) -> dict[str, list[dict[str, str]]]:
    """The tables of a Markdown text by the heading above them: rows as {column: cell}."""
    found: dict[str, list[dict[str, str]]] = {}
    heading, head = "", []
    for line in markdown.splitlines():
        if line.startswith("#"):
            heading, head = line.lstrip("# "), []
        elif line.startswith("|") and not line.startswith("| ---"):
            cells = [cell.strip() for cell in line.strip("|").split(" | ")]
            if not head:
                head, found[heading] = cells, []
            elif set(line) - set("| -"):
                found[heading].append(dict(zip(head, cells, strict=True)))
    return found


def mean_of(rows: list[dict[str, Any]], field: str = "corr", **wanted: Any) -> float:
    values = [row[field] for row in rows if all(row[name] == value for name, value in wanted.items())]
    return float(np.mean([value for value in values if value is not None]))


def test_markdown_shows_the_means_of_the_rows(folder: Path) -> None:
    rows, found = list(read_rows(folder)), tables((folder / "report.md").read_text())
    overview = {row["Corr, mean over meshes and seeds"]: row for row in found["All methods in the paper's conditions"]}
    assert overview.keys() == {
        "no attack",
        "noise 0.05%",
        "noise 0.1%",
        "noise 0.50%",
        "subdivision loop",
        "subdivision midpoint",
    }
    for name, row in overview.items():
        group, _, condition = name.rpartition(" ")
        wanted = {"group": group, "condition": condition, "mesh": "Bimba"}  # the model that the paper has too
        if name == "no attack":
            wanted = {"group": "no attack"}
        for label in ("first", "second"):
            assert row[label] == f"{mean_of(rows, label=label, **wanted):.2f}"
    assert overview["noise 0.50%"]["paper"] == "0.79"
    messages = {row["messages read back exactly"]: row for row in found["Messages"]}
    ours = [row["message_ok"] for row in rows if (row["label"], row["group"]) == ("first", "noise")]
    assert messages["noise"]["first"].startswith(f"{sum(ours)} of {len(ours)} · ")


def test_each_of_the_papers_tables_is_there_with_both_figures_and_the_difference(folder: Path) -> None:
    rows, found = list(read_rows(folder)), tables((folder / "report.md").read_text())
    for group, conditions in {"noise": ["0.05%", "0.1%", "0.50%"], "subdivision": ["loop", "midpoint"]}.items():
        for label in ("first", "second"):
            table = {row[""]: row for row in found[f"{group.capitalize()}: {label}"]}
            assert list(table) == conditions
            for condition in conditions:
                ours = f"{mean_of(rows, label=label, mesh='Bimba', group=group, condition=condition):.2f}"
                theirs = PAPER.value(group, condition, "Bimba")
                assert theirs is not None
                gap = signed(float(ours) - theirs)
                assert table[condition]["Bimba"] == f"{ours} · paper {theirs:.2f} ({gap})"
                assert "paper" not in table[condition]["Bunny"]  # it is in no such table of the paper
    table = {row[""]: row for row in found["Saliency: first"]}
    assert table["MRMS · 10³"]["Bimba"].startswith(
        f"{1e3 * mean_of(rows, 'mrms', label='first', mesh='Bimba'):.2f} · paper 0.37"
    )
    comparison = {row["Corr"]: row for row in found["Noise: Bunny"]}
    assert comparison["Cho 2007, as published"] == {"Corr": "Cho 2007, as published", "0.1%": "0.72", "0.50%": "0.66"}
    assert comparison["first"]["0.50%"].endswith(")")


def test_the_page_has_the_same_tables_as_the_markdown(folder: Path) -> None:
    page, found = (folder / "report.html").read_text(), tables((folder / "report.md").read_text())
    for heading, rows in found.items():
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


def test_the_page_is_whole_and_loads_nothing(folder: Path) -> None:
    page = (folder / "report.html").read_text()
    parser = Balance()
    parser.feed(page)
    assert parser.open == []
    assert {"svg", "table", "details"} <= parser.seen
    assert not {"script", "link", "iframe", "b>rider"} & parser.seen
    assert all(link.startswith(("#", "data:")) for link in parser.links)
    assert "http" not in page
    assert not re.search(r"url\((?!#)", page)
    assert "@import" not in page
    assert "a &lt;small&gt; campaign" in page
    assert "Horse &amp; &lt;b&gt;rider" in page


def test_figures_take_their_ink_from_the_page(folder: Path) -> None:
    page = (folder / "report.html").read_text()
    assert page.count("<svg") == 5  # noise, subdivision, detection, false positives, comparison on the bunny
    assert "currentColor" in page
    assert "#010203" not in page


def test_failures_and_strangers_are_shown(folder: Path) -> None:
    found = tables((folder / "report.md").read_text())
    (failure,) = found["Failures"]
    assert (failure["method"], failure["at"]) == ("second", "marking")
    assert "bad luck" in failure["reason"]
    assert failure["rows"] == "9"
    strangers = {row[""]: row for row in found["Readings under wrong keys"]}
    assert strangers["first"]["readings"] == str(2 * 2 * 3)


def test_an_unfinished_campaign_says_so(tmp_path: Path) -> None:
    invented(plan_in(tmp_path), tmp_path / "out", leave_out=3)
    markdown, _ = write_report(tmp_path / "out", pictures=False)
    assert "of 9 jobs (of 12: unfinished)" in markdown.read_text()


def test_no_rows_no_report(tmp_path: Path) -> None:
    next(run(plan_in(tmp_path), tmp_path / "out"))
    with pytest.raises(SpecError, match="no rows yet"):
        write_report(tmp_path / "out")
    with pytest.raises(SpecError, match="holds no campaign"):
        write_report(tmp_path)


def test_the_gallery_is_in_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    invented(plan_in(tmp_path), tmp_path / "out")
    marked: list[str] = []
    monkeypatch.setattr(gallery, "trial", lambda job: marked.append(job.mesh.name) or trial(job))
    markdown, page = write_report(tmp_path / "out")
    assert marked == ["Bimba"]  # once, and no mesh but the gallery's
    pictures = re.findall(r'src="data:image/jpeg;base64,([^"]+)"', page.read_text())
    assert len(pictures) == 3 + 2 + 2 + 4  # saliency; cover and marked; after attacks; saliency: cover, marked, after
    assert all(base64.b64decode(picture)[:2] == b"\xff\xd8" for picture in pictures)
    ranks = {row["Spearman's ρ of saliency"]: row for row in tables(markdown.read_text())[RANKS]}
    assert list(ranks) == ["marked", "noise 0.50%", "subdivision loop"]
    assert all(f"<small>ρ = {row['Bimba']}</small>" in page.read_text() for row in ranks.values())
    (tmp_path / "ball.ply").unlink()
    job.cover_of.cache_clear()
    _, page = write_report(tmp_path / "out")
    assert "Bimba: not drawn" in page.read_text()


@pytest.fixture(scope="module")
def vase() -> TriangleMesh:
    return make("vase:vertices=1500")


def wave(mesh: TriangleMesh) -> Floats:
    """A number for each vertex that depends on its place alone."""
    return np.sin(np.asarray(mesh.vertices) @ [3.0, 1.0, 2.0])


@pytest.mark.parametrize("attack", ["similarity", "noise:amplitude=0.003", "smooth:iterations=30", "quantise:bits=8"])
def test_counterparts_go_by_number_while_the_triangulation_lasts(vase: TriangleMesh, attack: str) -> None:
    attacked = attack_all(vase, (attack, "similarity"), 5)
    found = counterparts(np.asarray(vase.vertices), np.asarray(attacked.vertices))
    assert found.tolist() == list(range(len(vase.vertices)))


@pytest.mark.parametrize(
    ("attack", "reach"), [("reorder", 0.0), ("crop:share=0.3", 0.0), ("subdivide:scheme=midpoint", 0.501)]
)
def test_counterparts_are_nearest_otherwise(vase: TriangleMesh, attack: str, reach: float) -> None:
    """At the same place, or half an edge away at most."""
    cover, attacked = np.asarray(vase.vertices), np.asarray(attack_all(vase, (attack,), 5).vertices)
    corners = cover[np.asarray(vase.triangles)]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max()
    gaps = np.linalg.norm(cover[counterparts(cover, attacked)] - attacked, axis=1)
    assert len(gaps) == len(attacked)
    assert gaps.max() <= reach * longest + 1e-9


def test_rank_correlation_is_of_the_order_alone(vase: TriangleMesh) -> None:
    before = wave(vase)
    assert rank_correlation(vase, before, vase, np.exp(5 * before)) == pytest.approx(1.0)
    assert rank_correlation(vase, before, vase, -before) == pytest.approx(-1.0)
    noise = np.random.default_rng(0).uniform(size=len(before))
    assert abs(rank_correlation(vase, before, vase, noise) or 1.0) < 0.1
    assert rank_correlation(vase, before, vase, np.ones(len(before))) is None


def test_rank_correlation_follows_vertices_through_renumbering_and_motion(vase: TriangleMesh) -> None:
    shuffled = attack_all(vase, ("reorder",), 3)
    moved = TriangleMesh(shuffled)
    moved.scale(7.0, center=np.array([1.0, 2.0, 3.0]))
    moved.rotate(TriangleMesh.get_rotation_matrix_from_xyz((0.5, 1.0, -2.0)))
    moved.translate((100.0, -20.0, 3.0))
    assert rank_correlation(vase, wave(vase), shuffled, wave(shuffled)) == pytest.approx(1.0)
    assert (rank_correlation(vase, wave(vase), moved, wave(shuffled)) or 0.0) > 0.99


def section_of(folder: Path, title: str) -> str:
    """The HTML of one section of the report."""
    page = (folder / "report.html").read_text()
    start = page.index(f"<h2>{title}</h2>")
    return page[start : page.index("</section>", start)]


def test_rivals_are_drawn_beside_ours_on_the_same_model(folder: Path) -> None:
    section = section_of(folder, "Comparison with published methods")
    drawing = section[section.index("<h3>Noise: Bunny</h3>") : section.index("</svg>")]
    for name in ("Cho 2007", "Zhan 2014", "the paper's method", "first", "second"):
        assert f">{name}</text>" in drawing.replace("&#x27;", "'")
    assert "none of the models" not in section


def test_without_a_common_model_the_comparison_says_so(tmp_path: Path) -> None:
    invented(plan_in(tmp_path, TOML.replace("Bunny =", "Rabbit =")), tmp_path / "out")
    write_report(tmp_path / "out", pictures=False)
    section = section_of(tmp_path / "out", "Comparison with published methods")
    assert "none of the models" in section
    assert section.count("<svg") == 1


def test_a_campaign_without_the_papers_conditions_is_compared_with_nothing(tmp_path: Path) -> None:
    others = TOML.replace("attacks.noise", "attacks.hiss").replace("attacks.subdivision", "attacks.division")
    others = others.replace("noise/0", "hiss/0").replace("subdivision/loop", "division/loop")
    invented(plan_in(tmp_path, others), tmp_path / "out")
    markdown, page = write_report(tmp_path / "out", pictures=False)
    found = tables(markdown.read_text())
    assert "All methods in the paper's conditions" not in found
    assert "mean Corr, all attacks" in found["At a glance"][0]
    assert TONES["better"] not in page.read_text()


def test_the_page_says_what_colours_and_methods_are(folder: Path) -> None:
    page, found = (folder / "report.html").read_text(), tables((folder / "report.md").read_text())
    assert all(escape(text) in page for text in TONES.values())
    methods = {row[""]: row for row in found["The methods"]}
    assert methods["first"]["its reader needs"] == "key alone (blind)"
    assert "Hamidi" in methods["first"]["how it works"]
    assert "share = 1 (" in methods["second"]["options not at their default"]


@pytest.mark.parametrize(
    ("conditions", "places", "scaled"),
    [
        (("11 bit", "7 bit"), (11, 7), True),
        (("0.05%", "0.50%"), (0.05, 0.5), True),
        (("loop", "midpoint", "sqrt3"), (0, 1, 2), False),
        (("5 it", "loop"), (0, 1), False),
    ],
)
def test_conditions_stand_by_their_strength_with_the_strongest_on_the_right(
    conditions: tuple[str, ...], places: tuple[float, ...], scaled: bool
) -> None:
    _, axes, x, by_strength = axes_for(conditions)
    assert (tuple(x), by_strength) == (places, scaled)
    shown = axes.transData.transform(np.stack([x, 0 * x], axis=1))[:, 0]
    assert (np.diff(shown) > 0).all()


def test_the_papers_figures_are_complete() -> None:
    tables = {entry[0] for entry in PAPER.entries}
    assert {"noise", "smoothing", "reordering", "quantization", "similarity", "subdivision", "cropping"} <= tables
    assert len(PAPER.models("noise")) == 6
    assert PAPER.mean_of("noise", "0.50%", PAPER.models("noise")) == pytest.approx(
        (0.83 + 0.72 + 0.74 + 0.76 + 0.74 + 0.79) / 6
    )
    assert PAPER.value("noise comparison", "0.50%", "Bunny", method="cho2007") == 0.66
    assert PAPER.value("noise", "0.07%", "Bimba") is None
    for entry in PAPER.entries:
        assert 0 < entry[5] <= 6


@pytest.mark.parametrize(
    ("condition", "value"), [("0.05%", 0.05), ("0.10%", 0.1), ("11 bit", 11), ("5 it", 5), ("1", None), ("loop", None)]
)
def test_a_strength_is_a_number_with_a_unit(condition: str, value: float | None) -> None:
    assert strength(condition) == value


def test_the_difference_is_that_of_the_figures_shown() -> None:
    cell = compared(0.924, 0.906)
    assert (cell.text, cell.remark) == ("0.92", "paper 0.91 (+0.01)")
    assert compared(0.876, 0.9103).tone == "same"  # 0.88 and 0.91
    assert compared(None, 0.5).text == "–"
    assert compared(0.5, None).tone == ""
    assert (number(-0.001), number(-0.5), signed(0.0)) == ("0.00", "−0.50", "+0.00")


@pytest.mark.parametrize(
    ("gain", "tone"), [(0.2, "better"), (0.02, "same"), (-0.03, "same"), (-0.1, "below"), (-0.5, "far")]
)
def test_tones(gain: float, tone: str) -> None:
    assert tone_of(gain) == tone
    assert compared(0.5 - gain, 0.5, low=True).tone == tone_of(2 * gain)  # less is better, relative to 0.5


def test_the_interval_holds_the_mean_and_shrinks_with_the_sample() -> None:
    values = np.random.default_rng(3).uniform(0, 1, 400).tolist()
    low, high = interval(values)
    assert low < np.mean(values) < high
    assert high - low < 0.5 * np.subtract(*interval(values[:40])[::-1])
    assert interval([0.5]) == (0.5, 0.5)


def test_rows_are_not_touched(folder: Path) -> None:
    before = (folder / "rows.jsonl").read_bytes()
    write_report(folder, pictures=False)
    assert (folder / "rows.jsonl").read_bytes() == before
    assert json.loads(before.splitlines()[0])["mesh"] == "Bimba"
