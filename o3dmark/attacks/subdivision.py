"""Subdivision: every triangle becomes four (or three), every new vertex is a fixed mean of old ones.

A scheme is a sparse matrix from old to new positions, written as the scheme's masks. The masks are those of the surface
with its seams closed, while seams stay in the connectivity: nothing cracks. Edges that do not have exactly two
triangles (boundary and non-manifold edges) are creases, so that no mesh need be refused.
"""

# ruff: noqa: ARG002 - attacks without randomness take an rng too

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from o3dmark.arrays import Floats, Ints
from o3dmark.attacks import ATTACKS, Attack
from o3dmark.attacks._carry import checked_arrays, colours_of, copied, made
from o3dmark.mesh import geometry
from o3dmark.registry import option


@ATTACKS.register("subdivide")
@dataclass(frozen=True)
class Subdivide(Attack):
    """Refinement of the whole mesh. Colours are interpolated, texture coordinates dropped.

    midpoint     new vertices halve the edges; the shape does not change
    loop         Loop 1987, Smooth subdivision surfaces based on triangles: old vertices move, the shape is smoothed
    butterfly    Dyn, Levin and Gregory 1990: old vertices stay, new ones are a mean of eight (the regular mask at every
                 valence); edges next to a boundary are halved
    sqrt3        Kobbelt 2000: a vertex in every triangle, then old edges flip; boundary edges and vertices stay

    Source: Wang et al. 2010, A benchmark for 3D mesh watermarking, "subdivision": loop, midpoint, sqrt3, once each.
    """

    scheme: Literal["loop", "midpoint", "butterfly", "sqrt3"] = option("loop", "rule for the new vertices")
    iterations: int = option(1, "number of refinements, each to 4 times the triangles (sqrt3: 3 times); 0: none")

    def __post_init__(self) -> None:
        if not 0 <= self.iterations <= 6:
            raise ValueError(f"iterations should be 0 to 6, not {self.iterations}")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, triangles = checked_arrays(mesh)
        if not self.iterations:
            return copied(mesh)
        colours = colours_of(mesh)
        refine = _insert_and_flip if self.scheme == "sqrt3" else _split_in_four
        for _ in range(self.iterations):
            sides = _Sides(triangles, len(vertices))
            kept, place = geometry.weld(vertices)
            welded = _Sides(place[triangles], len(kept))
            new = MASKS[self.scheme](welded) @ vertices[kept]
            triangles, parents, twins = refine(sides, welded)
            vertices = np.concatenate([new[: len(kept)][place], new[len(kept) :][twins]])
            colours = None if colours is None else np.concatenate([colours, colours[parents].mean(axis=1)])
        return made(mesh, vertices, triangles, colours)


@dataclass(frozen=True, eq=False)
class _Sides:
    """The edges of triangles (m, 3) over n vertices and who meets at them; a repeated corner counts nowhere."""

    triangles: Ints
    n: int

    @cached_property
    def _numbered(self) -> tuple[Ints, Ints]:
        return geometry.numbered_edges(self.triangles)

    @property
    def edges(self) -> Ints:
        """Vertices of each edge (e, 2), the lower first."""
        return self._numbered[0]

    @property
    def side(self) -> Ints:
        """The edge from corner c to the next one (m, 3)."""
        return self._numbered[1]

    @cached_property
    def proper(self) -> NDArray[np.bool_]:
        """True (m,) for triangles with three different corners."""
        return np.asarray((self.triangles != np.roll(self.triangles, 1, axis=1)).all(axis=1))

    @cached_property
    def regular(self) -> NDArray[np.bool_]:
        """True (e,) for edges with exactly two triangles."""
        return np.bincount(self.side[self.proper].ravel(), minlength=len(self.edges)) == 2

    @cached_property
    def ends(self) -> sp.csr_array:
        """(e, n): one at both ends of an edge."""
        return _incidence(np.arange(len(self.edges)).repeat(2), self.edges.ravel(), (len(self.edges), self.n))

    @cached_property
    def opposite(self) -> sp.csr_array:
        """(e, n): one at the corners that face the edge."""
        facing = np.roll(self.triangles, 1, axis=1)[self.proper]
        return _incidence(self.side[self.proper].ravel(), facing.ravel(), (len(self.edges), self.n))

    @cached_property
    def around(self) -> sp.csr_array:
        """(e, e): one at the other edges of an edge's triangles."""
        side, e = self.side[self.proper], len(self.edges)
        return _incidence(np.tile(side, 2).ravel(), np.c_[np.roll(side, 1, 1), np.roll(side, 2, 1)].ravel(), (e, e))

    def neighbours(self, chosen: NDArray[np.bool_]) -> sp.csr_array:
        """(n, n): one where a chosen edge (e,) joins two different vertices."""
        a, b = self.edges[chosen & (self.edges[:, 0] != self.edges[:, 1])].T
        return _incidence(np.concatenate([a, b]), np.concatenate([b, a]), (self.n, self.n))


