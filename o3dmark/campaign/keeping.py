"""A finished folder in the form that is kept: a table without what is the same everywhere, or counts and failures."""

import csv
import io
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from o3dmark.campaign.folder import load, save
from o3dmark.campaign.ledger import locked
from o3dmark.campaign.row import LINES, TABLE, Row, read_rows, read_table, text_of
from o3dmark.errors import BackendError, SpecError
from o3dmark.files import replacing

SUMMARY = "summary.csv"


def compact(directory: str | Path) -> Path:
    """Put rows.csv in the place of rows.jsonl, in the campaign's order; returns its path. `run` can go on from it.

    Columns that are the same in every row stand in campaign.json under "constant". rows.jsonl goes when all rows were
    read back from the table. Errors: SpecError without rows, BackendError when they are not the same or still written.
    """
    directory = Path(directory)
    with locked(directory):
        kept, rows = load(directory), _in_order(directory)
        contents = [{name: value for name, value in row.to_dict().items() if name != "p_value"} for row in rows]
        constant, varying = _columns(contents)
        save(directory, kept, constant=constant)
        lines = ([text_of(content.get(name)) for name in varying] for content in contents)
        _write(directory / TABLE, varying, lines)
        if list(read_table(directory / TABLE)) != rows:
            raise BackendError(f"{directory / TABLE} does not hold what {LINES} does; the latter is kept")
        (directory / LINES).unlink(missing_ok=True)
    return directory / TABLE


def summarise(directory: str | Path) -> Path:
    """Write DIR/summary.csv: a line for each method and condition, how many readings went how, and why; its path.

    For sweeps with too many rows to keep: what is ``ok`` is only counted, what was ``refused`` or ``failed`` is told in
    full. Errors: SpecError without rows.
    """
    lines: dict[tuple[str, ...], list[Row]] = {}
    for row in _in_order(Path(directory)):
        lines.setdefault((row.label, row.group, row.condition, row.control, row.attack), []).append(row)
    head = ("label", "group", "condition", "control", "attack", "ok", "refused", "failed", "reasons")
    _write(Path(directory) / SUMMARY, head, (_summary(names, rows) for names, rows in lines.items()))
    return Path(directory) / SUMMARY


def _in_order(directory: Path) -> list[Row]:
    """All rows, in the order of the campaign, whatever the order in which jobs were finished."""
    rank = {job.id: number for number, job in enumerate(load(directory).campaign.jobs())}
    rows = sorted(read_rows(directory), key=lambda row: rank[row.job])
    if not rows:
        raise SpecError(f"{directory} holds no rows yet; run `o3dmark bench` first")
    return rows


def _columns(contents: Sequence[Mapping[str, Any]]) -> tuple[dict[str, Any], list[str]]:
    """The columns that are the same everywhere, with their value, and the names of the others."""
    names = list(dict.fromkeys(name for content in contents for name in content))
    same = {name for name in names if all(each.get(name) == contents[0].get(name) for each in contents)}
    return {name: contents[0].get(name) for name in names if name in same}, [name for name in names if name not in same]


def _summary(names: tuple[str, ...], rows: list[Row]) -> tuple[Any, ...]:
    counts = Counter(row.outcome for row in rows)
    reasons = "\n".join(f"{row.mesh}, seed {row.seed}: {row.failure}" for row in rows if row.failure)
    return (*names, counts["ok"], counts["refused"], counts["failed"], reasons)


def _write(path: Path, head: Sequence[str], lines: Iterable[Sequence[Any]]) -> None:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(lines)
    with replacing(path) as draft:
        draft.write_text(text.getvalue(), encoding="utf-8", newline="")
