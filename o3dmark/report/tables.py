"""The tables that every campaign has: the overview, its attacks, mesh by mesh, and what failed."""

from collections import Counter
from collections.abc import Iterator

from o3dmark.campaign.plan import UNTOUCHED
from o3dmark.campaign.row import Row
from o3dmark.report.content import Cell, Section, Table, ber_number, corr_cell, corr_number, fitting, number
from o3dmark.report.cost import SCALES, cost, measure
from o3dmark.report.data import Entry, Results
from o3dmark.report.summary import ber, corr, mean, share_interval

_WORDS = 140  # length of a failure's reason that is worth showing
CORR = "Corr is the correlation of the bits sent and read: 1 when every bit was read, 0 on average by chance."


def overview_section(results: Results) -> Iterator[Section]:
    """The entries, what they are, their means beside published ones, their messages."""
    tables = [_glance(results), _methods(results), _messages(results)]
    intro = f"{CORR} BER is the share of bits read wrongly."
    if results.compared:
        intro += " Colours and arrows compare with the published mean over the same meshes."
        tables.insert(2, published_conditions(results))
    yield Section("Overview", intro, tuple(tables))


def published_conditions(results: Results) -> Table:
    """One line for every condition that has published figures: their mean and each entry's."""
    there = {mesh for mesh in results.meshes if any(results.published.value(*each, mesh) for each in results.compared)}
    untouched = (
        corr_cell(corr(row for row in results.of(who, UNTOUCHED) if row.mesh in there)) for who in results.entries
    )
    rows = [(Cell(UNTOUCHED), Cell("–"), *untouched)]
    rows += [
        (
            Cell(f"{group} {condition}"),
            Cell(number(results.published.mean_of(group, condition, results.meshes))),
            *(_without_remark(_beside(results, who, group, condition)) for who in results.entries),
        )
        for group, condition in results.compared
    ]
    caption = (
        "Corr, mean over seeds and those meshes that have a published figure of their name. 1.00: every bit of every"
        " reading."
    )
    head = ("mean Corr", "published", *(who.name for who in results.entries))
    return Table("All methods in the published conditions", head, tuple(rows), caption)


def _glance(results: Results) -> Table:
    """One line for every entry."""
    rows = []
    for who in results.entries:
        attacked = results.attacked(who)
        costs = (number(cost(results, who, metric)) for metric in results.metrics)
        rows.append(
            (
                Cell(who.name),
                agreement(results, who),
                Cell(ber_number(ber(attacked))),
                share(attacked, "message_ok"),
                *map(Cell, costs),
                Cell(number(mean(row.seconds for row in attacked), 1)),
            )
        )
    over = "published conditions" if results.compared else "all attacks"
    head = (
        "",
        f"mean Corr, {over}",
        "mean BER, all attacks",
        "messages read",
        *(measure(metric).title for metric in results.metrics),
        "s a reading",
    )
    caption = (
        f"Means over meshes, seeds and conditions. {SCALES} Messages: those read back exactly after all attacks, with"
        " the 95 % interval of the share (Wilson)."
    )
    return Table("At a glance", head, tuple(rows), caption)


def agreement(results: Results, who: Entry) -> Cell:
    """Mean Corr over conditions: those that have published figures, with their mean, or all where none has."""
    if not results.compared:
        return corr_cell(mean(corr(results.of(who, *each)) for each in results.conditions))
    pairs = [results.beside(who, *each) for each in results.compared]
    return corr_cell(mean(corr(ours) for ours, _ in pairs), mean(theirs for _, theirs in pairs))


def _methods(results: Results) -> Table:
    """What each method of the campaign is, as its own class says."""
    rows = [
        (Cell(label), *(Cell(told[name]) for name in ("says", "needs", "options")))
        for label, told in results.methods.items()
    ]
    head = ("", "how it works", "its reader needs", "options not at their default")
    return Table("The methods", head, tuple(rows), prose=True)


