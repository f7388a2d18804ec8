"""The controls: what is read with wrong keys, and from meshes that carry no mark. It ought to be nothing."""

import math
from collections.abc import Iterator

from o3dmark.campaign.row import UNMARKED, WRONG_KEY, Row
from o3dmark.report.content import Cell, Section, Table, ber_number, corr_number
from o3dmark.report.data import Contestant, Results
from o3dmark.report.summary import ber, corr
from o3dmark.report.tables import share

_TITLES = {WRONG_KEY: "Marked meshes read with wrong keys", UNMARKED: "Unmarked meshes"}
_RATES = (0.1, 0.01, 0.001)


def control_section(results: Results) -> Iterator[Section]:
    """A table for each kind of control that the campaign has."""
    tables = [_table(results, control, title) for control, title in _TITLES.items()]
    intro = (
        "Readings that ought to find nothing. A p-value says how often chance agrees as well with the known bits, so of"
        " n readings n · p should have one of p or less, on average, and no more than that: the number allowed. That"
        " holds for single readings (uncharged); the p-values reported (charged) are larger, since they pay for every"
        " hypothesis that the reader tried."
    )
    if any(table.rows for table in tables):
        yield Section("Controls", intro, tuple(table for table in tables if table.rows))


def _table(results: Results, control: str, title: str) -> Table:
    rows = [
        _row(who, rows)
        for who in results.contestants
        if (rows := [row for row in results.controls(who, control) if row.failure is None])
    ]
    small = [f"p ≤ {rate:g}, {kind}" for kind in ("charged", "uncharged") for rate in _RATES]
    caption = "Shares with their 95 % interval (Wilson); beside the numbers of small p-values, how many are allowed."
    return Table(title, ("", "readings", "mean Corr", "mean BER", "messages read", *small), tuple(rows), caption)


def _row(who: Contestant, rows: list[Row]) -> tuple[Cell, ...]:
    texts = (str(len(rows)), corr_number(corr(rows)), ber_number(ber(rows)))
    small = (*_small([row.log10_p for row in rows]), *_small([row.log10_p_uncharged for row in rows]))
    return (Cell(who.name), *map(Cell, texts), share(rows, "message_read"), *small)


def _small(log10_p: list[float | None]) -> list[Cell]:
    """How many p-values are as small as each rate, and how many may be."""
    values = [value for value in log10_p if value is not None]
    return [
        Cell(str(sum(value <= math.log10(rate) for value in values)), f"{rate * len(values):.2g} allowed")
        for rate in _RATES
    ]
