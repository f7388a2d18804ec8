"""OBJ files: nothing is misread, and what cannot be read says so."""

import numpy as np
import open3d as o3d
import pytest

from fixtures.files import CORNERS, assert_refused
from o3dmark.files import read_mesh, write_mesh
from o3dmark.mesh.surface import Surface, TriangleMesh, mesh_arrays


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
