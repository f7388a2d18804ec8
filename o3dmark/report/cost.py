"""What marks cost: the metrics between cover and marked meshes, beside published ones."""

from collections.abc import Iterator
from dataclasses import dataclass

from o3dmark.report.content import Cell, Section, Table, cost_cell, fitting, number
from o3dmark.report.data import Entry, Results
from o3dmark.report.summary import mean

TABLE = "imperceptibility"
SCALES = (
    "Lengths (MRMS, Hausdorff distance, displacements) are in thousandths of the bounding-box diagonal; MSDM is 0 for"
    " equal meshes and near 1 where nothing looks alike."
)


@dataclass(frozen=True)
class Measure:
    """How a metric is shown: its title, the factor before its value, and its name in files of published figures."""

    title: str
    factor: float = 1.0
    published: str = ""


_MEASURES = {
    "mrms": Measure("MRMS · 10³", 1e3, "mrms_e-3"),
    "hausdorff": Measure("HD · 10³", 1e3, "hd_e-3"),
    "rms_displacement": Measure("RMS displacement · 10³", 1e3),
    "max_displacement": Measure("largest displacement · 10³", 1e3),
    "msdm": Measure("MSDM", 1.0, "msdm"),
    "msdm2": Measure("MSDM2"),
    "fmpd": Measure("FMPD"),
    "snr": Measure("SNR, dB"),
}


def measure(metric: str) -> Measure:
    """How to show a metric; one that is not known here is shown as it is."""
    return _MEASURES.get(metric, Measure(metric))


def cost(results: Results, who: Entry, metric: str, mesh: str | None = None) -> float | None:
    """The mean of a metric over a entry's marked meshes, in the unit in which it is shown."""
    value = results.cost(who, metric, mesh)
    return None if value is None else measure(metric).factor * value


def cost_section(results: Results) -> Iterator[Section]:
    """Every metric on every mesh: first the methods that stand for lines of the published table, then the others."""
    lines = {label: line for line, label in (results.campaign.imperceptibility or {}).items()}
    ordered = sorted(results.entries, key=lambda who: who.label not in lines)
    tables = [_cost_table(results, who, lines.get(who.label, ""), bool(lines)) for who in ordered]
    intro = f"What a mark costs, mean over the seeds. {SCALES}"
    if any(cell.tone for table in tables for row in table.rows for cell in row):
        intro += " Less is better; the colours are of relative differences from published figures for the same meshes."
    if results.metrics:
        yield Section("Imperceptibility", intro, tuple(tables))


def _cost_table(results: Results, who: Entry, line: str, named: bool) -> Table:
    rows = [_cost_row(results, who, line, metric) for metric in results.metrics]
    title = f"{line.capitalize()}: {who.name}" if line else who.name
    return fitting(Table(title, ("", *results.meshes, "mean"), tuple(rows), folded=named and not line))


def _cost_row(results: Results, who: Entry, line: str, metric: str) -> tuple[Cell, ...]:
    name = measure(metric).published
    ours = {mesh: cost(results, who, metric, mesh) for mesh in results.meshes}
    theirs = {mesh: published(results, TABLE, line, mesh, name) for mesh in results.meshes}
    both = [mesh for mesh in results.meshes if ours[mesh] is not None and theirs[mesh] is not None]
    overall = (
        cost_cell(mean(ours[mesh] for mesh in both), mean(theirs[mesh] for mesh in both))
        if both
        else Cell(number(cost(results, who, metric)))
    )
    return (Cell(measure(metric).title), *(cost_cell(ours[mesh], theirs[mesh]) for mesh in results.meshes), overall)


def published(results: Results, table: str, line: str, mesh: str, name: str, method: str | None = None) -> float | None:
    """A published cost; None where there is none of that table, line, mesh and metric."""
    return results.published.value(table, line, mesh, name, method) if name else None
