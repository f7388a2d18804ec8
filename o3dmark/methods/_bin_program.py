"""A bit in the mean of each bin of distances to the centre, at the least cost: a quadratic programme.

Vertex i moves by x_i along its direction d_i; its distance rho_i to the centre changes by s_i x_i, s_i = d_i . u_i.

    minimise      sum_i w_i x_i^2
    subject to    bin b's mean of (rho_i + s_i x_i - low_b) / width, weighted by area, >= 1/2 + alpha or <= 1/2 - alpha
                  the centre of the surface stays
                  rho_i + s_i x_i stays in its bin, no nearer to its edges than a margin or than it was

Centre and means are integrals over the surface; a vertex stands for a third of the area around it. The constraints are
linearised, areas included; what is left of a violation is removed by the cheapest further motion, until nothing is (it
grows instead where the areas are taken to be constant). The extreme distances and the outermost two of N + 2 bins stay.
"""

import abc
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import clarabel
import numpy as np
import scipy.sparse as sp

from o3dmark.arrays import Bits, Floats, Ints
from o3dmark.coding.keys import Key
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface
from o3dmark.methods import Extraction
from o3dmark.methods._distortion import OutOfReachError
from o3dmark.methods._norm_bins import SPREAD, Bins, BinsMethod, Mean, check_filled
from o3dmark.methods._published import Deal

_MOST_ROUNDS, _MOST_HALVINGS = 12, 4  # of linearisation, and of a step that leaves more of a violation than there was
_TOLERANCE = 1e-3  # what is left of a violation, in bin widths
_MARGIN = 0.02  # of a bin's width
_LEAST_SLOPE = 0.3  # |s_i| of vertices that move: along normals, others slide much and get hardly farther out


@dataclass(frozen=True, eq=False)
class Distances:
    """Distance rho (n,) of the vertices to the centre of the surface, their directions u (n, 3) and areas (n,)."""

    rho: Floats
    u: Floats
    area: Floats
    centre: Floats

    @classmethod
    def of(cls, surface: Surface) -> "Distances":
        centre = surface.centroid
        offset = surface.vertices - centre
        return cls(np.linalg.norm(offset, axis=1), geometry.unit(offset), surface.vertex_areas, centre)

    @property
    def spread(self) -> bool:
        """Whether distances differ, so that there are bins."""
        return bool(np.ptp(self.rho) > SPREAD * self.rho.max())

    def means(self, bins: Bins) -> Floats:
        """Area-weighted mean (N,) of each bin's distances, 0 to 1 from edge to edge; 1/2 where it is empty."""
        used = bins.of >= 0
        share = np.zeros(len(self.rho))
        share[used] = (self.rho[used] - bins.edges[bins.of[used]]) / (bins.edges[1] - bins.edges[0])
        total = bins.sums(self.area)
        return np.divide(bins.sums(self.area * share), total, out=np.full(bins.count, 0.5), where=total > 0)


