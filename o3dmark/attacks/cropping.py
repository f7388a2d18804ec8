"""Attacks that leave only a part: cropping, holes, and a fragment pasted beside a foreign object."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import scipy.sparse.csgraph
from numpy.typing import NDArray

from o3dmark.attacks import ATTACKS, Attack
from o3dmark.attacks._carry import checked_arrays, colours_of, copied, kept, made
from o3dmark.attacks.company import primitive
from o3dmark.attacks.geometry import Similarity, random_direction
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import mesh_arrays
from o3dmark.registry import option

if TYPE_CHECKING:
    from o3dmark.mesh.surface import TriangleMesh


@ATTACKS.register("crop")
@dataclass(frozen=True)
class Crop(Attack):
    """A fixed share of the vertices is cut off, with every triangle that uses one of them.

    plane    the vertices furthest along a random direction go (the benchmark)
    ball     the vertices furthest from a random vertex go: what stays is the inside of a ball

    round(share * n) of the n vertices that triangles use are cut; those left without a triangle go with them.
    Source: Wang et al. 2010, A benchmark for 3D mesh watermarking, "cropping", 10, 30, 50 %.
    """

    share: float = option(0.3, "share of the vertices cut off, 0 to 0.99; 0: none")
    kind: Literal["plane", "ball"] = option("plane", "shape of the cut")
    largest: bool = option(False, "of what stays, keep the largest connected piece only")

    def __post_init__(self) -> None:
        if not 0 <= self.share <= 0.99:
            raise ValueError(f"share should be 0 to 0.99, not {self.share}")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, triangles = checked_arrays(mesh)
        direction, seed = random_direction(rng), rng.integers(len(triangles))
        if not self.share:
            return _largest_piece(mesh) if self.largest else copied(mesh)
        depth = vertices @ direction
        if self.kind == "ball":
            depth = np.linalg.norm(vertices - vertices[triangles[seed, 0]], axis=1)
        used = geometry.used_vertices(triangles)
        gone = used[np.argsort(-depth[used], kind="stable")[: round(self.share * len(used))]]
        part = _without(mesh, gone, f"crop:share={self.share}")
        return _largest_piece(part) if self.largest else part


@ATTACKS.register("holes")
@dataclass(frozen=True)
class Holes(Attack):
    """Round holes: around each of ``count`` random vertices the nearest ones go, with every triangle that uses one.

    Each hole takes the same number of vertices; holes may overlap, so that ``share`` is an upper limit but for the
    vertices left without a triangle, which go too. Source: defined here, after what scanners leave out.
    """

    share: float = option(0.05, "share of the vertices in all holes together, 0 to 0.9; 0: none")
    count: int = option(5, "number of holes")

    def __post_init__(self) -> None:
        if not 0 <= self.share <= 0.9 or self.count < 1:
            raise ValueError("wants share in 0 .. 0.9 and count >= 1")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, triangles = checked_arrays(mesh)
        if not self.share:
            return copied(mesh)
        used = geometry.used_vertices(triangles)
        count = min(self.count, max(1, round(self.share * len(used))))  # of a few vertices, not all holes fit
        size = max(1, round(self.share * len(used) / count))
        gone = []
        for centre in rng.choice(used, count, replace=False):
            distance = np.linalg.norm(vertices[used] - vertices[centre], axis=1)
            gone.append(used[np.argsort(distance, kind="stable")[:size]])
        return _without(mesh, np.concatenate(gone), f"holes:share={self.share}")


@ATTACKS.register("paste")
@dataclass(frozen=True)
class Paste(Attack):
    """A fragment cropped by a random plane, moved by a random similarity, beside a foreign object in one mesh.

    The foreign object is a primitive of Open3D, of ``size`` times the fragment's diagonal, turned at random, one of its
    vertices touching the fragment. Texture coordinates are dropped; the foreign object is grey where there are colours.
    Source: defined here; what theft of a part looks like to the owner.
    """

    share: float = option(0.5, "share of the vertices cut off first, 0 to 0.99; 0: the whole mesh is pasted")
    foreign: Literal["torus", "sphere", "box", "cone"] = option("torus", "the foreign object")
    size: float = option(1.0, "diagonal of the foreign object, over that of the fragment")

    def __post_init__(self) -> None:
        if not 0 <= self.share <= 0.99 or not 0 < self.size < 1e6:
            raise ValueError("wants share in 0 .. 0.99 and a positive size")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        fragment = Similarity().attack(Crop(self.share).attack(mesh, rng), rng)
        vertices, triangles = mesh_arrays(fragment)
        other, other_triangles = mesh_arrays(Similarity(0, 360, 1, 1).attack(primitive(self.foreign), rng))
        other *= self.size * geometry.diagonal(vertices) / geometry.diagonal(other)
        other += vertices[rng.integers(len(vertices))] - other[rng.integers(len(other))]
        colours = colours_of(fragment)
        if colours is not None:
            colours = np.concatenate([colours, np.full(other.shape, 0.5)])
        corners = np.concatenate([triangles, other_triangles + len(vertices)])
        return made(fragment, np.concatenate([vertices, other]), corners, colours)


def _without(mesh: Any, gone: NDArray[np.int64], what: str) -> "TriangleMesh":
    vertices, triangles = mesh_arrays(mesh)
    marked = np.zeros(len(vertices), bool)
    marked[gone] = True
    stays: NDArray[np.bool_] = np.logical_not(marked[triangles].any(axis=1))
    if not stays.any():
        raise MeshError(f"{what} leaves no triangle of this mesh ({len(triangles)} triangles); cut off less")
    return kept(mesh, stays)


def _largest_piece(mesh: Any) -> "TriangleMesh":
    """The connected piece, seams closed, with the most vertices."""
    vertices, triangles = mesh_arrays(mesh)
    place = geometry.weld(vertices)[1]
    corners = place[triangles]
    _, piece = scipy.sparse.csgraph.connected_components(geometry.adjacency(corners, place.max() + 1))
    sizes = np.bincount(piece[geometry.used_vertices(corners)])
    stays: NDArray[np.bool_] = np.equal(piece[corners[:, 0]], sizes.argmax())
    return kept(mesh, stays)
