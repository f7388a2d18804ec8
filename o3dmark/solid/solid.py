"""The solid that a mesh bounds, whatever the mesh is like: wound outward, closed, and cut into quadrature points.

    Surface -> oriented -> closed -> Solid -> samples: points with area vectors

Integrals over the solid become sums over these samples by the divergence theorem, and such sums hardly notice how the
surface is triangulated. A mesh with holes, borders or non-manifold edges is closed as a chain: the fans over its
boundary make every edge be used equally often in both directions, which is all that the theorem asks for.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from o3dmark.arrays import Bools, Floats, Ints
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface

_FLAT = 0.03  # volume of a piece, over the power 3/2 of its area, below which noise might turn it inside out
_CORNERS = np.full((3, 3), 1 / 6) + np.eye(3) / 2  # the three-point rule, exact for quadratics


@dataclass(frozen=True, eq=False)
class Solid:
    """A closed, outward surface: vertices (n, 3), triangles (m, 3). The first ``len(movable)`` vertices are the mesh's.

    ``movable`` (n_mesh,) is True at the vertices that the fans over the holes do not touch.
    """

    vertices: Floats
    triangles: Ints
    movable: Bools

    @classmethod
    def of(cls, surface: Surface) -> "Solid":
        """The solid that ``surface`` bounds."""
        triangles = oriented(surface.vertices, surface.triangles)
        vertices, caps = fans(surface.vertices, triangles)
        movable = np.ones(len(surface.vertices), bool)
        movable[caps[caps < len(movable)]] = False
        return cls(vertices, np.concatenate([triangles, caps]), movable)

    def moved(self, vertices: Floats) -> "Solid":
        """The same solid with the mesh's vertices at ``vertices`` (n_mesh, 3). Only movable ones may have moved."""
        return Solid(np.concatenate([vertices, self.vertices[len(vertices) :]]), self.triangles, self.movable)

    @cached_property
    def area_vectors(self) -> Floats:
        return geometry.area_vectors(self.vertices, self.triangles)

    @cached_property
    def areas(self) -> Floats:
        """Triangle areas (m,)."""
        return np.asarray(np.linalg.norm(self.area_vectors, axis=1))

    @cached_property
    def area(self) -> float:
        return float(self.areas.sum())

    @cached_property
    def vertex_area_vectors(self) -> Floats:
        """A third of the area vectors around each vertex of the mesh (n_mesh, 3)."""
        return self._at_vertices(self.area_vectors)

    @cached_property
    def vertex_areas(self) -> Floats:
        """A third of the area around each vertex of the mesh (n_mesh,)."""
        return self._at_vertices(self.areas)

    def _at_vertices(self, values: Floats) -> Floats:
        sums = geometry.sum_at_vertices(values, self.triangles, len(self.vertices))
        return sums[: len(self.movable)] / 3.0


@dataclass(frozen=True, eq=False)
class Samples:
    """Quadrature points of a surface: points (q, 3), area vectors (q, 3).

    ``corners`` (q, 3) are the vertices of the triangle that each point lies in, ``weights`` (q, 3) its barycentric
    coordinates there.
    """

    points: Floats
    area_vectors: Floats
    corners: Ints
    weights: Floats


def samples(solid: Solid, longest: float, shortest: float = 0.0) -> Samples:
    """Quadrature points of a solid's surface, for functions that vary over lengths well above ``longest``.

    Triangles with an edge above ``longest`` are split; each part then has three points, or one, its centroid, when all
    edges are below ``shortest``.
    """
    fine = _longest_edge(solid.vertices, solid.triangles) < shortest
    whole, rest = np.flatnonzero(fine), np.flatnonzero(~fine)
    owner, corners = _split(solid.vertices, solid.triangles[rest], longest)  # (p,), (p, 3 corners, 3 coordinates)
    part = np.abs(np.linalg.det(corners))  # of the triangle's area: barycentric coordinates map it to a unit one
    triangle = np.concatenate([whole, np.repeat(rest[owner], 3)])
    share = np.concatenate([np.ones(len(whole)), np.repeat(part / 3.0, 3)])
    weights = np.concatenate([np.full((len(whole), 3), 1.0 / 3.0), (_CORNERS @ corners).reshape(-1, 3)])
    vertex = solid.triangles[triangle]
    points = sum(weights[:, [c]] * solid.vertices[vertex[:, c]] for c in range(3))
    return Samples(np.asarray(points), share[:, None] * solid.area_vectors[triangle], vertex, weights)


def oriented(vertices: Floats, triangles: Ints) -> Ints:
    """The triangles (m, 3) wound alike across every edge that two of them share, and outward in every piece.

    A one-sided piece (a Moebius strip) cannot be wound alike and keeps its winding; a thin one keeps it too,
    unless the volume of all is negative.
    """
    edge = geometry.edge_keys(triangles).ravel()
    forward = (triangles < np.roll(triangles, -1, axis=1)).ravel()
    face = np.repeat(np.arange(len(triangles)), 3)
    order = np.argsort(edge, kind="stable")
    first = np.flatnonzero(np.diff(edge[order], prepend=-1))
    pair = first[np.diff(first, append=len(edge)) == 2]
    one, other = order[pair], order[pair + 1]
    unlike = forward[one] == forward[other]
    flip, piece = _two_colouring(face[one], face[other], unlike, len(triangles))
    area = geometry.areas(vertices, triangles)
    size = np.bincount(piece, area)
    flip ^= (np.bincount(piece, area * flip) > 0.5 * size)[piece]  # the winding that most of a piece has
    wound = np.where(flip[:, None], triangles[:, ::-1], triangles)
    volume = _piece_volumes(vertices, wound, piece)
    inward = np.where(np.abs(volume) > _FLAT * size**1.5, volume < 0.0, volume.sum() < 0.0)
    return np.where(inward[piece][:, None], wound[:, ::-1], wound)


