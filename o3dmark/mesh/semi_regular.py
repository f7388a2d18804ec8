"""Semi-regular meshes: those that are a coarse mesh, 1-to-4 subdivided a number of times, and their lazy wavelets.

Subdivision keeps the coarse vertices, the *even* ones, and puts an *odd* vertex on every coarse edge. An odd vertex has
six neighbours, or four on a boundary, of which two are even: the ends of its edge. From one even vertex the others
follow: they lie straight across the odd ones (Taubin, "Detecting and reconstructing subdivision connectivity", 2002).

The lazy wavelet (Lounsbery, DeRose, Warren 1997, without lifting) keeps the even vertices, and writes each odd one as
the midpoint of its edge and a difference from it, its coefficient. Both directions are exact but for rounding.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from o3dmark.arrays import Bools, Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface

_INSIDE, _BORDER = 6, 4  # neighbours of an odd vertex


@dataclass(frozen=True, eq=False)
class Subdivision:
    """One subdivision undone: the fine vertices that are ``even`` (c,) and ``odd`` (e,), by their numbers.

    edges (e, 2)       for each odd vertex the two ends of its edge, numbered among the even ones
    triangles (m, 3)   of the coarse mesh, numbered among the even ones
    """

    even: Ints
    odd: Ints
    edges: Ints
    triangles: Ints

    def midpoints(self, coarse: Floats) -> Floats:
        """The midpoint (e, 3) of each edge of coarse vertices (c, 3)."""
        return np.asarray(coarse[self.edges].mean(axis=1))


@dataclass(frozen=True, eq=False)
class Wavelets:
    """Vertices of the coarsest mesh, ``base`` (c, 3), and the coefficients of each level (e, 3), the coarsest first."""

    base: Floats
    details: tuple[Floats, ...]


def subdivisions(surface: Surface) -> tuple[Subdivision, ...]:
    """All subdivisions of a surface, the coarsest first. Errors: MeshError for none: it is not semi-regular."""
    found: list[Subdivision] = []
    triangles, n = surface.triangles, len(surface.vertices)
    while (coarser := coarsened(triangles, n)) is not None:
        found.insert(0, coarser)
        triangles, n = coarser.triangles, len(coarser.even)
    if not found:
        raise MeshError(
            "the mesh is not semi-regular (a coarse mesh of which each triangle was cut into four): remesh it by"
            " subdivision first, or take a method for any mesh"
        )
    return tuple(found)


def analysis(vertices: Floats, levels: tuple[Subdivision, ...]) -> Wavelets:
    """The wavelets of vertices (n, 3)."""
    details: list[Floats] = []
    for level in reversed(levels):
        coarse = vertices[level.even]
        details.insert(0, vertices[level.odd] - level.midpoints(coarse))
        vertices = coarse
    return Wavelets(vertices, tuple(details))


def synthesis(wavelets: Wavelets, levels: tuple[Subdivision, ...]) -> Floats:
    """The vertices (n, 3) that have these wavelets."""
    vertices = wavelets.base
    for level, detail in zip(levels, wavelets.details, strict=True):
        fine = np.empty((len(level.even) + len(level.odd), 3))
        fine[level.even] = vertices
        fine[level.odd] = level.midpoints(vertices) + detail
        vertices = fine
    return vertices


def coarsened(triangles: Ints, n_vertices: int) -> Subdivision | None:
    """The last 1-to-4 subdivision of triangles (m, 3) over so many vertices undone; None where there was none.

    None, too, for triangles that are not wound alike, or where it is open which vertices are even (all are regular).
    """
    twin = _twins(triangles)
    if twin is None or len(triangles) % 4:
        return None
    even = _even_vertices(triangles, twin, n_vertices)
    if even is None:
        return None
    central = np.flatnonzero(~even[triangles].any(axis=1))
    across = twin[3 * central[:, None] + np.arange(3)]  # half-edges of the corner tiles
    if 4 * len(central) != len(triangles) or (across < 0).any():
        return None
    apex = triangles.ravel()[3 * (across // 3) + (across + 2) % 3]
    pairs, of = _pairs_by_edge(triangles[central], apex)
    if not even[apex].all() or len(pairs) != np.count_nonzero(~even):
        return None
    number = np.cumsum(even) - 1
    return Subdivision(np.flatnonzero(even), of, number[pairs], number[apex])


def _pairs_by_edge(middle: Ints, apex: Ints) -> tuple[Ints, Ints]:
    """Edges (e, 2) of coarse triangles ``apex`` (m, 3), and the odd vertex (e,) of each: those of ``middle`` (m, 3).

    The half-edge from corner c to c + 1 of a middle triangle looks at corner c of the coarse one.
    """
    ends = np.stack([np.roll(apex, 1, axis=1), apex], axis=2).reshape(-1, 2)  # about corner c of the middle
    odd, first = np.unique(middle.ravel(), return_index=True)
    pairs, number = geometry.numbered_pairs(ends)
    same = len(pairs) == len(odd) and np.array_equal(number, number[first][np.searchsorted(odd, middle.ravel())])
    return (ends[first], odd) if same else (ends[:0], odd[:0])


def _twins(triangles: Ints) -> Ints | None:
    """For the half-edge 3 t + c, from corner c of triangle t to the next, the opposite one (3 m,), or -1 on a boundary.

    None where two triangles use an edge in the same direction.
    """
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    size = int(triangles.max()) + 1
    keys, wanted = start * size + end, end * size + start
    order = np.argsort(keys)
    ranked = keys[order]
    if (ranked[1:] == ranked[:-1]).any():
        return None
    place = np.minimum(np.searchsorted(ranked, wanted), len(ranked) - 1)
    return np.where(ranked[place] == wanted, order[place], -1)


def _even_vertices(triangles: Ints, twin: Ints, n: int) -> Bools | None:
    """True (n,) at the even vertices; None where no set is such that a subdivision explains all others."""
    neighbours = geometry.adjacency(triangles, n)
    valence = np.diff(neighbours.indptr)
    border = np.zeros(n, bool)
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    border[start[twin < 0]] = border[end[twin < 0]] = True
    regular = valence == np.where(border, _BORDER, _INSIDE)
    if regular.all():
        return None
    groups, group = connected_components(_straight_links(triangles, twin, n, border, regular), directed=False)
    counts = neighbours @ sp.csr_array((np.ones(n), (np.arange(n), group)), shape=(n, groups))
    counts = sp.coo_array(counts)
    in_own = counts.coords[1] == group[counts.coords[0]]
    _, piece = connected_components(neighbours, directed=False)
    size, piece_size = np.bincount(group, minlength=groups), np.bincount(piece)
    piece_of = np.zeros(groups, np.int64)
    piece_of[group] = piece
    explained = np.bincount(
        counts.coords[1][~in_own & (counts.data == 2) & regular[counts.coords[0]]], minlength=groups
    )
    touching = np.bincount(counts.coords[1][in_own], minlength=groups)
    good = (touching == 0) & (explained == piece_size[piece_of] - size)
    if not np.array_equal(np.sort(piece_of[good]), np.arange(len(piece_size))):
        return None
    return np.asarray(good[group])


def _straight_links(triangles: Ints, twin: Ints, n: int, border: Bools, regular: Bools) -> sp.csr_array:
    """Joins the two vertices (n, n) that lie straight across each regular vertex, by each of its neighbours."""
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    half_edges = np.arange(len(start))
    inside = half_edges[regular[start] & ~border[start]]
    turned = inside
    for _ in range(_INSIDE // 2):
        turned = twin[3 * (turned // 3) + (turned + 2) % 3]  # the next half-edge around the same start
    one, other = end[inside], end[turned]
    out, into = half_edges[twin < 0], half_edges[twin < 0]
    after, before = np.full(n, -1), np.full(n, -1)
    after[start[out]], before[end[into]] = end[out], start[into]
    along = np.flatnonzero(border & regular & (after >= 0) & (before >= 0))
    rows, columns = np.concatenate([one, after[along]]), np.concatenate([other, before[along]])
    return sp.csr_array((np.ones(len(rows)), (rows, columns)), shape=(n, n))
