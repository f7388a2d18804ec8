"""A mixture of copies beside the cover: as vectors, of which `coding.collusion` asks who took part.

Every copy moves the cover by a combination of K known motions. A copy's vector has the
coefficients, in coordinates in which its length is the RMS motion; directions are about uniform there, since the writer
takes, of all combinations that say the bits, one of the shortest. A mean of copies has the mean of their vectors, and
so, about, have a median and a vertex-wise mix. What was put together of pieces has, in a patch of the surface, the
vector of that piece's copy, as far as the patch can tell.
"""

from collections.abc import Callable, Iterator
from functools import cached_property

import numpy as np

from o3dmark.arrays import Bits, Bools, Floats, Ints
from o3dmark.coding.collusion import Matches, Mixture, Seen
from o3dmark.mesh import geometry, registration, similarity
from o3dmark.mesh.surface import Surface
from o3dmark.methods import Progress
from o3dmark.methods.shape_spectrum.embedder import Cover

_SHARES = (0.3, 0.1, 0.03)  # of the surface's vertices in a patch
_PATCHES = 16  # of each size
_SURE = 3.0  # times the noise: directions of which a patch tells less are left out
_FEWEST = 8  # directions that a patch tells, or it is not used
_LEAST_NOISE = 1e-9  # over the diagonal
_MATCHED = 3e-3  # of the RMS motion: what differs by less is the same coordinate; float32 rounds to a tenth of it
_LEAST_SLOPE = 0.3  # of a coordinate, along the normal: others move so little that they are the same by chance
_CHANCE = 2000  # vectors of random directions
_COUNTED = 4000  # vertices whose coordinates are compared


class Remade:
    """A cover and its copies; they are made again when they are first asked for, and kept as vectors."""

    def __init__(self, cover: Cover, words: Bits, change: Callable[[Bits], Floats]) -> None:
        """``words`` (N, n_bits); ``change`` of the projections (K,) by which the cover came to carry one of them."""
        self.cover, self._words, self._change = cover, words, change
        self._vectors: Floats | None = None

    def vectors(self, progress: Progress) -> Floats:
        """The copies' vectors (N, K): the coefficients of their motions in `functions`."""
        if self._vectors is None:
            changes = []
            for number, word in enumerate(self._words):
                progress(number, len(self._words))
                changes.append(self._change(word))
            self._vectors = np.array(changes) @ self._root
        return self._vectors

    @cached_property
    def area(self) -> Floats:
        """Of each vertex (n,), zero where it may not move."""
        return np.asarray(self.cover.solid.vertex_areas * self.cover.solid.movable)

    @cached_property
    def functions(self) -> Floats:
        """The functions (K, n) that motions along the normals are mixed from, orthonormal over the surface."""
        return np.asarray(np.linalg.solve(self._root, self.cover.along_normals), np.float64)

    def coordinates(self, vertex: Ints, axis: Ints) -> Floats:
        """How coordinates (q,) of vertices answer to those functions: (q, K)."""
        motions = self.cover.directions[3 * vertex + axis] @ self.cover.basis.T
        return np.asarray(np.linalg.solve(self._root, motions.T).T)

    @cached_property
    def _root(self) -> Floats:
        """L (K, K): a change c of the projections moves the surface by a mean square of c' L L' c."""
        functions = self.cover.along_normals
        return np.asarray(np.linalg.cholesky((functions * self.area) @ functions.T / self.area.sum()))


def mixture(received: Surface, copies: Remade, progress: Progress) -> Mixture:
    """What ``received`` shows of the copies.

    Nothing where the vertices of the cover are not found again, after simplification or remeshing, or where they are
    where they were.
    """
    cover, area, functions = copies.cover, copies.area, copies.functions
    match = _counterparts(received, cover)
    if match is None:
        return Mixture()
    there = received.vertices[match]
    pose = similarity.fitted(there, cover.surface.vertices)
    motion = np.einsum("vd,vd->v", similarity.apply(pose, there) - cover.surface.vertices, cover.normals)
    if np.sqrt(motion**2 @ area / area.sum()) < _LEAST_NOISE * cover.surface.diagonal:
        return Mixture()
    vectors = copies.vectors(progress)
    found = (_patch(motion, functions, area * patch, vectors, cover) for patch in _patches(cover))
    patches = tuple(each for each in found if each is not None)
    return Mixture(patches, _matches(there, vectors, copies))


def _counterparts(received: Surface, cover: Cover) -> Ints | None:
    """For each vertex of the cover the one of the received surface that it became (n,); None where they are lost."""
    here, there = cover.surface.vertices, received.vertices
    if len(here) != len(there):
        return None
    match = registration.match_vertices(here, there)
    return match if len(np.unique(match)) == len(here) else None


def _matches(there: Floats, vectors: Floats, copies: Remade) -> Matches:
    """How many coordinates of vertices ``there`` (n, 3), as they came, are those of each copy, and of chance."""
    rng = np.random.default_rng(0)
    some = rng.permutation(len(there))[:_COUNTED]
    vertex, axis = np.nonzero(np.abs(copies.cover.normals[some]) > _LEAST_SLOPE)
    vertex = some[vertex]
    length = float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))
    limit, here = _MATCHED * length, there[vertex, axis]
    directions = geometry.unit(rng.standard_normal((_CHANCE, vectors.shape[1]))) * length
    start, motions = copies.cover.surface.vertices[vertex, axis] - here, copies.coordinates(vertex, axis)

    def counts(moved: Floats) -> Floats:
        found = [np.count_nonzero(np.abs(start + motions @ each) < limit) for each in moved]
        return np.array(found, np.float64)

    return Matches(counts(vectors), counts(directions))


def _patches(cover: Cover) -> Iterator[Bools]:
    """Which vertices (n,) belong to each patch: the nearest to one of a few that lie far apart."""
    vertices = cover.surface.vertices
    yield np.ones(len(vertices), bool)
    centre = int(np.argmax(np.linalg.norm(vertices - vertices.mean(axis=0), axis=1)))
    nearest = np.full(len(vertices), np.inf)
    for _ in range(_PATCHES):
        distance = np.linalg.norm(vertices - vertices[centre], axis=1)
        for share in _SHARES:
            yield distance <= np.quantile(distance, share)
        nearest = np.minimum(nearest, distance)
        centre = int(np.argmax(nearest))


def _patch(motion: Floats, functions: Floats, area: Floats, vectors: Floats, cover: Cover) -> Seen | None:
    """What a patch, where ``area`` (n,) is not zero, tells; None where that is too little.

    The fragment's own motion, left over by the alignment, is fitted with the coefficients.
    """
    inside = area > 0.0
    weight = np.sqrt(area[inside] / area.sum())
    points = cover.surface.vertices[inside]
    free = similarity.motions(points - points.mean(axis=0), cover.normals[inside]) * weight[:, None]
    free = np.linalg.qr(free)[0]
    A, d = functions[:, inside].T * weight[:, None], motion[inside] * weight
    A, d = A - free @ (free.T @ A), d - free @ (free.T @ d)
    U, strength, directions = np.linalg.svd(A, full_matrices=False)
    told = U.T @ d
    noise = max(float(np.linalg.norm(d - U @ told)), _LEAST_NOISE * cover.surface.diagonal)
    noise /= np.sqrt(max(1, len(d) - len(strength)))
    typical = float(np.sqrt(np.mean(vectors**2)))
    sure = strength * typical > _SURE * noise
    if sure.sum() < _FEWEST:
        return None
    return Seen(told[sure] / strength[sure], vectors @ directions[sure].T)
