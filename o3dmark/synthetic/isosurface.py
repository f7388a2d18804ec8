"""From an implicit solid to an irregular closed mesh with as many vertices as asked for.

Cells of a grid that the surface may cross are refined eightfold until they are small (`crossed_cells`) and polygonised
by `marching_tetrahedra`; the vertices are shaken along the surface, quadric decimation (Garland and Heckbert 1997)
leaves more of them where it curves more, and Newton steps bring those that remain back onto it (`project`).
"""

from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from o3dmark.arrays import Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import triangle_mesh
from o3dmark.synthetic.field import Field

if TYPE_CHECKING:
    from o3dmark.mesh.surface import TriangleMesh

HALF_BOX = 1.5  # every solid lies inside the cube [-1.5, 1.5]^3
_COARSEST = 0.3  # size of the cells that are refined first: a tenth of the box
_CHUNK = 1 << 15  # points evaluated at once: they fit a cache
_ATTEMPTS = 3  # decimations, each from another grid, before a pose is given up
_RELAXATIONS = 3  # steps of relaxing after decimation: they leave no folds in the kept meshes
_OFFSETS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
_KUHN = np.array(  # six tetrahedra of a cell, wound alike
    [
        [0, 4 >> a, 7 ^ (4 >> c), 7] if (b - a) % 3 == 1 else [0, 7 ^ (4 >> c), 4 >> a, 7]
        for a, b, c in permutations(range(3))
    ]
)


def _triangles_by_case() -> list[tuple[int, Ints]]:
    """(case, rows (3, 2)): the tetrahedron's edges that each triangle joins; bit i of case tells corner i is inside."""
    rows = []
    for i, j, k, m in permutations(range(4)):
        even = np.linalg.det(np.eye(4)[[i, j, k, m]]) > 0
        if even and j < min(k, m):  # one corner inside, or all but one
            rows += [(1 << i, [[i, j], [i, k], [i, m]]), (15 ^ (1 << i), [[i, j], [i, m], [i, k]])]
        if even and i < j:
            rows += [(1 << i | 1 << j, [[i, k], [i, m], [j, m]]), (1 << i | 1 << j, [[i, k], [j, m], [j, k]])]
    return [(case, np.array(edges)) for case, edges in rows]


_CASES = _triangles_by_case()


def remesh(field: Field, n_vertices: int, genus: int, detail: int, rng: np.random.Generator) -> "TriangleMesh | None":
    """A closed mesh of the surface field = 0 with ``n_vertices`` vertices, decimated from at least ``detail``.

    None when the surface has another genus or several pieces, or when no manifold mesh with so few vertices was found.
    """
    spacing = _spacing(field, max(int(2.2 * n_vertices), detail))
    for _ in range(_ATTEMPTS):
        vertices, triangles = marching_tetrahedra(field, spacing)
        mesh = triangle_mesh(_shaken(vertices, triangles, spacing, rng), triangles)
        if mesh.euler_poincare_characteristic() != 2 - 2 * genus:
            return None
        mesh = mesh.simplify_quadric_decimation(2 * (n_vertices - 2 + 2 * genus))
        mesh = _relaxed(field, mesh.remove_unreferenced_vertices())
        if is_sound(mesh, genus):
            return mesh
        spacing *= 0.97  # another grid, so that other edges collapse, perhaps without pinching the surface
    return None


def is_sound(mesh: "TriangleMesh", genus: int) -> bool:
    """True for one closed, consistently wound, manifold piece of the given genus."""
    return bool(
        mesh.is_edge_manifold(allow_boundary_edges=False)
        and mesh.is_vertex_manifold()
        and mesh.is_orientable()
        and mesh.euler_poincare_characteristic() == 2 - 2 * genus
        and len(mesh.cluster_connected_triangles()[1]) == 1
    )


def marching_tetrahedra(field: Field, spacing: float, steepest: float = 1.6) -> tuple[Floats, Ints]:
    """Vertices (n, 3) and triangles (m, 3) of the surface field = 0, wound outward; manifold, whatever the field.

    Each cell of a grid of the given spacing is cut into six tetrahedra around its diagonal (Kuhn 1960). Where the field
    proves to grow faster than ``steepest`` times the distance, the search for cells is done again, wider.
    Errors: MeshError when the surface is not closed, because it leaves the box or the field jumps.
    """
    cells = crossed_cells(field, spacing, steepest)
    keys, place = np.unique(_keys((cells[:, None] + _OFFSETS).reshape(-1, 3)), return_inverse=True)
    corners = (_corners(keys) * spacing).astype(np.float64)
    inside = (values := evaluate(field, corners)) < 0
    tetrahedra = place.reshape(-1, 8)[:, _KUHN].reshape(-1, 4)
    case = inside[tetrahedra] @ np.array([1, 2, 4, 8])
    ends = np.concatenate([tetrahedra[case == number][:, rows] for number, rows in _CASES])  # (m, 3, 2)
    edges, triangles = geometry.numbered_pairs(ends.reshape(-1, 2))
    a, b = edges.T
    share = np.clip(values[a] / (values[a] - values[b]), 0.02, 0.98)[:, None]
    vertices = corners[a] + share * (corners[b] - corners[a])
    if geometry.boundary_vertices(triangles.reshape(-1, 3), len(edges)).any():
        if steepest > 6.0:
            raise MeshError("the solid leaves its box, or its field is no distance")
        return marching_tetrahedra(field, spacing, 2.0 * steepest)
    return vertices, triangles.reshape(-1, 3)


