"""The rows of a PLY file's elements: where they stand, and their numbers as arrays.

They are counted in units: the bytes of a binary file, the words of a text. To both the same layout applies.
"""

import itertools
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from o3dmark.arrays import AnyArray, Bools
from o3dmark.errors import MeshError
from o3dmark.files.ply.header import Element, Header, Property
from o3dmark.files.text.notation import floats

_FOREIGN = re.compile(rb"[^\s0-9eE+\-.infatyINFATY()]")  # is in no number, not even in "-nan(ind)" or "Infinity"
_PLURAL = {"vertex": "vertices", "face": "faces"}


@dataclass(frozen=True, eq=False)
class Body:
    """What follows the header: ``data``, bytes (uint8) in an ``order``, or the words of a text (float64) in none.

    ``stop``: the word at which a text stops being numbers, or "".
    """

    name: str
    data: AnyArray
    order: str
    stop: str = ""

    @classmethod
    def of(cls, path: Path, header: Header, content: bytes) -> "Body":
        """Errors: MeshError where the words of a text are not numbers."""
        if header.order:
            return cls(path.name, np.frombuffer(content, np.uint8)[header.size :], header.order)
        text, stop = numbers_of(content[header.size :])
        return cls(path.name, floats(path, text, "its rows", width=1).ravel(), "", stop)

    def size(self, kind: str) -> int:
        """Of one number, in units."""
        return np.dtype(kind).itemsize if self.order else 1

    def dtype(self, kind: str) -> np.dtype[np.generic]:
        return np.dtype(self.order + kind) if self.order else np.dtype(np.float64)

    def view(self, kind: str, start: int, shape: tuple[int, ...] = (), strides: tuple[int, ...] = ()) -> AnyArray:
        """The numbers of a kind that begin at ``start`` and stand ``strides`` apart, in place."""
        unit = self.data.itemsize
        return np.ndarray(shape, self.dtype(kind), self.data, start * unit, tuple(unit * step for step in strides))

    def take(self, kind: str, places: AnyArray) -> AnyArray:
        """The numbers of a kind that begin at these places (n,), copied."""
        if not self.order:
            return self.data[places]
        return self.data[places[:, None] + np.arange(self.size(kind))].view(self.dtype(kind))[:, 0]

    def put(self, kind: str, places: AnyArray, values: AnyArray) -> None:
        """The opposite of `take`, for bytes that are the caller's own."""
        written = values.astype(self.dtype(kind))[:, None].view(np.uint8)
        self.data[places[:, None] + np.arange(self.size(kind))] = written


