"""PLY files of any header, and damaged ones: read as they are, or refused in a line of text."""

import contextlib
import math
import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fixtures.ply import CODES, SIGNS, any_ply, binary_ply, parse_ply
from fixtures.shapes import icosphere
from o3dmark.errors import MeshError
from o3dmark.files.ply import Ply
from o3dmark.files.references import Source
from o3dmark.mesh.surface import mesh_arrays

PATH = Path("nowhere/a.ply")
WHOLE = sorted(kind for kind, code in CODES.items() if code not in "fd")
FRACTIONS = sorted(set(CODES) - set(WHOLE))
WORDS = st.text("abcdefghijklmnopqrstuvw_0123456789", min_size=1, max_size=8)


def read(content):
    return Ply(Source(PATH, {PATH.name: content}))


def numbers(kind):
    """Any number of a type; of floats what a text can say of them."""
    if CODES[kind] in "fd":
        return st.floats(allow_nan=False, allow_infinity=False, width=8 * struct.calcsize(CODES[kind]))
    bits, signed = 8 * struct.calcsize("=" + CODES[kind]), CODES[kind].islower()
    return st.integers(-(1 << bits - 1) if signed else 0, (1 << bits - signed) - 1)


@st.composite
def properties(draw, taken=()):
    """Some properties, with a strategy for the numbers or lists of each."""
    names = draw(st.lists(WORDS.filter(lambda name: name not in taken), unique=True, max_size=3))
    found = []
    for name in names:
        kind = draw(st.sampled_from(sorted(CODES)))
        if draw(st.booleans()):
            counted = draw(st.sampled_from(WHOLE))
            found.append((f"list {counted} {kind} {name}", st.lists(numbers(kind), max_size=3)))
        else:
            found.append((f"{kind} {name}", numbers(kind)))
    return found


@st.composite
def elements(draw):
    """Vertices and faces with properties in any order, and other elements, in any order too."""
    n = draw(st.integers(3, 8))
    position = [(f"{draw(st.sampled_from(FRACTIONS))} {name}", None) for name in "xyz"]
    vertex = [
        (f"{words.split()[0]} {words.split()[1]}", numbers(words.split()[0])) if strategy is None else (words, strategy)
        for words, strategy in draw(st.permutations([*position, *draw(properties(taken=("x", "y", "z")))]))
    ]
    largest = draw(st.integers(3, 6))
    kind, counted = draw(st.sampled_from(WHOLE)), draw(st.sampled_from(WHOLE))
    corners = st.lists(st.integers(0, n - 1), min_size=draw(st.integers(3, largest)), max_size=largest)
    face = draw(st.permutations([(f"list {counted} {kind} vertex_indices", corners), *draw(properties())]))
    made = [("vertex", vertex, n), ("face", face, draw(st.integers(1, 6)))]
    others = draw(st.lists(WORDS.filter(lambda name: name not in ("vertex", "face")), unique=True, max_size=2))
    made += [(name, draw(properties()), draw(st.integers(0, 3))) for name in others]
    return [
        (name, [words for words, _ in columns], [[draw(strategy) for _, strategy in columns] for _ in range(count)])
        for name, columns, count in draw(st.permutations(made))
    ]


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(elements(), st.sampled_from(sorted(SIGNS)), st.sampled_from(["\n", "\r\n"]), st.data())
def test_any_header_is_read_and_kept(made, form, newline, data):
    lines = data.draw(st.lists(WORDS.map("comment {}".format) | WORDS.map("Made by {}".format), max_size=2))
    content = any_ply(made, form=form, newline=newline, lines=lines)
    asset, parsed = read(content), parse_ply(content)
    vertices = np.column_stack([parsed.column(name) for name in "xyz"])
    faces = [row["vertex_indices"][1] for row in parsed.rows["face"]]
    np.testing.assert_array_equal(asset.parts[0].vertices, vertices)
    fans = [(int(f[0]), int(f[k]), int(f[k + 1])) for f in faces for k in range(1, len(f) - 1)]
    assert [tuple(t) for t in asset.parts[0].triangles.tolist()] == fans
    assert asset.with_positions({0: vertices})[PATH.name] == content

    moved = np.where(data.draw(st.integers(0, 1)), vertices, np.float32(0.5))
    moved[data.draw(st.integers(0, len(vertices) - 1))] = [1.0, -2.0, 0.25]
    after = parse_ply(asset.with_positions({0: moved})[PATH.name])
    assert (after.header, after.rest) == (parsed.header, parsed.rest)
    for name, rows in parsed.rows.items():
        for old, new in zip(rows, after.rows[name], strict=True):
            assert all(old[p] == new[p] for p in old if name != "vertex" or p not in ("x", "y", "z"))
    written = np.column_stack([after.column(name) for name in "xyz"])
    np.testing.assert_allclose(written, moved, rtol=0, atol=0 if form != "ascii" else 2e-8 * np.abs(vertices).max())


V, T = icosphere(1)
FACES = [[[0.5], t] for t in T.tolist()]
MIXED = [[[], t if k % 3 else [*t, 0]] for k, t in enumerate(T.tolist())]
VERTEX = [f"float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")]
SMALL = [
    any_ply(
        [
            ("vertex", VERTEX, np.concatenate([V, V], axis=1).tolist()),
            ("face", ["list uchar float texcoord", "list uchar short vertex_indices"], faces),
            ("tristrips", ["list int int vertex_index"], [[[0, 1, 2, -1, 3, 4, 5]]]),
        ],
        form=form,
    )
    for form in SIGNS
    for faces in (FACES, MIXED)
]


