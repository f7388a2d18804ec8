"""Figures that somebody has printed: the CSV that a campaign names and keeps.

    table,method,metric,condition,model,value
    noise,hamidi,corr,0.05%,Flower,0.97

What its columns say stands in `report.published`, which compares with them.
"""

import csv
from typing import NamedTuple

from o3dmark.errors import SpecError


class PublishedFigure(NamedTuple):
    """One printed figure: a line of the file."""

    table: str
    method: str
    metric: str
    condition: str
    model: str
    value: float


def figures(text: str) -> tuple[PublishedFigure, ...]:
    """The lines of a CSV file of printed figures; none of an empty text. Errors: SpecError with the line's number."""
    if not text:
        return ()
    lines = csv.reader(text.splitlines())
    if tuple(next(lines, ())) != PublishedFigure._fields:
        raise SpecError(f"published: the first line should be {','.join(PublishedFigure._fields)}")
    return tuple(_figure(line, lines.line_num) for line in lines if line)


def _figure(line: list[str], number: int) -> PublishedFigure:
    try:
        *names, value = line
        table, method, metric, condition, model = names
        return PublishedFigure(table, method, metric, condition, model, float(value))
    except ValueError:
        wanted = ",".join(PublishedFigure._fields)
        raise SpecError(f"published, line {number}: should be {wanted} with a number at its end, not {line}") from None
