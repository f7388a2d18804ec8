"""PLY files written again: a parser of the tests' own sees that nothing but positions and normals differ."""

import numpy as np
import pytest

from fixtures.ply import SIGNS, any_ply, ascii_ply, binary_ply, parse_ply
from fixtures.shapes import icosphere, rotation
from o3dmark.errors import MeshError
from o3dmark.files.ply import Ply
from o3dmark.files.references import Source
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import mesh_arrays

XYZ, NORMAL = ("x", "y", "z"), ("nx", "ny", "nz")
FORMS = ("ascii", "binary_little_endian", "binary_big_endian")
FLOATS = [f"float {name}" for name in XYZ]
TETRAHEDRON = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
FACES = [[[0, 2, 1]], [[0, 1, 3]], [[0, 3, 2]], [[1, 2, 3]]]
V, T = icosphere(2)
LARGE = 100_000  # bytes; many of the bad meshes are of this size, and the slow parser takes its time


@pytest.fixture
def ply(tmp_path):
    """A PLY asset of some bytes, which are in no file."""
    return lambda content: Ply(Source(tmp_path / "a.ply", {"a.ply": content}))


def some_motion(vertices, seed=0, size=1e-3):
    """About half of the positions moved a little, equal ones alike."""
    rng = np.random.default_rng(seed)
    places, place = np.unique(vertices, axis=0, return_inverse=True)
    moved = places + size * np.ptp(places[np.isfinite(places).all(axis=1)]) * rng.normal(size=places.shape)
    moved = np.where(rng.random((len(places), 1)) < 0.5, moved, places)
    return moved[place.ravel()]


def assert_only_moved(asset, content, moved):
    """Only words and bytes of vertices' positions that move differ, and of their normals; returns the new file."""
    written = asset.with_positions({0: moved})["a.ply"]
    before, after = parse_ply(content), parse_ply(written)
    assert (before.header, before.rest) == (after.header, after.rest)
    for element, rows in before.rows.items():
        for name in rows[0] if rows else ():
            if element != "vertex" or name not in (*XYZ, *NORMAL):
                assert before.raw(name, element) == after.raw(name, element)
    vertices = asset.parts[0].vertices
    for axis, name in enumerate(XYZ):
        stays = moved[:, axis] == vertices[:, axis]
        stays |= np.isnan(moved[:, axis]) & np.isnan(vertices[:, axis])
        assert (np.array(before.raw(name), object) == np.array(after.raw(name), object))[stays].all()
    return after


def points(parsed, names=XYZ):
    return np.column_stack([parsed.column(name) for name in names])


def scan(form, newline="\n"):
    """What a scanner may write: everything that people have asked for at once, the faces in two sorts of polygons."""
    normals = V + 0.01 * np.random.default_rng(1).normal(size=V.shape)
    rows = [
        [k, *normal, *point, 10, 20, 30, [0.5] * (k % 3), 0.25, 3 * k]
        for k, (point, normal) in enumerate(zip(V.tolist(), normals.astype(np.float32).tolist(), strict=True))
    ]
    vertex = ["int label", *(f"float32 {name}" for name in NORMAL), *(f"double {name}" for name in XYZ)]
    vertex += ["uchar red", "uchar green", "uchar blue", "list uchar float weights", "float quality", "ushort frame"]
    corners = [t.tolist() for t in T]
    faces = [[[0.0, 0.5, 0.5, 1.0, 1.0, 1.0], t if k % 2 else [*t, t[0] ^ 1], k] for k, t in enumerate(corners)]
    face = ["list uchar float texcoord", "list uint8 int vertex_indices", "int segment"]
    edge = ["int vertex1", "int vertex2", "char crease"]
    return any_ply(
        [
            ("camera", ["float fx"], [[1.5]]),
            ("face", face, faces),
            ("vertex", vertex, rows),
            ("edge", edge, [[0, 1, -1]]),
        ],
        form=form,
        newline=newline,
        lines=["comment VCGLIB generated", "comment TextureFile bust.png", "obj_info of a scan", "Created by hand"],
        gap=" \t",
    )


