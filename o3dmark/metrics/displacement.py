"""How far the vertices themselves moved, for two meshes with the same triangles over the same vertices.

Unlike surface distances these see vertices that slide along the surface.
"""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from o3dmark.arrays import Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.mesh.surface import Surface, mesh_arrays
from o3dmark.metrics import METRICS, Metric


@dataclass(frozen=True, eq=False)
class Pairing:
    """Two meshes whose k-th vertices correspond: positions before and after (n, 3) of every vertex in use.

    ``surface`` is the reference's, and ``moved`` the same connectivity with the distorted positions. Vertices that
    coincide in the reference are one vertex of both; where the distorted mesh tore them apart, the first of them counts
    in ``moved`` and each of them in ``after``.
    """

    surface: Surface
    moved: Surface
    before: Floats
    after: Floats


def paired(reference: Any, distorted: Any) -> Pairing:
    """Match two Open3D triangle meshes vertex by vertex, in file order; the order of the triangles may differ.

    Errors: MeshError when a mesh is unusable, or the number of vertices or the triangles differ.
    """
    (before, triangles), (after, others) = mesh_arrays(reference), mesh_arrays(distorted)
    surface = Surface.from_arrays(before, triangles)
    Surface.from_arrays(after, others)  # raises for what cannot be measured
    if len(before) != len(after) or not _same_triangles(triangles, others):
        raise MeshError(
            "the meshes do not have the same triangles over the same vertices in the same order"
            f" ({len(before)} and {len(after)} vertices, {len(triangles)} and {len(others)} triangles);"
            " MRMS, Hausdorff and MSDM2 compare any two meshes"
        )
    used = surface.vertex_map >= 0
    first = np.unique(surface.vertex_map[used], return_index=True)[1]
    return Pairing(surface, surface.moved(after[used][first]), before[used], after[used])


def _same_triangles(triangles: Ints, others: Ints) -> bool:
    return len(triangles) == len(others) and (
        np.array_equal(triangles, others) or np.array_equal(_canonical(triangles), _canonical(others))
    )


def _canonical(triangles: Ints) -> Ints:
    """Each triangle turned so that its lowest corner is first, and all of them sorted."""
    turn = (triangles.argmin(axis=1)[:, None] + np.arange(3)) % 3
    turned = np.take_along_axis(triangles, turn, axis=1)
    return turned[np.lexsort(turned.T)]


@METRICS.register("max_displacement")
@dataclass(frozen=True)
class MaxDisplacement(Metric):
    """The farthest that a vertex moved, over the diagonal of the reference's bounding box.

    Needs the same triangles over the same vertices in the same order. Source: the maximum norm, vertex by vertex.
    """

    needs_equal_connectivity: ClassVar[bool] = True

    def __call__(self, reference: Any, distorted: Any) -> float:
        pair = paired(reference, distorted)
        return float(np.linalg.norm(pair.after - pair.before, axis=1).max() / pair.surface.diagonal)


@METRICS.register("rms_displacement")
@dataclass(frozen=True)
class RmsDisplacement(Metric):
    """Root mean square of the vertices' movement, each vertex alike, over the diagonal of the reference's box.

    Needs the same triangles over the same vertices in the same order. Source: the vertex RMSE of the watermarking
    literature.
    """

    needs_equal_connectivity: ClassVar[bool] = True

    def __call__(self, reference: Any, distorted: Any) -> float:
        pair = paired(reference, distorted)
        moved = np.sum((pair.after - pair.before) ** 2, axis=1)
        return float(np.sqrt(moved.mean()) / pair.surface.diagonal)


@METRICS.register("snr")
@dataclass(frozen=True)
class SNR(Metric):
    """Signal-to-noise ratio in dB: 10 log10( sum |v - c|^2 / sum |v - v'|^2 ), c the mean of the reference's vertices.

    The one metric that grows as meshes come closer: infinite for equal ones, as ``identity`` says.
    Needs the same triangles over the same vertices in the same order. Source: signal processing's ratio of energies, as
    papers on mesh watermarking report it.
    """

    needs_equal_connectivity: ClassVar[bool] = True
    identity: ClassVar[float] = math.inf

    def __call__(self, reference: Any, distorted: Any) -> float:
        pair = paired(reference, distorted)
        signal = np.sum((pair.before - pair.before.mean(axis=0)) ** 2)
        noise = np.sum((pair.after - pair.before) ** 2)
        return float(10.0 * np.log10(signal / noise)) if noise else math.inf
