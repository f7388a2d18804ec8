"""Bins of values, a statistic of each, and the power that moves it: how Cho, Prost and Jung hide a bit in a histogram.

The range of the values is cut into N + 2 bins of equal width, of which the first and the last are not used. In a bin
the values are normalised by the bin's own least and largest, so that they are about uniform, and raised to a power k
at which their statistic is what the bit asks for. Least and largest stay, and so do the bins.
"""

import abc
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from o3dmark.arrays import Bits, Bools, Floats, Ints
from o3dmark.coding.keys import Key
from o3dmark.errors import MeshError
from o3dmark.mesh.surface import Surface
from o3dmark.methods import Extraction
from o3dmark.methods._published import Deal, PublishedMethod
from o3dmark.registry import option

VERTICES_PER_BIT = 16  # on average; bins of the outermost norms have fewer
SPREAD = 1e-6  # of norms over the largest: below it there is nothing to bin
_FEWEST, _IDLE = 3, 0.1  # values without which a bin holds no bit; the share of such bins that a code makes up for
_STEEPEST = 50.0  # power; reached where a bin has a handful of values
_NEWTON_STEPS, _NEWTON_TOLERANCE = 25, 1e-10
_ROUNDS = 3  # of embedding about the centre that the last one left; on Bunny and Venus one would do
_FLAT = 1e-12  # slope of a bin that no power moves


@dataclass(frozen=True, eq=False)
class Bins:
    """Which bin (n,) each value is in, 0 to N - 1, or -1 in none; ``edges`` (N + 1,) between them."""

    of: Ints
    edges: Floats

    @classmethod
    def equal_width(cls, values: Floats, count: int) -> "Bins":
        """N = ``count`` of N + 2 bins of equal width between the least and the largest of ``values`` (n,)."""
        low, high = float(values.min()), float(values.max())
        width = (high - low) / (count + 2)
        place = np.floor((values - low) / width).astype(np.int64) - 1 if width > 0 else np.full(len(values), -1)
        return cls(np.where(place < count, place, -1), low + width * np.arange(1.0, count + 2.0))

    @classmethod
    def equal_count(cls, values: Floats, count: int) -> "Bins":
        """N = ``count`` of N + 2 bins that hold equally many of ``values`` (n,)."""
        ordered = np.sort(values)
        edges = ordered[np.linspace(0, len(values) - 1, count + 3).astype(np.int64)][1:-1]
        place = np.searchsorted(edges, values, side="right") - 1
        return cls(np.where(place < count, place, -1), edges)

    def among(self, chosen: Bools) -> "Bins":
        """The same bins, of the ``chosen`` values (n,) alone."""
        return Bins(np.where(chosen, self.of, -1), self.edges)

    @property
    def count(self) -> int:
        return len(self.edges) - 1

    def sums(self, weights: Floats) -> Floats:
        """Sum (N,) of ``weights`` (n,) over each bin."""
        used = self.of >= 0
        return np.bincount(self.of[used], weights[used], minlength=self.count).astype(np.float64)

    def ranges(self, values: Floats) -> tuple[Floats, Floats]:
        """Least and largest (N,) of ``values`` (n,) in each bin; those of an empty one are not finite."""
        used = self.of >= 0
        low, high = np.full(self.count, np.inf), np.full(self.count, -np.inf)
        np.minimum.at(low, self.of[used], values[used])
        np.maximum.at(high, self.of[used], values[used])
        return low, high


def check_filled(values: Floats, bins: Bins) -> None:
    """Whether nearly all bins of ``values`` (n,) can hold a bit. Errors: MeshError says how many cannot."""
    low, high = bins.ranges(values)
    idle = int(np.count_nonzero((bins.sums(np.ones(len(values))) < _FEWEST) | ~(high > low)))
    if idle > _IDLE * bins.count:
        raise MeshError(
            f"{idle} of {bins.count} bins have fewer than {_FEWEST} values, or all alike, and hold no bit:"
            " ask for fewer bits, or take a method without bins"
        )


