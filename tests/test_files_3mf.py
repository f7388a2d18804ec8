"""3MF: the archive comes back with nothing but the digits of vertices changed."""

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fixtures.threemf_files import (
    CORE,
    SQUARE,
    archive,
    entries,
    mesh,
    meshes,
    model,
    triangle_list,
    vertex_list,
    without_coordinates,
)
from o3dmark.errors import MeshError
from o3dmark.files.references import Source
from o3dmark.files.threemf import ThreeMf

ROOT = "3D/3dmodel.model"
SHIFT = np.array([0.125, -1 / 3, 1e-5])


def opened(content, name="part.3mf"):
    return ThreeMf(Source(Path(name), {name: content}))


def moved(content, vertices):
    asset = opened(content)
    return asset.with_positions(vertices)[asset.name]


def assert_only_positions_differ(before, after):
    """Everything of the archive is as before; of model files, all but coordinates; of those, all that did not move."""
    (comment, infos, files), (comment_after, infos_after, files_after) = entries(before), entries(after)
    assert (comment, infos, list(files)) == (comment_after, infos_after, list(files_after))
    for name, text in files.items():
        assert without_coordinates(text) == without_coordinates(files_after[name])
        assert name.endswith(".model") or text == files_after[name]


def assert_moves(content, entry=ROOT):
    """Each mesh can be moved alone, and then has the new positions and nothing else changes. Returns its asset."""
    asset = opened(content)
    assert asset.with_positions({}) == {asset.name: content}
    assert asset.with_positions({n: part.vertices for n, part in enumerate(asset.parts)}) == {asset.name: content}
    for number, part in enumerate(asset.parts):
        new = part.vertices + SHIFT
        new[0] = part.vertices[0]
        after = asset.with_positions({number: new})[asset.name]
        assert_only_positions_differ(content, after)
        again = opened(after)
        for other in range(len(asset.parts)):
            wanted = new if other == number else asset.parts[other].vertices
            np.testing.assert_allclose(again.parts[other].vertices, wanted, rtol=0, atol=1e-7)
            np.testing.assert_array_equal(again.parts[other].vertices[0], asset.parts[other].vertices[0])
    return asset


WRITTEN = {
    "plain": model(),
    "single quotes": model(mesh(vertices=vertex_list(pattern="<vertex x='{}' y='{}' z='{}'/>"))),
    "mixed quotes": model(mesh(vertices=vertex_list(pattern="<vertex x='{}' y=\"{}\" z='{}'/>"))),
    "attributes around": model(mesh(vertices=vertex_list(pattern='<vertex a="8" z="{2}" x = "{0}" y="{1}" w="7" />'))),
    "pairs of tags": model(mesh(vertices=vertex_list(pattern='<vertex x="{}" y="{}" z="{}"></vertex>'))),
    "comments": model(mesh(vertices=vertex_list() + '<!-- <vertex x="1" y="2" z="3"/> </vertices> --> <?a <vertex?>')),
    "carriage returns": model().replace("\n", "\r\n"),
    "mixed": model(mesh(vertices=vertex_list()[:-2] + '\tname="&lt;" />\n')),
    "white space within": model(mesh(vertices=vertex_list(pattern='<vertex x=" {} " y="\n{}" z="{}"/>'))),
    "no line ends": model(mesh(vertices=vertex_list(pattern='<vertex x="{}" y="{}" z="{}"/>'))),
    "a lone vertex more": model(mesh(vertices=vertex_list((*SQUARE, (1, 2, 3))))),
    "byte order mark": "\ufeff" + model(),
    "declared": model(head='<?xml version="1.0" encoding="UTF-8" standalone="yes"?>\n<!-- ü <vertices> -->'),
    "exponents": model(mesh(vertices=vertex_list(((0, 0, 0), ("1e1", 0, "-2.5E-3"), (".5", "+4.", 0), (1, 1, 1))))),
    "character references": model(mesh(vertices=vertex_list((("&#49;0", 0, 0), *SQUARE[1:])))),
    "slicer's paint": model(mesh(triangles=triangle_list() + '<triangle v1="0" v2="1" v3="3" paint_color="8"/>')),
    "properties": model(mesh(triangles=triangle_list(pattern='<triangle v1="{}" v2="{}" v3="{}" pid="5" p1="0"/>'))),
}


@pytest.mark.parametrize("text", WRITTEN.values(), ids=WRITTEN.keys())
def test_only_positions_differ_however_it_is_written(text):
    asset = assert_moves(archive(text))
    vertices, triangles = meshes(text)["1"]
    np.testing.assert_array_equal(asset.parts[0].vertices, vertices)
    np.testing.assert_array_equal(asset.parts[0].triangles, triangles)


