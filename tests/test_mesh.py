"""Meshes to surfaces and back: nothing given is changed, nothing unusable gets in, and out comes the mesh moved."""

import numpy as np
import open3d as o3d
import pytest

from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import (
    MeshArrays,
    Surface,
    TriangleMesh,
    check_precision,
    float_steps,
    is_cloud,
    legacy_cloud,
    legacy_mesh,
    mesh_arrays,
    point_cloud,
    triangle_mesh,
    with_vertices,
)

VERTICES, TRIANGLES = mesh_arrays(TriangleMesh.create_octahedron())
FLOAT64 = o3d.core.float64


def arrays_of(mesh):
    """Copies of every array of a legacy mesh."""
    names = ("vertices", "triangles", "vertex_normals", "triangle_normals", "vertex_colors", "triangle_uvs")
    return {name: np.array(getattr(mesh, name)) for name in names}


def soup(mesh):
    """The same triangles, each with corners of its own."""
    vertices, triangles = mesh_arrays(mesh)
    return triangle_mesh(vertices[triangles.ravel()], np.arange(triangles.size).reshape(-1, 3))


def tensor_mesh(dtype):
    return o3d.t.geometry.TriangleMesh(o3d.core.Tensor(VERTICES.astype(dtype)), o3d.core.Tensor(TRIANGLES))


@pytest.fixture
def dressed():
    """An octahedron with normals, colours, texture coordinates and one vertex that no triangle uses."""
    mesh = triangle_mesh(np.vstack([VERTICES, [9.0, 9, 9]]), TRIANGLES)
    mesh.compute_vertex_normals()
    rng = np.random.default_rng(0)
    mesh.vertex_colors = o3d.utility.Vector3dVector(rng.random((len(VERTICES) + 1, 3)))
    mesh.triangle_uvs = o3d.utility.Vector2dVector(rng.random((3 * len(TRIANGLES), 2)))
    mesh.triangle_material_ids = o3d.utility.IntVector([0] * len(TRIANGLES))
    return mesh


def test_surface_of_a_clean_mesh_is_the_mesh(spot):
    vertices, triangles = mesh_arrays(spot)
    surface = Surface.of(spot)
    np.testing.assert_array_equal(surface.vertices, vertices)
    np.testing.assert_array_equal(surface.triangles, triangles)
    np.testing.assert_array_equal(surface.vertex_map, np.arange(len(vertices)))
    assert (surface.vertices.dtype, surface.triangles.dtype, surface.vertex_map.dtype) == (
        np.float64,
        np.int64,
        np.int64,
    )


def test_surface_and_with_vertices_leave_the_mesh_as_it_is(dressed):
    before = arrays_of(dressed)
    surface = Surface.of(dressed)
    with_vertices(dressed, surface, 2 * surface.vertices)
    for name, array in arrays_of(dressed).items():
        np.testing.assert_array_equal(array, before[name], err_msg=name)


def test_plain_arrays_are_copied():
    vertices, triangles = VERTICES.copy(), TRIANGLES.copy()
    surface = Surface.from_arrays(vertices, triangles)
    vertices[:], triangles[:] = 0.0, 0
    np.testing.assert_array_equal(surface.vertices, VERTICES)
    np.testing.assert_array_equal(surface.triangles, TRIANGLES)


def test_arrays_of_a_surface_are_read_only():
    surface = Surface.from_arrays(VERTICES, TRIANGLES)
    for surface_ in (surface, surface.moved(2 * VERTICES)):
        for array in (surface_.vertices, surface_.triangles, surface_.vertex_map):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 0


def test_moved_keeps_the_connectivity_and_copies_the_vertices():
    positions = 3 * VERTICES
    moved = Surface.from_arrays(VERTICES, TRIANGLES).moved(positions)
    positions[:] = 0.0
    np.testing.assert_array_equal(moved.vertices, 3 * VERTICES)
    np.testing.assert_array_equal(moved.triangles, TRIANGLES)