def crossed_cells(field: Field, spacing: float, steepest: float) -> Ints:
    """Integer coordinates (n, 3) of the cells of a grid, in steps of ``spacing``, that the surface may cross."""
    levels = max(0, int(np.ceil(np.log2(_COARSEST / spacing))))
    step = spacing * 2**levels
    half = int(np.ceil(HALF_BOX / step))
    cells = np.stack(np.meshgrid(*[np.arange(-half, half)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    for level in range(levels + 1):
        near = np.abs(evaluate(field, (cells + 0.5) * step)) < steepest * 0.5 * 3**0.5 * step
        cells = cells[near]
        if level < levels:
            cells, step = (2 * cells[:, None] + _OFFSETS).reshape(-1, 3), step / 2
    return cells


def evaluate(field: Field, points: Floats) -> Floats:
    """The field (n,) at points (n, 3), in pieces that fit a cache."""
    return np.concatenate([field(points[i : i + _CHUNK]) for i in range(0, max(len(points), 1), _CHUNK)])


def project(field: Field, points: Floats, normals: Floats, reach: float) -> Floats:
    """Points (n, 3) moved along their unit normals, no farther than ``reach``, by one Newton step to the surface."""
    probe = 0.1 * reach
    ahead, behind = (evaluate(field, points + side * probe * normals) for side in (1.0, -1.0))
    slope = np.maximum((ahead - behind) / (2.0 * probe), 0.3)
    return points - np.clip(0.5 * (ahead + behind) / slope, -reach, reach)[:, None] * normals


def _spacing(field: Field, n_vertices: int) -> float:
    """The grid step that gives about ``n_vertices``, whose number goes with its inverse square."""
    trial = 0.04
    return float(trial * np.sqrt(len(marching_tetrahedra(field, trial)[0]) / n_vertices))


def _shaken(vertices: Floats, triangles: Ints, spacing: float, rng: np.random.Generator) -> Floats:
    """The vertices moved at random along the surface, so that nothing of the grid is left in the mesh."""
    mean = geometry.neighbour_mean(triangles, len(vertices))
    vertices = mean @ vertices
    jitter = np.clip(rng.normal(scale=0.12, size=vertices.shape), -0.3, 0.3) * spacing
    return mean @ (vertices + _tangential(jitter, geometry.unit(geometry.vertex_area_vectors(vertices, triangles))))


def _relaxed(field: Field, mesh: "TriangleMesh") -> "TriangleMesh":
    """A decimated mesh without needles and folds: its vertices relaxed along the surface and brought back onto it."""
    vertices, triangles = np.asarray(mesh.vertices), np.asarray(mesh.triangles).astype(np.int64)
    mean = geometry.neighbour_mean(triangles, len(vertices))
    reach = 0.3 * float(np.sqrt(geometry.areas(vertices, triangles).mean()))
    for _ in range(_RELAXATIONS):
        normals = geometry.unit(geometry.vertex_area_vectors(vertices, triangles))
        pull = mean @ vertices - vertices
        folded = _folded(vertices, triangles, normals)[:, None]
        vertices = vertices + np.where(folded, 0.8 * pull, 0.4 * _tangential(pull, normals))
        vertices = project(field, vertices, normals, reach)
    return triangle_mesh(vertices, triangles)


def _folded(vertices: Floats, triangles: Ints, normals: Floats) -> npt.NDArray[np.bool_]:
    """True (n,) at the corners of triangles that lean over by more than some 75 degrees from their corners' normals."""
    facing = geometry.unit(geometry.area_vectors(vertices, triangles))
    leaning = np.einsum("ij,ikj->ik", facing, normals[triangles]).min(axis=1) < 0.25
    mask = np.zeros(len(vertices), bool)
    mask[triangles[leaning].ravel()] = True
    return mask


def _tangential(vectors: Floats, normals: Floats) -> Floats:
    return vectors - np.einsum("ij,ij->i", vectors, normals)[:, None] * normals


_BITS = 20  # a cell's three coordinates, each in 20 bits, as one sortable number
_ORIGIN = np.int64(sum(1 << (_BITS * axis + _BITS - 1) for axis in range(3)))


def _keys(cells: Ints) -> Ints:
    return cells @ np.array([1 << (2 * _BITS), 1 << _BITS, 1], np.int64) + _ORIGIN


def _corners(keys: Ints) -> Ints:
    mask, half = (1 << _BITS) - 1, 1 << (_BITS - 1)
    return np.stack([keys >> (2 * _BITS), (keys >> _BITS) & mask, keys & mask], axis=1) - half