@pytest.mark.parametrize("form", FORMS)
def test_nothing_else_of_a_scan_changes(ply, form):
    content = scan(form)
    asset = ply(content)
    part = asset.parts[0]
    np.testing.assert_array_equal(part.vertices, V)
    assert len(part.triangles) == 480
    assert asset.references == ("bust.png",)
    assert asset.contents == {
        *("normals", "vertex colours", "texture coordinates", "textures", "comments", "polygons"),
        *("element camera", "element edge", "property label", "property quality", "property weights"),
        *("property frame", "property segment"),
    }
    moved = some_motion(part.vertices)
    after = assert_only_moved(asset, content, moved)
    np.testing.assert_allclose(points(after), moved, rtol=0, atol=1e-8 if form == "ascii" else 0)


@pytest.mark.parametrize("content", [scan(form) for form in FORMS] + [scan("ascii", "\r\n")])
def test_positions_as_they_are_are_the_file_as_it_is(ply, content):
    asset = ply(content)
    assert asset.with_positions({})["a.ply"] == content
    assert asset.with_positions({0: asset.parts[0].vertices})["a.ply"] == content


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("kind", ["float", "double", "float32", "float64"])
def test_normals_turn_with_the_surface(ply, form, kind):
    """Theorem: when the surface turns as one, so do its normals; their lengths stay, whatever they were."""
    normals = geometry.vertex_area_vectors(V, T) * np.random.default_rng(3).uniform(1, 100, size=(len(V), 1))
    normals = normals.astype(np.float32)
    rows = np.concatenate([V, normals], axis=1).tolist()
    vertex = [*(f"double {name}" for name in XYZ), *(f"{kind} {name}" for name in NORMAL)]
    faces = [[t.tolist()] for t in T]
    asset = ply(any_ply([("vertex", vertex, rows), ("face", ["list uchar int vertex_index"], faces)], form=form))
    turn = rotation(5)
    turn = turn if np.trace(turn) > 0.5 else turn @ turn  # by less than 100 degrees
    written = parse_ply(asset.with_positions({0: V @ turn.T})["a.ply"])
    np.testing.assert_allclose(points(written, NORMAL), normals @ turn.T, atol=1e-6)


def test_normals_of_a_surface_that_stays_keep_every_bit(ply):
    far = np.concatenate([V, V + 10.0])
    normals = np.random.default_rng(3).normal(size=far.shape)
    normals[5], normals[6] = 0.0, np.nan
    rows = np.concatenate([far, normals], axis=1).tolist()
    faces = [[t.tolist()] for t in np.concatenate([T, T + len(V)])]
    content = any_ply(
        [("vertex", [f"double {p}" for p in (*XYZ, *NORMAL)], rows), ("face", ["list uchar int vertex_index"], faces)],
        form="binary_big_endian",
    )
    moved = far.copy()
    moved[: len(V)] += 0.01 * np.random.default_rng(4).normal(size=V.shape)
    after = parse_ply(ply(content).with_positions({0: moved})["a.ply"])
    before = parse_ply(content)
    for name in NORMAL:
        same = np.array(before.raw(name)) == np.array(after.raw(name))
        assert same[len(V) :].all()
        assert same[5:7].all()
        assert not same[: len(V)].all()


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("kind", ["char", "int16", "int", "uchar", "ushort", "uint32"])
def test_whole_numbers_stay_whole(ply, form, kind):
    rows = [[40 * x + 3, 40 * y + 3, 40 * z + 3] for x, y, z in TETRAHEDRON]
    face = ("face", ["list uchar int vertex_index"], FACES)
    content = any_ply([("vertex", [f"{kind} {p}" for p in XYZ], rows), face], form=form)
    asset = ply(content)
    assert (asset.parts[0].steps == 1.0).all()
    moved = asset.parts[0].vertices + np.array([0.4, 0.6, -1.5])
    after = assert_only_moved(asset, content, moved)
    np.testing.assert_array_equal(points(after), np.rint(moved))
    with pytest.raises(MeshError, match="x = 1e\\+12"):
        asset.with_positions({0: moved + 1e12})


