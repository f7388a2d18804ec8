"""STL files written again: a parser of the tests' own sees that nothing but corners and facets' normals differ."""

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fixtures.shapes import icosphere, rotation
from fixtures.stl_files import binary_stl, parse_binary, parse_text, text_stl
from o3dmark.errors import MeshError
from o3dmark.files import _open3d
from o3dmark.files.references import Source
from o3dmark.files.stl import Stl
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface, mesh_arrays

PATH = Path("nowhere/a.stl")
V, T = icosphere(2)
CORNERS = V[T]
NORMALS = geometry.unit(geometry.area_vectors(V, T)).astype(np.float32)
MAGICS = b"COLOR=\xa9\xa9\xff\xff,MATERIAL=\x7f\x7f\x7f\xff"
BINARY = {
    "plain": binary_stl(CORNERS, normals=NORMALS),
    "zero normals": binary_stl(CORNERS),
    "colours": binary_stl(CORNERS, normals=NORMALS, header=MAGICS, attributes=np.arange(len(T)) % 7),
    "solid": binary_stl(CORNERS, normals=NORMALS, header=b"solid Part1 exported by a CAD program"),
    "more behind": binary_stl(CORNERS, normals=NORMALS, header=b"solid", tail=b"signature\0" * 30),
}
HALVES = [("upper solid", NORMALS[:160], CORNERS[:160]), ("", NORMALS[160:200], CORNERS[160:200])]
HALVES += [("facet vertex 1 2 3 endloop", NORMALS[200:], CORNERS[200:])]
TEXT = {
    "one solid": text_stl([("part", NORMALS, CORNERS)]),
    "several solids": text_stl(HALVES, number="%.9g"),
    "capitals": text_stl(HALVES, change=str.upper, newline="\r\n", indent="\t"),
    "no ends": text_stl(HALVES, end=False, indent="", number="%r"),
    "no name": text_stl([("", NORMALS, CORNERS)], number="%12.4f"),
    "old compiler": text_stl([("a", NORMALS, CORNERS)]).replace(
        b"normal %.6e" % NORMALS[7, 0], b"normal -1.#IND00e+000", 1
    ),
}


def read(content):
    return Stl(Source(PATH, {PATH.name: content}))


def some_motion(vertices, seed=0):
    """Half of the positions moved a little, equal ones alike."""
    rng = np.random.default_rng(seed)
    places, place = np.unique(vertices, axis=0, return_inverse=True)
    moved = places + 1e-3 * rng.normal(size=places.shape)
    return np.where(rng.random((len(places), 1)) < 0.2, moved, places)[place.ravel()]


def written(asset, moved):
    return asset.with_positions({0: moved})[PATH.name]


def facets(content):
    """What is no number of a facet, and its numbers as they stand there (m, 12); and what these say."""
    if content in BINARY.values() or struct.unpack_from("<I", content, 80)[0] * 50 + 84 <= len(content):
        head, numbers, attributes, tail = parse_binary(content)
        values = [[struct.unpack("<f", raw)[0] for raw in row] for row in numbers]
        return (head, attributes, tail), np.array(numbers, object), np.array(values)
    rest, numbers = parse_text(content)
    values = [[float("nan" if b"#" in word else word) for word in row] for row in numbers]
    return rest, np.array(numbers, object), np.array(values)


def assert_only_moved(asset, content, moved):
    """Only corners that move differ, and the normals of their facets; returns the numbers of the new file (m, 12)."""
    after = written(asset, moved)
    (rest, old, before), (new_rest, new, values) = facets(content), facets(after)
    assert rest == new_rest
    same = old == new
    vertices = asset.parts[0].vertices
    assert same[:, 3:].reshape(-1, 3)[moved == vertices].all()
    stays = (moved == vertices).reshape(-1, 9).all(axis=1) | (before[:, :3] == 0).all(axis=1)
    assert same[stays, :3].all()
    return values


@pytest.mark.parametrize("name", [*BINARY, *TEXT])
def test_nothing_else_changes(name):
    content = {**BINARY, **TEXT}[name]
    asset = read(content)
    vertices = asset.parts[0].vertices
    assert len(vertices) == 3 * len(T)
    np.testing.assert_array_equal(asset.parts[0].triangles.ravel(), np.arange(len(vertices)))
    np.testing.assert_array_equal(facets(content)[2][:, 3:].reshape(-1, 3), vertices)
    assert asset.with_positions({}) == asset.with_positions({0: vertices}) == {PATH.name: content}
    moved = some_motion(vertices)
    values = assert_only_moved(asset, content, moved)
    if name in BINARY:
        np.testing.assert_array_equal(values[:, 3:].reshape(-1, 3), moved.astype(np.float32))
    np.testing.assert_allclose(values[:, 3:].reshape(-1, 3), moved, rtol=0, atol=1e-7)


