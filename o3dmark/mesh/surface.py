"""From Open3D's meshes to the read-only arrays that o3dmark computes with, and back.

A `Surface` is what the mathematics sees of a mesh: vertices at equal positions welded into one, so that texture seams
and triangle soups neither open nor split; vertices that no triangle uses, and degenerate triangles (a repeated
corner, a repeated triangle), left out. `with_vertices` carries new positions back to every original vertex, and
colours, texture coordinates and materials go through untouched. Who has no more than arrays, as from a file, gives and
gets `MeshArrays`; Open3D, which takes half a second to import, is then not needed.
"""

import os
import sys
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from o3dmark.arrays import Bools, Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.normals import turned

_COARSEST = 1 / 256  # of the diagonal: coordinates of 8 bits still hold every bit (results/), of 7 bits not always

if TYPE_CHECKING:
    import open3d as o3d

    TriangleMesh: TypeAlias = o3d.geometry.TriangleMesh
    PointCloud: TypeAlias = o3d.geometry.PointCloud


def __getattr__(name: str) -> Any:
    """`TriangleMesh` and `PointCloud`, Open3D's, when somebody asks for them."""
    if name not in ("TriangleMesh", "PointCloud"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    import open3d as o3d

    return getattr(o3d.geometry, name)


class MeshArrays(NamedTuple):
    """A mesh without Open3D: vertices (n, 3) float64 and triangles (m, 3) int64, as they stand, nothing welded."""

    vertices: Floats
    triangles: Ints


class Facets:
    """Vertices (n, 3) and triangles (m, 3), with the areas of these, each computed once: a `Surface`, or a solid."""

    vertices: Floats
    triangles: Ints

    @cached_property
    def area_vectors(self) -> Floats:
        """Each triangle's normal times its area (m, 3)."""
        return geometry.area_vectors(self.vertices, self.triangles)

    @cached_property
    def areas(self) -> Floats:
        """Triangle areas (m,)."""
        return np.asarray(np.linalg.norm(self.area_vectors, axis=1))

    @cached_property
    def area(self) -> float:
        return float(self.areas.sum())


@dataclass(frozen=True, eq=False)
class Surface(Facets):
    """Read-only arrays of a mesh and the quantities derived from them, each computed once.

    vertices (n, 3) float64; triangles (m, 3) int64; vertex_map (N,) int64: for each of the mesh's N vertices its row in
    ``vertices``, or -1 when no triangle uses it. For meshes without coincident or unused vertices it is 0 .. N-1.
    as_wound: whether its triangles are to be taken as they are wound, and what is open for open.
    """

    vertices: Floats
    triangles: Ints
    vertex_map: Ints
    as_wound: bool = False

    def __post_init__(self) -> None:
        for array in (self.vertices, self.triangles, self.vertex_map):
            array.setflags(write=False)

    @classmethod
    def of(cls, mesh: Any) -> "Surface":
        """The surface of a triangle mesh: arrays, or Open3D's, legacy or tensor, of any device and precision.

        A surface comes back as it is.

        Errors: MeshError with no triangle, an index out of range, a coordinate that is not finite, or no area.
        """
        return mesh if isinstance(mesh, cls) else cls.from_arrays(*mesh_arrays(mesh))

    @classmethod
    def from_arrays(cls, vertices: Floats, triangles: Ints) -> "Surface":
        """The surface of plain arrays (n, 3) and (m, 3), copied; errors as in `of`."""
        _check(vertices, triangles)
        kept, position = geometry.weld(vertices)
        corners = position[triangles]
        corners = corners[proper_triangles(corners)]
        used = geometry.used_vertices(corners)
        if not len(used) or not geometry.diagonal(vertices[kept[used]]):
            raise MeshError("the mesh has no triangle with three different corners")
        row = np.full(len(kept), -1, np.int64)
        row[used] = np.arange(len(used))
        surface = cls(vertices[kept[used]].copy(), row[corners], row[position])
        if not surface.area > 1e-12 * surface.diagonal**2:
            raise MeshError("the mesh has no area: its vertices lie on a point or a line")
        return surface

    def moved(self, vertices: Floats) -> "Surface":
        """The same connectivity with its vertices elsewhere (n, 3)."""
        return Surface(np.array(vertices, np.float64), self.triangles, self.vertex_map, self.as_wound)

    def part(self, triangles: Bools) -> "Surface":
        """Some of the triangles (m,) as a surface. Errors: MeshError for none, or none with an area."""
        corners = self.triangles[triangles]
        used, rows = np.unique(corners, return_inverse=True)
        return Surface.from_arrays(self.vertices[used], rows.reshape(-1, 3))

    @cached_property
    def diagonal(self) -> float:
        """Diagonal of the axis-aligned bounding box."""
        return geometry.diagonal(self.vertices)

    @cached_property
    def multiplicity(self) -> Ints:
        """How many of the mesh's vertices lie at each vertex (n,): one, but at seams and after a coarse rounding."""
        return np.bincount(self.vertex_map[self.vertex_map >= 0], minlength=len(self.vertices)).astype(np.int64)

    @cached_property
    def centroid(self) -> Floats:
        """Centre of mass (3,) of the surface."""
        return geometry.area_centroid(self.vertices, self.triangles)

    @cached_property
    def vertex_areas(self) -> Floats:
        return geometry.vertex_areas(self.vertices, self.triangles)

    @cached_property
    def vertex_area_vectors(self) -> Floats:
        """Un-normalised, area-weighted vertex normals (n, 3)."""
        return geometry.vertex_area_vectors(self.vertices, self.triangles)

    @cached_property
    def normals(self) -> Floats:
        """Unit vertex normals (n, 3); zero where the triangles around a vertex cancel."""
        return geometry.unit(self.vertex_area_vectors)

    @cached_property
    def neighbour_mean(self) -> sp.csr_array:
        """The matrix D^-1 A (n, n) of the umbrella operator."""
        return geometry.neighbour_mean(self.triangles, len(self.vertices))


def mesh_arrays(mesh: Any) -> MeshArrays:
    """Vertices (n, 3) float64 and triangles (m, 3) int64 of a mesh, Open3D's or of arrays, as they are, copied."""
    if _is(mesh, "t.geometry.TriangleMesh"):
        if "positions" not in mesh.vertex or "indices" not in mesh.triangle:
            raise MeshError("the tensor mesh has no vertices, or no triangles")
        return MeshArrays(_numbers(mesh.vertex.positions), mesh.triangle.indices.cpu().numpy().astype(np.int64))
    if not (isinstance(mesh, MeshArrays) or _is(mesh, "geometry.TriangleMesh")):
        raise _no_mesh(mesh)
    return MeshArrays(np.array(mesh.vertices, np.float64), np.array(mesh.triangles, np.int64))


def legacy_mesh(mesh: Any) -> "TriangleMesh":
    """A mesh as Open3D's legacy kind, in double precision; a legacy one as it is. Errors: MeshError by its type."""
    if isinstance(mesh, MeshArrays):
        return triangle_mesh(*mesh)
    if _is(mesh, "t.geometry.TriangleMesh"):
        mesh_arrays(mesh)
        return mesh.to_legacy()
    if not _is(mesh, "geometry.TriangleMesh"):
        raise _no_mesh(mesh)
    return mesh


def as_given(given: Any, mesh: Any) -> Any:
    """A mesh as the kind that was given: a legacy one as arrays, or as a tensor mesh on that device, in that precision.

    What other kinds have no place for is lost; a mesh that is of the kind comes back as it is.
    """
    if isinstance(given, MeshArrays) and not isinstance(mesh, MeshArrays):
        return mesh_arrays(mesh)
    if not (_is(given, "t.geometry.TriangleMesh") and _is(mesh, "geometry.TriangleMesh")):
        return mesh
    import open3d as o3d

    types = given.vertex.positions.dtype, given.triangle.indices.dtype
    return o3d.t.geometry.TriangleMesh.from_legacy(mesh, *types, device=given.device)


def is_cloud(shape: Any) -> bool:
    """Whether a shape is a point cloud, of Open3D's legacy or its tensor kind."""
    return _is(shape, "geometry.PointCloud") or _is(shape, "t.geometry.PointCloud")


def _is(shape: Any, kind: str) -> bool:
    """Whether a shape is of that class of Open3D; there is nothing of Open3D's where nobody has imported it."""
    if "open3d" not in sys.modules:
        return False
    import open3d as o3d

    return isinstance(shape, attrgetter(kind)(o3d))


def _no_mesh(mesh: Any) -> MeshError:
    text = f"an Open3D TriangleMesh is wanted, not {type(mesh).__name__}"
    if isinstance(mesh, str | os.PathLike):
        return MeshError(f"{text} {os.fspath(mesh)!r}: read_mesh(path) reads a file")
    if isinstance(mesh, np.ndarray | list | tuple):
        how = "Vector3dVector(vertices), Vector3iVector(triangles)"
        return MeshError(f"{text}: open3d.geometry.TriangleMesh({how}) makes one of arrays")
    if is_cloud(mesh):
        return MeshError(f"{text}: create_from_point_cloud_poisson makes a mesh of points")
    return MeshError(text)


def legacy_cloud(cloud: Any) -> "PointCloud":
    """The points, and normals if any, of a legacy or tensor cloud, in double precision; a legacy one as it is.

    Errors: MeshError for a tensor cloud without points.
    """
    if _is(cloud, "geometry.PointCloud"):
        return cloud
    if "positions" not in cloud.point:
        raise MeshError("the tensor cloud has no points")
    return point_cloud(
        _numbers(cloud.point.positions), _numbers(cloud.point.normals) if "normals" in cloud.point else None
    )


def with_points(cloud: Any, points: Floats) -> Any:
    """A copy of a point cloud, legacy or tensor, with its points there (n, 3), in its own precision; all else stays."""
    import open3d as o3d

    if _is(cloud, "geometry.PointCloud"):
        moved = o3d.geometry.PointCloud(cloud)
        moved.points = o3d.utility.Vector3dVector(np.array(points, np.float64, order="C"))
        return moved
    moved = cloud.clone()
    moved.point.positions = _like(cloud.point.positions, points)
    return moved


def triangle_mesh(vertices: Floats, triangles: Ints) -> "TriangleMesh":
    """An Open3D mesh from vertices (n, 3) and triangles (m, 3)."""
    import open3d as o3d

    return o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(np.array(vertices, np.float64, order="C")),
        o3d.utility.Vector3iVector(np.array(triangles, np.int32, order="C")),
    )


