"""What is kept of a campaign with too many rows to keep: how many readings went how, and why some did not."""

import csv
from collections.abc import Iterator
from pathlib import Path

from o3dmark.errors import SpecError
from o3dmark.report.content import Cell, Section, Table

_COUNTS = ("ok", "refused", "failed")
_SHOWN = 3  # reasons of a line that are told


def sweep_section(path: Path) -> Iterator[Section]:
    """A table for each table of attacks of a summary.csv, as `o3dmark.campaign.summarise` writes it.

    Errors: SpecError for another file.
    """
    groups: dict[str, list[dict[str, str]]] = {}
    with path.open(encoding="utf-8", newline="") as file:
        for line in csv.DictReader(file):
            groups.setdefault(line.get("group", ""), []).append(line)
    try:
        tables = [_table(group, lines) for group, lines in groups.items()]
    except (KeyError, ValueError, AttributeError) as error:
        raise SpecError(f"{path} is no summary of a campaign: {error!r}") from None
    intro = (
        "Only counts are kept of this campaign: readings that went well, meshes or attacks that were refused with a"
        f" reason, and what failed otherwise. Of the reasons of a line the first {_SHOWN} are shown; the file has all."
    )
    yield Section("What happened", intro, tuple(tables))


def _table(group: str, lines: list[dict[str, str]]) -> Table:
    head = ("condition", "method", *_COUNTS, "reasons")
    return Table(group.capitalize(), head, tuple(map(_row, lines)), prose=True)


def _row(line: dict[str, str]) -> tuple[Cell, ...]:
    reasons = line["reasons"].splitlines()
    told = "; ".join(reasons[:_SHOWN]) + (f"; and {len(reasons) - _SHOWN} more" if len(reasons) > _SHOWN else "")
    counts = (Cell(f"{int(line[name])}") for name in _COUNTS)
    return (Cell(f"{line['condition']} {line['control']}".strip()), Cell(line["label"]), *counts, Cell(told))
