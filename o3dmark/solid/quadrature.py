"""A surface as quadrature points: positions with area vectors, by which integrals over it become sums."""

from dataclasses import dataclass

import numpy as np

from o3dmark.arrays import Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.mesh.surface import Facets

_MOST_PARTS = 600_000  # by which triangles may be cut; of 150 real meshes none needs more than 460 000
_NOTHING = 1e-13  # of the area: a triangle so small counts as one point, however long it is
_CORNERS = np.full((3, 3), 1 / 6) + np.eye(3) / 2  # the three-point rule, exact for quadratics


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


@dataclass(frozen=True, eq=False)
class Rule:
    """Where the points lie, on a surface and on the same surface moved a little.

    Of each point its ``triangle`` (q,), its ``share`` (q,) of the area and its barycentric coordinates ``weights``
    (q, 3) there.
    """

    triangle: Ints
    share: Floats
    weights: Floats

    def samples(self, facets: Facets) -> Samples:
        """The points on the surface that the rule was made for, its vertices moved or not."""
        vertex = facets.triangles[self.triangle]
        points = sum(self.weights[:, [c]] * facets.vertices[vertex[:, c]] for c in range(3))
        area_vectors = self.share[:, None] * facets.area_vectors[self.triangle]
        return Samples(np.asarray(points), area_vectors, vertex, self.weights)


def samples(facets: Facets, longest: float, shortest: float = 0.0) -> Samples:
    """Quadrature points of a surface, by the `rule` for it."""
    return rule(facets, longest, shortest).samples(facets)


def rule(facets: Facets, longest: float, shortest: float = 0.0) -> Rule:
    """Where to take points of a surface, for functions that vary over lengths well above ``longest``.

    Triangles with an edge above ``longest`` are split; each part then has three points, or one, its centroid, when all
    edges are below ``shortest`` or it has no area. Errors: MeshError where that makes too many, as of triangles far
    longer than all else.
    """
    fine = (_longest_edge(facets.vertices, facets.triangles) < shortest) | (facets.areas < _NOTHING * facets.area)
    whole, rest = np.flatnonzero(fine), np.flatnonzero(~fine)
    owner, corners = _split(facets.vertices, facets.triangles[rest], longest)  # (p,), (p, 3 corners, 3 coordinates)
    part = np.abs(np.linalg.det(corners))  # of the triangle's area: barycentric coordinates map it to a unit one
    triangle = np.concatenate([whole, np.repeat(rest[owner], 3)])
    share = np.concatenate([np.ones(len(whole)), np.repeat(part / 3.0, 3)])
    weights = np.concatenate([np.full((len(whole), 3), 1.0 / 3.0), (_CORNERS @ corners).reshape(-1, 3)])
    return Rule(triangle, share, weights)


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
    parts = len(triangles)
    while len(owner) or not done:
        position = corners @ vertices[triangles[owner]]
        length = np.linalg.norm(position - np.roll(position, -1, axis=1), axis=2)
        long = length.max(axis=1) > longest
        done.append((owner[~long], corners[~long]))
        owner, corners, edge = owner[long], corners[long], length[long].argmax(axis=1)
        parts += len(owner)
        if parts > len(triangles) + _MOST_PARTS:
            raise MeshError(
                "the mesh has triangles so much longer than the solid is large that they cannot be measured"
            )
        turned = np.take_along_axis(corners, ((edge[:, None] + np.arange(3)) % 3)[:, :, None], axis=1)
        a, b, c = turned[:, 0], turned[:, 1], turned[:, 2]  # the longest edge is a b
        m = 0.5 * (a + b)
        owner = np.concatenate([owner, owner])
        corners = np.concatenate([np.stack([a, m, c], axis=1), np.stack([m, b, c], axis=1)])
    return np.concatenate([o for o, _ in done]), np.concatenate([c for _, c in done])