def point_cloud(points: Floats, normals: Floats | None = None) -> "PointCloud":
    """An Open3D point cloud from points (n, 3) and, if given, normals (n, 3)."""
    import open3d as o3d

    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.array(points, np.float64, order="C")))
    if normals is not None:
        cloud.normals = o3d.utility.Vector3dVector(np.array(normals, np.float64, order="C"))
    return cloud


def with_vertices(mesh: Any, surface: Surface, vertices: Floats) -> Any:
    """A copy of ``mesh`` whose surface has its vertices at ``vertices`` (n, 3), in the precision that ``mesh`` has.

    ``surface`` is Surface.of(mesh), or that welded: what was merged goes the same way. Vertices that no triangle uses
    stay where they are; normals, where the mesh had any, turn with the surface; all other attributes are kept.
    """
    before, triangles = mesh_arrays(mesh)
    after, used = before.copy(), surface.vertex_map >= 0
    row = surface.vertex_map[used]
    after[used] = np.where(
        before[used] == surface.vertices[row], vertices[row], before[used] + (vertices - surface.vertices)[row]
    )
    if isinstance(mesh, MeshArrays):
        return MeshArrays(after, triangles)
    if _is(mesh, "t.geometry.TriangleMesh"):
        return _tensor_with(mesh, before, after, triangles)
    return _legacy_with(mesh, before, after, triangles)


