"""OBJ and OFF files written again: a parser of the tests' own sees that nothing but positions and normals differ."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fixtures.shapes import icosphere, rotation
from fixtures.text_files import Parsed, parse_obj, parse_off
from o3dmark.errors import MeshError
from o3dmark.files.obj import Obj
from o3dmark.files.off import Off
from o3dmark.files.references import Source
from o3dmark.mesh import geometry

V, T = icosphere(2)
PARSERS = {"obj": (Obj, parse_obj), "off": (Off, parse_off)}
HEALTH = settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
LARGE = 3_000_000  # bytes: the slow parser takes its time


def opened(kind, content, folder="nowhere"):
    path = Path(folder) / f"a.{kind}"
    return PARSERS[kind][0](Source(path, {path.name: content}))


def some_motion(vertices, seed=0, size=1e-3):
    """About half of the positions moved a little, equal ones alike."""
    rng = np.random.default_rng(seed)
    places, place = np.unique(vertices, axis=0, return_inverse=True)
    moved = places + size * np.ptp(places) * rng.normal(size=places.shape)
    moved = np.where(rng.random((len(places), 1)) < 0.5, moved, places)
    return moved[place.ravel()]


def assert_only_moved(kind, content, goal=None):
    """Only words of vertices that move differ, and of their normals; the new file, as parsed."""
    asset, before = opened(kind, content), PARSERS[kind][1](content)
    vertices = asset.parts[0].vertices
    np.testing.assert_array_equal(vertices, np.array(before.numbers(before.vertices)))
    fans = [[f[0], f[k], f[k + 1]] for f in before.faces for k in range(1, len(f) - 1)]
    if all(len(face) < 4 for face in before.faces):
        assert asset.parts[0].triangles.tolist() == fans
    assert asset.with_positions({})[asset.name] == content
    assert asset.with_positions({0: vertices})[asset.name] == content

    goal = some_motion(vertices) if goal is None else goal
    after: Parsed = PARSERS[kind][1](asset.with_positions({0: goal})[asset.name])
    assert after.rest == before.rest
    assert after.faces == before.faces
    old, new = (np.array(each.words(each.vertices), object) for each in (before, after))
    assert (old == new)[goal == vertices].all()
    extent = geometry.diagonal(vertices)
    np.testing.assert_allclose(after.numbers(after.vertices), goal, rtol=1e-15, atol=1e-8 * extent)
    return after


# ---- OBJ ----


def rows(points=V, form="{:.6f}", word="v"):
    return [f"{word} " + " ".join(form.format(x) for x in point) for point in points]


def faces(triangles=T, form="{0}"):
    return ["f " + " ".join(form.format(c + 1) for c in t) for t in triangles.tolist()]


def everything(newline):
    """What people have asked for at once: names, groups, quads, colours, free forms, lines that go on, odd blanks."""
    colours = [f"{row} 1 0.5 0.25" for row in rows()[:100]]
    head = ["# made by hand \\", "mtllib a b.mtl other.mtl", "mtllib  third.mtl  ", "o caf\xe9 #1", "", "\t"]
    body = [*colours, *(row.replace(" ", "  \t") + "  # the rest" for row in rows()[100:])]
    body += [*rows(word="vn", form="{:.4f}"), *(f"vt {u} 0.5 0" for u in np.linspace(0, 1, 7)), "vp 0.1 0.2", "vp 0.5"]
    groups = ["g left right", "s 1", "usemtl skin of #2", *faces(T[:100], "{0}/1/{0}")]
    groups += ["f 1/1/1 2/2/2 \\", " 3/3/3 \\", "4/4/4", "l 1 2 3", "p 5", "f -1//-1 -2//-2 -3//-3", "g", "s off"]
    groups += [*faces(T[100:]), "curv2 1 2", "v 9 9 9", "f -1 1 2", "end", "# and no line's end"]
    return newline.join([*head, *body, *groups]).encode("latin-1")


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_nothing_else_of_an_obj_changes(newline):
    content = everything(newline)
    after = assert_only_moved("obj", content)
    assert len(after.vertices) == len(V) + 1
    kinds = {"polygons", "lines", "points", "normals", "texture coordinates", "vertex colours", "materials", "names"}
    assert opened("obj", content).contents == kinds | {"groups", "comments", "free forms"}


@pytest.mark.parametrize("head", [b"", b"\xef\xbb\xbf", b"\xef\xbb\xbf\n", b"\n\n  \n"], ids=repr)
@pytest.mark.parametrize("tail", [b"", b"\n", b" ", b"\r\n\r\n"], ids=repr)
def test_an_obj_may_begin_and_end_anyhow(head, tail):
    assert_only_moved("obj", head + "\n".join([*rows(), *faces()]).encode() + tail)


@pytest.mark.parametrize("form", ["{:.2f}", "{:+.5f}", "{:e}", "{:.17g}", "{:.25f}", "{:.0f}.", "{:E}"])
def test_whatever_the_numbers_look_like_those_that_move_get_the_digits_that_they_need(form):
    points = V * 37.0
    content = "\n".join([*rows(points, form), *faces()]).encode()
    read = np.array(parse_obj(content).numbers(parse_obj(content).vertices))
    goal = some_motion(read, size=1e-3)
    after, moved = assert_only_moved("obj", content, goal), (goal != read).any(axis=1)
    words = [word for moves, row in zip(moved, after.words(after.vertices), strict=True) if moves for word in row]
    assert len(words) > 100
    decimals = {len(word.partition(b".")[2]) for word in words}
    assert min(decimals) >= 6  # 1e-8 of a diagonal of 128
    assert not any(b"e" in word.lower() for word in words)


@pytest.mark.parametrize("far", [0.0, 5e5, 4.6e6, -1e9])
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_as_many_digits_as_the_motion_needs(far, size):
    """UTM metres: a mark of a thousandth of the size of a thing stands in digits that the file has to be given."""
    points = np.round(V * size + far, 3)
    content = "\n".join([*rows(points, "{:.3f}"), *faces()]).encode()
    read = np.array(parse_obj(content).numbers(parse_obj(content).vertices))
    moved = read + 1e-6 * size * np.random.default_rng(0).standard_normal(read.shape)
    written = opened("obj", content).with_positions({0: moved})["a.obj"]
    now = np.array(parse_obj(written).numbers(parse_obj(written).vertices))
    assert np.abs(now - moved).max() <= max(1e-8 * geometry.diagonal(read), np.spacing(abs(far) + size))


def test_normals_turn_with_the_surface():
    """A small rigid turn of all: each normal turns alike, to first order, and stays as long as it was."""
    turn = Rotation.from_rotvec([0.01, 0.02, -0.01]).as_matrix()
    content = "\n".join([*rows(form="{:.9f}"), *rows(2.0 * V, "{:.9f}", "vn"), *faces(form="{0}//{0}")]).encode()
    asset = opened("obj", content)
    after = parse_obj(asset.with_positions({0: asset.parts[0].vertices @ turn.T})["a.obj"])
    np.testing.assert_allclose(after.numbers(after.normals), 2.0 * V @ turn.T, atol=2e-3)  # of 0.04 that they turn
    np.testing.assert_allclose(np.linalg.norm(after.numbers(after.normals), axis=1), 2.0, atol=1e-8)


def test_normals_that_no_face_names_stay():
    content = "\n".join([*rows(), *rows(form="{:.3f}", word="vn"), *faces()]).encode()
    asset, before = opened("obj", content), parse_obj(content)
    after = parse_obj(asset.with_positions({0: asset.parts[0].vertices @ rotation(1).T})["a.obj"])
    assert after.words(after.normals) == before.words(before.normals)


@pytest.mark.parametrize("word", ["nan", "inf", "-inf", "1e999"])
def test_vertices_that_are_no_numbers_are_kept_where_they_stay(word):
    content = "\n".join([*rows(), f"v {word} 0 0", *faces()]).encode()
    asset = opened("obj", content)
    moved = np.array(asset.parts[0].vertices)
    moved[:10] += 0.01
    written = asset.with_positions({0: moved})["a.obj"]
    assert f"v {word} 0 0".encode() in written


# ---- OFF ----


def off(kind="OFF", vertex=lambda k: "", face=lambda k: "", newline="\n", counts="{} {} 0", points=V):  # noqa: ARG005
    head = [kind, counts.format(len(points), len(T))]
    body = [f"{x:.6f} {y:.6f} {z:.6f}{vertex(k)}" for k, (x, y, z) in enumerate(points.tolist())]
    body += [f"3 {a} {b} {c}{face(k)}" for k, (a, b, c) in enumerate(T.tolist())]
    return newline.join([*head, *body, ""]).encode()


def normal(k):
    return "".join(f" {x:.4f}" for x in V[k])


OFFS = {
    "plain": off(),
    "no edges": off(counts="{} {}"),
    "crlf": off(newline="\r\n"),
    "cr": off(newline="\r"),
    "small letters": off("off"),
    "face colours as bytes": off(face=lambda k: f" {k % 256} 0 255"),
    "face colours, four": off(face=lambda k: f" 0.5 0.25 {k / 400:.3f} 1"),
    "face colours by number": off(face=lambda k: f" {k % 8}"),
    "some faces coloured": off(face=lambda k: " 255 0 0" if k % 2 else ""),
    "vertex colours": off("COFF", vertex=lambda k: f" {k % 256} 10 20 255"),
    "three numbers of a colour": off("COFF", vertex=lambda _: " 0.1 0.2 0.3"),
    "normals": off("NOFF", vertex=normal),
    "colours and normals": off("CNOFF", vertex=lambda k: f"{normal(k)} 1 2 3 255"),
    "texture coordinates": off("STOFF", vertex=lambda k: f" 0.{k} 0.5"),
    "all of it": off("STCNOFF", vertex=lambda k: f"{normal(k)} 1 2 3 255 0.5 0.25", face=lambda _: " 1 0 0"),
    "comments": b"# first\n" + off(vertex=lambda _: " # v", face=lambda _: "\t# 3 1 2").replace(b"OFF", b"OFF # kind"),
    "blank lines": off().replace(b"\n", b"\n\n \n"),
    "mark": b"\xef\xbb\xbf" + off(),
    "no last end": off().rstrip(),
}


@pytest.mark.parametrize("name", OFFS)
def test_nothing_else_of_an_off_changes(name):
    after = assert_only_moved("off", OFFS[name])
    assert len(after.vertices) == len(V)
    assert len(after.faces) == len(T)


def test_polygons_and_lines_of_an_off_stay():
    content = off(counts=f"{{}} {len(T) + 3} 0") + b"4 0 1 2 3\n2 0 1\n1 5\n"
    after = assert_only_moved("off", content)
    assert after.faces[-3:] == [[0, 1, 2, 3], [0, 1], [5]]
    assert opened("off", content).contents == {"polygons", "lines", "points"}


@pytest.mark.parametrize(("kind", "words"), [("4OFF", "three dimensions"), ("nOFF", "three"), ("OFF BINARY", "binary")])
def test_other_kinds_of_off_are_refused_by_name(kind, words):
    with pytest.raises(MeshError, match=words):
        opened("off", off(kind))


# ---- any ----

NUMBERS = st.floats(-1e6, 1e6, allow_nan=False).map(lambda x: round(x, 6))
FORMS = st.sampled_from(["{:.6f}", "{:g}", "{:+.3f}", "{:.9e}", "{!r}", "{:.0f}"])
GAPS = st.sampled_from([" ", "  ", "\t", " \t "])
ENDS = st.sampled_from(["\n", "\r\n", "\r", "\n\n", " \n", "\t\r\n"])
WORDS = st.text("abcdefghij_.-/0123456789", min_size=1, max_size=8)


@st.composite
def any_obj(draw):
    """Lines of all kinds in any order, a face after the vertices that it names."""
    text, n, n_normals = [], 0, 0
    gap = draw(GAPS)
    for _ in range(draw(st.integers(3, 25))):
        kind = draw(st.sampled_from("vvvvnftgoulp#x"))
        if kind == "v" or n < 3:
            form = draw(FORMS)
            numbers = [form.format(draw(NUMBERS)) for _ in range(3)] + ["0.5"] * draw(st.sampled_from([0, 0, 1, 3, 4]))
            words, n = ["v", *numbers], n + 1
        elif kind == "n":
            words, n_normals = ["vn", *(f"{draw(st.floats(-1, 1)):.4f}" for _ in range(3))], n_normals + 1
        elif kind == "f":
            corners = [draw(st.sampled_from([k, k - n - 1])) for k in draw(st.permutations(range(1, n + 1)))]
            size = draw(st.integers(3, min(n, 5)))
            tail = draw(st.sampled_from(["", "/1", "//", "/"] + ["//1"] * (n_normals > 0)))
            words = ["f", *(f"{corner}{tail}" for corner in corners[:size])]
            if draw(st.integers(0, 4)) == 0:
                words.insert(2, "\\\n")
        else:
            word = {"t": "vt", "g": "g", "o": "o", "u": "usemtl", "l": "l", "p": "p", "#": "#", "x": "x_unknown"}[kind]
            words = [word, *(draw(st.lists(WORDS, min_size=1, max_size=3)) if kind not in "lpt" else ["1", "1"])]
        text += [gap.join(words), draw(ENDS)]
    text += [gap.join(["f", *map(str, range(1, n + 1))]), "\n"]  # a vertex that no face has may be written anyhow
    return draw(st.sampled_from(["", "\ufeff"])) + "".join(text[: -1 if draw(st.booleans()) else None])


@HEALTH
@given(any_obj(), st.integers(0, 2**32 - 1))
def test_any_obj_changes_in_its_positions_only(text, seed):
    content = text.encode()
    before = parse_obj(content)
    vertices = np.array(before.numbers(before.vertices))
    assume(geometry.diagonal(vertices) > 0.0)
    assert_only_moved("obj", content, some_motion(vertices, seed))


@st.composite
def any_off(draw):
    """A vertex and a face a line, the words and lines any way apart, comments anywhere."""
    letters = draw(st.sampled_from(["", "C", "N", "CN", "ST", "STCN"]))
    n, gap = draw(st.integers(3, 8)), draw(GAPS)
    width = (3 if "N" in letters else 0) + (4 if "C" in letters else 0) + (2 if "ST" in letters else 0)
    form = draw(FORMS)
    lines = [[form.format(draw(NUMBERS)) for _ in range(3)] + ["0.5"] * width for _ in range(n)]
    sizes = draw(st.lists(st.integers(1, min(n, 5)), min_size=1, max_size=6))
    colour = st.sampled_from([[], ["7"], ["255", "0", "0"], ["0.5", "0.5", "0.5", "1"]])
    lines += [[str(n), *map(str, range(n))]]  # a vertex that no face has may be written anyhow
    lines += [[str(size), *map(str, draw(st.permutations(range(n)))[:size]), *draw(colour)] for size in sizes]
    counts = [str(n), str(len(sizes) + 1), *(["0"] if draw(st.booleans()) else [])]
    head = [[letters + "OFF"], counts] if draw(st.booleans()) else [[letters + "OFF", *counts]]
    comment = st.sampled_from(["", "", " # 1 2 3", "#"])
    return "".join(gap.join(words) + draw(comment) + draw(ENDS) for words in [*head, *lines])


@HEALTH
@given(any_off(), st.integers(0, 2**32 - 1))
def test_any_off_changes_in_its_positions_only(text, seed):
    content = text.encode()
    before = parse_off(content)
    vertices = np.array(before.numbers(before.vertices))
    assume(geometry.diagonal(vertices) > 0.0)
    assert_only_moved("off", content, some_motion(vertices, seed))


@pytest.mark.parametrize("kind", ["obj", "off"])
def test_real_files(shared, kind):
    """Those whose vertices all are in faces: what is in none may be written anyhow."""
    examined = 0
    for folder in (shared("cases"), shared("meshes/extra"), shared("meshes/paper")):
        for path in sorted(folder.rglob(f"*.{kind}")):
            content = path.read_bytes()
            if len(content) < LARGE:
                part = opened(kind, content, path.parent).parts[0]
                if len(np.unique(part.triangles)) == len(part.vertices):
                    assert_only_moved(kind, content)
                    examined += 1
    if not examined:
        pytest.skip(f"no {kind} file is beside the repo")
