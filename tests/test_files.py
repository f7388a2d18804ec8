"""Reading and writing in any format; STL and glTF, which Open3D reads well."""

import struct

import numpy as np
import open3d as o3d
import pytest

from fixtures.files import assert_refused
from o3dmark.errors import MeshError
from o3dmark.files import FORMATS, read_mesh, read_points, read_shape, write_mesh
from o3dmark.mesh.surface import Surface, TriangleMesh, mesh_arrays


@pytest.mark.parametrize("ending", [".obj", ".off"])
@pytest.mark.parametrize("place", [0.0, 5e5])
def test_text_keeps_every_bit(noisy_spot, tmp_path, ending, place):
    mesh = TriangleMesh(noisy_spot).translate(np.full(3, place))
    mesh.vertex_colors = o3d.utility.Vector3dVector(np.tile([1.0, 0.0, 0.2], (len(mesh.vertices), 1)))
    write_mesh(tmp_path / f"a{ending}", mesh)
    back = read_mesh(tmp_path / f"a{ending}")
    for got, wanted in zip(mesh_arrays(back), mesh_arrays(mesh), strict=True):
        np.testing.assert_array_equal(got, wanted)
    np.testing.assert_allclose(back.vertex_colors, mesh.vertex_colors)


@pytest.mark.parametrize("ending", [".stl", ".glb"])
def test_other_formats_keep_the_shape(noisy_spot, tmp_path, ending):
    write_mesh(tmp_path / f"a{ending}", noisy_spot)
    got, wanted = Surface.of(read_mesh(tmp_path / f"a{ending}")), Surface.of(noisy_spot)
    corners = [s.vertices[s.triangles] for s in (got, wanted)]
    np.testing.assert_allclose(*corners, atol=2e-7)


def test_endings_of_any_case(noisy_spot, tmp_path):
    write_mesh(tmp_path / "A.PLY", noisy_spot)
    np.testing.assert_array_equal(read_mesh(tmp_path / "A.PLY").vertices, noisy_spot.vertices)


def test_writing_leaves_the_mesh_as_it_is(spot, tmp_path):
    for ending in FORMATS:
        write_mesh(tmp_path / f"a{ending}", spot)
    assert not spot.has_triangle_normals()


def test_stl_is_a_soup_that_welds(spot, tmp_path):
    write_mesh(tmp_path / "a.stl", spot)
    soup = read_mesh(tmp_path / "a.stl")
    assert len(soup.triangles) == len(spot.triangles)
    assert len(Surface.of(soup).vertices) == len(spot.vertices)


@pytest.mark.parametrize("count", [2, 2**32 - 1])
def test_lying_stl(write, count):
    facet = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
    assert len(read_mesh(write("a.stl", bytes(80) + struct.pack("<I", 1) + facet)).triangles) == 1
    assert_refused(write("a.stl", bytes(80) + struct.pack("<I", count) + facet))


@pytest.mark.parametrize("ending", FORMATS)
def test_empty_files_and_text(write, ending):
    assert_refused(write(f"empty{ending}", b""), "is empty")
    assert_refused(write(f"text{ending}", "Lorem ipsum dolor sit amet\n" * 20))


def test_files_that_are_not_there(tmp_path):
    for read in (read_mesh, read_shape, read_points):
        with pytest.raises(MeshError, match=r"no file at .*gone\.ply"):
            read(tmp_path / "gone.ply")
        with pytest.raises(MeshError, match="no file at"):
            read(tmp_path)


def test_endings_nobody_reads(write):
    for name in ("a.txt", "a", "a.blend"):
        assert_refused(write(name, "x"), ".ply, .obj")
