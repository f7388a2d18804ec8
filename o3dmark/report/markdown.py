"""The report as Markdown: all the tables, none of the pictures. Names are text, whatever they hold."""

import re
from collections.abc import Iterator, Mapping, Sequence

from o3dmark.report.content import Cell, Section, Table

_INLINE = re.compile(r"[\\`*\[\]~$|]|(?<![^\W_])_|_(?![^\W_])")  # an underscore within a word marks nothing up
_ENTITIES = {"&": "&amp;", "<": "&lt;", ">": "&gt;"}
_BLOCK = re.compile(r"([#+=-]|\d+(?=[.)](?:\s|$)))")  # what makes a heading or a list where a paragraph begins with it


def markdown(title: str, facts: Mapping[str, str], tiles: Mapping[str, Cell], sections: Sequence[Section]) -> str:
    """The whole document."""
    return "\n".join(_lines(title, facts, tiles, sections)) + "\n"


def table_lines(table: Table) -> Iterator[str]:
    """A table without its title and caption, a line at a time."""
    yield from _table(table.head, table.rows)


def inline(text: str) -> str:
    """A text that shows as it is, within a line or a cell."""
    for character, entity in _ENTITIES.items():
        text = text.replace(character, entity)
    return _INLINE.sub(r"\\\g<0>", " ".join(text.split()))


def paragraph(text: str) -> str:
    """A text that shows as it is, where a line begins."""
    text = inline(text)
    found = _BLOCK.match(text)
    return text if not found else f"{found[0]}\\{text[found.end() :]}" if found[0].isdigit() else f"\\{text}"


def _lines(
    title: str, facts: Mapping[str, str], tiles: Mapping[str, Cell], sections: Sequence[Section]
) -> Iterator[str]:
    yield f"# {paragraph(title)}\n"
    yield from (f"- {paragraph(name)}: {inline(value)}" for name, value in facts.items())
    if tiles:
        yield ""
        yield from _table(tuple(tiles), [tuple(tiles.values())])
    for section in sections:
        tables = [block for block in section.blocks if isinstance(block, Table)]
        if tables or not section.blocks:
            yield f"\n## {paragraph(section.title)}\n"
            yield paragraph(section.intro)
        for table in tables:
            yield f"\n### {paragraph(table.title)}\n" if table.title else ""
            if table.caption:
                yield f"{paragraph(table.caption)}\n"
            yield from _table(table.head, table.rows)


def _table(head: Sequence[str], rows: Sequence[Sequence[Cell]]) -> Iterator[str]:
    yield "| " + " | ".join(map(inline, head)) + " |"
    yield "|" + " --- |" * len(head)
    for row in rows:
        yield "| " + " | ".join(map(_cell, row)) + " |"


def _cell(cell: Cell) -> str:
    return inline(f"{cell.text} · {cell.remark}" if cell.remark else cell.text)
