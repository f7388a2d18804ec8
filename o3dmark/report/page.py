"""The report as one HTML page that loads nothing: style and template beside this file, pictures inside."""

import base64
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from importlib.resources import files
from itertools import groupby
from string import Template

from o3dmark.report.content import TONES, Block, Cell, Figure, Picture, Section, Table

_LONG = 40  # characters from which a cell's text may be broken


def page(title: str, facts: Mapping[str, str], tiles: Mapping[str, Cell], sections: Sequence[Section]) -> str:
    """The whole document."""
    template = Template((files(__package__) / "page.html").read_text(encoding="utf-8"))
    return template.substitute(
        title=escape(title),
        facts="".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in facts.items()),
        tiles="".join(_tile(name, cell) for name, cell in tiles.items()),
        tones=_legend() if any(cell.tone for cell in _cells(tiles, sections)) else "",
        contents="".join(f'<a href="#{_anchor(section)}">{escape(section.title)}</a>' for section in sections),
        sections="".join(map(_section, sections)),
    )


def _cells(tiles: Mapping[str, Cell], sections: Sequence[Section]) -> Iterator[Cell]:
    yield from tiles.values()
    tables = (block for section in sections for block in section.blocks if isinstance(block, Table))
    yield from (cell for table in tables for row in table.rows for cell in row)


def _legend() -> str:
    """What the colours mean, where something is compared."""
    spans = (f'<span class="{tone}">{escape(text)}</span>' for tone, text in TONES.items())
    return f'<p class="tones">{"".join(spans)}</p>'


def _tile(name: str, cell: Cell) -> str:
    text = f"<p>{escape(name)}</p><b>{escape(cell.text)}</b><small>{escape(cell.remark)}</small>"
    return f'<div class="tile {cell.tone}">{text}</div>'


def _anchor(section: Section) -> str:
    return "".join(letter if letter.isalnum() else "-" for letter in section.title.lower())


def _section(section: Section) -> str:
    parts = []
    for kind, blocks in groupby(section.blocks, key=_kind):
        parts.append(f'<div class="{kind}">{"".join(map(_block, blocks))}</div>')
    head = (
        f'<section id="{_anchor(section)}"><h2>{escape(section.title)}</h2><p class="intro">{escape(section.intro)}</p>'
    )
    return head + "".join(parts) + "</section>"


def _kind(block: Block) -> str:
    """Blocks that follow each other and are of one kind are laid out together."""
    return "folds" if isinstance(block, Table) and block.folded else f"{type(block).__name__.lower()}s"


def _block(block: Block) -> str:
    if isinstance(block, Table):
        return _table(block)
    if isinstance(block, Figure):
        caption = f"<figcaption>{escape(block.caption)}</figcaption>" if block.caption else ""
        return f"<figure><h3>{escape(block.title)}</h3>{block.svg}{caption}</figure>"
    return _picture(block)


def _picture(picture: Picture) -> str:
    image = ""
    if picture.jpeg:
        data = base64.b64encode(picture.jpeg).decode()
        image = f'<img alt="{escape(picture.title)}" src="data:image/jpeg;base64,{data}">'
    text = f"<b>{escape(picture.title)}</b><small>{escape(picture.caption)}</small>"
    return f"<figure>{image}<figcaption>{text}</figcaption></figure>"


def _table(table: Table) -> str:
    head = "".join(f"<th>{escape(name)}</th>" for name in table.head)
    rows = "".join(f"<tr>{''.join(map(_cell, row))}</tr>" for row in table.rows)
    caption = f'<p class="intro">{escape(table.caption)}</p>' if table.caption else ""
    kind = ' class="prose"' if table.prose else ""
    body = (
        f'{caption}<div class="scroll"><table{kind}><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>'
    )
    if table.folded:
        return f"<details><summary>{escape(table.title)}</summary>{body}</details>"
    return (f"<h3>{escape(table.title)}</h3>" if table.title else "") + body


def _cell(cell: Cell) -> str:
    remark = f"<small>{escape(cell.remark)}</small>" if cell.remark else ""
    kind = cell.tone or ("long" if len(cell.text) > _LONG else "")
    opening = f'<td class="{kind}">' if kind else "<td>"
    return f"{opening}{escape(cell.text)}{remark}</td>"