class Statistic(abc.ABC):
    """What is measured of a bin's values when they are normalised to [0, 1].

    level       of uniform values
    deviation   of a single uniform value
    """

    level: ClassVar[float]
    deviation: ClassVar[float]

    @abc.abstractmethod
    def terms(self, unit: Floats) -> Floats:
        """Numbers in [0, 1], the mean of which is the statistic; a power of a value gives that power of its number."""

    @abc.abstractmethod
    def raised(self, unit: Floats, power: Floats) -> Floats:
        """Values ``unit`` (n,) in [0, 1], each raised to its ``power`` (n,)."""


class Mean(Statistic):
    """The mean: 1/2 for uniform values."""

    level, deviation = 1 / 2, (1 / 12) ** 0.5

    def terms(self, unit: Floats) -> Floats:
        return unit

    def raised(self, unit: Floats, power: Floats) -> Floats:
        return np.asarray(unit**power)


class Variance(Statistic):
    """The mean square of the values normalised to [-1, 1]: 1/3 for uniform values."""

    level, deviation = 1 / 3, (4 / 45) ** 0.5

    def terms(self, unit: Floats) -> Floats:
        return np.asarray((2.0 * unit - 1.0) ** 2)

    def raised(self, unit: Floats, power: Floats) -> Floats:
        signed = 2.0 * unit - 1.0
        return np.asarray((np.sign(signed) * np.abs(signed) ** power + 1.0) / 2.0)


def normalised(values: Floats, bins: Bins) -> Floats:
    """Values (n,) over the range of their bin, 0 to 1; 1/2 in a bin of one value and outside of all."""
    low, high = bins.ranges(values)
    used = bins.of >= 0
    unit = np.full(len(values), 0.5)
    place = bins.of[used]
    width = (high - low)[place]
    unit[used] = np.divide(values[used] - low[place], width, out=unit[used], where=width > 0)
    return unit


def powers(terms: Floats, bins: Bins, targets: Floats) -> Floats:
    """The power (N,) of each bin at which the mean of its ``terms`` (n,) in [0, 1] is its target (N,).

    By Newton's method in log k, from where uniform terms would have it. As near as powers of 1/50 to 50 come.
    """
    inside = (bins.of >= 0) & (terms > 0)
    place, logs = bins.of[inside], np.log(terms[inside])
    size = np.maximum(bins.sums(np.ones(len(terms))), 1.0)
    limit = np.log(_STEEPEST)
    log_k = np.clip(np.log(1.0 / targets - 1.0), -limit, limit)
    for _ in range(_NEWTON_STEPS):
        k = np.exp(log_k)
        raised = np.exp(k[place] * logs)
        error = np.bincount(place, raised, minlength=bins.count) / size - targets
        slope = k * np.bincount(place, raised * logs, minlength=bins.count) / size
        step = np.divide(-error, slope, out=np.zeros_like(error), where=slope < -_FLAT)
        log_k = np.clip(log_k + np.clip(step, -1.0, 1.0), -limit, limit)
        if np.abs(error[slope < -_FLAT]).max(initial=0.0) < _NEWTON_TOLERANCE:
            break
    return np.exp(log_k)


def modulated(values: Floats, bins: Bins, statistic: Statistic, held: Bits, alpha: float) -> Floats:
    """Values (n,) of which each bin's statistic is its level + alpha where it holds 1, - alpha where it holds 0."""
    unit = normalised(values, bins)
    targets = statistic.level + alpha * (2.0 * held.astype(np.float64) - 1.0)
    k = powers(statistic.terms(unit), bins, targets)
    low, high = bins.ranges(values)
    used = bins.of >= 0
    place = bins.of[used]
    moved = values.copy()
    moved[used] = low[place] + (high - low)[place] * statistic.raised(unit[used], k[place])
    return moved


