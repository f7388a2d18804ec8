"""The rows of a campaign, and the few ways in which a report sums them up."""

import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from o3dmark.campaign import Campaign, load, read_rows
from o3dmark.campaign.plan import UNTOUCHED
from o3dmark.campaign.row import WRONG_KEY as STRANGER
from o3dmark.errors import SpecError

Row = dict[str, Any]
_BOOTSTRAPS = 1000


@dataclass(frozen=True)
class Contestant:
    """A method under its name in the campaign, with a number of bits."""

    label: str
    n_bits: int
    name: str


@dataclass(frozen=True)
class Results:
    """A campaign, what is known of its run, and its rows."""

    campaign: Campaign
    about: dict[str, Any]
    rows: tuple[Row, ...]

    @classmethod
    def load(cls, directory: str | Path) -> "Results":
        """What is in a folder. Errors: SpecError when it holds no campaign or no row."""
        kept = load(directory)
        about = asdict(kept.runs[-1]) if kept.runs else {}
        rows = tuple(row.to_dict() for row in read_rows(directory))
        if not rows:
            raise SpecError(f"{directory} holds no rows yet; run `o3dmark bench` first")
        return cls(kept.campaign, about, rows)

    @cached_property
    def contestants(self) -> tuple[Contestant, ...]:
        """In the order of the campaign; those without any row are left out."""
        several, there = len(self.campaign.bits) > 1, {(row["label"], row["n_bits"]) for row in self.rows}
        return tuple(
            Contestant(label, n_bits, f"{label}, {n_bits} bits" if several else label)
            for label in self.campaign.methods
            for n_bits in self.campaign.bits
            if (label, n_bits) in there
        )

    @cached_property
    def groups(self) -> dict[str, list[str]]:
        """The campaign's own tables and their conditions, as listed: from weak to strong."""
        groups: dict[str, list[str]] = {}
        for case in self.campaign.cases:
            groups.setdefault(case.group, []).append(case.condition)
        return groups

    @cached_property
    def _index(self) -> dict[tuple[str, int, str], list[Row]]:
        index: dict[tuple[str, int, str], list[Row]] = {}
        for row in self.rows:
            index.setdefault((row["label"], row["n_bits"], row["group"]), []).append(row)
        return index

    def of(self, who: Contestant, group: str, condition: str | None = None, mesh: str | None = None) -> list[Row]:
        """The rows of a contestant in a table, in one condition and of one mesh if they are named."""
        return [
            row
            for row in self._index.get((who.label, who.n_bits, group), [])
            if condition in (None, row["condition"]) and mesh in (None, row["mesh"])
        ]

    def attacked(self, who: Contestant) -> list[Row]:
        """The contestant's rows in all tables of attacks."""
        return [row for group in self.groups for row in self.of(who, group)]

    def strangers(self, who: Contestant) -> list[Row]:
        """The contestant's readings under wrong keys."""
        return self.of(who, STRANGER)

    def cost(self, who: Contestant, metric: str, mesh: str | None = None) -> float | None:
        """The mean of a metric between cover and marked meshes."""
        return mean(row.get(metric) for row in self.of(who, UNTOUCHED, mesh=mesh))


def mean(values: Iterable[float | None]) -> float | None:
    """The mean of those that are there; None without any."""
    present = [float(value) for value in values if value is not None]
    return sum(present) / len(present) if present else None


def corr(rows: Iterable[Row]) -> float | None:
    """Mean Corr."""
    return mean(row["corr"] for row in rows)


def interval(values: list[float]) -> tuple[float, float]:
    """The 95 % bootstrap interval of a mean (percentiles, 1000 resamples, always the same)."""
    sample = np.asarray(values, np.float64)
    chosen = np.random.default_rng(0).integers(0, len(sample), (_BOOTSTRAPS, len(sample)))
    low, high = np.percentile(sample[chosen].mean(axis=1), [2.5, 97.5])
    return float(low), float(high)


def strength(condition: str) -> float | None:
    """The number that a condition begins with, if a unit follows it: "0.05%" -> 0.05; a bare number is only a name."""
    found = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*[^\d\s.].*", condition)
    return float(found[1]) if found else None