def _legacy_with(mesh: Any, before: Floats, after: Floats, triangles: Ints) -> Any:
    import open3d as o3d

    marked = o3d.geometry.TriangleMesh(mesh)
    marked.vertices = o3d.utility.Vector3dVector(after)
    if mesh.has_vertex_normals():
        normals = np.asarray(mesh.vertex_normals)
        marked.vertex_normals = o3d.utility.Vector3dVector(turned(before, after, triangles, normals)(normals))
    if mesh.has_triangle_normals():
        marked.compute_triangle_normals()
    return marked


def _tensor_with(mesh: Any, before: Floats, after: Floats, triangles: Ints) -> Any:
    import open3d as o3d

    if mesh.vertex.positions.dtype == o3d.core.Dtype.Float32:
        check_precision(float_steps(before), geometry.diagonal(before))
    marked = mesh.clone()
    marked.vertex.positions = _like(mesh.vertex.positions, after)
    if "normals" in mesh.vertex:
        normals = _numbers(mesh.vertex.normals)
        marked.vertex.normals = _like(mesh.vertex.normals, turned(before, after, triangles, normals)(normals))
    if "normals" in mesh.triangle:
        marked.compute_triangle_normals()
    return marked


def float_steps(values: Floats, dtype: np.dtype[Any] | type[np.floating[Any]] = np.float32) -> Floats:
    """How far apart numbers of a floating type are at the magnitudes of values (n, 3), read-only."""
    with np.errstate(over="ignore", invalid="ignore"):  # of the largest number, and of what is none
        steps = np.spacing(np.abs(values).astype(dtype)).astype(np.float64)
    steps.setflags(write=False)
    return steps