def test_steps_are_those_of_the_type(ply):
    rows = [[1.0 + x, 1.0 + y, 1000 * z] for x, y, z in TETRAHEDRON]
    face = ("face", ["list uchar int vertex_index"], FACES)
    asset = ply(any_ply([("vertex", ["float x", "double y", "short z"], rows), face], form=FORMS[1]))
    np.testing.assert_array_equal(asset.parts[0].steps[1], [2.0**-22, 2.0**-52, 1.0])
    assert not ply(ascii_ply(4, 1, "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n").encode()).parts[0].steps.any()


def test_a_number_too_large_for_float32_is_refused(ply):
    asset = ply(binary_ply(V, T, kind="float"))
    with pytest.raises(MeshError, match="y = 1e\\+39"):
        asset.with_positions({0: asset.parts[0].vertices + np.array([0, 1e39, 0])})


@pytest.mark.parametrize("kind", ["float", "double"])
@pytest.mark.parametrize("order", ["little", "big"])
def test_positions_are_rounded_to_the_nearest(ply, kind, order):
    content = binary_ply(V, T, kind=kind, order=order)
    moved = V + 1e-3 * np.random.default_rng(0).normal(size=V.shape)
    written = ply(content).with_positions({0: moved})["a.ply"]
    assert written == binary_ply(moved, T, kind=kind, order=order)


@pytest.mark.parametrize("digits", ["%.3f", "%.12f", "%g", "%e", "%r", "%.9e"])
def test_equal_positions_stay_equal_in_a_text(ply, digits):
    """Whether they were equal, or one is put where another is and stays."""
    vertices = np.concatenate([V, V[:40]]) * 1e-3
    rows = [[digits % x for x in point] for point in vertices.tolist()]
    asset = ply(
        any_ply([("vertex", FLOATS, rows), ("face", ["list uchar int vertex_index"], [[t.tolist()] for t in T])])
    )
    before = asset.parts[0].vertices
    moved = before + np.array([1e-5, 0, 0])
    moved[100:150] = before[100:150]
    moved[:20] = moved[len(V) : len(V) + 20] = before[100:120]
    after = points(parse_ply(asset.with_positions({0: moved})["a.ply"]))
    np.testing.assert_array_equal(after[:20], after[100:120])
    np.testing.assert_array_equal(after[20:40], after[len(V) + 20 :])
    np.testing.assert_allclose(after, moved, rtol=0, atol=2e-11)


def test_faces_of_two_corners_turn_no_normals(ply):
    rows = [[*point, 0, 0, 1] for point in TETRAHEDRON]
    face = ("face", ["list uchar int vertex_index"], [[[0, 1]], [[1, 2]]])
    asset = ply(any_ply([("vertex", [*FLOATS, *(f"float {name}" for name in NORMAL)], rows), face]))
    after = parse_ply(asset.with_positions({0: 2.0 * asset.parts[0].vertices})["a.ply"])
    np.testing.assert_array_equal(points(after), 2.0 * np.array(TETRAHEDRON))
    assert set(after.raw("nz")) == {b"1"}


def test_faces_without_corners_among_no_vertices_are_refused(ply):
    face = ("face", ["list uchar int vertex_index"], [[[]], [[]]])
    with pytest.raises(MeshError, match="0 corners"):
        ply(any_ply([("vertex", FLOATS, []), face]))


def test_vertices_in_no_triangle_may_have_normals(ply):
    rows = [[*point, 0, 0, 1] for point in [*TETRAHEDRON, [9, 9, 9], [8, 8, 8]]]
    face = ("face", ["list uchar int vertex_index"], FACES)
    asset = ply(any_ply([("vertex", [*FLOATS, *(f"float {name}" for name in NORMAL)], rows), face]))
    moved = asset.parts[0].vertices + np.array([0.1, 0, 0]) * np.arange(6)[:, None]
    after = parse_ply(asset.with_positions({0: moved})["a.ply"])
    np.testing.assert_array_equal(points(after, NORMAL)[4:], [[0, 0, 1]] * 2)