@dataclass(frozen=True, eq=False)
class Rows:
    """Where the rows of an element stand.

    ``end``: the unit after them; ``offsets``: of each property in a row, of a list that of its length; ``lengths``: of
    the lists, 1 for others; ``stride``: from row to row. Rows of lists that are not all as long as in the first row
    are not ``even``, and only ``end`` is told.
    """

    body: Body
    element: Element
    start: int
    end: int
    even: bool = True
    stride: int = 0
    offsets: tuple[int, ...] = ()
    lengths: tuple[int, ...] = ()

    @classmethod
    def of(cls, body: Body, element: Element, start: int) -> "Rows":
        """The rows that begin at ``start``.

        Errors: MeshError when they do not end in the file, before memory is taken for them.
        """
        properties = element.properties
        least = sum(body.size(p.counted or p.kind) for p in properties)
        if least * element.count > len(body.data) - start:
            raise _short(body, element, (len(body.data) - start) // least)
        if not element.count:
            return cls(body, element, start, start)
        lengths = _first_lengths(body, element, start)
        sizes = [
            (body.size(p.counted) if p.counted else 0) + length * body.size(p.kind)
            for p, length in zip(properties, lengths, strict=False)
        ]
        offsets, stride = tuple(itertools.accumulate(sizes, initial=0))[:-1], sum(sizes)
        if len(lengths) == len(properties) and start + element.count * stride <= len(body.data):
            rows = cls(body, element, start, start + element.count * stride, True, stride, offsets, lengths)
            if all(
                (rows._even(p.counted, offset) == length).all()
                for p, offset, length in zip(properties, offsets, lengths, strict=True)
                if p.counted
            ):
                return rows
        if not any(p.counted for p in properties):
            raise _short(body, element, (len(body.data) - start) // stride)
        end, _, _ = _walk(body, element, start, None)
        return cls(body, element, start, end, even=False)

    def numbers(self, name: Property) -> AnyArray:
        """A property that is no list, of every row (n,), in its own type."""
        if self.even:
            return self._even(name.kind, self.offsets[self.element.properties.index(name)])
        return self.body.take(name.kind, self.places(name))

    def block(self, name: Property) -> AnyArray:
        """The items of lists in even rows (n, length), in their own type."""
        which = self.element.properties.index(name)
        offset = self.start + self.offsets[which] + self.body.size(name.counted)
        shape, step = (self.element.count, self.lengths[which]), self.body.size(name.kind)
        return self.body.view(name.kind, offset, shape, (self.stride, step))

    def lists(self, name: Property) -> tuple[AnyArray, AnyArray]:
        """Where the lists in uneven rows begin (n,), in units, and how long they are (n,)."""
        _, places, lengths = _walk(self.body, self.element, self.start, name)
        return places, lengths

    def items(self, name: Property, places: AnyArray, lengths: AnyArray) -> AnyArray:
        """The items of all these lists (k,), in their own type, or as whole numbers of a text."""
        from o3dmark.files.ply.ragged import gather  # numba takes a fifth of a second to load, and few files need it

        size = self.body.size(name.kind)
        bits = np.empty(int(lengths.sum(dtype=np.int64)), np.int64)
        gather(self.body.data, places, lengths, size, self.body.order == ">", bits)
        return bits.astype(f"u{size}").view(name.kind) if self.body.order else bits

    def places(self, name: Property) -> AnyArray:
        """Where a property that is no list stands (n,), in units."""
        if not self.even:
            return _walk(self.body, self.element, self.start, name)[1]
        offset = self.start + self.offsets[self.element.properties.index(name)]
        return offset + self.stride * np.arange(self.element.count)

    def copied(self) -> "Rows":
        """The same rows of a binary file, and nothing else, in bytes of their own."""
        return replace(
            self,
            body=replace(self.body, data=self.body.data[self.start : self.end].copy()),
            start=0,
            end=self.end - self.start,
        )

    def put(self, name: Property, values: AnyArray, where: Bools) -> None:
        """Write a property that is no list in some rows (n,), in rows that were `copied`."""
        if self.even:
            np.copyto(self.numbers(name), values, casting="unsafe", where=where)
        else:
            self.body.put(name.kind, self.places(name)[where], values[where])

    def _even(self, kind: str, offset: int) -> AnyArray:
        return self.body.view(kind, self.start + offset, (self.element.count,), (self.stride,))


def numbers_of(content: bytes) -> tuple[bytes, str]:
    """A text up to the first word that cannot be a number, and that word, or ""."""
    foreign = _FOREIGN.search(content)
    if foreign is None:
        return content, ""
    head = content[: foreign.start()]
    if head and not head[-1:].isspace():
        head = head[: len(head) - len(head.rsplit(None, 1)[-1])]
    word = content[len(head) : foreign.end() + 20].split(None, 1)[0]
    return head, word[:20].decode("ascii", "replace")


def _first_lengths(body: Body, element: Element, start: int) -> tuple[int, ...]:
    """How long the lists of the first row are, 1 for other properties; fewer numbers where it is damaged."""
    at, lengths = start, list[int]()
    for p in element.properties:
        length = 1
        if p.counted:
            if at + body.size(p.counted) > len(body.data):
                break
            number = float(body.view(p.counted, at))
            if not 0 <= number < len(body.data) or not number.is_integer():
                break
            length = int(number)
            at += body.size(p.counted)
        at += length * body.size(p.kind)
        lengths.append(length)
    return tuple(lengths)


def _walk(body: Body, element: Element, start: int, wanted: Property | None) -> tuple[int, AnyArray, AnyArray]:
    """Where the rows end; and of a property where it, or the first item of it, stands (n,), and how many there are."""
    from o3dmark.files.ply.ragged import NOT_WHOLE, walk

    properties = element.properties
    sizes = np.array([body.size(p.counted or p.kind) for p in properties], np.int64)
    items = np.array([body.size(p.kind) if p.counted else 0 for p in properties], np.int64)
    signed = np.array([body.order != "" and p.counted[:1] == "i" for p in properties])
    which = -1 if wanted is None else properties.index(wanted)
    rows = 0 if wanted is None else element.count
    dtype = np.int32 if len(body.data) < 1 << 31 else np.int64  # a row may be one byte of the file
    places, lengths = (np.empty(rows, dtype) for _ in range(2))
    found, end, negative = walk(
        body.data, start, element.count, sizes, items, signed, body.order == ">", which, places, lengths
    )
    if negative:
        what = negative if negative != NOT_WHOLE else "no whole number"
        raise MeshError(f"{body.name}: the length of a list in row {found} of element {element.name} is {what}")
    if found < element.count:
        raise _short(body, element, found)
    return end, places, lengths


def _short(body: Body, element: Element, found: int) -> MeshError:
    what = _PLURAL.get(element.name, f"rows of {element.name}")
    stop = f"; {body.stop!r} is no number" if body.stop else ""
    return MeshError(f"{body.name} is truncated: it announces {element.count} {what}, but {found} can be read{stop}")
