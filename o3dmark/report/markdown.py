"""The report as Markdown: all the tables, none of the pictures."""

from collections.abc import Iterator, Mapping, Sequence

from o3dmark.report.content import Cell, Section, Table


def markdown(title: str, facts: Mapping[str, str], tiles: Mapping[str, Cell], sections: Sequence[Section]) -> str:
    """The whole document."""
    return "\n".join(_lines(title, facts, tiles, sections)) + "\n"


def _lines(
    title: str, facts: Mapping[str, str], tiles: Mapping[str, Cell], sections: Sequence[Section]
) -> Iterator[str]:
    yield f"# {title}\n"
    yield from (f"- {name}: {_escaped(value)}" for name, value in facts.items())
    yield ""
    yield from _table(tuple(tiles), [tuple(tiles.values())])
    for section in sections:
        tables = [block for block in section.blocks if isinstance(block, Table)]
        if tables:
            yield f"\n## {section.title}\n"
            yield section.intro
        for table in tables:
            yield f"\n### {table.title}\n" if table.title else ""
            if table.caption:
                yield f"{table.caption}\n"
            yield from _table(table.head, table.rows)


def _table(head: Sequence[str], rows: Sequence[Sequence[Cell]]) -> Iterator[str]:
    yield "| " + " | ".join(map(_escaped, head)) + " |"
    yield "|" + " --- |" * len(head)
    for row in rows:
        yield (
            "| "
            + " | ".join(_escaped(f"{cell.text} · {cell.remark}" if cell.remark else cell.text) for cell in row)
            + " |"
        )


def _escaped(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
