"""PLY files and point clouds: every bit is kept, and a header that lies is found out."""

import struct

import numpy as np
import open3d as o3d
import pytest

from fixtures.files import CORNERS, assert_refused
from fixtures.ply import PLY_HEADER, ascii_ply, binary_ply
from o3dmark.errors import MeshError
from o3dmark.files import read_mesh, read_points, read_shape, write_mesh
from o3dmark.mesh.surface import PointCloud, Surface, TriangleMesh, mesh_arrays


def test_ply_keeps_every_bit(noisy_spot, tmp_path):
    write_mesh(tmp_path / "a.ply", noisy_spot)
    back = read_mesh(tmp_path / "a.ply")
    for got, wanted in zip(mesh_arrays(back), mesh_arrays(noisy_spot), strict=True):
        np.testing.assert_array_equal(got, wanted)


@pytest.mark.parametrize("order", ["little", "big"])
def test_ply_of_another_program_keeps_every_bit(noisy_spot, write, order):
    vertices, triangles = mesh_arrays(read_mesh(write("a.ply", binary_ply(*mesh_arrays(noisy_spot), order=order))))
    np.testing.assert_array_equal(vertices, noisy_spot.vertices)
    np.testing.assert_array_equal(triangles, noisy_spot.triangles)


def test_colours_go_through_ply(spot, tmp_path):
    mesh = TriangleMesh(spot)
    mesh.vertex_colors = o3d.utility.Vector3dVector(np.tile([1.0, 0.0, 0.2], (len(mesh.vertices), 1)))
    write_mesh(tmp_path / "a.ply", mesh)
    np.testing.assert_allclose(read_mesh(tmp_path / "a.ply").vertex_colors, mesh.vertex_colors)


@pytest.mark.parametrize("share", [0.3, 0.66, 0.999])
def test_truncated_binary_ply(noisy_spot, write, share):
    content = binary_ply(*mesh_arrays(noisy_spot))
    assert_refused(write("a.ply", content[: int(share * len(content))]), "truncated")


def test_truncated_ascii_ply(write):
    whole = ascii_ply(4, 2, CORNERS + "3 0 1 2\n3 0 2 3\n")
    assert len(read_mesh(write("a.ply", whole)).triangles) == 2
    assert_refused(write("a.ply", whole[:-12]))
    assert_refused(write("a.ply", whole.replace("1 0 0", "1.000000000000000 0 0")[:-12]), "2 faces")


@pytest.mark.parametrize("change", [("vertex 2930", "vertex 2931"), ("face 5856", "face 5857")])
def test_lying_header_of_a_binary_ply(noisy_spot, write, change):
    assert_refused(
        write("a.ply", binary_ply(*mesh_arrays(noisy_spot)).replace(*(word.encode() for word in change))), "truncated"
    )


@pytest.mark.parametrize(("vertices", "faces"), [(10**11, 2), (4, 2 * 10**9), (-4, 2)])
def test_lying_header_of_an_ascii_ply(write, vertices, faces):
    """Counts that the file is too small for are refused before memory is asked for."""
    assert_refused(write("a.ply", ascii_ply(vertices, faces, CORNERS + "3 0 1 2\n3 0 2 3\n")))


def test_ply_polygons_come_as_triangles(write):
    assert Surface.of(read_mesh(write("a.ply", ascii_ply(4, 1, CORNERS + "4 0 1 2 3")))).area == 1.0


def test_ply_lists_other_than_the_corners_may_be_empty(write):
    header = PLY_HEADER.format(format="binary_little_endian", kind="float", vertices=3, faces=1)
    header = header.replace("end_header", "property list uchar float texcoord\nend_header")
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
    path = write("a.ply", header.encode() + corners + struct.pack("<BiiiB", 3, 0, 1, 2, 0))
    assert np.asarray(read_mesh(path).triangles).tolist() == [[0, 1, 2]]


@pytest.mark.parametrize("content", ["hello\n", "ply\nformat ascii 1.0\nelement vertex 3\n", "end_header\n"])
def test_what_is_no_ply(write, content):
    assert_refused(write("a.ply", content), "does not begin like a PLY file")


def test_a_ply_without_faces_is_a_cloud(write):
    text = ascii_ply(4, 0, CORNERS)
    for path in (write("a.ply", text), write("b.ply", text.split("element face")[0] + "end_header\n" + CORNERS)):
        cloud = read_shape(path)
        assert isinstance(cloud, PointCloud)
        np.testing.assert_array_equal(cloud.points, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
        with pytest.raises(MeshError, match="4 vertices and no triangle"):
            read_mesh(path)


def test_read_shape_of_a_mesh_is_a_mesh(noisy_spot, tmp_path):
    write_mesh(tmp_path / "a.ply", noisy_spot)
    assert isinstance(read_shape(tmp_path / "a.ply"), TriangleMesh)


def test_points_and_their_normals(noisy_spot, tmp_path):
    noisy_spot.compute_vertex_normals()
    cloud = PointCloud(noisy_spot.vertices)
    cloud.normals = noisy_spot.vertex_normals
    o3d.io.write_point_cloud(str(tmp_path / "a.ply"), cloud)
    back = read_points(tmp_path / "a.ply")
    np.testing.assert_array_equal(back.points, noisy_spot.vertices)
    np.testing.assert_array_equal(back.normals, noisy_spot.vertex_normals)


@pytest.mark.parametrize(("body", "words"), [("", "no point"), ("0 0 nan\n1 0 0\n", "not finite")])
def test_bad_points(write, body, words):
    path = write("a.ply", ascii_ply(body.count("\n"), 0, body))
    with pytest.raises(MeshError, match=words):
        read_points(path)