def test_names_spaces_with_prefixes():
    plain = model().replace("<model", "<c:model").replace(f'xmlns="{CORE}"', f'xmlns:c="{CORE}"')
    for tag in ("resources", "build", "object", "mesh", "vertices", "triangles", "vertex", "triangle", "item"):
        plain = plain.replace(f"<{tag}", f"<c:{tag}").replace(f"</{tag}", f"</c:{tag}")
    asset = assert_moves(archive(plain.replace("</model", "</c:model")))
    np.testing.assert_array_equal(asset.parts[0].vertices, SQUARE)


def test_vertices_of_other_names_spaces_stay():
    outline = vertex_list(pattern='<s:vertex x="{}" y="{}"/>')
    slices = (
        '<s:slicestack xmlns:s="http://schemas.microsoft.com/3dmanufacturing/slice/2015/07" id="9"><s:slice ztop="1">'
        f"<s:vertices>{outline}</s:vertices></s:slice></s:slicestack>"
    )
    asset = assert_moves(archive(model(slices + mesh())))
    assert len(asset.parts) == 1
    assert "extension slice" in asset.contents


@pytest.mark.parametrize("streamed", [False, True])
@pytest.mark.parametrize("compression", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_archives_of_every_kind(streamed, compression):
    before = archive(compression=compression, streamed=streamed)
    assert_moves(before)
    assert_moves(b"#!/bin/sh\n" + before)  # what stands before an archive is none of its business


def test_archives_with_64_bit_sizes():
    kept = io.BytesIO()
    with zipfile.ZipFile(kept, "w", zipfile.ZIP_DEFLATED) as out:
        for name, content in entries(archive())[2].items():
            with out.open(name, "w", force_zip64=True) as file:
                file.write(content)
    assert_moves(kept.getvalue())


def test_what_did_not_change_keeps_its_compressed_bytes():
    picture = np.random.default_rng(0).bytes(5000)
    before = archive(others=[("Metadata/thumbnail.png", picture)])
    asset = opened(before)
    after = asset.with_positions({0: asset.parts[0].vertices + SHIFT})[asset.name]
    start = before.index(picture[:100])
    assert before[: start + 5000] == after[: start + 5000]


def test_digits():
    """As many as there were and as are needed; none change where nothing moved; equal positions stay equal."""
    asset = opened(archive())
    new = asset.parts[0].vertices.copy()
    new[1, 0], new[2, 0] = 10.00000012, 10.5
    text = entries(asset.with_positions({0: new})[asset.name])[2][ROOT]
    assert b'<vertex x="10.0000001" y="0" z="0" />' in text
    assert b'<vertex x="10.5" y="7.25" z="0" />' in text


def test_equal_positions_stay_equal():
    vertices = [(x, y, 1e-12) for x in (0, 0.1) for y in ("1e-3", 0.001, 0.5)]
    before = archive(model(mesh(vertices=vertex_list(vertices), triangles=triangle_list([(0, 2, 3)]))))
    new = opened(before).parts[0].vertices.copy()
    new[:] = new[2]
    after = opened(moved(before, {0: new})).parts[0].vertices
    assert (after == after[0]).all()


COMPONENTS = (
    mesh(1)
    + mesh(2, attributes=' name="second" pid="4"')
    + '<object id="3"><components><component objectid="1" transform="2 0 0 0 1 0 0 0 1 5 6 7"/>'
    '<component objectid="2"/></components></object>'
    '<object id="4"><components><component objectid="3" transform="0 1 0 -1 0 0 0 0 1 0 0 0"/></components></object>'
    + mesh(5)
)


def test_objects_stand_where_the_build_and_components_put_them():
    build = '<item objectid="4" transform="1 0 0 0 1 0 0 0 1 100 0 0"/><item objectid="1"/>'
    asset = assert_moves(archive(model(COMPONENTS, build)))
    first, second, alone = asset.parts
    assert [part.name for part in asset.parts] == ["object 1", "second", "object 5"]
    assert (len(first.placements), len(second.placements), len(alone.placements)) == (2, 1, 1)
    np.testing.assert_array_equal(alone.placements[0], np.eye(4))
    x, y, z = 1.0, 2.0, 3.0
    inner = np.array([2 * x + 5, y + 6, z + 7])  # a row times a matrix
    outer = np.array([-inner[1] + 100, inner[0], inner[2], 1])
    places = {tuple(place @ [x, y, z, 1]) for place in first.placements}
    assert places == {tuple(outer), (x, y, z, 1)}
    assert {"several meshes", "names", "materials", "nodes"} <= asset.contents


def test_models_in_further_files():
    """As the production extension has it, and slicers write it."""
    root = model(
        '<object id="8"><components><component p:path="/3D/Objects/a.model" objectid="1"/>'
        '<component p:path="/3D/Objects/b%20c.model" objectid="1" transform="1 0 0 0 1 0 0 0 1 0 0 9"/></components>'
        "</object>",
        '<item objectid="8"/>',
        ' requiredextensions="p"',
    )
    others = [("3D/Objects/a.model", model(build="")), ("3D/Objects/b c.model", model(mesh() + mesh(2), build=""))]
    asset = assert_moves(archive(root, others))
    assert [len(part.placements) for part in asset.parts] == [1, 1, 1]
    assert asset.parts[1].placements[0, 2, 3] == 9
    assert "extension production" in asset.contents


def test_contents():
    assert opened(archive()).contents == {"metadata"}  # of the slicer: last.config
    colours = (
        '<m:colorgroup id="5"><m:color color="#fff"/></m:colorgroup><m:texture2d id="6" path="/3D/Texture/a.png"/>'
    )
    text = model(colours + mesh(attributes=' name="n"'), attributes="", before="<!-- c -->")
    assert opened(archive(text)).contents == {"metadata", "vertex colours", "textures", "names", "comments"}
    assert "property paint_color" in opened(archive(WRITTEN["slicer's paint"])).contents
    assert "materials" in opened(archive(WRITTEN["properties"])).contents


CHAIN = "".join(
    f'<object id="{i}"><components><component objectid="{i + 1}"/><component objectid="{i + 1}"/></components></object>'
    for i in range(2, 60)
)
REFUSED = {
    "not a zip": (b"solid nothing", "zip"),
    "cut": (archive()[:900], "zip"),
    "bad XML": (archive(model() + "<"), "damaged"),
    "no model": (archive("<nothing/>"), "no 3MF model"),
    "document type": (archive(model(head='<!DOCTYPE a [<!ENTITY b "c">]>')), "DOCTYPE"),
    "UTF-16": (archive(model().encode("utf-16")), "UTF-8"),
    "Latin": (archive(model(head='<?xml version="1.0" encoding="ISO-8859-1"?>')), "UTF-8"),
    "no number": (archive(model(mesh(vertices=vertex_list((("a", 0, 0), *SQUARE))))), "'a'"),
    "no coordinate": (archive(model().replace('z="', 'q="')), "number"),
    "underscore": (archive(model(mesh(vertices=vertex_list((("1_0", 0, 0), *SQUARE))))), "'1_0'"),
    "infinite": (archive(model(mesh(vertices=vertex_list((("1e999", 0, 0), *SQUARE))))), "'1e999'"),
    "vertex beyond": (archive(model(mesh(triangles=triangle_list([(0, 1, 4)])))), "beyond"),
    "negative vertex": (archive(model(mesh(triangles=triangle_list([(0, 1, -1)])))), "vertex"),
    "two lists": (archive(model(mesh(vertices=vertex_list() + "</vertices><vertices>"))), "two lists"),
    "two meshes": (archive(model(mesh(triangles=triangle_list() + "</triangles></mesh><mesh><triangles>"))), "two"),
    "one id twice": (archive(model(mesh() + mesh())), "one id"),
    "no such object": (archive(model(build='<item objectid="7"/>')), "not there"),
    "no such file": (archive(model(build='<item objectid="1" p:path="/3D/b.model"/>')), "b.model"),
    "transform": (archive(model(build='<item objectid="1" transform="1 2 3"/>')), "twelve"),
    "its own part": (
        archive(model('<object id="1"><components><component objectid="1"/></components></object>')),
        "itself",
    ),
    "without measure": (archive(model(mesh(60) + CHAIN, '<item objectid="2"/>')), "100000"),
    "nested": (archive(model(before="<a>" * 99 + "</a>" * 99)), "deep"),
    "empty": (b"", "empty"),
}


@pytest.mark.parametrize(("content", "word"), REFUSED.values(), ids=REFUSED.keys())
def test_refusals(content, word):
    with pytest.raises(MeshError) as caught:
        opened(content)
    text = str(caught.value)
    assert word in text
    assert "part.3mf" in text
    assert "\n" not in text


def test_encrypted_archives_are_refused():
    content = bytearray(archive())
    content[content.index(b"PK\x01\x02") + 8] |= 1
    with pytest.raises(MeshError, match="encrypted"):
        opened(bytes(content))


def test_a_directory_that_runs_into_its_end_is_refused():
    """The comment of the last entry is said to be longer than there is room for."""
    content = bytearray(archive())
    content[content.rindex(b"PK\x01\x02") + 32] += 4
    [part] = opened(bytes(content)).parts
    with pytest.raises(MeshError, match="directory is longer"):
        moved(bytes(content), {0: part.vertices + SHIFT})


def test_bombs_are_refused():
    """An archive that says how much it holds, and one that lies."""
    huge = io.BytesIO()
    with zipfile.ZipFile(huge, "w", zipfile.ZIP_DEFLATED) as out:
        for number in range(9):
            with out.open(f"{number}.model", "w") as file:
                for _ in range(32):
                    file.write(bytes(1 << 20))
    with pytest.raises(MeshError, match="256 MiB"):
        opened(huge.getvalue())
    liar = archive(model(before=" " * (1 << 20)))
    at = liar.index(b"PK\x01\x02", liar.index(b"PK\x01\x02", liar.index(b"PK\x01\x02") + 1) + 1)
    with pytest.raises(MeshError):
        opened(liar[: at + 24] + (1000).to_bytes(4, "little") + liar[at + 28 :])


def test_long_text_is_read_in_pieces():
    """Over a megabyte between tags, and a list that no piece holds whole."""
    many = np.random.default_rng(0).normal(size=(60_000, 3))
    text = model(
        mesh(vertices=vertex_list(many.tolist()), triangles=triangle_list([(0, 1, 59_999)] * 50_000)),
        before=f"<metadata name='a'>{'x' * 5_000_000}</metadata>",
    )
    before = archive(text)
    asset = opened(before)
    np.testing.assert_array_equal(asset.parts[0].vertices, many)
    assert len(asset.parts[0].triangles) == 50_000
    after = asset.with_positions({0: many + SHIFT})[asset.name]
    assert_only_positions_differ(before, after)
    np.testing.assert_allclose(meshes(entries(after)[2][ROOT])["1"][0], many + SHIFT, rtol=0, atol=1e-7)


def test_a_fresh_parser_agrees_across_pieces(monkeypatch):
    """However the bytes are cut, the same is read."""
    monkeypatch.setattr("o3dmark.files.threemf.PIECE", 37)
    for text in WRITTEN.values():
        asset = assert_moves(archive(text))
        np.testing.assert_array_equal(asset.parts[0].vertices, meshes(text)["1"][0])


numbers = (
    st.floats(-1e6, 1e6)
    .map(lambda x: st.sampled_from([repr(x), f"{x:.3f}", f"{x:e}", f"{x:+g}"]))
    .flatmap(lambda texts: texts)
)


@settings(max_examples=50, deadline=None)
@given(
    st.lists(st.tuples(numbers, numbers, numbers), min_size=3, max_size=6),
    st.lists(st.floats(-1e3, 1e3), min_size=9, max_size=9),
)
def test_numbers_of_every_sort_go_through(rows, new):
    text = model(mesh(vertices=vertex_list(rows), triangles=triangle_list([(0, 1, 2)])))
    content = archive(text)
    asset = opened(content)
    vertices = asset.parts[0].vertices
    np.testing.assert_array_equal(vertices, meshes(text)["1"][0])
    changed = vertices.copy()
    changed[:3] = np.reshape(new, (3, 3))
    after = asset.with_positions({0: changed})[asset.name]
    assert_only_positions_differ(content, after)
    diagonal = np.linalg.norm(np.ptp(vertices, axis=0)) or 1e-6
    np.testing.assert_allclose(opened(after).parts[0].vertices, changed, rtol=0, atol=max(1e-8 * diagonal, 1e-13))


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_damage_gives_a_sound_asset_or_a_clear_error(data):
    """In the archive, and in the model inside it."""
    text = bytearray(model(COMPONENTS, '<item objectid="4"/>').encode())
    content = bytearray(archive(bytes(text)))
    for target in (text, content):
        for _ in range(data.draw(st.integers(0, 3))):
            target[data.draw(st.integers(0, len(target) - 1))] = data.draw(st.integers(0, 255))
    for damaged in (archive(bytes(text)), bytes(content)):
        try:
            asset = opened(damaged)
            after = asset.with_positions({n: part.vertices + SHIFT for n, part in enumerate(asset.parts)})
        except MeshError as error:
            assert "part.3mf" in str(error)  # noqa: PT017
            continue
        for part, again in zip(asset.parts, opened(after[asset.name]).parts, strict=True):
            assert part.triangles.max(initial=-1) < len(part.vertices)
            np.testing.assert_array_equal(part.triangles, again.triangles)


def test_the_sample_of_a_slicer(shared):
    path = shared("cases/part.3mf")
    before = path.read_bytes()
    asset = assert_moves(before)
    vertices, triangles = meshes(entries(before)[2][ROOT])["1"]
    np.testing.assert_array_equal(asset.parts[0].vertices, vertices)
    np.testing.assert_array_equal(asset.parts[0].triangles, triangles)
    assert len(asset.mesh().triangles) == len(triangles)
