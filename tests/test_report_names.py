"""Names are text: whatever a mesh, a method or a condition is called, no report gets a tag, a link or a heading."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest
from markdown_it import MarkdownIt

from fixtures.kept_folder import COMPARED, RUN, invented_rows, keep
from o3dmark.campaign.plan import Case, Gallery, Source
from o3dmark.report import write_report
from o3dmark.report.markdown import inline, paragraph

EVIL = (
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "a | b | c",
    "`code` **bold** __bold__ _it_ ~~gone~~",
    "# heading\n\n## two\n- three",
    "![seen](http://example.org/x.png) [link](http://example.org) <http://example.org>",
    "&lt;b&gt; &copy; \\",
    "</text><script>1</script> $\\frac{1}{2}$ ]]> -->",
    "_hidden_",
    "1. one",
)
PARSER = MarkdownIt("commonmark", {"html": True}).enable(["table", "strikethrough"])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of a campaign in which everything is called something evil."""
    campaign = replace(
        COMPARED,
        title=EVIL[4],
        meshes=tuple(Source(name, "vase") for name in EVIL),
        methods=dict.fromkeys(EVIL, EVIL[0]),
        main=EVIL[0],
        cases=tuple(Case(name, other, ("reorder",)) for name in EVIL for other in (EVIL[0], EVIL[8])),
        seeds=(0,),
        wrong_keys=1,
        gallery=Gallery(EVIL[:1], (), EVIL[1]),
        imperceptibility={EVIL[4]: EVIL[0]},
        published_names={"hamidi": EVIL[1], "cho2007": EVIL[8]},
    )
    rows = [replace(row, failure=EVIL[1] if row.mesh == EVIL[2] else None) for row in invented_rows(campaign)]
    folder = keep(tmp_path_factory.mktemp("evil"), campaign, rows, runs=(dict.fromkeys(RUN, EVIL[5]),))
    pictures = [
        {"file": "1.jpg", "mesh": EVIL[1], "kind": kind, "group": EVIL[0], "condition": EVIL[0], "caption": EVIL[5]}
        for kind in ("saliency", "original", "marked", "attacked", "attacked saliency")
    ]
    (folder / "1.jpg").write_bytes(b"\xff\xd8\xff")
    (folder / "pictures.json").write_text(json.dumps(pictures))
    write_report(folder)
    return folder


def test_markdown_has_headings_lists_and_tables_of_plain_text_alone(folder: Path) -> None:
    tokens = PARSER.parse((folder / "report.md").read_text())
    kinds = {token.type for token in tokens} | {child.type for token in tokens for child in token.children or ()}
    cells = {f"{part}_{side}" for part in ("table", "thead", "tbody", "tr", "th", "td") for side in ("open", "close")}
    blocks = {
        f"{part}_{side}" for part in ("heading", "paragraph", "bullet_list", "list_item") for side in ("open", "close")
    }
    assert kinds == cells | blocks | {"inline", "text"}


def test_markdown_shows_every_name_as_it_is(folder: Path) -> None:
    tokens = PARSER.parse((folder / "report.md").read_text())
    cells = {
        "".join(child.content for child in token.children or ()).partition(" · ")[0]
        for token in tokens
        if token.type == "inline"
    }
    assert {" ".join(name.split()) for name in EVIL} <= cells


def test_rows_of_markdown_tables_have_as_many_cells_as_their_heads(folder: Path) -> None:
    width = 0
    for line in (folder / "report.md").read_text().splitlines():
        bars = len(re.findall(r"(?<!\\)\|", line))
        if line.startswith("| ---"):
            assert bars == width
        width = bars if not line.startswith("|") or not width else width
        assert not line.startswith("|") or bars == width, line


class Tags(HTMLParser):
    """Every tag and attribute of a page, and all its text."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: set[str] = set()
        self.attributes: set[str] = set()
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.attributes |= {name for name, _ in attrs}

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def test_the_page_gets_no_tag_and_no_attribute_of_a_name(folder: Path) -> None:
    parser = Tags()
    parser.feed((folder / "report.html").read_text())
    assert "script" not in parser.tags
    assert not {name for name in parser.attributes if name.startswith("on")}
    assert {tag for tag in parser.tags if tag in ("b", "code", "strong", "em")} <= {"b"}
    for name in EVIL:
        assert name in parser.text, name


def test_figures_name_every_method_in_their_legend(folder: Path) -> None:
    page = (folder / "report.html").read_text()
    first = Tags()
    first.feed(page[page.index("<svg") : page.index("</svg>")])
    shown = {" ".join(text.split()) for text in first.text}
    for name in EVIL:
        for line in name.split("\n"):
            assert " ".join(line.split()) in shown, name


@pytest.mark.parametrize(
    "text", [*EVIL, "- a", "+ a", "12) a", "=", "* a", "---", "> a", "    a", "| a |", "a_b_c", "~~~"]
)
def test_a_paragraph_shows_its_text(text: str) -> None:
    (_, content, _) = PARSER.parse(paragraph(text))
    assert "".join(child.content for child in content.children or ()) == " ".join(text.split())
    assert "\n" not in inline(text)


def test_plain_names_are_left_as_they_are() -> None:
    for name in ("octa_flower_7919", "saliency-scs:sync=rank,step=0.035", "0.05%", "MRMS · 10³"):
        assert inline(name) == paragraph(name) == name
