"""How far a mark moved each vertex, and the mesh moved so much farther that one sees it."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import open3d as o3d

from o3dmark.arrays import Floats
from o3dmark.errors import MeshError
from o3dmark.mesh.surface import Surface, TriangleMesh, legacy_mesh, mesh_arrays
from o3dmark.view.colours import colour_limits

VISIBLE = 0.01  # over the diagonal: length of an exaggerated displacement that one sees
ROUNDING = 1e-9  # over the diagonal: what moved less did not move
PERCENT = "% of the bounding-box diagonal"
DISPLACEMENT = f"displacement, {PERCENT}"


def distance_from(name: str) -> str:
    """What the colour bar of distances from a mesh of that name says."""
    return f"distance from {name}, {PERCENT}"


def agree(one: Any, other: Any) -> bool:
    """Whether two meshes have the same triangles between as many vertices, so that each vertex has one to move to."""
    (vertices, triangles), (others, other_triangles) = mesh_arrays(one), mesh_arrays(other)
    return vertices.shape == others.shape and np.array_equal(triangles, other_triangles)


@dataclass(frozen=True, eq=False)
class Displacement:
    """From the vertices ``before`` (n, 3) of a cover ``by`` vectors (n, 3) to those of ``marked``, in its unit.

    diagonal: of the cover's bounding box.
    """

    before: Floats
    by: Floats
    marked: Any
    diagonal: float

    @classmethod
    def of(cls, cover: Any, marked: Any) -> "Displacement":
        """Errors: MeshError when the two differ in vertex count, or the cover has nothing to draw."""
        before, after = mesh_arrays(cover)[0], mesh_arrays(marked)[0]
        if before.shape != after.shape:
            raise MeshError(
                f"{len(before)} vertices in the cover and {len(after)} in the marked mesh: a displacement needs as many"
                " in both; distance_sheet compares other meshes"
            )
        return cls(before, after - before, marked, Surface.of(cover).diagonal)

    @cached_property
    def lengths(self) -> Floats:
        """Of each vertex (n,), in per cent of the diagonal."""
        return np.asarray(np.linalg.norm(self.by, axis=1) / self.diagonal * 100.0)

    @property
    def factor(self) -> float:
        """A round number, 1 at least, that makes nearly all of it visible."""
        moved = self.lengths[self.lengths > 100.0 * ROUNDING] / 100.0
        return _round_factor(VISIBLE / float(np.percentile(moved, 98))) if len(moved) else 1.0

    def exaggerated(self, factor: float) -> TriangleMesh:
        """The marked mesh with its vertices at before + factor * by; colours and textures stay."""
        copy = TriangleMesh(legacy_mesh(self.marked))
        copy.vertices = o3d.utility.Vector3dVector(self.before + factor * self.by)
        return copy


def from_zero(lengths: Floats) -> tuple[float, float]:
    """Colour limits for lengths: from zero to where their long tail begins."""
    return 0.0, colour_limits(np.append(lengths, 0.0))[1]


def _round_factor(factor: float) -> float:
    """The greatest of 1, 2, 5, 10, 20, ... that is not above ``factor``; 1 at least."""
    factor = max(factor, 1.0) * (1 + 1e-9)  # 99.999... is 100
    power = 10.0 ** np.floor(np.log10(factor))
    return float(power * max(step for step in (1, 2, 5) if step * power <= factor))
