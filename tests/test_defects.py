"""Bad meshes, every kind that was ever met: each is refused in one line of text, or it is sound and can be marked.

The files are written here, without Open3D; where the collection of real ones is present, they all have to pass too.
"""

import itertools
import struct

import numpy as np
import pytest

from fixtures.ply import ascii_ply, binary_ply
from fixtures.shapes import icosphere
from o3dmark.errors import MeshError, O3dmarkError
from o3dmark.files import FORMATS, read_mesh, read_shape
from o3dmark.mesh.saliency import Saliency
from o3dmark.mesh.surface import PointCloud, Surface, mesh_arrays
from o3dmark.methods import METHODS

BITS = np.array([1, 0, 1, 1, 0, 0, 1, 0], np.uint8)
LARGE = 5_000  # vertices; larger ones are marked in the slow run only


def bumpy():
    vertices, triangles = icosphere(3)
    return (1 + 0.1 * np.sin(5 * vertices).sum(axis=1, keepdims=True)) * vertices * [1.0, 1.3, 0.8], triangles


V, T = bumpy()
N = len(V)
RNG = np.random.default_rng(0)
SHUFFLE = RNG.permutation(N + 50)
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
CUBE = np.array([[x, y, z] for x in (0.0, 1) for y in (0.0, 1) for z in (0.0, 1)])
GRID = np.array([[x, y, 0.0] for x in range(20) for y in range(20)])
GRID_CELLS = [(20 * x + y, 20 * x + 20 + y, 20 * x + 21 + y, 20 * x + 1 + y) for x in range(19) for y in range(19)]
WHOLE = binary_ply(V, T)


def put(array, index, row):
    changed = array.copy()
    changed[index] = row
    return changed


def lines(rows, start=""):
    return "".join(start + " ".join(map(str, row)) + "\n" for row in rows)


def off(vertices, faces):
    return f"OFF\n{len(vertices)} {len(faces)} 0\n" + lines(vertices.tolist()) + lines((len(f), *f) for f in faces)


def obj(vertices, faces=(), first=1):
    return lines(vertices.tolist(), "v ") + lines(([corner + first for corner in face] for face in faces), "f ")


def stl(corners):
    """A binary STL of triangles (m, 3, 3), its normals left at zero, as many programs do."""
    facets = np.zeros(len(corners), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    facets["corners"] = corners
    return bytes(80) + struct.pack("<I", len(corners)) + facets.tobytes()


def ascii_stl(corners):
    loops = ("outer loop\n" + lines(corner, "vertex ") + "endloop\n" for corner in corners.tolist())
    return "solid part\n" + "".join(f"facet normal 0 0 0\n{loop}endfacet\n" for loop in loops) + "endsolid part\n"


def moebius(n=100):
    """A strip with one side: rungs of three vertices, the last one joined to the first upside down."""
    turn = np.repeat(2 * np.pi * np.arange(n) / n, 3)
    aside = np.tile([-0.3, 0.0, 0.3], n)
    radius = 1 + aside * np.cos(turn / 2)
    vertices = np.stack([radius * np.cos(turn), radius * np.sin(turn), aside * np.sin(turn / 2)], axis=1)

    def at(i, j):
        return 3 * (i % n) + (2 - j if i == n else j)

    return vertices, [(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)) for i in range(n) for j in range(2)]


def tetrahedral_grid(n=6):
    """Every face of a grid of tetrahedra, five to a cell: most of them lie inside."""
    vertices = np.array([[x, y, z] for x in range(n) for y in range(n) for z in range(n)], float)
    tetrahedra = ((0, 1, 2, 4), (3, 1, 2, 7), (5, 1, 4, 7), (6, 2, 4, 7), (1, 2, 4, 7))
    corners = np.array([0, 1, n, n + 1, n * n, n * n + 1, n * n + n, n * n + n + 1])
    cells = [x * n * n + y * n + z for x in range(n - 1) for y in range(n - 1) for z in range(n - 1)]
    faces = np.array([face for tetrahedron in tetrahedra for face in itertools.combinations(tetrahedron, 3)])
    return vertices, np.concatenate([cell + corners[faces] for cell in cells])


def holes():
    """The base shape with four holes, and all vertices still there."""
    kept = ~np.isin(T, [0, 100, 200, 300]).any(axis=1)
    return V, T[kept]


def isolated(order):
    """Fifty vertices that no triangle uses, among the others in some order."""
    vertices = np.vstack([V, RNG.random((50, 3))])
    return vertices[order], np.argsort(order)[T]


def seams():
    """A hundred corners with vertices of their own."""
    triangles = T.copy()
    triangles[::12, 0] = N + np.arange(len(T[::12]))
    return np.vstack([V, V[T[::12, 0]]]), triangles