def test_derived_quantities_are_those_of_geometry(spot):
    surface = Surface.of(spot)
    arrays = surface.vertices, surface.triangles
    assert surface.area == pytest.approx(geometry.areas(*arrays).sum())
    assert surface.diagonal == geometry.diagonal(surface.vertices)
    np.testing.assert_array_equal(surface.centroid, geometry.area_centroid(*arrays))
    np.testing.assert_array_equal(surface.vertex_areas, geometry.vertex_areas(*arrays))
    np.testing.assert_array_equal(surface.normals, geometry.unit(geometry.vertex_area_vectors(*arrays)))
    assert (surface.neighbour_mean != geometry.neighbour_mean(surface.triangles, len(surface.vertices))).nnz == 0
    assert surface.normals is surface.normals  # computed once


def test_a_soup_is_welded_into_the_mesh_it_came_from(spot):
    whole, pieces = Surface.of(spot), Surface.of(soup(spot))
    assert len(pieces.vertices) == len(whole.vertices)
    assert not geometry.boundary_vertices(pieces.triangles, len(pieces.vertices)).any()
    np.testing.assert_array_equal(pieces.vertices[pieces.triangles], whole.vertices[whole.triangles])


def test_multiplicity_counts_the_vertices_at_each_place(spot, dressed):
    np.testing.assert_array_equal(Surface.of(spot).multiplicity, 1)
    corners = np.bincount(np.asarray(spot.triangles).ravel())
    assert sorted(Surface.of(soup(spot)).multiplicity) == sorted(corners)
    assert Surface.of(dressed).multiplicity.sum() == len(VERTICES)  # the unused one does not count


def test_zeros_of_either_sign_are_one_place():
    vertices = np.vstack([VERTICES, np.where(VERTICES == 0, -0.0, VERTICES)])
    surface = Surface.from_arrays(vertices, np.vstack([TRIANGLES[:4], TRIANGLES[4:] + len(VERTICES)]))
    assert len(surface.vertices) == len(VERTICES)


def test_vertices_of_no_triangle_have_no_row():
    vertices = np.vstack([[[5.0, 5, 5]], VERTICES, [[7.0, 7, 7]]])
    surface = Surface.from_arrays(vertices, TRIANGLES + 1)
    np.testing.assert_array_equal(surface.vertices, VERTICES)
    np.testing.assert_array_equal(surface.vertex_map, [-1, *range(len(VERTICES)), -1])


def test_a_coordinate_that_is_not_finite_is_refused_even_where_no_triangle_is():
    with pytest.raises(MeshError, match="not finite"):
        Surface.from_arrays(np.vstack([VERTICES, [[np.nan, 0, 0]]]), TRIANGLES)


def test_triangles_that_are_none_are_left_out():
    a, b, c = TRIANGLES[0]
    repeated = np.vstack([TRIANGLES, [[a, a, b], [a, b, c], [b, c, a], [c, b, a]]])
    np.testing.assert_array_equal(Surface.from_arrays(VERTICES, repeated).triangles, TRIANGLES)


def test_a_triangle_that_welding_collapses_is_left_out():
    vertices = np.vstack([VERTICES, VERTICES[:1]])
    surface = Surface.from_arrays(vertices, np.vstack([TRIANGLES, [[0, 1, len(VERTICES)]]]))
    np.testing.assert_array_equal(surface.triangles, TRIANGLES)