def _midpoint(s: _Sides) -> sp.csr_array:
    return _stacked(sp.eye_array(s.n), 0.5 * s.ends)


def _loop(s: _Sides) -> sp.csr_array:
    new = _rows(s.regular, 0.375 * s.ends + 0.125 * s.opposite, 0.5 * s.ends)
    crease = s.neighbours(~s.regular)
    along = _rows(_degree(crease) == 2, 0.75 * sp.eye_array(s.n) + 0.125 * crease, sp.eye_array(s.n))
    cosine, valence = _valence_cosine(s)
    beta = (0.625 - (0.375 + 0.25 * cosine) ** 2) / valence
    old = _rows(_degree(crease) == 0, _pulled(s, beta, valence), along)
    return _stacked(old, new)


def _butterfly(s: _Sides) -> sp.csr_array:
    inner = s.regular & (s.around @ (~s.regular).astype(np.float64) == 0)
    wings = s.around @ s.opposite - 2.0 * s.ends  # across the four outer edges; each also faces an end of this one
    return _stacked(sp.eye_array(s.n), _rows(inner, 0.5 * s.ends + 0.125 * s.opposite - 0.0625 * wings, 0.5 * s.ends))


def _sqrt3(s: _Sides) -> sp.csr_array:
    m = len(s.triangles)
    new = _incidence(np.arange(m).repeat(3), s.triangles.ravel(), (m, s.n)) / 3.0
    cosine, valence = _valence_cosine(s)
    smooth = _pulled(s, (4.0 - 2.0 * cosine) / (9.0 * valence), valence)
    return _stacked(_rows(_degree(s.neighbours(~s.regular)) == 0, smooth, sp.eye_array(s.n)), new)


MASKS = {"midpoint": _midpoint, "loop": _loop, "butterfly": _butterfly, "sqrt3": _sqrt3}


def _split_in_four(stored: _Sides, welded: _Sides) -> tuple[Ints, Ints, Ints]:
    """New triangles, the parents (new, 2) of each new vertex, and its row among the welded edges (new,)."""
    a, b, c = stored.triangles.T
    ab, bc, ca = (stored.n + stored.side).T
    children = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    twins = np.empty(len(stored.edges), np.int64)
    twins[stored.side.ravel()] = welded.side.ravel()
    return np.stack([np.stack(child, axis=1) for child in children], axis=1).reshape(-1, 3), stored.edges, twins


def _insert_and_flip(stored: _Sides, _: _Sides) -> tuple[Ints, Ints, Ints]:
    """As `_split_in_four`: parents are (new, 3), and stored and welded triangles have the same rows."""
    m = len(stored.triangles)
    side, start, stop = stored.side.ravel(), stored.triangles.ravel(), np.roll(stored.triangles, -1, axis=1).ravel()
    centre = stored.n + np.arange(m).repeat(3)
    forward = np.bincount(side, start < stop, minlength=len(stored.edges))[side]
    flips = stored.regular[side] & (forward == 1.0)  # the two triangles run along the edge in opposite directions
    both = np.bincount(side, centre.astype(np.float64), minlength=len(stored.edges)).astype(np.int64)
    third = np.where(flips, both[side] - centre, stop)
    return np.stack([start, third, centre], axis=1), stored.triangles, np.arange(m)


def _valence_cosine(s: _Sides) -> tuple[Floats, Floats]:
    valence = np.maximum(_degree(s.neighbours(np.ones(len(s.edges), bool))), 1.0)
    return np.cos(2.0 * np.pi / valence), valence


def _pulled(s: _Sides, weight: Floats, valence: Floats) -> sp.csr_array:
    """(n, n): (1 - valence weight) of the vertex itself and ``weight`` (n,) of every neighbour."""
    neighbours = s.neighbours(np.ones(len(s.edges), bool))
    return sp.diags_array(1.0 - valence * weight) + sp.diags_array(weight) @ neighbours


def _degree(matrix: sp.csr_array) -> Floats:
    return np.asarray(matrix.sum(axis=1)).ravel()


def _incidence(rows: Ints, columns: Ints, shape: tuple[int, int]) -> sp.csr_array:
    return sp.csr_array((np.ones(len(rows)), (rows, columns)), shape=shape)


def _rows(chosen: NDArray[np.bool_], where_true: sp.csr_array, where_false: sp.csr_array) -> sp.csr_array:
    mask = chosen.astype(np.float64)
    return sp.csr_array(sp.diags_array(mask) @ where_true + sp.diags_array(1.0 - mask) @ where_false)


def _stacked(old: sp.csr_array, new: sp.csr_array) -> sp.csr_array:
    return sp.csr_array(sp.vstack([old, new]))
