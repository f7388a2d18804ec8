"""The figures of the paper beside ours. The paper's are in paper_tables.csv: facts, typed from its tables.

Hamidi, Chetouani, El Haziti, El Hassouni, Cherifi, "A robust blind 3-D mesh watermarking technique based on SCS
quantization and mesh saliency for copyright protection", 2019.
"""

import csv
from collections.abc import Iterable
from dataclasses import dataclass
from importlib.resources import files

from o3dmark.report.content import Cell, Section, Table, compared
from o3dmark.report.data import Contestant, Results, Row, corr, mean, strength

METRICS = {
    "mrms_e-3": ("mrms", 1e3, "MRMS · 10³"),
    "hd_e-3": ("hausdorff", 1e3, "HD · 10³"),
    "msdm": ("msdm", 1.0, "MSDM"),
}


@dataclass(frozen=True)
class Paper:
    """Every figure of the paper's tables: table, method, metric, condition, model, value."""

    entries: tuple[tuple[str, str, str, str, str, float], ...]

    @classmethod
    def read(cls) -> "Paper":
        """The file in this package."""
        text = (files(__package__) / "paper_tables.csv").read_text(encoding="utf-8")
        rows = list(csv.reader(text.splitlines()))[1:]
        return cls(tuple((*row[:5], float(row[5])) for row in rows))  # type: ignore[misc]

    def value(
        self, table: str, condition: str, model: str, metric: str = "corr", method: str = "hamidi"
    ) -> float | None:
        """One figure, or None. Conditions are the same when their numbers are: "0.10%" is "0.1%"."""
        found = (
            entry[5]
            for entry in self.entries
            if entry[:3] == (table, method, metric) and entry[4] == model and _same(entry[3], condition)
        )
        return next(found, None)

    def mean_of(self, table: str, condition: str, models: Iterable[str], metric: str = "corr") -> float | None:
        """The mean over some of the paper's models."""
        return mean(self.value(table, condition, model, metric) for model in models)

    def models(self, table: str) -> tuple[str, ...]:
        """The models of a table in its order."""
        return tuple(dict.fromkeys(entry[4] for entry in self.entries if entry[0] == table))

    def methods(self, table: str) -> tuple[str, ...]:
        """The methods that a table compares."""
        return tuple(dict.fromkeys(entry[1] for entry in self.entries if entry[0] == table))

    def conditions(self, table: str) -> tuple[str, ...]:
        """The conditions of a table in its order."""
        return tuple(dict.fromkeys(entry[3] for entry in self.entries if entry[0] == table))


def _same(one: str, other: str) -> bool:
    return one == other or (strength(one) is not None and strength(one) == strength(other))


PAPER = Paper.read()


def common_models(results: Results, table: str) -> list[str]:
    """The models of a table of the paper that the campaign has: means are compared over these."""
    names = {mesh.name for mesh in results.campaign.meshes}
    return [model for model in PAPER.models(table) if model in names]


def both(results: Results, who: Contestant, group: str, condition: str) -> tuple[list[Row], float | None]:
    """A contestant's rows in one condition and the paper's mean Corr, both over the common models.

    Without a common model, the rows of all meshes and the mean over all the paper's models.
    """
    models, rows = common_models(results, group), results.of(who, group, condition)
    if models:
        rows = [row for row in rows if row["mesh"] in models]
    return rows, PAPER.mean_of(group, condition, models or PAPER.models(group))


def paper_section(results: Results) -> Section:
    """For each of the paper's tables and each contestant: every model in every condition, ours and the paper's."""
    tables = [
        _paper_table(results, who, group, folded=number > 0)
        for group in results.groups
        if PAPER.models(group)
        for number, who in enumerate(results.contestants)
    ]
    intro = (
        "Corr, model by model: our figure, the mean over the seeds, large; the paper's and the difference below it."
        " Means are over the models that both have. What stands in for the paper's models is named at the end."
    )
    return Section("The paper's robustness tables", intro, tuple(tables))


def _paper_table(results: Results, who: Contestant, group: str, folded: bool) -> Table:
    meshes = [mesh.name for mesh in results.campaign.meshes]
    rows = []
    for condition in results.groups[group]:
        cells = [
            compared(corr(results.of(who, group, condition, mesh)), PAPER.value(group, condition, mesh))
            for mesh in meshes
        ]
        rows_of_all, theirs = both(results, who, group, condition)
        overall = compared(corr(rows_of_all), theirs)
        rows.append((Cell(condition), *cells, overall))
    return Table(f"{group.capitalize()}: {who.name}", ("", *meshes, "mean"), tuple(rows), folded=folded)


def imperceptibility_section(results: Results) -> Section:
    """MRMS, Hausdorff distance and MSDM, with and without saliency, as the paper's table; and of every contestant."""
    head = ("", *(mesh.name for mesh in results.campaign.meshes), "mean")
    tables = []
    for line, label in (results.campaign.imperceptibility or {}).items():
        for who in (each for each in results.contestants if each.label == label):
            rows = [_cost_row(results, who, line, key) for key in METRICS]
            tables.append(Table(f"{line.capitalize()}: {who.name}", head, tuple(rows)))
    named = set((results.campaign.imperceptibility or {}).values())
    for who in results.contestants:
        if who.label not in named:
            rows = [_cost_row(results, who, "", key) for key in METRICS]
            tables.append(Table(who.name, head, tuple(rows), folded=bool(named)))
    intro = (
        "What the mark costs: MRMS and Hausdorff distance in thousandths of the bounding-box diagonal; MSDM is 0 for"
        " equal meshes and near 1 where nothing looks alike. Here less is better; colours as above, for relative"
        " differences."
    )
    return Section("Imperceptibility", intro, tuple(tables))


def _cost_row(results: Results, who: Contestant, line: str, key: str) -> tuple[Cell, ...]:
    metric, factor, title = METRICS[key]

    def ours(mesh: str | None) -> float | None:
        value = results.cost(who, metric, mesh)
        return None if value is None else factor * value

    models = common_models(results, "imperceptibility")
    theirs = PAPER.mean_of("imperceptibility", line, models, key)
    overall = mean(ours(model) for model in models) if models else ours(None)
    cells = [
        compared(ours(mesh.name), PAPER.value("imperceptibility", line, mesh.name, key), low=True)
        for mesh in results.campaign.meshes
    ]
    return (Cell(title), *cells, compared(overall, theirs, low=True))