def check_precision(steps: Floats, diagonal: float) -> None:
    """Whether numbers that lie ``steps`` apart hold a mark in a mesh of that diagonal; as fine as 8 bits they do.

    Errors: MeshError, which says how coarse they are and what would do.
    """
    coarsest = float(np.max(steps, initial=0.0))
    if coarsest > _COARSEST * diagonal:
        raise MeshError(
            f"its numbers lie {coarsest:.3g} apart, the mesh measures {diagonal:.3g}: too coarse to carry a mark."
            " Move the mesh to the origin before it is stored, or store it in a type that holds more digits"
        )


def _numbers(tensor: Any) -> Floats:
    return np.array(tensor.cpu().numpy(), np.float64)


def _like(tensor: Any, values: Floats) -> Any:
    """Values in the type and on the device of a tensor."""
    import open3d as o3d

    return o3d.core.Tensor(np.ascontiguousarray(values)).to(tensor.dtype).to(tensor.device)


def _check(vertices: Floats, triangles: Ints) -> None:
    if not len(triangles):
        raise MeshError(f"the mesh has {len(vertices)} vertices and no triangle")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        wrong = triangles.min() if triangles.min() < 0 else triangles.max()
        raise MeshError(f"a triangle names vertex {wrong}, but the mesh has vertices 0 to {len(vertices) - 1}")
    bad = ~np.isfinite(vertices).all(axis=1)
    if bad.any():
        raise MeshError(f"{bad.sum()} vertices have coordinates that are not finite; the first is {bad.argmax()}")


def proper_triangles(corners: Ints) -> NDArray[np.bool_]:
    """True (m,) for triangles with three different corners, at the first appearance of their corner set."""
    ordered = np.sort(corners, axis=1)
    first = np.zeros(len(corners), bool)
    first[geometry.distinct_rows(ordered)[0]] = True
    a, b, c = ordered.T
    return first & (a != b) & (b != c)