def fans(vertices: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    """Triangles (c, 3) that close a surface, and the vertices (n, 3) with the centre of each fan appended.

    One fan for each connected part of the boundary, around its length-weighted centroid.
    """
    start, end = boundary(triangles, len(vertices))
    if not len(start):
        return vertices, np.empty((0, 3), np.int64)
    links = sp.coo_array((np.ones(len(start)), (start, end)), shape=(len(vertices), len(vertices)))
    loop = np.unique(connected_components(links, directed=False)[1][start], return_inverse=True)[1]
    length = np.maximum(np.linalg.norm(vertices[end] - vertices[start], axis=1), 1e-300)
    middle = 0.5 * (vertices[start] + vertices[end])
    total = np.stack([np.bincount(loop, length * column) for column in middle.T], axis=1)
    centre = total / np.bincount(loop, length)[:, None]
    return np.concatenate([vertices, centre]), np.stack([end, start, len(vertices) + loop], axis=1)


def boundary(triangles: Ints, n_vertices: int) -> tuple[Ints, Ints]:
    """Start and end (b,) of the directed edges left over when opposite ones cancel: the boundary of the chain."""
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    links = sp.coo_array((np.ones(len(start)), (start, end)), shape=(n_vertices, n_vertices)).tocsr()
    net = sp.coo_array(links - links.T)
    times = np.maximum(np.rint(net.data), 0).astype(np.int64)
    return np.repeat(net.row.astype(np.int64), times), np.repeat(net.col.astype(np.int64), times)


def normal_rms(solid: Solid, displacement: Floats) -> float:
    """RMS distance between the surface and the surface moved by ``displacement`` (n_mesh, 3), to first order.

    The normal part of the motion, linear in each triangle, integrated exactly; fans over holes are left out.
    """
    n = len(solid.movable)
    real = (solid.triangles < n).all(axis=1)
    return geometry.normal_rms(solid.area_vectors[real], displacement[solid.triangles[real]])


def _two_colouring(a: Ints, b: Ints, unlike: Bools, count: int) -> tuple[Bools, Ints]:
    """Which of ``count`` things to flip so that each pair (a, b) that is ``unlike`` becomes alike; and their pieces.

    Connected components of the double cover: every thing is there as it is and flipped (+ count).
    """
    cross = np.where(unlike, count, 0)
    row = np.concatenate([a, a + count])
    column = np.concatenate([b + cross, b + count - cross])
    cover = sp.coo_array((np.ones(len(row)), (row, column)), shape=(2 * count, 2 * count))
    label = connected_components(cover, directed=False)[1]
    base = sp.coo_array((np.ones(len(a)), (a, b)), shape=(count, count))
    pieces, piece = connected_components(base, directed=False)
    leader = np.full(pieces, -1)
    leader[piece[::-1]] = np.arange(count)[::-1]
    return label[:count] != label[leader[piece]], piece.astype(np.int64)


def _piece_volumes(vertices: Floats, triangles: Ints, piece: Ints) -> Floats:
    """Signed volume (p,) of each piece, its holes coned to the mean of their edges' midpoints."""
    start, end = boundary(triangles, len(vertices))
    of_vertex = np.zeros(len(vertices), np.int64)
    of_vertex[triangles.ravel()] = np.repeat(piece, 3)
    middle, at = 0.5 * (vertices[start] + vertices[end]), of_vertex[start]
    pieces = int(piece.max(initial=-1)) + 1
    count = np.bincount(at, minlength=pieces)
    total = np.stack([np.bincount(at, column, minlength=pieces) for column in middle.T], axis=1)
    apex = total / np.maximum(count, 1)[:, None]
    arm = vertices[triangles[:, 0]] - apex[piece]
    cones = np.einsum("md,md->m", geometry.area_vectors(vertices, triangles), arm) / 3.0
    return np.asarray(np.bincount(piece, cones, pieces), np.float64)


def _longest_edge(vertices: Floats, triangles: Ints) -> Floats:
    """Length (m,) of the longest edge of each triangle."""
    a, b, c = vertices[triangles.T]
    return np.sqrt(np.max([np.einsum("md,md->m", edge, edge) for edge in (b - a, c - b, a - c)], axis=0))


def _split(vertices: Floats, triangles: Ints, longest: float) -> tuple[Ints, Floats]:
    """Halve triangles across their longest edge until none is above ``longest``.

    Returns the triangle (p,) that each part comes from and its corners (p, 3, 3) in barycentric coordinates there.
    """
    owner = np.arange(len(triangles))
    corners = np.broadcast_to(np.eye(3), (len(triangles), 3, 3))
    done: list[tuple[Ints, Floats]] = []
    while len(owner) or not done:
        position = corners @ vertices[triangles[owner]]
        length = np.linalg.norm(position - np.roll(position, -1, axis=1), axis=2)
        long = length.max(axis=1) > longest
        done.append((owner[~long], corners[~long]))
        owner, corners, edge = owner[long], corners[long], length[long].argmax(axis=1)
        turned = np.take_along_axis(corners, ((edge[:, None] + np.arange(3)) % 3)[:, :, None], axis=1)
        a, b, c = turned[:, 0], turned[:, 1], turned[:, 2]  # the longest edge is a b
        m = 0.5 * (a + b)
        owner = np.concatenate([owner, owner])
        corners = np.concatenate([np.stack([a, m, c], axis=1), np.stack([m, b, c], axis=1)])
    return np.concatenate([o for o, _ in done]), np.concatenate([c for _, c in done])