@pytest.mark.parametrize("size", [5e-324, 1e-310, 1e-200, 1e30, 1.7e308])
def test_any_size_can_be_written_in_a_text(ply, size):
    rows = [[size * x, -size * y, size * z] for x, y, z in TETRAHEDRON]
    asset = ply(any_ply([("vertex", FLOATS, rows), ("face", ["list uchar int vertex_index"], FACES)]))
    moved = 0.5 * asset.parts[0].vertices
    after = points(parse_ply(asset.with_positions({0: moved})["a.ply"]))
    np.testing.assert_allclose(after, moved, rtol=0, atol=1e-8 * size)


@pytest.mark.parametrize(("form", "signalling"), [(FORMS[1], "0000a07f"), (FORMS[2], "7fa00000")])
def test_both_zeros_and_what_is_no_number_keep_their_bytes(ply, form, signalling):
    rows = [[0.0, -0.0, float("nan")], [7.0, 0, 0], [0, 1, 0], [0, 0, 1]]
    content = any_ply([("vertex", FLOATS, rows), ("face", ["list uchar int vertex_index"], FACES)], form=form)
    content = content.replace(np.array(7.0, SIGNS[form] + "f4").tobytes(), bytes.fromhex(signalling))
    asset = ply(content)
    assert asset.with_positions({0: np.abs(asset.parts[0].vertices)})["a.ply"] == content


def test_colours_and_normals_reach_the_mesh(ply):
    """Full colour is 255 in bytes, 65535 in shorts and 1 in floats."""
    for kind, full in (("uchar", 255), ("ushort", 65535), ("float", 1.0), ("double", 1.0)):
        names = [*FLOATS, *(f"{kind} {name}" for name in ("red", "green", "blue")), *(f"float {n}" for n in NORMAL)]
        rows = [[*point, full, 0, type(full)(full / 5), 0, 0, 1] for point in TETRAHEDRON]
        face = ("face", ["list uchar int vertex_index"], FACES)
        mesh = ply(any_ply([("vertex", names, rows), face], form=FORMS[2])).mesh()
        np.testing.assert_allclose(np.asarray(mesh.vertex_colors), [[1, 0, 0.2]] * 4, atol=1e-7)
        np.testing.assert_array_equal(np.asarray(mesh.vertex_normals), [[0, 0, 1]] * 4)
        np.testing.assert_array_equal(mesh_arrays(mesh)[1], [face[0] for face in FACES])


@pytest.mark.parametrize("form", FORMS)
def test_strips_are_triangles_of_one_side(ply, form):
    grid = [[x, y, 0] for x in range(3) for y in range(2)]
    strip = ("tristrips", ["list int int vertex_indices"], [[[0, 2, 1, 3, -1, 2, 4, 3, 5]], [[0, 2]], [[]]])
    asset = ply(any_ply([("vertex", FLOATS, grid), strip], form=form))
    assert asset.counts == (6, 3)
    np.testing.assert_array_equal(asset.parts[0].triangles, [[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5]])


@pytest.mark.parametrize("form", FORMS)
def test_a_cloud_has_no_part(ply, form):
    content = any_ply([("vertex", [*FLOATS, "float intensity"], [[*point, 1.0] for point in TETRAHEDRON])], form=form)
    asset = ply(content)
    assert asset.parts == ()
    assert asset.counts == (4, 0)
    assert asset.contents == {"points", "property intensity"}
    assert asset.with_positions({}) == {"a.ply": content}
    np.testing.assert_array_equal(np.asarray(asset.mesh().vertices), TETRAHEDRON)


def real_files(shared):
    """The PLY files among the cases and the bad meshes that are kept beside the repo."""
    return [path for folder in ("cases", "meshes/defects") for path in sorted(shared(folder).glob("*.ply"))]


def test_real_files(shared, ply):
    read = 0
    for path in real_files(shared):
        content = path.read_bytes()
        try:
            asset = ply(content)
        except MeshError:
            assert path.stem.startswith("made_"), path
            continue
        read += 1
        assert asset.with_positions({})["a.ply"] == content
        if asset.parts and (len(content) < LARGE or path.parent.name == "cases"):
            vertices = asset.parts[0].vertices
            assert asset.with_positions({0: vertices})["a.ply"] == content
            assert_only_moved(asset, content, some_motion(vertices))
    assert read > 20
