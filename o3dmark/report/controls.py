"""The controls: what is read with wrong keys, and from meshes that carry no mark. It ought to be nothing."""

import math
from collections.abc import Iterator

from o3dmark.campaign.row import UNMARKED, WRONG_KEY, Row
from o3dmark.report.content import Cell, Section, Table, ber_number, corr_number
from o3dmark.report.data import Entry, Results
from o3dmark.report.summary import ber, corr
from o3dmark.report.tables import share

CONTROLS = {WRONG_KEY: "Marked meshes read with wrong keys", UNMARKED: "Unmarked meshes"}
_TESTS = {
    "log10_p_uncharged": "known bits, hypotheses not charged",
    "log10_p": "known bits, hypotheses charged",
    "log10_p_best": "known bits choose among all readings, all charged",
    "log10_p_message": "unknown message, all messages and hypotheses charged",
}
_RATES = (0.1, 0.01, 0.001)


def control_section(results: Results) -> Iterator[Section]:
    """For each kind of control that the campaign has: what was read, and how many p-values are small."""
    intro = (
        "Readings that ought to find nothing. A p-value says how often chance does as well, so of n readings no more"
        " than n · p may have one of p or less, on average: the number allowed. Uncharged, a p-value is that of the one"
        " reading that the method chose; charged, it pays for every hypothesis that was tried."
    )
    tables = [table for control in CONTROLS for table in control_tables(results, control)]
    if tables:
        yield Section("Controls", intro, tuple(tables))


def control_tables(results: Results, control: str) -> Iterator[Table]:
    """The readings of one kind of control, and their small p-values, entry by entry."""
    readings = {who: _readings(results, who, control) for who in results.entries}
    readings = {who: rows for who, rows in readings.items() if rows}
    if not readings:
        return
    caption = "Messages read: any, with the 95 % interval of their share (Wilson)."
    head = ("", "readings", "mean Corr", "mean BER", "messages read")
    yield Table(CONTROLS[control], head, tuple(_read(who, rows) for who, rows in readings.items()), caption)
    lines = [_small(who, rows, test) for who, rows in readings.items() for test in _TESTS]
    rates = (f"p ≤ {rate:g}" for rate in _RATES)
    caption = "How many p-values are as small as that, and how many are allowed."
    title = f"{CONTROLS[control]}: small p-values"
    yield Table(title, ("", "p-value", "readings", *rates), tuple(filter(None, lines)), caption)


def _readings(results: Results, who: Entry, control: str) -> list[Row]:
    return [row for row in results.controls(who, control) if row.failure is None]


def _read(who: Entry, rows: list[Row]) -> tuple[Cell, ...]:
    texts = (who.name, str(len(rows)), corr_number(corr(rows)), ber_number(ber(rows)))
    return (*map(Cell, texts), share(rows, "message_read"))


def _small(who: Entry, rows: list[Row], test: str) -> tuple[Cell, ...]:
    """How many p-values of a test are as small as each rate, and how many may be; empty without any."""
    values = [value for row in rows if (value := getattr(row, test)) is not None]
    counts = (
        Cell(str(sum(value <= math.log10(rate) for value in values)), f"{rate * len(values):.2g} allowed")
        for rate in _RATES
    )
    return (Cell(who.name), Cell(_TESTS[test]), Cell(str(len(values))), *counts) if values else ()