def soft_bits(values: Floats, bins: Bins, statistic: Statistic) -> Floats:
    """How far each bin's statistic is above its level (N,), in deviations of that of as many uniform values."""
    size = bins.sums(np.ones(len(values)))
    terms = bins.sums(statistic.terms(normalised(values, bins)))
    return np.asarray((terms - size * statistic.level) / (statistic.deviation * np.sqrt(np.maximum(size, 1.0))))


@dataclass(frozen=True, eq=False)
class Norms:
    """Norms ``values`` (n,) of all vertices, about the mean of all, and which of them carry bits, ``used`` (n,).

    All norms tell where bins are: of fewer, the extreme ones would come and go with single vertices.
    """

    values: Floats
    used: Bools

    @property
    def spread(self) -> bool:
        """Whether norms differ, so that there are bins."""
        return bool(np.ptp(self.values) > SPREAD * self.values.max())

    def bins(self, count: int) -> Bins:
        return Bins.equal_width(self.values, count).among(self.used)


@dataclass(frozen=True)
class BinsMethod(PublishedMethod):
    """A bit in a statistic of each bin of some values of the vertices; alpha is the strength."""

    least: ClassVar[float] = 1e-3
    largest: ClassVar[float] = 0.45

    alpha: float = option(0.05, "by how much a bin's mean differs from 1/2, in bin widths")

    @property
    def strength(self) -> float:
        """See `PublishedMethod.strength`."""
        return self.alpha

    def capacity(self, mesh: Any) -> int:
        """A bit for every 16 vertices."""
        return len(Surface.of(mesh).vertices) // VERTICES_PER_BIT


@dataclass(frozen=True)
class NormBinsMethod(BinsMethod):
    """A bit in a statistic of each bin of vertex norms, the distances to the mean of the vertices."""

    statistic: ClassVar[Statistic]

    def carriers(self, surface: Surface) -> Bools:
        """The vertices (n,) whose norms are binned: all."""
        return np.ones(len(surface.vertices), bool)

    def capacity(self, mesh: Any) -> int:
        """A bit for every 16 vertices that carry bits."""
        return int(np.count_nonzero(self.carriers(Surface.of(mesh)))) // VERTICES_PER_BIT

    def writer(self, surface: Surface, message: Bits, key: Key) -> Callable[[float], Floats]:
        """See `PublishedMethod.writer`. Embedding moves the centre, and who carries bits: it is done again there."""
        cover = self.observe(surface)
        if not cover.spread:
            raise MeshError("all vertices lie at one distance from their mean: nothing tells bins apart")
        check_filled(cover.values, cover.bins(len(message)))
        held = Deal.of(self.name, len(message), key).written(message)

        def moved(alpha: float) -> Floats:
            seen, vertices = cover, surface.vertices
            for done in range(_ROUNDS):
                seen = self.observe(surface.moved(vertices)) if done else cover
                new = modulated(seen.values, seen.bins(len(message)), self.statistic, held, alpha)
                ratio = (new / np.maximum(seen.values, 1e-300))[:, None]
                centre = vertices.mean(axis=0)
                vertices = np.where(ratio == 1.0, vertices, centre + (vertices - centre) * ratio)
            return vertices

        return moved

    def observe(self, mesh: Any) -> Norms:
        """See `Method.observe`."""
        if isinstance(mesh, Norms):
            return mesh
        surface = Surface.of(mesh)
        return Norms(vertex_norms(surface.vertices), self.carriers(surface))

    def read(self, seen: Norms, n_bits: int, key: Key) -> Extraction:
        """See `PublishedMethod.read`."""
        if not seen.spread:
            return Extraction(np.zeros(n_bits))
        soft = soft_bits(seen.values, seen.bins(n_bits), self.statistic)
        return Extraction(Deal.of(self.name, n_bits, key).read(soft))


def vertex_norms(vertices: Floats) -> Floats:
    """Distance (n,) of each of the vertices (n, 3) to their mean."""
    return np.asarray(np.linalg.norm(vertices - vertices.mean(axis=0), axis=1))