@dataclass(frozen=True, eq=False)
class Programme:
    """The programme of one mesh: vertices ``move`` (k,) along ``directions`` (k, 3), at a ``cost`` (k,) each."""

    surface: Surface
    bins: Bins
    move: Ints
    directions: Floats
    cost: Floats
    centre: Floats

    @property
    def width(self) -> float:
        """Of a bin."""
        return float(self.bins.edges[1] - self.bins.edges[0])

    def moved(self, motion: Floats) -> Floats:
        """All vertices (n, 3), those that move by ``motion`` (k,) along their directions."""
        vertices = self.surface.vertices.copy()
        vertices[self.move] += motion[:, None] * self.directions
        return vertices

    def solve(self, held: Bits, alpha: float) -> Floats:
        """The vertices (n, 3) whose bins hold bits ``held`` (N,). Errors: MeshError where no motion does that."""
        motion = np.zeros(len(self.move))
        violation = self._violation(motion, held, alpha)
        for _ in range(_MOST_ROUNDS):
            start, motion = motion, self._nearest(motion, held, alpha)
            left = self._violation(motion, held, alpha)
            for _ in range(_MOST_HALVINGS):
                if left <= max(violation, _TOLERANCE):
                    break
                motion = (start + motion) / 2.0
                left = self._violation(motion, held, alpha)
            violation = left
            if violation <= _TOLERANCE:
                return self.moved(motion)
        raise OutOfReachError(
            f"no motion was found that writes these bits with alpha {alpha:.3g}: ask for a smaller one or fewer bits"
        )

    def _violation(self, motion: Floats, held: Bits, alpha: float) -> float:
        """By how much a constraint on a mean, or on the centre, is violated, in bin widths."""
        seen = Distances.of(self.surface.moved(self.moved(motion)))
        lack = alpha - (2.0 * held.astype(np.float64) - 1.0) * (seen.means(self.bins) - Mean.level)
        filled = self.bins.sums(seen.area) > 0
        drift = float(np.linalg.norm(seen.centre - self.centre)) / self.width
        return max(drift, float(lack[filled].max(initial=0.0)))

    def _nearest(self, motion: Floats, held: Bits, alpha: float) -> Floats:
        """The motion (k,) nearest to another one at which the programme, linearised there, is met."""
        width, sign = self.width, 2.0 * held.astype(np.float64) - 1.0
        surface = self.surface.moved(self.moved(motion))
        seen, start = Distances.of(surface), motion / width
        slope = np.sum(seen.u[self.move] * self.directions, axis=1)
        place = (seen.rho[self.move] - self.bins.edges[self.bins.of[self.move]]) / width - slope * start
        low, high = np.minimum(_MARGIN, place), np.maximum(1.0 - _MARGIN, place)
        filled, stay = self.bins.sums(seen.area) > 0, sp.diags_array(slope, format="csc")
        centre, means = self.derivatives(surface, seen)
        signed = sp.csc_array(sp.diags_array(sign) @ means)
        drift = centre @ start - (seen.centre - self.centre) / width
        excess = sign * (seen.means(self.bins) - Mean.level) - alpha - signed @ start
        rows = sp.vstack([sp.csc_array(centre), -signed[filled], stay, -stay], format="csc")
        limits = np.concatenate([drift, excess[filled], high - place, place - low])
        found = nearest_point(start, self.cost, rows, limits, len(drift))
        if found is None:
            raise OutOfReachError(
                f"no motion writes these bits with alpha {alpha:.3g} and leaves the centre at rest:"
                " ask for a smaller one or fewer bits"
            )
        return found * width

    def derivatives(self, surface: Surface, seen: Distances) -> tuple[Floats, sp.csc_array]:
        """Of the centre (3, k), and of the bins' means (N, k) about a centre at rest, by each vertex's motion.

        Means by motions over the width of a bin.
        """
        ways = np.zeros((len(surface.vertices), 3))
        ways[self.move] = self.directions
        growth = area_growth(surface, ways)
        offset = surface.vertices[surface.triangles].mean(axis=1) - seen.centre
        by_growth = [np.bincount(surface.triangles.ravel(), (growth * axis[:, None]).ravel()) for axis in offset.T]
        centre = (seen.area[:, None] * ways + np.stack(by_growth, axis=1)) / surface.area
        means = self._by_distances(seen, ways) + self._by_areas(surface, seen, growth)
        return centre[self.move].T, sp.csc_array(means[:, self.move])

    def _by_distances(self, seen: Distances, ways: Floats) -> sp.csc_array:
        """The derivative of the means (N, n) at constant areas."""
        used = np.flatnonzero(self.bins.of >= 0)
        share = seen.area[used] / self.bins.sums(seen.area)[self.bins.of[used]]
        entries = share * np.sum(seen.u[used] * ways[used], axis=1)
        return sp.csc_array((entries, (self.bins.of[used], used)), shape=(self.bins.count, len(ways)))

    def _by_areas(self, surface: Surface, seen: Distances, growth: Floats) -> sp.csc_array:
        """The derivative of the means (N, n) at constant distances: a corner that moves makes all three heavier."""
        n = len(surface.vertices)
        corners, used = surface.triangles, np.flatnonzero(self.bins.of >= 0)
        bin_of, excess = self.bins.of[used], np.zeros(n)
        place = (seen.rho[used] - self.bins.edges[bin_of]) / self.width
        excess[used] = (place - seen.means(self.bins)[bin_of]) / self.bins.sums(seen.area)[bin_of]
        entries = growth[:, :, None] * excess[corners][:, None, :] * self.width / 3.0  # (m, who moves, who is heavier)
        rows = np.broadcast_to(self.bins.of[corners][:, None, :], entries.shape)
        columns = np.broadcast_to(corners[:, :, None], entries.shape)
        some = (entries != 0.0) & (rows >= 0)
        return sp.csc_array((entries[some], (rows[some], columns[some])), shape=(self.bins.count, n))


