"""Many elements of one kind, read at once from the bytes of an XML document: <vertex x="1" y="2" z="3"/> ...

Only runs of elements that are written alike, as programs write them, are read here; what is not is left to a parser.
"""

import re
from collections.abc import Set
from dataclasses import dataclass

import numpy as np

from o3dmark.arrays import AnyArray, Bools, Ints

_ATTRIBUTE = re.compile(rb"""\s([^\s=<>"'/&]+)\s*=\s*(?:"([^"]*)"|'([^']*)')""")
_TAG = re.compile(rb"""<([^\s=<>"'/&]+)(?:\s+[^\s=<>"'/&]+\s*=\s*(?:"[^"]*"|'[^']*'))*\s*/?>""")
_ODD = bytes(sorted({*range(32), *range(127, 256), ord("&")} - set(b"\t\n\r")))  # needs a parser


@dataclass(frozen=True)
class Rows:
    """The values of some attributes of n elements: values (n, k), and where each stands in the bytes, from start to
    stop (n, k); ``attributes`` are the names of all that the elements have."""

    values: AnyArray
    start: Ints
    stop: Ints
    attributes: tuple[str, ...]


def rows(
    text: bytes, tag: bytes, names: tuple[str, ...], dtype: type[np.float64] | type[np.int64], prefixes: Set[str]
) -> Rows | None:
    """The attributes ``names`` of all elements in ``text``, which consists of elements of one tag and white space.

    None where they are not written alike, are not numbers, or use a prefix for a name space that is not declared.
    """
    first, last = text.find(b"<"), text.rfind(b"<")
    second = text.find(b"<", first + 1)
    sample = text[first : second if second > 0 else len(text)]
    match = _TAG.fullmatch(sample.rstrip())
    if match is None or match[1] != tag or not match[0].endswith(b"/>"):
        return None
    if text.translate(None, _ODD) != text or text[:first].strip():
        return None
    given = [name.decode() for name, _, _ in _ATTRIBUTE.findall(sample)]
    if len({*given}) < len(given) or not {*names} <= {*given} or not _declared(given, prefixes):
        return None
    data = np.frombuffer(text, np.uint8)
    quote = b'"' if b'"' in sample else b"'"
    quotes = np.flatnonzero(data == quote[0])
    if len(quotes) != 2 * len(given) * text.count(b"<"):
        return None
    start, stop = (quotes[side::2].reshape(-1, len(given)) for side in (0, 1))
    start = start + 1
    frame = data[~_between(start, stop, len(data))].tobytes()
    one, final = _frame_of(sample), _frame_of(text[last:])
    if final.rstrip() != one.rstrip() or frame != text[:first] + one * (len(start) - 1) + final:
        return None
    column = [given.index(name) for name in names]
    return _numbers(data, start, stop, column, dtype, tuple(given))


def attribute_places(text: bytes, at: int) -> dict[str, tuple[int, int]]:
    """Where the words of a tag's values begin and end, by the names of their attributes as written."""
    tag = _TAG.match(text, at)
    places = {}
    for match in _ATTRIBUTE.finditer(text, at, tag.end()) if tag else ():
        start, stop = match.span(match.lastindex or 2)
        value = text[start:stop]
        before = len(value) - len(value.lstrip())
        places[match[1].decode("utf-8", "replace")] = start + before, start + len(value.rstrip())
    return places


def longest_fraction(text: bytes, values: Rows) -> int:
    """The most digits after the point in any of the values; 16 where there is an exponent, which says nothing."""
    data = np.frombuffer(text, np.uint8)
    inside = _between(values.start, values.stop, len(data))
    if (inside & ((data | 32) == ord("e"))).any():
        return 16
    points = np.flatnonzero(inside & (data == ord(".")))
    stops = np.sort(values.stop, axis=None)
    return int((stops[np.searchsorted(stops, points)] - points - 1).max(initial=0))


def _numbers(
    data: AnyArray,
    start: Ints,
    stop: Ints,
    column: list[int],
    dtype: type[np.float64] | type[np.int64],
    given: tuple[str, ...],
) -> Rows | None:
    order = sorted(column)
    inside = _between(start[:, order], stop[:, order], len(data))
    blank = inside & (data <= ord(" "))
    start, stop = start[:, column], stop[:, column]
    if (start == stop).any() or blank.any():
        return None
    try:
        values = np.fromstring(np.where(inside, data, np.uint8(ord(" "))).tobytes(), dtype, sep=" ")
    except ValueError:
        return None
    if len(values) != start.size or not np.isfinite(values).all():
        return None
    return Rows(values.reshape(start.shape)[:, np.argsort(np.argsort(column))], start, stop, given)


def _between(start: Ints, stop: Ints, length: int) -> Bools:
    """True (length,) from each start to before its stop; the ranges do not overlap."""
    change = np.zeros(length + 1, np.int8)
    change[start.ravel()] = 1
    change[stop.ravel()] -= 1
    return np.cumsum(change[:-1], dtype=np.int8).view(np.bool_)


def _frame_of(text: bytes) -> bytes:
    """A tag without the values of its attributes."""
    return re.sub(rb"""("|')[^"']*\1""", rb"\1\1", text)


def _declared(names: list[str], prefixes: Set[str]) -> bool:
    """Whether the prefixes of attributes are known, and none of the attributes declares another."""
    return all(
        not name.startswith("xmlns") and (":" not in name or name.split(":", 1)[0] in prefixes | {"xml"})
        for name in names
    )
