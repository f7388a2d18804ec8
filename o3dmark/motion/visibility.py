"""Whether an eye can tell a surface from the same surface moved, by the shading: in just noticeable differences.

A turn of the normal by d radians changes the light of a matt surface by about the share d. Whether that is seen
hangs on how wide the change is, and on what else there is: wide, slow changes are hard to see, and so are those in the
midst of others as strong. Normals are compared in bands of scale, each half as fine as the one before: a pyramid over
the surface, whose wide bands are worked out on few points.

Source: Mannos and Sakrison 1974, The effects of a visual fidelity criterion on the encoding of images (sensitivity);
Legge and Foley 1980, Contrast masking in human vision (masking).
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from o3dmark.arrays import Floats, Ints
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface

_FINEST, _BANDS = 0.005, 4  # standard deviation of the finest blur, over the diagonal; bands, each twice as wide
_SENSITIVITY = 200.0  # at its best: a contrast of half a per cent is seen
_MASKING = 0.7  # exponent by which the threshold rises with the contrast that is there
_GAIN = 0.45  # of a wave, in all bands together: that of blurs by t and 4 t alone is a third at most
_WAVE = 7.5  # length of the waves that a band shows best, over its width
_TOLERANCE = 3e-3  # of a blurred signal; with 1e-3 the jnd of bunny, bimba and fandisk differ by 0.5 % at most
_MOST_STEPS = 500  # of the blur's iteration: 112 642 vertices take 40
_TINY = np.finfo(np.float64).tiny
_CELL = 0.5  # side of the cells that make one point of the next band, over the blur's deviation
_FIRST_CELL = 0.2  # the same for the finest band: 0.06 degrees, half the wave that eyes see best


class Visibility:
    """What of a surface's motions an eye sees that has its diagonal ``angle`` degrees wide before it."""

    def __init__(self, surface: Surface, angle: float = 30.0) -> None:
        self.surface, self._angle = surface, angle

    def __call__(self, after: Surface, share: float = 0.95) -> float:
        """The just noticeable differences between the surface and ``after``, the same one moved, that a ``share`` of
        the surface stays below."""
        local, area = self.local(after), self.surface.vertex_areas
        order = np.argsort(local)
        below = np.cumsum(area[order]) / area.sum()
        return float(local[order[min(int(np.searchsorted(below, share)), len(order) - 1)]])

    def local(self, after: Surface) -> Floats:
        """The same at each vertex (n,)."""
        squares, rows = np.zeros(len(self.surface.vertices)), np.arange(len(self.surface.vertices))
        changes = self._energies(after.normals - self.surface.normals)
        for band, (level, change, own) in enumerate(zip(self._levels, changes, self._own, strict=True)):
            rows = rows if level.rows is None else level.rows[rows]
            squares += self._visible(change, own, band)[rows]
        return np.asarray(np.sqrt(squares))

    @cached_property
    def acuity(self) -> Floats:
        """How many just noticeable differences a contrast of 1 in every band would be at each vertex (n,)."""
        squares, rows = np.zeros(len(self.surface.vertices)), np.arange(len(self.surface.vertices))
        for band, (level, own) in enumerate(zip(self._levels, self._own, strict=True)):
            rows = rows if level.rows is None else level.rows[rows]
            squares += self._visible(1.0, own, band)[rows]
        return np.asarray(np.sqrt(squares))

    def _visible(self, change: Floats | float, own: Floats, band: int) -> Floats:
        """The squared jnd of squared contrasts in a band, amid those of the surface as it is."""
        threshold2 = self._threshold(_FINEST * 2.0**band) ** 2
        return np.asarray(change / threshold2 / np.maximum(1.0, own / threshold2) ** _MASKING)

    def _threshold(self, width: float) -> float:
        """The contrast that is just seen in the band of a width, over the diagonal, where nothing masks it."""
        return 1.0 / (_SENSITIVITY * _relative_sensitivity(1.0 / (self._angle * _WAVE * width)))

    def _energies(self, signals: Floats) -> list[Floats]:
        """The squared contrast of signals (n, 3) around each point of each level, as high as waves rise."""
        found = []
        for level in self._levels:
            finer = level.gathered(signals)
            signals = level.blur(finer)
            around = level.blur(np.sum((finer - signals) ** 2, axis=1, keepdims=True) / _GAIN**2)
            found.append(2.0 * np.maximum(around[:, 0], 0.0))  # twice the mean square
        return found

    @cached_property
    def _own(self) -> list[Floats]:
        """The squared contrast of the surface as it is, which masks changes."""
        return self._energies(self.surface.normals)

    @cached_property
    def _levels(self) -> "list[_Level]":
        surface, finest = self.surface, 2.0 * _FINEST * self.surface.diagonal
        whole = _Level.of(surface.vertices, surface.vertex_areas, geometry.edges(surface.triangles), finest)
        levels = [whole.coarser(_FIRST_CELL * finest, finest)]
        for band in range(1, _BANDS):
            deviation = finest * 2.0**band
            levels.append(levels[-1].coarser(0.5 * _CELL * deviation, deviation))
        return levels


