"""A campaign's folder as the report sees it: what was planned, who ran it, what was read, what others have printed."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from o3dmark.campaign import Campaign, Run, load, read_rows
from o3dmark.campaign.keeping import SUMMARY
from o3dmark.campaign.plan import UNTOUCHED
from o3dmark.campaign.row import Row
from o3dmark.errors import SpecError
from o3dmark.report.published import Published
from o3dmark.report.summary import mean


@dataclass(frozen=True)
class Entry:
    """A method under its name in the campaign, with a number of bits."""

    label: str
    n_bits: int
    name: str


@dataclass(frozen=True)
class Results:
    """A campaign, its runs, what it says of its methods, and its rows; none where only their summary is kept."""

    campaign: Campaign
    runs: tuple[Run, ...]
    methods: Mapping[str, Mapping[str, str]]
    rows: tuple[Row, ...]
    directory: Path
    published: Published = field(default_factory=Published)

    @classmethod
    def load(cls, directory: str | Path) -> "Results":
        """What is in a folder. Errors: SpecError when it holds no campaign, or neither rows nor their summary."""
        kept, rows = load(directory), tuple(read_rows(directory))
        if not rows and not (Path(directory) / SUMMARY).exists():
            raise SpecError(f"{directory} holds no rows yet; run `o3dmark bench` first")
        text, names = kept.campaign.published, kept.campaign.published_names
        published = Published.read(text, names or {}) if text else Published()
        return cls(kept.campaign, kept.runs, kept.methods, rows, Path(directory), published)

    @cached_property
    def entries(self) -> tuple[Entry, ...]:
        """In the order of the campaign; those without any row are left out."""
        several, there = len(self.campaign.bits) > 1, {(row.label, row.n_bits) for row in self.rows}
        return tuple(
            Entry(label, n_bits, f"{label}, {n_bits} bits" if several else label)
            for label in self.campaign.methods
            for n_bits in self.campaign.bits
            if (label, n_bits) in there
        )

    @cached_property
    def main(self) -> Entry | None:
        """The method that the campaign calls its own, with the first number of bits; None before its first row."""
        return next((who for who in self.entries if who.label == self.campaign.main), None)

    @cached_property
    def groups(self) -> dict[str, list[str]]:
        """The campaign's tables of attacks and their conditions, as listed: from weak to strong."""
        groups: dict[str, list[str]] = {}
        for case in self.campaign.cases:
            groups.setdefault(case.group, []).append(case.condition)
        return groups

    @cached_property
    def conditions(self) -> list[tuple[str, str]]:
        """All of them: (table, condition)."""
        return [(group, condition) for group, listed in self.groups.items() for condition in listed]

    @cached_property
    def meshes(self) -> list[str]:
        """Their names, in the order of the campaign."""
        return [mesh.name for mesh in self.campaign.meshes]

    @cached_property
    def metrics(self) -> list[str]:
        """The metrics between cover and marked meshes that were measured, in the order of the rows."""
        return list(
            dict.fromkeys(name for row in self.rows for name, value in row.metrics.items() if value is not None)
        )

    @cached_property
    def _index(self) -> dict[tuple[str, int, str, str], list[Row]]:
        index: dict[tuple[str, int, str, str], list[Row]] = {}
        for row in self.rows:
            index.setdefault((row.label, row.n_bits, row.control, row.group), []).append(row)
        return index

    def of(
        self, who: Entry, group: str, condition: str | None = None, mesh: str | None = None, control: str = ""
    ) -> list[Row]:
        """A entry's readings in a table, in one condition and of one mesh if they are named."""
        return [
            row
            for row in self._index.get((who.label, who.n_bits, control, group), [])
            if condition in (None, row.condition) and mesh in (None, row.mesh)
        ]

    def attacked(self, who: Entry) -> list[Row]:
        """The entry's readings in all tables of attacks."""
        return [row for group in self.groups for row in self.of(who, group)]

    def controls(self, who: Entry, control: str) -> list[Row]:
        """The entry's readings under wrong keys, or of unmarked meshes."""
        return [row for row in self.rows if (row.label, row.n_bits, row.control) == (who.label, who.n_bits, control)]

    def cost(self, who: Entry, metric: str, mesh: str | None = None) -> float | None:
        """The mean of a metric between cover and marked meshes."""
        return mean(row.metrics.get(metric) for row in self.of(who, UNTOUCHED, mesh=mesh))

    def beside(self, who: Entry, group: str, condition: str) -> tuple[list[Row], float | None]:
        """A entry's readings that have a published counterpart, and the mean of those counterparts.

        Both are over the same meshes: those that were read here and have a figure of their name there. Without any:
        no row, None.
        """
        rows = [row for row in self.of(who, group, condition) if row.corr is not None]
        theirs = {
            mesh: self.published.value(group, condition, mesh) for mesh in dict.fromkeys(row.mesh for row in rows)
        }
        return [row for row in rows if theirs[row.mesh] is not None], mean(theirs.values())

    @cached_property
    def compared(self) -> list[tuple[str, str]]:
        """The conditions that have a published figure for a mesh of this campaign."""
        return [each for each in self.conditions if self.published.mean_of(*each, self.meshes) is not None]
