"""Reading and writing: nothing is misread, what cannot be read says so, nothing is half written."""

import struct

import numpy as np
import open3d as o3d
import pytest

from fixtures.ply import PLY_HEADER, ascii_ply, binary_ply
from o3dmark.errors import MeshError
from o3dmark.files import FORMATS, read_mesh, read_points, read_shape, replacing, write_mesh
from o3dmark.mesh.surface import PointCloud, Surface, TriangleMesh, mesh_arrays, triangle_mesh

CORNERS = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"


@pytest.fixture
def write(tmp_path):
    """Write text or bytes under a name; returns the path."""

    def write(name, content):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


@pytest.fixture
def noisy(spot):
    """Spot with digits in every place of its doubles."""
    vertices, triangles = mesh_arrays(spot)
    return triangle_mesh(vertices + np.random.default_rng(0).normal(size=vertices.shape) * 1e-3, triangles)


def assert_refused(path, *words):
    for read in (read_mesh, read_shape):
        with pytest.raises(MeshError) as caught:
            read(path)
        text = str(caught.value)
        assert "\n" not in text
        assert all(word in text for word in (*words, path.name)), text


# Round trips


def test_ply_keeps_every_bit(noisy, tmp_path):
    write_mesh(tmp_path / "a.ply", noisy)
    back = read_mesh(tmp_path / "a.ply")
    for got, wanted in zip(mesh_arrays(back), mesh_arrays(noisy), strict=True):
        np.testing.assert_array_equal(got, wanted)


@pytest.mark.parametrize("order", ["little", "big"])
def test_ply_of_another_program_keeps_every_bit(noisy, write, order):
    vertices, triangles = mesh_arrays(read_mesh(write("a.ply", binary_ply(*mesh_arrays(noisy), order=order))))
    np.testing.assert_array_equal(vertices, noisy.vertices)
    np.testing.assert_array_equal(triangles, noisy.triangles)


@pytest.mark.parametrize("ending", [".obj", ".off"])
@pytest.mark.parametrize("place", [0.0, 5e5])
def test_text_keeps_every_bit(noisy, tmp_path, ending, place):
    mesh = TriangleMesh(noisy).translate(np.full(3, place))
    mesh.vertex_colors = o3d.utility.Vector3dVector(np.tile([1.0, 0.0, 0.2], (len(mesh.vertices), 1)))
    write_mesh(tmp_path / f"a{ending}", mesh)
    back = read_mesh(tmp_path / f"a{ending}")
    for got, wanted in zip(mesh_arrays(back), mesh_arrays(mesh), strict=True):
        np.testing.assert_array_equal(got, wanted)
    np.testing.assert_allclose(back.vertex_colors, mesh.vertex_colors)


@pytest.mark.parametrize("ending", [".stl", ".glb"])
def test_other_formats_keep_the_shape(noisy, tmp_path, ending):
    write_mesh(tmp_path / f"a{ending}", noisy)
    got, wanted = Surface.of(read_mesh(tmp_path / f"a{ending}")), Surface.of(noisy)
    corners = [s.vertices[s.triangles] for s in (got, wanted)]
    np.testing.assert_allclose(*corners, atol=2e-7)


def test_endings_of_any_case(noisy, tmp_path):
    write_mesh(tmp_path / "A.PLY", noisy)
    np.testing.assert_array_equal(read_mesh(tmp_path / "A.PLY").vertices, noisy.vertices)


def test_writing_leaves_the_mesh_as_it_is(spot, tmp_path):
    for ending in FORMATS:
        write_mesh(tmp_path / f"a{ending}", spot)
    assert not spot.has_triangle_normals()


def test_colours_go_through_ply(spot, tmp_path):
    mesh = TriangleMesh(spot)
    mesh.vertex_colors = o3d.utility.Vector3dVector(np.tile([1.0, 0.0, 0.2], (len(mesh.vertices), 1)))
    write_mesh(tmp_path / "a.ply", mesh)
    np.testing.assert_allclose(read_mesh(tmp_path / "a.ply").vertex_colors, mesh.vertex_colors)