def nearest_point(start: Floats, cost: Floats, rows: sp.csc_array, limits: Floats, equations: int) -> Floats | None:
    """The x (k,) of least sum_i cost_i (x_i - start_i)^2 under rows x = limits, <= but in the first.

    The first ``equations`` rows are equations, the others bounds. None where there is no such x.
    """
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    cones = [clarabel.ZeroConeT(equations), clarabel.NonnegativeConeT(len(limits) - equations)]
    P = sp.diags_array(cost / cost.mean(), format="csc")
    found = clarabel.DefaultSolver(P, -(P @ start), rows, limits, cones, settings).solve()
    solved = found.status in (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved)
    return np.asarray(found.x) if solved else None


def area_growth(surface: Surface, ways: Floats) -> Floats:
    """How each triangle's area changes (m, 3) when one of its corners moves along its vector in ``ways`` (n, 3)."""
    corner = surface.vertices[surface.triangles]
    opposite = np.roll(corner, -2, axis=1) - np.roll(corner, -1, axis=1)
    normals = geometry.unit(surface.area_vectors)[:, None, :]
    return np.asarray(np.einsum("mcd,mcd->mc", np.cross(normals, opposite), ways[surface.triangles]) / 2.0)


@dataclass(frozen=True)
class BinProgrammeMethod(BinsMethod):
    """A bit in the mean of each bin of distances to the surface's centre, written at the least cost."""

    @abc.abstractmethod
    def directions(self, surface: Surface) -> Floats:
        """The unit vectors (n, 3) along which vertices move."""

    @abc.abstractmethod
    def costs(self, surface: Surface, directions: Floats) -> Floats:
        """What it costs (n,) to move each vertex along its direction, positive: w_i of the programme."""

    def writer(self, surface: Surface, message: Bits, key: Key) -> Callable[[float], Floats]:
        """See `PublishedMethod.writer`."""
        seen = Distances.of(surface)
        if not seen.spread:
            raise MeshError("all vertices lie at one distance from the centre of the surface: nothing tells bins apart")
        bins = Bins.equal_width(seen.rho, len(message))
        check_filled(seen.rho, bins)
        held = Deal.of(self.name, len(message), key).written(message)
        ways = self.directions(surface)
        move = np.flatnonzero((bins.of >= 0) & (np.abs(np.sum(ways * seen.u, axis=1)) > _LEAST_SLOPE))
        if not len(move):
            raise MeshError("no vertex comes nearer to the centre by moving along its normal: take along=radius")
        cost = self.costs(surface, ways)[move]
        programme = Programme(surface, bins, move, ways[move], cost, seen.centre)
        return lambda alpha: programme.solve(held, alpha)

    def observe(self, mesh: Any) -> Distances:
        """See `Method.observe`."""
        return mesh if isinstance(mesh, Distances) else Distances.of(Surface.of(mesh))

    def read(self, seen: Distances, n_bits: int, key: Key) -> Extraction:
        """See `PublishedMethod.read`: how far means are from 1/2, in deviations of that of as many uniform values."""
        if not seen.spread:
            return Extraction(np.zeros(n_bits))
        bins = Bins.equal_width(seen.rho, n_bits)
        size = bins.sums(seen.area) ** 2 / np.maximum(bins.sums(seen.area**2), 1e-300)
        soft = (seen.means(bins) - Mean.level) / Mean.deviation * np.sqrt(size)
        return Extraction(Deal.of(self.name, n_bits, key).read(soft))