def _messages(results: Results) -> Table:
    """How many messages came back, table by table."""
    rows = [
        (Cell(group), *(share(results.of(who, group), "message_ok") for who in results.entries))
        for group in [UNTOUCHED, *results.groups]
    ]
    caption = "Messages read back exactly, through the error-correcting code; the 95 % interval of the share (Wilson)."
    return Table("Messages", ("after", *(who.name for who in results.entries)), tuple(rows), caption)


def attacks_section(results: Results) -> Iterator[Section]:
    """The conditions that have no published figures: one cell for each of them and each entry."""
    tables = [
        _attack_table(results, group, [each for each in conditions if (group, each) not in results.compared])
        for group, conditions in results.groups.items()
    ]
    intro = f"{CORR} Means over meshes and seeds; beside them the mean BER, and messages read back exactly."
    if tables := [table for table in tables if table.rows]:
        yield Section("Attacks without published figures" if results.compared else "Attacks", intro, tuple(tables))


def _attack_table(results: Results, group: str, conditions: list[str]) -> Table:
    rows = [(Cell(each), *(_reading(results.of(who, group, each)) for who in results.entries)) for each in conditions]
    return Table(group.capitalize(), ("mean Corr", *(who.name for who in results.entries)), tuple(rows))


def meshes_section(results: Results) -> Iterator[Section]:
    """For each table of attacks and each entry: every mesh in every condition."""
    tables = [
        _mesh_table(results, who, group, folded=who != results.main)
        for group in results.groups
        for who in results.entries
    ]
    intro = "Corr, mean over the seeds."
    if results.compared:
        intro += (
            " Below our figure stand the published one and the difference, where there is one for a mesh of that name;"
            " the mean is then over those meshes alone."
        )
    if tables:
        yield Section("Mesh by mesh", intro, tuple(tables))


def _mesh_table(results: Results, who: Entry, group: str, folded: bool) -> Table:
    rows = [
        (
            Cell(each),
            *(
                corr_cell(corr(results.of(who, group, each, mesh)), results.published.value(group, each, mesh))
                for mesh in results.meshes
            ),
            _beside(results, who, group, each),
        )
        for each in results.groups[group]
    ]
    table = Table(f"{group.capitalize()}: {who.name}", ("Corr", *results.meshes, "mean"), tuple(rows), folded=folded)
    return fitting(table)


def failure_section(results: Results) -> Iterator[Section]:
    """What did not work at all, and why."""
    counts = Counter(
        (row.label, row.mesh, "marking" if row.failure.startswith("marking: ") else row.attack, row.failure[:_WORDS])
        for row in results.rows
        if row.failure
    )
    rows = [(*map(Cell, key), Cell(str(count))) for key, count in sorted(counts.items())]
    head = ("method", "mesh", "at", "reason", "rows")
    if rows:
        intro = "Readings that did not take place; no mean and no share counts them."
        yield Section("Failures", intro, (Table("", head, tuple(rows), prose=True),))


def share(rows: list[Row], field: str) -> Cell:
    """How many of the readings that can answer say yes, with the interval of that share."""
    answers = [bool(answer) for row in rows if (answer := getattr(row, field)) is not None]
    if not answers:
        return Cell("–")
    low, high = share_interval(sum(answers), len(answers))
    return Cell(f"{sum(answers)} of {len(answers)}", f"{100 * low:.0f}–{100 * high:.0f} %")


def _reading(rows: list[Row]) -> Cell:
    return Cell(corr_number(corr(rows)), f"BER {ber_number(ber(rows))}, messages {share(rows, 'message_ok').text}")


def _beside(results: Results, who: Entry, group: str, condition: str) -> Cell:
    """Mean Corr over the meshes that have a published figure, and that; over all meshes where none has."""
    if (group, condition) not in results.compared:
        return corr_cell(corr(results.of(who, group, condition)))
    rows, theirs = results.beside(who, group, condition)
    return corr_cell(corr(rows), theirs)


def _without_remark(cell: Cell) -> Cell:
    return Cell(cell.text, tone=cell.tone)
