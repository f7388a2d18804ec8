"""The tables that are ours alone: the overview, attacks that the paper has not, wrong keys, failures."""

import inspect
from collections import Counter
from typing import Any

from o3dmark.campaign.plan import UNTOUCHED
from o3dmark.coding.detection import Rate
from o3dmark.methods import METHODS
from o3dmark.registry import describe
from o3dmark.report.content import Cell, Section, Table, Tone, compared, number
from o3dmark.report.data import Contestant, Results, Row, corr, mean
from o3dmark.report.paper import PAPER, both

_WORDS = 140  # length of a failure's reason that is worth showing


def overview_section(results: Results) -> Section:
    """The contestants; one line for every condition of the paper, its mean and each contestant's; messages."""
    conditions = _paper_conditions(results)
    tables = [_glance(results), _methods(results), _messages(results)]
    intro = "Corr is 1 when every bit was read, 0 on average by chance."
    if conditions:
        intro += " Colours and arrows compare with the paper's mean over the same models."
        rows = tuple(_overview_row(results, *each) for each in [(UNTOUCHED, "-"), *conditions])
        head = ("Corr, mean over meshes and seeds", "paper", *(who.name for who in results.contestants))
        tables.insert(2, Table("All methods in the paper's conditions", head, rows))
    return Section("Overview", intro, tuple(tables))


def _paper_conditions(results: Results) -> list[tuple[str, str]]:
    """The campaign's conditions that are in a table of the paper: (table, condition)."""
    return [(group, each) for group, listed in results.groups.items() if PAPER.models(group) for each in listed]


def _glance(results: Results) -> Table:
    """One line for every contestant."""
    conditions = _paper_conditions(results)
    considered = conditions or [(group, each) for group, listed in results.groups.items() for each in listed]
    rows = []
    for who in results.contestants:
        pairs = [both(results, who, *each) for each in considered]
        costs = (results.cost(who, "mrms"), results.cost(who, "hausdorff"))
        rows.append(
            (
                Cell(who.name),
                compared(
                    mean(corr(ours) for ours, _ in pairs), mean(theirs for _, theirs in pairs) if conditions else None
                ),
                _share(results.attacked(who), "message_ok"),
                *(Cell(number(None if cost is None else 1e3 * cost)) for cost in costs),
                Cell(number(results.cost(who, "msdm"))),
                Cell(number(mean(row["seconds"] for row in results.attacked(who)), 1)),
            )
        )
    where = "paper's conditions" if conditions else "all attacks"
    head = ("", f"mean Corr, {where}", "messages read", "MRMS · 10³", "HD · 10³", "MSDM", "s a reading")
    return Table("At a glance", head, tuple(rows))


def _methods(results: Results) -> Table:
    """What each contestant is, in the words of its own class, and what sets it apart from the method's defaults."""
    rows = []
    for label, spec in results.campaign.methods.items():
        method = METHODS.make(spec)
        needs = "key and cover mesh" if method.informed else "key alone (blind)"
        says = (inspect.getdoc(type(method)) or "").partition("\n")[0]
        rows.append((Cell(label), Cell(says), Cell(needs), Cell(_options(method))))
    head = ("", "how it works", "its reader needs", "options not at their default")
    return Table("The methods", head, tuple(rows), prose=True)


def _options(method: Any) -> str:
    changed = [
        f"{name} = {value if isinstance(value, str) else format(value, 'g')} ({doc.partition(';')[0]})"
        for name, _, default, doc in describe(type(method))
        if (value := getattr(method, name)) != default
    ]
    return ", ".join(changed) or "none"


def _overview_row(results: Results, group: str, condition: str) -> tuple[Cell, ...]:
    cells, theirs = [], None
    for who in results.contestants:
        rows, theirs = both(results, who, group, condition)
        full = compared(corr(rows), theirs)
        cells.append(Cell(full.text, tone=full.tone))
    name = group if condition == "-" else f"{group} {condition}"
    return (Cell(name), Cell(number(theirs)), *cells)


def _messages(results: Results) -> Table:
    """How many messages came back, table by table."""
    groups = [UNTOUCHED, *results.groups]
    rows = [
        (Cell(group), *(_share(results.of(who, group), "message_ok") for who in results.contestants))
        for group in groups
    ]
    head = ("messages read back exactly", *(who.name for who in results.contestants))
    caption = "Through the error-correcting code; with the 95 % interval of the share (Wilson)."
    return Table("Messages", head, tuple(rows), caption)


def other_attacks_section(results: Results) -> Section:
    """The campaign's attacks that are in no table of the paper."""
    tables = [
        Table(
            group.capitalize(),
            ("Corr; messages read", *(who.name for who in results.contestants)),
            tuple(
                (Cell(condition), *(_reading(results, who, group, condition) for who in results.contestants))
                for condition in conditions
            ),
        )
        for group, conditions in results.groups.items()
        if not PAPER.models(group)
    ]
    intro = (
        "Mean Corr of the raw bits, and messages read back exactly. Here colours and arrows count messages: up where"
        " all were read, down where some were, twice down where none was."
    )
    return Section("Attacks beyond the paper", intro, tuple(tables))


def wrong_key_section(results: Results) -> Section:
    """What other keys read from the marked meshes: nothing, one hopes."""
    rows = []
    for who in results.contestants:
        if strangers := results.strangers(who):
            p_values = [row["p_value"] for row in strangers if row["p_value"] is not None]
            cells = Cell(str(len(p_values))), Cell(number(corr(strangers))), _share(strangers, "message_read")
            small = [
                Cell(f"{sum(p <= rate for p in p_values)}", f"≤ {rate * len(p_values):.2g} expected")
                for rate in (0.1, 0.01)
            ]
            rows.append((Cell(who.name), *cells, *small))
    head = ("", "readings", "mean Corr", "messages read", "p ≤ 0.1", "p ≤ 0.01")
    intro = (
        "Every marked mesh was also read under keys that have nothing to do with it. A p-value says how often chance"
        " does as well."
    )
    return Section("Wrong keys", intro, (Table("Readings under wrong keys", head, tuple(rows)),) if rows else ())


def failure_section(results: Results) -> Section:
    """What did not work at all, and why."""
    counts = Counter(
        (row["label"], row["mesh"], "marking" if _unmarked(row) else row["attack"], row["failure"][:_WORDS])
        for row in results.rows
        if row["failure"]
    )
    rows = [(*(Cell(str(part)) for part in key), Cell(str(count))) for key, count in sorted(counts.items())]
    head = ("method", "mesh", "at", "reason", "rows")
    return Section(
        "Failures", "Readings that did not take place.", (Table("", head, tuple(rows), prose=True),) if rows else ()
    )


def _unmarked(row: Row) -> bool:
    return str(row["failure"]).startswith("marking: ")


def _share(rows: list[Row], field: str) -> Cell:
    answers = [bool(row[field]) for row in rows if row[field] is not None]
    if not answers:
        return Cell("–")
    low, high = Rate(sum(answers), len(answers)).interval
    return Cell(f"{sum(answers)} of {len(answers)}", f"{100 * low:.0f}–{100 * high:.0f} %")


def _reading(results: Results, who: Contestant, group: str, condition: str) -> Cell:
    rows = results.of(who, group, condition)
    read = [bool(row["message_ok"]) for row in rows if row["message_ok"] is not None]
    tone: Tone = "" if not read else "better" if all(read) else "below" if any(read) else "far"
    return Cell(number(corr(rows)), _share(rows, "message_ok").text, tone)