@pytest.mark.parametrize("name", [*BINARY, *TEXT])
def test_corners_that_meet_still_meet(name):
    asset = read({**BINARY, **TEXT}[name])
    after = read(written(asset, some_motion(asset.parts[0].vertices)))
    before = [geometry.weld(a.parts[0].vertices)[1] for a in (asset, after)]
    np.testing.assert_array_equal(*before)


@pytest.mark.parametrize("digits", ["%.3f", "%.12f", "%g", "%e", "%r", "%.9e"])
def test_a_corner_put_upon_another_meets_it(digits):
    asset = read(text_stl([("a", NORMALS, 1e-3 * CORNERS)], number=digits))
    moved = asset.parts[0].vertices.copy()
    moved[:300] = moved[300:600]
    values = facets(written(asset, moved))[2][:, 3:].reshape(-1, 3)
    np.testing.assert_array_equal(values[:300], values[300:600])


@pytest.mark.parametrize("content", [BINARY["plain"], text_stl([("a", NORMALS, CORNERS)], number="%.9f")])
def test_normals_turn_with_their_facet(content):
    """Theorem: when the surface turns as one, so do its normals."""
    asset = read(content)
    turn = rotation(5)
    turn = turn if np.trace(turn) > 0.5 else turn @ turn  # by less than 100 degrees
    values = facets(written(asset, asset.parts[0].vertices @ turn.T))[2]
    np.testing.assert_allclose(values[:, :3], NORMALS @ turn.T, atol=1e-6)


def test_normals_follow_their_own_facet_only():
    """An exact normal stays exact, to float32, however its facet moves; a tilted one stays as tilted."""
    asset = read(BINARY["plain"])
    moved = asset.parts[0].vertices + 0.05 * np.random.default_rng(0).normal(size=(3 * len(T), 3))
    values = facets(written(asset, moved))[2]
    corners = values[:, 3:].reshape(-1, 3, 3)
    exact = geometry.unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    np.testing.assert_allclose(values[:, :3], exact, atol=2e-6)


def test_normals_without_a_direction_stay():
    normals = NORMALS.copy()
    normals[0], normals[1], normals[2] = 0.0, np.nan, [np.inf, 0, 0]
    flat = CORNERS.copy()
    flat[3, 1] = flat[3, 0]
    content = binary_stl(flat, normals=normals)
    asset = read(content)
    _, before, _ = facets(content)
    _, after, _ = facets(written(asset, 1.01 * asset.parts[0].vertices + some_motion(asset.parts[0].vertices)))
    assert (before[:4, :3] == after[:4, :3]).all()
    assert (before[:, 3:] != after[:, 3:]).any(axis=1).all()


def test_contents():
    assert read(BINARY["plain"]).contents == frozenset()
    assert read(BINARY["colours"]).contents == {"header", "attribute words"}
    assert read(BINARY["solid"]).contents == {"header"}
    assert read(TEXT["one solid"]).contents == {"names"}
    assert read(TEXT["several solids"]).contents == {"names", "several meshes"}
    assert read(TEXT["no name"]).contents == frozenset()


def test_steps_are_those_of_float32():
    steps = read(binary_stl([[[1.5, 0, 0], [0, 1000, 0], [0, 0, 3]]])).parts[0].steps
    assert steps[0, 0] == 2.0**-23
    assert steps[1, 1] == 2.0**-14
    assert not read(TEXT["one solid"]).parts[0].steps.any()


@pytest.mark.parametrize("content", [BINARY["plain"], BINARY["zero normals"], BINARY["solid"]])
def test_the_mesh_is_what_open3d_reads(write, content):
    mesh, known = read(content).mesh(), _open3d.read(write("a.stl", content))
    for got, wanted in zip(mesh_arrays(mesh), mesh_arrays(known), strict=True):
        np.testing.assert_array_equal(got, wanted)
    assert mesh.has_vertex_normals() == (content != BINARY["zero normals"])
    if mesh.has_vertex_normals():
        np.testing.assert_array_equal(np.asarray(mesh.vertex_normals), np.asarray(known.vertex_normals))