class _Level(NamedTuple):
    """Points of a surface (n, 3) with their areas (n,) and edges (e, 2), and how signals are blurred among them.

    rows    for each point of the level below the one here that stands for it; None where they are the same
    below   the areas of those
    """

    points: Floats
    areas: Floats
    edges: Ints
    deviation: float
    joined: sp.csr_array
    degree: Floats
    rows: Ints | None = None
    below: Floats | None = None

    @classmethod
    def of(cls, points: Floats, areas: Floats, edges: Ints, deviation: float) -> "_Level":
        n = len(points)
        one, other = np.concatenate([edges, edges[:, ::-1]]).T
        joined = sp.csr_array((np.ones(len(one)), (one, other)), shape=(n, n))
        return cls(points, areas, edges, deviation, joined, np.bincount(one, minlength=n).astype(np.float64))

    def coarser(self, side: float, deviation: float) -> "_Level":
        """A level of so wide a blur, a point for all within a cell that hang together there, so that sheets stay apart.

        The same points where cells are no wider than edges.
        """
        if not len(self.edges) or side**2 < self._mean_square:
            return self._replace(deviation=deviation, rows=None, below=None)
        cell = geometry.distinct_rows(np.floor((self.points - self.points.min(axis=0)) / side))[1]
        inside = self.edges[cell[self.edges[:, 0]] == cell[self.edges[:, 1]]]
        graph = sp.csr_array((np.ones(len(inside)), tuple(inside.T)), shape=self.joined.shape)
        count, rows = connected_components(graph, directed=False)
        areas = np.bincount(rows, self.areas, count).astype(np.float64)
        edges = rows[self.edges].astype(np.int64)
        edges = geometry.numbered_pairs(edges[edges[:, 0] != edges[:, 1]])[0]
        points = _mean(self.points, rows, self.areas, areas)
        level = _Level.of(points, areas, edges, deviation)
        return level._replace(rows=rows, below=self.areas)

    def gathered(self, signals: Floats) -> Floats:
        """Signals (N, d) of the level below as means at the points here (n, d)."""
        return signals if self.rows is None else _mean(signals, self.rows, self.below, self.areas)

    @property
    def _mean_square(self) -> float:
        """Of the lengths of edges."""
        return float(np.mean(np.sum((self.points[self.edges[:, 0]] - self.points[self.edges[:, 1]]) ** 2, axis=1)))

    def blur(self, signals: Floats) -> Floats:
        """Signals (n, d) diffused over the surface by one implicit step, whose cost grows little with its width.

        Conjugate gradients, all d at once; BLAS, whose threads would wait for each other, has no part in it.
        """
        if not len(self.edges):
            return signals
        t = self.deviation**2 / self._mean_square  # a step to the neighbours' mean has the variance of an edge
        mass = np.maximum(self.degree, 1.0)[:, None]
        diagonal, enough = mass + t * self.degree[:, None], _TOLERANCE**2 * _dots(mass * signals, mass * signals)
        x, residual = signals.copy(), mass * signals - diagonal * signals + t * (self.joined @ signals)
        step = residual / diagonal
        slope = _dots(residual, step)
        for _ in range(_MOST_STEPS):
            if (_dots(residual, residual) <= enough).all():
                break
            pulled = diagonal * step - t * (self.joined @ step)
            length = slope / np.maximum(_dots(step, pulled), _TINY)
            x += length * step
            residual -= length * pulled
            eased = residual / diagonal
            slope, before = _dots(residual, eased), slope
            step = eased + slope / np.maximum(before, _TINY) * step
        return x


def _relative_sensitivity(frequency: float) -> float:
    """Of the eye to waves of so many cycles a degree, over that at its best; Mannos and Sakrison's fit."""
    return float(2.6 * (0.0192 + 0.114 * frequency) * np.exp(-((0.114 * frequency) ** 1.1)))


def _mean(signals: Floats, rows: Ints, weights: Floats | None, total: Floats) -> Floats:
    """Weighted means (n, d) of signals (N, d) over those that have the same row."""
    weighted = signals if weights is None else signals * weights[:, None]
    sums = [np.bincount(rows, column, len(total)) for column in weighted.T]
    return np.asarray(np.stack(sums, axis=1) / np.maximum(total, _TINY)[:, None])


def _dots(one: Floats, other: Floats) -> Floats:
    return np.einsum("nd,nd->d", one, other)