@st.composite
def damaged(draw):
    """A small file with some bytes changed, left out, put in or cut off."""
    content = bytearray(draw(st.sampled_from(SMALL)))
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(content)) | st.integers(0, min(400, len(content))))
        length, new = (
            draw(st.integers(0, 8)),
            draw(st.binary(max_size=8) | st.sampled_from([b"-1", b"999999999", b"\xff" * 4])),
        )
        content[at : at + length] = new
    return bytes(content[: draw(st.integers(0, len(content)))] if draw(st.booleans()) else content)


def assert_one_line(error):
    assert PATH.name in str(error)
    assert "\n" not in str(error)


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
    vertices, triangles = mesh_arrays(asset.mesh())
    for part in asset.parts:
        assert triangles.min(initial=0) >= 0
        assert triangles.max(initial=-1) < len(vertices)
        assert asset.with_positions({0: part.vertices})[PATH.name] == content
        moved = np.where(np.isfinite(part.vertices), 0.25, part.vertices)
        try:
            written = asset.with_positions({0: moved})[PATH.name]
        except MeshError:  # the type of a coordinate was changed to one that cannot hold it
            continue
        np.testing.assert_array_equal(read(written).parts[0].triangles, part.triangles)


HEAD = "ply\nformat {} 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
BINARY, TEXT = HEAD.format("binary_little_endian"), HEAD.format("ascii")
POINTS = {"binary_little_endian": bytes(36), "ascii": b"0 0 0\n1 0 0\n0 1 0\n"}
LIES = {
    "vertices": (BINARY.replace("vertex 3", "vertex 99999999999"), b"", "99999999999 vertices, but 3 can"),
    "vertices of a text": (TEXT.replace("vertex 3", "vertex 99999999999"), b"", "99999999999 vertices, but 3 can"),
    "faces": (BINARY + "element face 4000000000\nproperty list uchar int vertex_indices\n", b"", "4000000000 faces"),
    "a polygon": (
        BINARY + "element face 1\nproperty list uint int vertex_indices\n",
        b"\xff" * 4 + bytes(99),
        "1 faces, but 0",
    ),
    "below zero": (
        BINARY + "element face 1\nproperty list int int vertex_indices\n",
        b"\xfd\xff\xff\xff",
        "row 0 of element face is -3",
    ),
    "half a corner": (TEXT + "element face 1\nproperty list int int vertex_indices\n", b"2.5 0 1 2", "no whole number"),
    "a corner between": (TEXT + "element face 1\nproperty list int int vertex_indices\n", b"3 0 1.5 2", "vertex 1.5"),
    "a corner beyond": (
        TEXT + "element face 1\nproperty list int int vertex_indices\n",
        b"3 0 1 3",
        "vertex 3, which is none of the 3",
    ),
    "other rows": (BINARY + "element edge 9\nproperty int vertex1\n", bytes(12), "9 rows of edge, but 3 can"),
    "a word": (TEXT + "element face 1\nproperty list int int vertex_indices\n", b"3 0 one 2", "'one' is no number"),
    "no count": (BINARY.replace("vertex 3", "vertex -3"), b"", "'vertex -3'"),
    "no type": (BINARY.replace("float x", "real x"), b"", "'real x'"),
    "no x": (BINARY.replace("float x", "float a"), b"", "no numbers x, y, z"),
    "no element": ("ply\nformat ascii 1.0\nproperty float x\n", b"", "before any element"),
    "no format": (BINARY.replace("binary_little_endian", "binary"), b"", "no format"),
    "empty faces": (
        BINARY + "element face 9\nproperty list uchar int vertex_indices\n",
        bytes(9),
        "faces have 0 corners",
    ),
}


@pytest.mark.parametrize("lie", LIES)
def test_a_header_that_lies_is_found_out(lie):
    head, body, words = LIES[lie]
    form = head.split()[2]
    with pytest.raises(MeshError) as caught:
        read(head.encode() + b"end_header\n" + POINTS.get(form, b"") + body)
    assert words in str(caught.value)


LARGE = {
    "one polygon of bytes": (1, "list int uchar", struct.pack("<i", 60_000_000) + bytes(60_000_000)),
    "a million counts": (20_000_000, "list uchar uchar", b"\1\0" * 20_000_000),
    "polygons of bytes": (200_000, "list uchar uchar", (b"\xff" + bytes(255)) * 200_000),
    "lies of a billion": (1_000_000_000, "list uchar int", bytes(30_000_000)),
}


@pytest.mark.parametrize("name", LARGE)
def test_memory_is_at_most_ten_times_the_file(name):
    count, kind, body = LARGE[name]
    head = BINARY + f"element face {count}\nproperty {kind} vertex_indices\nend_header\n"
    content = head.encode() + bytes(36) + body
    tracemalloc.start()
    with contextlib.suppress(MeshError):
        read(content)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 9 * len(content) + (1 << 28)  # and the content itself


def test_a_long_header_and_a_text_of_one_word_take_no_time():
    names = "".join(f"property float p{k}\n" for k in range(20_000))
    content = BINARY + names + "end_header\n"
    with pytest.raises(MeshError, match="0 can be read"):
        read(content.encode() + bytes(36))
    with pytest.raises(MeshError):
        read((TEXT + "end_header\n").encode() + b"1" * 10_000_000 + b"#")
    assert math.isinf(read((TEXT + "end_header\n").encode() + b"9" * 10_000 + b" 0" * 8).mesh().get_max_bound()[0])


def test_a_body_may_begin_with_a_line_feed():
    """After a header whose lines end in carriage returns alone."""
    x = struct.unpack("<f", b"\n\n\n\n")[0]
    content = binary_ply([[x, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], kind="float")
    head = content.index(b"end_header") + 11
    asset = read(content[:head].replace(b"\n", b"\r") + content[head:])
    assert asset.parts[0].vertices[0, 0] == x