@pytest.mark.parametrize("name", TEXT)
def test_every_text_is_the_same_surface(name):
    surface = Surface.of(read(TEXT[name]).mesh())
    assert (len(surface.vertices), len(surface.triangles)) == (len(V), len(T))
    np.testing.assert_allclose(surface.area, geometry.areas(V, T).sum(), rtol=1e-4)


@pytest.mark.parametrize("content", [b"solid\nendsolid\n", b"solid Empty", bytes(84), bytes(200)])
def test_without_facets_there_is_no_part(content):
    asset = read(content)
    assert asset.parts == ()
    assert asset.with_positions({}) == {PATH.name: content}
    assert not asset.mesh().has_vertices()


WHOLE = TEXT["one solid"]
REFUSED = {
    "a text": (b"Lorem ipsum dolor sit amet\n" * 20, "no STL file"),
    "a few bytes": (b"hello", "it has 5 bytes"),
    "fewer facets": (BINARY["plain"][:-1], "announces 320 facets, which take 16084"),
    "many facets": (bytes(80) + b"\xff" * 4 + bytes(500), "announces 4294967295 facets"),
    "fewer, and solid": (BINARY["solid"][:-1], "announces 320 facets"),
    "cut in a number": (WHOLE[: WHOLE.rindex(b"vertex") + 12], "320 facets begin"),
    "cut in a loop": (WHOLE[: WHOLE.rindex(b"endloop") + 3], "319 loops end"),
    "four corners": (WHOLE.replace(b"endloop", b"vertex 0 0 0\nendloop", 1), "961 vertices instead of 960"),
    "two numbers": (WHOLE.replace(b"vertex", b"vertex 1 2 vertex", 1), "damaged"),
    "a word": (WHOLE.replace(b"vertex ", b"vertex one", 1), "not all numbers"),
    "no normal": (WHOLE.replace(b"facet normal", b"facet", 1), "damaged"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused(name):
    content, words = REFUSED[name]
    with pytest.raises(MeshError) as caught:
        read(content)
    assert words in str(caught.value)


def test_a_number_too_large_for_float32_is_refused():
    asset = read(BINARY["plain"])
    with pytest.raises(MeshError, match="1e\\+39"):
        asset.with_positions({0: asset.parts[0].vertices + 1e39})


SMALL = [
    binary_stl(CORNERS[:3], normals=NORMALS[:3], header=b"solid"),
    text_stl([("a", NORMALS[:2], CORNERS[:2]), ("b", NORMALS[:1], CORNERS[:1])], number="%.3g"),
]


@st.composite
def damaged(draw):
    """A small file with some bytes changed, left out, put in or cut off."""
    content = bytearray(draw(st.sampled_from(SMALL)))
    for _ in range(draw(st.integers(1, 4))):
        at, length = draw(st.integers(0, len(content))), draw(st.integers(0, 8))
        words = st.sampled_from([b"\nsolid ", b"facet", b" vertex ", b"nan", b"-1.#IND", b"1e999", b"\xff" * 4])
        content[at : at + length] = draw(st.binary(max_size=8) | words)
    return bytes(content[: draw(st.integers(0, len(content)))] if draw(st.booleans()) else content)


@settings(max_examples=300, deadline=None)
@given(damaged())
def test_a_damaged_file_is_refused_or_sound(content):
    try:
        asset = read(content)
    except MeshError as error:
        assert_one_line(error)
        return
    assert asset.with_positions({})[PATH.name] == content
    assert isinstance(asset.contents, frozenset)
    assert len(mesh_arrays(asset.mesh())[1]) == len(asset.parts[0].triangles if asset.parts else ())
    for part in asset.parts:
        assert written(asset, part.vertices) == content
        moved = np.where(np.isfinite(part.vertices), 0.25, part.vertices)
        assert len(read(written(asset, moved)).parts[0].vertices) == len(moved)


def assert_one_line(error):
    assert PATH.name in str(error)
    assert "\n" not in str(error)


LARGE = 1_300_000  # bytes; the slow parser takes its time


def test_real_files(shared):
    paths = [path for folder in ("cases", "meshes/defects") for path in sorted(shared(folder).glob("*.stl"))]
    for path in paths:
        content = path.read_bytes()
        asset = read(content)
        assert asset.with_positions({})[PATH.name] == content
        if asset.parts and len(content) < LARGE:
            vertices = asset.parts[0].vertices
            assert written(asset, vertices) == content
            assert_only_moved(asset, content, some_motion(vertices))
    assert len(paths) > 10