# OBJ


def obj(vertices=CORNERS, faces=""):
    return "".join(f"v {line}\n" for line in vertices.splitlines()) + faces


@pytest.mark.parametrize(
    ("faces", "triangles"),
    [
        ("f 1 2 3\n", [[0, 1, 2]]),
        ("f 1 2 3 4\n", [[0, 1, 2], [0, 2, 3]]),
        ("f -4 -3 -2 -1\n", [[0, 1, 2], [0, 2, 3]]),
        ("f 1//7 2//7 3//7\n", [[0, 1, 2]]),
        ("f 1 2 \\\n 3 4\n", [[0, 1, 2], [0, 2, 3]]),
        ("# f 1 2 4\ng part\nusemtl x\ns off\nf 1 2 3 # end\n".replace(" # end", ""), [[0, 1, 2]]),
        ("f 1 2\nl 1 2\nf 2 3 4\n", [[1, 2, 3]]),
    ],
    ids=["triangle", "quad", "negative", "normals", "continued", "comments", "two corners"],
)
def test_obj_faces(write, faces, triangles):
    assert np.asarray(read_mesh(write("a.obj", obj(faces=faces))).triangles).tolist() == triangles


def test_obj_polygon_of_any_size_keeps_its_area(write):
    angle = 2 * np.pi * np.arange(12) / 12
    vertices = "".join(f"{np.cos(a):.17g} {np.sin(a):.17g} 0\n" for a in angle)
    mesh = read_mesh(write("a.obj", obj(vertices, "f " + " ".join(str(i + 1) for i in range(12)))))
    assert len(mesh.triangles) == 10
    assert Surface.of(mesh).area == pytest.approx(12 / 2 * np.sin(2 * np.pi / 12), rel=1e-9)


def test_obj_negative_indices_count_from_the_line_they_stand_on(write):
    later = obj(faces="f -4 -3 -2\nv 5 5 5\nf -4 -3 -2\n")
    assert np.asarray(read_mesh(write("a.obj", later)).triangles).tolist() == [[0, 1, 2], [1, 2, 3]]


def test_obj_keeps_every_digit(write):
    path = write("a.obj", obj("0.12345678901234567 0 0\n1 0 0\n1 1 0\n", "f 1 2 3\n"))
    assert np.asarray(read_mesh(path).vertices)[0, 0] == 0.12345678901234567


def test_obj_vertex_colours(write):
    path = write("a.obj", obj("0 0 0 1 0 0\n1 0 0 0 1 0\n1 1 0 0 0 0.5\n", "f 1 2 3\n"))
    np.testing.assert_allclose(read_mesh(path).vertex_colors, [[1, 0, 0], [0, 1, 0], [0, 0, 0.5]])


def test_obj_colours_that_are_not_numbers_are_left_out(write):
    path = write("a.obj", obj("0 0 0 nan 0 0\n1 0 0 0 1 0\n1 1 0 0 0 1\n", "f 1 2 3\n"))
    assert not read_mesh(path).has_vertex_colors()
    assert Surface.of(read_mesh(path)).area == 0.5


@pytest.mark.parametrize("faces", ["f 1/1 2/2 3/3\n", "f -4/-4 -3/-3 -2/-2\n"])
def test_textured_obj_keeps_its_texture_coordinates(write, faces):
    text = obj() + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n" + faces
    mesh = read_mesh(write("a.obj", text))
    np.testing.assert_allclose(mesh.triangle_uvs, [[0, 0], [1, 0], [1, 1]])
    assert Surface.of(mesh).area == 0.5