def leaves(n=200):
    """A tree's foliage: loose quads, anywhere."""
    quads = RNG.normal(size=(n, 1, 3)) + 0.1 * RNG.normal(size=(n, 4, 3))
    return quads.reshape(-1, 3), [(4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 3) for i in range(n)]


FACES = np.array(QUADS) + 1
LINE = np.outer(np.arange(30), [1.0, 2, 3])
STRIP = np.array([(i, i + 1, i + 2) for i in range(28)])
FAN = np.vstack([CUBE[:2], [[1, 0, 0], [0, 1, 0], [-1, -1, 0]]]), [(0, 1, 2), (0, 1, 3), (0, 1, 4)]

# name: (content, number of vertices of its surface)
SOUND = {
    "ascii.ply": (ascii_ply(N, len(T), lines(V.tolist()) + lines((3, *t) for t in T)), N),
    "big_endian.ply": (binary_ply(V, T, order="big"), N),
    "single.ply": (binary_ply(V, T, kind="float"), N),
    "double.ply": (WHOLE, N),
    "plain.off": (off(V, T), N),
    "white_space.off": ("\t  OFF8 6 12 # or nah\n" + off(CUBE, QUADS).split("\n", 2)[2], 8),
    "binary.stl": (stl(V[T]), N),
    "ascii.stl": (ascii_stl(V[T]), N),
    "several_bodies.stl": (stl(np.concatenate([V[T], V[T] + [9, 0, 0]])), 2 * N),
    "broken.stl": (stl(V[T][::2]), len(np.unique(T[::2]))),
    "random_soup.stl": (stl(RNG.random((100, 3, 3))), 300),
    "flat_facets.stl": (stl(np.concatenate([V[T], V[T][:50, [0, 0, 1]]])), N),
    "isolated_at_the_end.ply": (binary_ply(*isolated(np.arange(N + 50))), N),
    "isolated_shuffled.ply": (binary_ply(*isolated(SHUFFLE)), N),
    "duplicate_vertices.ply": (binary_ply(np.vstack([V, V]), np.vstack([T[::2], T[1::2] + N])), N),
    "duplicate_faces.ply": (binary_ply(V, np.vstack([T, T[:200]])), N),
    "degenerate_faces.ply": (binary_ply(V, put(T, np.s_[::50, 1], T[::50, 0])), N),
    "zero_area_faces.ply": (binary_ply(put(V, T[::100, 0], V[T[::100, 1]]), T), N - len(T[::100])),
    "flipped_half.ply": (binary_ply(V, put(T, np.s_[::2], T[::2, ::-1])), N),
    "inside_out.ply": (binary_ply(V, T[:, ::-1]), N),
    "overlapping.ply": (binary_ply(np.vstack([V, V + 0.3]), np.vstack([T, T + N])), 2 * N),
    "soup.ply": (binary_ply(V[T].reshape(-1, 3), np.arange(T.size).reshape(-1, 3)), N),
    "seams.ply": (binary_ply(*seams()), N),
    "holes.off": (off(*holes()), N - 4),
    "far_offset_single.ply": (binary_ply(V + 1e3, T, kind="float"), N),
    "far_offset.ply": (binary_ply(V + 1e5, T), N),
    "tiny.ply": (binary_ply(1e-7 * V, T), N),
    "huge.ply": (binary_ply(1e7 * V, T), N),
    "flattened.ply": (binary_ply(V * [1, 1, 1e-3], T), N),
    "flat_grid.off": (off(GRID, GRID_CELLS), len(GRID)),
    "leaves.obj": (obj(*leaves()), 800),
    "moebius.obj": (obj(*moebius()), 300),
    "tetrahedral_grid.obj": (obj(*tetrahedral_grid()), 216),
    "fan_on_an_edge.obj": (obj(*FAN), 5),
    "two_cubes_at_a_corner.obj": (obj(np.vstack([CUBE, CUBE + 1]), [*QUADS, *np.array(QUADS) + 8]), 15),
    "dangling_edge.off": (off(np.vstack([CUBE, [[3, 3, 3], [4, 3, 3]]]), [*QUADS, (0, 8, 9)]), 10),
    "quads.off": (off(CUBE, QUADS), 8),
    "quads_and_triangles.obj": (obj(CUBE, [*QUADS[:5], (1, 5, 7), (1, 7, 3)]), 8),
    "hexagon.obj": (obj(V[:6], [(0, 1, 2, 3, 4, 5)]), 6),
    "negative_indices.obj": (obj(CUBE, QUADS, first=-8), 8),
    "too_few_indices.obj": (obj(CUBE[:3], [(0,), (0, 1), (0, 1, 2)]), 3),
    "colours_not_numbers.obj": (lines(((*v, "nan", 0.5, 0.5) for v in CUBE.tolist()), "v ") + lines(FACES, "f "), 8),
    "two_objects.obj": ("o a\n" + obj(CUBE, QUADS) + "o b\n" + obj(CUBE + 5, np.array(QUADS) + 8), 16),
    "comments.off": (off(CUBE, QUADS).replace("\n", "\n# so\n\n", 2), 8),
    "one_triangle.ply": (binary_ply(V[:3], [(0, 1, 2)]), 3),
    "tetrahedron.ply": (binary_ply(CUBE[[0, 1, 2, 4]], [(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)]), 4),
}
REFUSED = {
    "zero_bytes.ply": b"",
    "empty.ply": ascii_ply(0, 0, ""),
    "empty.obj": "# nothing\n",
    "empty.stl": "solid\nendsolid\n",
    "text.obj": "this is not a mesh\n",
    "no_faces.ply": binary_ply(V, []),
    "points.obj": obj(V),
    "not_a_number.ply": binary_ply(put(V, 100, [0, np.nan, 0]), T),
    "infinite.ply": binary_ply(put(V, (100, 2), np.inf), T),
    "not_a_number.obj": obj(put(V, 7, [0, np.nan, 0]), T),
    "index_beyond.ply": binary_ply(V, put(T, (9, 1), N + 10)),
    "index_negative.ply": binary_ply(V, put(T, (9, 1), -1)),
    "index_beyond.obj": obj(V, put(T, (9, 1), N + 10)),
    "truncated.ply": WHOLE[: 2 * len(WHOLE) // 3],
    "count_wrong.ply": WHOLE.replace(b"face 1280", b"face 1999"),
    "count_wrong.off": off(V, T).replace(f" {len(T)} ", f" {len(T) + 1} ", 1),
    "line.ply": binary_ply(LINE, STRIP),
    "one_place.ply": binary_ply(np.ones((30, 3)), STRIP),
}
assert b"face 1280" in WHOLE


def surface_or_refusal(path):
    """The mesh and its sound surface, or None and a line of text."""
    try:
        mesh = read_mesh(path)
        surface = Surface.of(mesh)
    except MeshError as error:
        assert_one_line(error)
        return None, str(error)
    assert np.isfinite(surface.vertices).all()
    assert surface.area > 0
    assert 0 <= surface.triangles.min() <= surface.triangles.max() == len(surface.vertices) - 1
    assert -1 <= surface.vertex_map.min() <= surface.vertex_map.max() == len(surface.vertices) - 1
    assert len(surface.vertex_map) == len(mesh.vertices)
    return mesh, surface


def assert_one_line(error):
    assert str(error).strip()
    assert "\n" not in str(error)


def mark_and_read(mesh, key):
    """Embed and extract: an error of our own, or finite vertices in the same triangles and eight finite soft bits."""
    method = METHODS.make("saliency-scs")
    vertices, triangles = mesh_arrays(mesh)
    marked = mesh
    try:
        marked = method.embed(mesh, BITS, key)
        assert np.isfinite(marked.vertices).all()
        np.testing.assert_array_equal(marked.triangles, triangles)
        np.testing.assert_array_equal(mesh.vertices, vertices)
    except O3dmarkError as error:
        assert_one_line(error)
    try:
        soft = method.extract(marked, len(BITS), key).soft
        assert soft.shape == BITS.shape
        assert np.isfinite(soft).all()
    except O3dmarkError as error:
        assert_one_line(error)


def write(path, content):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.parametrize("name", SOUND)
def test_a_strange_mesh_is_made_sound(name, tmp_path, key):
    content, vertices = SOUND[name]
    mesh, surface = surface_or_refusal(write(tmp_path / name, content))
    assert mesh is not None, surface
    assert len(surface.vertices) == vertices
    mark_and_read(mesh, key)


@pytest.mark.parametrize("name", REFUSED)
def test_a_hopeless_file_is_refused(name, tmp_path):
    mesh, reason = surface_or_refusal(write(tmp_path / name, REFUSED[name]))
    assert mesh is None
    assert name in reason or "vert" in reason or "triangle" in reason


def test_points_are_a_cloud(tmp_path):
    path = write(tmp_path / "cloud.ply", binary_ply(V, []))
    cloud = read_shape(path)
    assert isinstance(cloud, PointCloud)
    assert np.isfinite(Saliency()(cloud)).all()


def test_real_files(shared, key):
    folder = shared("meshes/defects")
    paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in FORMATS)
    assert len(paths) > 50
    refused = []
    for path in paths:
        mesh, outcome = surface_or_refusal(path)
        if mesh is None:
            refused.append((path.name, outcome))
        elif len(mesh.vertices) <= LARGE:
            mark_and_read(mesh, key)
    assert 10 < len(refused) < 30, refused


@pytest.mark.slow
def test_real_files_that_are_large(shared, key):
    for path in sorted(shared("meshes/defects").iterdir()):
        mesh, _ = surface_or_refusal(path)
        if mesh is not None and len(mesh.vertices) > LARGE:
            mark_and_read(mesh, key)