def test_with_vertices_carries_everything_through(dressed):
    surface = Surface.of(dressed)
    marked = with_vertices(dressed, surface, surface.vertices * [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(np.asarray(marked.vertices)[:-1], VERTICES * [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(np.asarray(marked.vertices)[-1], [9, 9, 9])
    for name in ("triangles", "vertex_colors", "triangle_uvs", "triangle_material_ids"):
        np.testing.assert_array_equal(getattr(marked, name), getattr(dressed, name), err_msg=name)


def test_arrays_are_a_mesh_without_open3d(dressed):
    arrays = mesh_arrays(dressed)
    surface = Surface.of(arrays)
    np.testing.assert_array_equal(surface.vertices, Surface.of(dressed).vertices)
    marked = with_vertices(arrays, surface, surface.vertices * [1.0, 2.0, 3.0])
    assert isinstance(marked, MeshArrays)
    as_mesh = with_vertices(dressed, surface, surface.vertices * [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(marked.vertices, as_mesh.vertices)
    np.testing.assert_array_equal(marked.triangles, as_mesh.triangles)
    np.testing.assert_array_equal(arrays.vertices, dressed.vertices)
    np.testing.assert_array_equal(legacy_mesh(marked).vertices, marked.vertices)
    copied = mesh_arrays(arrays)
    copied.vertices[:] = 0.0
    np.testing.assert_array_equal(arrays.vertices, dressed.vertices)
    assert not is_cloud(arrays)


def test_a_tuple_of_arrays_is_no_mesh():
    with pytest.raises(MeshError, match="not tuple"):
        Surface.of((VERTICES, TRIANGLES))


def test_normals_follow_the_surface_where_there_were_some(dressed):
    surface = Surface.of(dressed)
    marked = with_vertices(dressed, surface, surface.vertices * [1.0, 2.0, 3.0])
    expected = triangle_mesh(np.asarray(marked.vertices), TRIANGLES).compute_vertex_normals()
    np.testing.assert_allclose(marked.vertex_normals, expected.vertex_normals, atol=1e-12)
    bare = triangle_mesh(VERTICES, TRIANGLES)
    assert not with_vertices(bare, Surface.of(bare), VERTICES).has_vertex_normals()
    flat = TriangleMesh(bare).compute_triangle_normals()
    marked = with_vertices(flat, Surface.of(flat), VERTICES * [1.0, 2.0, 3.0])
    assert marked.has_triangle_normals()
    assert not marked.has_vertex_normals()
    assert not np.allclose(marked.triangle_normals, flat.triangle_normals)


def test_all_copies_of_a_seam_vertex_move_together(spot):
    mesh = soup(spot)
    surface = Surface.of(mesh)
    rng = np.random.default_rng(0)
    marked = with_vertices(mesh, surface, surface.vertices + 1e-3 * rng.normal(size=surface.vertices.shape))
    again = Surface.of(marked)
    np.testing.assert_array_equal(again.vertex_map, surface.vertex_map)
    np.testing.assert_array_equal(again.triangles, surface.triangles)


def test_with_vertices_is_the_inverse_of_surface(dressed):
    for mesh in (dressed, soup(dressed)):
        surface = Surface.of(mesh)
        np.testing.assert_array_equal(with_vertices(mesh, surface, surface.vertices).vertices, mesh.vertices)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_tensor_mesh_is_taken_and_given_back_in_its_precision(dtype):
    mesh = tensor_mesh(dtype)
    mesh.compute_vertex_normals()
    surface = Surface.of(mesh)
    np.testing.assert_array_equal(surface.vertices, VERTICES)
    marked = with_vertices(mesh, surface, surface.vertices * [1.0, 1.0, 1.7])
    assert isinstance(marked, o3d.t.geometry.TriangleMesh)
    assert marked.vertex.positions.dtype == mesh.vertex.positions.dtype
    assert marked.vertex.normals.dtype == mesh.vertex.normals.dtype
    np.testing.assert_array_equal(marked.vertex.positions.numpy(), (VERTICES * [1.0, 1.0, 1.7]).astype(dtype))
    expected = triangle_mesh(VERTICES * [1.0, 1.0, 1.7], TRIANGLES).compute_vertex_normals()
    np.testing.assert_allclose(marked.vertex.normals.numpy(), expected.vertex_normals, atol=1e-6)
    np.testing.assert_array_equal(mesh.vertex.positions.numpy(), VERTICES)


def test_numbers_too_coarse_for_a_mark_are_refused_with_what_would_do():
    mesh = tensor_mesh(np.float32)
    mesh.translate([5e6, 0.0, 0.0])
    surface = Surface.of(mesh)
    with pytest.raises(MeshError, match=r"0\.5 apart.*to the origin"):
        with_vertices(mesh, surface, surface.vertices)
    check_precision(float_steps(VERTICES + 1e4), 2.0)
    check_precision(float_steps(VERTICES + 5e6, np.float64), 2.0)


@pytest.mark.parametrize("missing", ["vertices", "triangles"])
def test_a_tensor_mesh_without_a_part_is_refused(missing):
    mesh = o3d.t.geometry.TriangleMesh()
    if missing == "triangles":
        mesh.vertex.positions = o3d.core.Tensor(VERTICES)
    with pytest.raises(MeshError, match="no vertices, or no triangles"):
        Surface.of(mesh)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_tensor_clouds_are_taken(dtype):
    cloud = o3d.t.geometry.PointCloud(o3d.core.Tensor(VERTICES.astype(dtype)))
    assert is_cloud(cloud)
    assert not legacy_cloud(cloud).has_normals()
    cloud.point.normals = o3d.core.Tensor(VERTICES.astype(dtype))
    for array in (legacy_cloud(cloud).points, legacy_cloud(cloud).normals):
        np.testing.assert_array_equal(array, VERTICES)
    with pytest.raises(MeshError, match="no points"):
        legacy_cloud(o3d.t.geometry.PointCloud())
    assert not is_cloud(tensor_mesh(dtype))


@pytest.mark.parametrize("thing", [None, "mesh.ply", VERTICES, point_cloud(VERTICES)], ids=lambda t: type(t).__name__)
def test_other_things_are_refused_by_their_type(thing):
    with pytest.raises(MeshError, match=rf"TriangleMesh.*{type(thing).__name__}"):
        Surface.of(thing)


def with_row(array, index, row):
    changed = array.copy()
    changed[index] = row
    return changed


LINE = np.outer(np.arange(len(VERTICES)), [1.0, 2, 3])
UNUSABLE = {
    "empty": (np.zeros((0, 3)), np.zeros((0, 3), np.int64), "0 vertices and no triangle"),
    "no triangle": (VERTICES, TRIANGLES[:0], "6 vertices and no triangle"),
    "index beyond": (VERTICES, with_row(TRIANGLES, 3, [0, 1, 99]), "names vertex 99.*0 to 5"),
    "index below": (VERTICES, with_row(TRIANGLES, 3, [0, -7, 1]), "names vertex -7.*0 to 5"),
    "NaN": (with_row(VERTICES, 2, [0, np.nan, 0]), TRIANGLES, "1 vertices.*not finite.*first is 2"),
    "infinite": (with_row(VERTICES, 4, [np.inf, 0, 0]), TRIANGLES, "not finite.*first is 4"),
    "one point": (np.ones_like(VERTICES), TRIANGLES, "three different corners"),
    "one line": (LINE, TRIANGLES, "no area.*line"),
    "corners repeated": (VERTICES, TRIANGLES[:, [0, 0, 1]], "three different corners"),
}


@pytest.mark.parametrize(("vertices", "triangles", "words"), UNUSABLE.values(), ids=UNUSABLE)
def test_an_unusable_mesh_says_why(vertices, triangles, words):
    with pytest.raises(MeshError, match=words) as caught:
        Surface.from_arrays(vertices, triangles)
    assert "\n" not in str(caught.value)


def test_area_is_judged_relative_to_the_size():
    for scale in (1e-9, 1e9):
        assert Surface.from_arrays(scale * VERTICES, TRIANGLES).area > 0
        with pytest.raises(MeshError, match="no area"):
            Surface.from_arrays(scale * LINE, TRIANGLES)


def test_meshes_and_clouds_copy_their_arrays():
    vertices, normals = VERTICES.copy(), VERTICES.copy()
    mesh, cloud = triangle_mesh(vertices, TRIANGLES), point_cloud(vertices, normals)
    vertices[:], normals[:] = 0.0, 0.0
    for array in (mesh.vertices, cloud.points, cloud.normals):
        np.testing.assert_array_equal(array, VERTICES)
    assert not point_cloud(VERTICES).has_normals()
