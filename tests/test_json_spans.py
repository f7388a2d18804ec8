"""Where values stand in a JSON text, and fields that nobody has checked."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from o3dmark.errors import MeshError
from o3dmark.files.gltf.json_fields import Fields
from o3dmark.files.gltf.json_spans import JsonSpans, loads, replaced

VALUES = st.recursive(
    st.none() | st.booleans() | st.floats(allow_nan=False, allow_infinity=False) | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=4),
    max_leaves=20,
)


def paths(value, path=()):
    yield path, value
    members = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in members:
        yield from paths(inner, (*path, key))


@given(VALUES, st.sampled_from([None, 0, 1, "\t"]), st.booleans())
def test_every_value_is_found_where_it_stands(value, indent, ascii_only):
    text = " \n" + json.dumps(value, indent=indent, ensure_ascii=ascii_only) + "\r\n "
    spans = JsonSpans(text)
    for path, inner in paths(value):
        start, end = spans.of(*path)
        assert json.loads(text[start:end]) == inner
        assert text[start:end].strip() == text[start:end]


@given(VALUES)
def test_a_replaced_value_leaves_all_others_as_they_are(value):
    text = json.dumps([value, {"here": value, "there": value}], indent=1)
    start, end = JsonSpans(text).of(1, "here")
    changed = replaced(text, {(start, end): '"new"'})
    assert json.loads(changed) == [value, {"here": "new", "there": value}]
    assert (changed[:start], changed[start + 5 :]) == (text[:start], text[end:])


def test_of_a_key_that_stands_twice_the_last_counts_as_it_does_for_json():
    text = '{"a" : {"b":1}, "\\u0061":{ "b"\t:\t2 ,"b":3}}'
    start, end = JsonSpans(text).of("a", "b")
    assert json.loads(text)["a"]["b"] == json.loads(text[start:end]) == 3
    assert start == text.rindex("3")


def test_what_is_not_there():
    spans = JsonSpans('{"a": [1, {}], "b": "text"}')
    for path in (("c",), ("a", 2), ("a", 1, "x"), ("b", 0), ("a", "0"), (0,)):
        assert spans.of(*path) is None


@pytest.mark.parametrize("text", ["", "{", '{"a": }', "[" * 200_000, "nul", "9" * 5000])
def test_damaged_texts(text):
    with pytest.raises(ValueError):  # noqa: PT011 - its words are the json module's
        loads(text, 0)


def test_fields_are_of_the_kind_that_is_asked_for():
    fields = Fields("a.glb, thing 3", {"n": 12.0, "t": "x", "no": -1, "list": [{}, 3], "f": [1, 2.5], "yes": True})
    assert (fields.whole("n"), fields.text("t"), fields.floats("f", (0, 0)), fields.flag("yes")) == (
        12,
        "x",
        [1, 2.5],
        True,
    )
    assert (fields.whole("none", 7), fields.numbers_of("none", 3), list(fields.part("none"))) == (7, [], [])
    for wrong in (
        lambda: fields.whole("no"),
        lambda: fields.whole("yes"),
        lambda: fields.whole("none"),
        lambda: fields.text("n"),
        lambda: fields.flag("n"),
        lambda: fields.number_of("n", 12),
        lambda: fields.floats("f", (0, 0, 0)),
        lambda: fields.floats("list", (0, 0)),
        lambda: fields.texts("list"),
        lambda: fields.parts("list", "item"),
        lambda: fields.part("t"),
        lambda: fields.numbers_of("list", 5),
        lambda: Fields("a.glb, thing 3", []),
        lambda: Fields("a.glb, thing 3", {"f": [10**400, 1]}).floats("f", (0, 0)),
    ):
        with pytest.raises(MeshError, match=r"^a\.glb, thing 3"):
            wrong()