def test_textured_obj_round_trip(spot, tmp_path):
    """Through as many programs as one likes: coordinates and image stay, and the files come together."""
    image = np.random.default_rng(0).integers(0, 255, (8, 4, 3)).astype(np.uint8)
    coordinates = np.random.default_rng(0).random((3 * len(spot.triangles), 2))
    near = TriangleMesh(spot).translate((1e2, 0.0, -1e3))  # six digits, or float32, would not do
    mesh = TriangleMesh(near)
    mesh.triangle_uvs = o3d.utility.Vector2dVector(coordinates)
    mesh.triangle_material_ids = o3d.utility.IntVector([0] * len(mesh.triangles))
    mesh.textures = [o3d.geometry.Image(image)]
    for generation in range(3):
        folder = tmp_path / str(generation)
        folder.mkdir()
        write_mesh(folder / "a.obj", mesh)
        assert {path.suffix for path in folder.iterdir()} == {".obj", ".mtl", ".png"}
        mesh = read_mesh(folder / "a.obj")
        np.testing.assert_array_equal(mesh.textures[0], image)
        np.testing.assert_allclose(mesh.triangle_uvs, coordinates, atol=1e-5)
        assert set(mesh.triangle_material_ids) == {0}
        corners = [v[t] for v, t in map(mesh_arrays, (mesh, near))]
        np.testing.assert_array_equal(*corners)


def test_a_texture_never_costs_a_vertex(write):
    """To float32, which Open3D reads, the second vertex is the first."""
    text = "v 1 1 0\nv 1.00000001 1 0\nv 1 2 0\nv 0 1 0\n"
    text += "vt 0 0\nvt 1 0\nvt 1 1\nf 1/1 3/2 4/3\nf 2/1 3/2 4/3\n"
    vertices, triangles = mesh_arrays(read_mesh(write("a.obj", text)))
    assert vertices[triangles][1, 0, 0] == 1.00000001


def test_a_texture_never_costs_a_polygon(write):
    """Where Open3D's reading is not complete, the shape is worth more than its texture coordinates."""
    text = obj() + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n" + "f 1/1 2/2 3/3 4/4\n"
    assert Surface.of(read_mesh(write("a.obj", text))).area == 1.0


BAD_OBJ = {
    "text": ("There is no mesh here\n", "no mesh"),
    "comment": ("# nothing\n", "no mesh"),
    "points": (obj(), "4 vertices and no triangle"),
    "two coordinates": (obj("0 0\n1 0\n0 1\n", "f 1 2 3\n"), "not 3 numbers"),
    "a word": (obj("0 0 here\n1 0 0\n0 1 0\n", "f 1 2 3\n"), "not 3 numbers"),
    "uneven": (obj("0 0 0\n1 0 0 1 1 1\n0 1 0\n", "f 1 2 3\n"), "not 6 numbers"),
    "corner a word": (obj(faces="f 1 2 three\n"), "line 5"),
    "corner zero": (obj(faces="f 0 1 2\nv 0 0 1\n"), "line 5"),
    "corner beyond": (obj(faces="f 1 2 5\n"), "4 vertices"),
    "corner before": (obj(faces="f 1 2 -5\n"), "4 vertices"),
    "corner after 32 bits": (obj(faces=f"f {2**32 + 1} 2 3\n"), "4 vertices"),
    "corner after 64 bits": (obj(faces=f"f {10**20} 2 3\n"), "4 vertices"),
    "textured corner beyond": (obj(faces="vt 0 0\nf 1/1 2/1 5/1\n"), "4 vertices"),
}


@pytest.mark.parametrize(("text", "words"), BAD_OBJ.values(), ids=BAD_OBJ)
def test_bad_obj(write, text, words):
    assert_refused(write("a.obj", text), words)


# PLY


@pytest.mark.parametrize("share", [0.3, 0.66, 0.999])
def test_truncated_binary_ply(noisy, write, share):
    content = binary_ply(*mesh_arrays(noisy))
    assert_refused(write("a.ply", content[: int(share * len(content))]), "truncated")


def test_truncated_ascii_ply(write):
    whole = ascii_ply(4, 2, CORNERS + "3 0 1 2\n3 0 2 3\n")
    assert len(read_mesh(write("a.ply", whole)).triangles) == 2
    assert_refused(write("a.ply", whole[:-12]))
    assert_refused(write("a.ply", whole.replace("1 0 0", "1.000000000000000 0 0")[:-12]), "2 faces")


@pytest.mark.parametrize("change", [("vertex 2930", "vertex 2931"), ("face 5856", "face 5857")])
def test_lying_header_of_a_binary_ply(noisy, write, change):
    assert_refused(
        write("a.ply", binary_ply(*mesh_arrays(noisy)).replace(*(word.encode() for word in change))), "truncated"
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


def test_read_shape_of_a_mesh_is_a_mesh(noisy, tmp_path):
    write_mesh(tmp_path / "a.ply", noisy)
    assert isinstance(read_shape(tmp_path / "a.ply"), TriangleMesh)


def test_points_and_their_normals(noisy, tmp_path):
    noisy.compute_vertex_normals()
    cloud = PointCloud(noisy.vertices)
    cloud.normals = noisy.vertex_normals
    o3d.io.write_point_cloud(str(tmp_path / "a.ply"), cloud)
    back = read_points(tmp_path / "a.ply")
    np.testing.assert_array_equal(back.points, noisy.vertices)
    np.testing.assert_array_equal(back.normals, noisy.vertex_normals)


@pytest.mark.parametrize(("body", "words"), [("", "no point"), ("0 0 nan\n1 0 0\n", "not finite")])
def test_bad_points(write, body, words):
    path = write("a.ply", ascii_ply(body.count("\n"), 0, body))
    with pytest.raises(MeshError, match=words):
        read_points(path)


# OFF and STL


@pytest.mark.parametrize(
    "text",
    [
        f"OFF\n4 2 0\n{CORNERS}3 0 1 2\n3 0 2 3\n",
        f"OFF\n# a square\n4 2 0 # counts\n{CORNERS}3 0 1 2\n3 0 2 3\n",
        f"OFF\r\n4 1 0\r\n{CORNERS}4 0 1 2 3\r\n",
        f"OFF 4 2 0\n{CORNERS}3 0 1 2\n3 0 2 3\n",
        f"OFF4 2 0\n{CORNERS}3 0 1 2\n3 0 2 3\n",
        f"\n# a square\n  off # so\n\n4\n2\n{CORNERS}3 0 1 2\n3 0 2 3\n",
        f"OFF\n4 2 0\n{CORNERS}3 0 1 2 1 0 0 # red\n# the other\n3 0 2 3 7\n",
        f"OFF\n4 4 0\n{CORNERS}3 0 1 2\n2 0 2\n1 3\n3 0 2 3\n",
    ],
    ids=["plain", "comments", "quad", "one line", "glued", "loose", "coloured faces", "lines and points"],
)
def test_off(write, text):
    assert Surface.of(read_mesh(write("a.off", text))).area == 1.0


@pytest.mark.parametrize(
    ("kind", "columns"),
    [
        ("COFF", "0.2 0.4 1"),
        ("COFF", "0.2 0.4 1 0.5"),
        ("coff", "51 102 255 128"),
        ("CNOFF", "0 0 1 51 102 255"),
        ("NOFF", "0 0 1"),
        ("STCNOFF", "0 0 1 0.2 0.4 1 1 0.7 0.7"),
    ],
)
def test_off_vertices_may_have_normals_and_colours(write, kind, columns):
    vertices = "".join(f"{row} {columns}\n" for row in CORNERS.splitlines())
    mesh = read_mesh(write("a.off", f"{kind}\n4 1 0\n{vertices}4 0 1 2 3\n"))
    assert Surface.of(mesh).area == 1.0
    assert mesh.has_vertex_colors() == ("C" in kind.upper())
    assert mesh.has_vertex_normals() == ("N" in kind.upper())
    assert np.allclose(mesh.vertex_colors, [0.2, 0.4, 1.0])
    assert np.allclose(mesh.vertex_normals, [0.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("vertices", "face", "words"),
    [
        (CORNERS, "4 0 1 2", "number of corners"),
        (CORNERS, "x 0 1 2", "number of corners"),
        (CORNERS, "3 0 1 4", "4 vertices"),
        (CORNERS, "3 0 1 -1", "4 vertices"),
        (CORNERS, f"3 0 1 {2**70}", "4 vertices"),
        (CORNERS.replace("1", "one"), "3 0 1 2", "not 3 numbers"),
        (CORNERS.replace(" 0\n", "\n"), "3 0 1 2", "not 3 numbers"),
        (CORNERS, "2 0 1", "no triangle"),
        (f"{CORNERS}# so", "", "0 can be read"),
    ],
)
def test_bad_off(write, vertices, face, words):
    assert_refused(write("a.off", f"OFF\n4 1 0\n{vertices}{face}\n"), words)


@pytest.mark.parametrize("kind", ["OFF", "CNOFF"])
def test_an_empty_off(write, kind):
    assert_refused(write("a.off", f"{kind}\n0 0 0\n"), "holds no mesh")


def test_a_coloured_off_without_colours_is_refused(write):
    assert_refused(write("a.off", f"COFF\n4 1 0\n{CORNERS}3 0 1 2\n"), "not 6 numbers")


@pytest.mark.parametrize("counts", ["4 3", "5 2", "99999999999 2", "2000000000 2", "4 2000000000"])
def test_off_counts_must_be_met(write, counts):
    assert_refused(write("a.off", f"OFF\n{counts} 0\n{CORNERS}3 0 1 2\n3 0 2 3\n"))


@pytest.mark.parametrize("text", ["hello there friend\n", "OFF\n", "OFF\nfour two 0\n", "OFF\n-4 2 0\n"])
def test_what_is_no_off(write, text):
    assert_refused(write("a.off", text), "does not begin like an OFF file")


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


# Any file


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


# Writing


def test_writing_where_it_cannot_be(spot, tmp_path):
    with pytest.raises(MeshError, match=r"no folder .*nowhere"):
        write_mesh(tmp_path / "nowhere" / "a.ply", spot)
    with pytest.raises(MeshError, match=r"cannot write a\.txt.*\.ply"):
        write_mesh(tmp_path / "a.txt", spot)
    assert not list(tmp_path.iterdir())


def half_written(name, mesh):
    """What a full disk does."""
    with open(name, "wb") as file:
        file.write(b"ply\nhalf a head")
    return False


@pytest.mark.parametrize("old", [None, b"what was there"])
def test_a_failing_write_leaves_the_old_file_and_nothing_else(spot, tmp_path, monkeypatch, old):
    path = tmp_path / "a.ply"
    if old:
        path.write_bytes(old)
    monkeypatch.setattr(o3d.io, "write_triangle_mesh", half_written)
    with pytest.raises(MeshError, match=r"could not write a\.ply"):
        write_mesh(path, spot)
    assert [file.read_bytes() for file in tmp_path.iterdir()] == ([old] if old else [])


def test_a_block_that_raises_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "a.json"
    path.write_text("old")

    def write():
        with replacing(path) as draft:
            draft.write_text("new")
            (draft.parent / "beside.txt").write_text("new")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write()
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == {"a.json": "old"}


def test_a_block_that_ends_well_replaces_the_file_and_brings_its_companions(tmp_path):
    path = tmp_path / "a.json"
    path.write_text("old")
    with replacing(path) as draft:
        draft.write_text("new")
        (draft.parent / "beside.txt").write_text("beside")
        assert path.read_text() == "old"
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == {"a.json": "new", "beside.txt": "beside"}
