"""A glTF's accessors: rows of numbers at regular places in its bytes, and single rows that stand elsewhere (sparse).

Sources: glTF 2.0 specification, 3.6 (binary data storage); KHR_mesh_quantization for positions in whole numbers.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from o3dmark.arrays import AnyArray, Bits, Bools, Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.files.asset import float_steps
from o3dmark.files.gltf.budget import Budget
from o3dmark.files.gltf.buffers import Buffer, Buffers, Edits, Space
from o3dmark.files.gltf.json_fields import Fields
from o3dmark.files.gltf.meshopt import MeshoptSpace, Packing

TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_OUTSIDE = 1 / 16  # of all that a type can hold: a mark moves a corner by less
_MATRICES = {"MAT2": 2, "MAT3": 3, "MAT4": 4}


@dataclass(frozen=True)
class Rows:
    """``count`` rows of ``width`` numbers, ``stride`` bytes apart, from byte ``start`` of a space."""

    space: Space
    start: int
    count: int
    width: int
    dtype: np.dtype[Any]
    stride: int
    where: str = field(default="", compare=False)

    @property
    def size(self) -> int:
        """Bytes of a row."""
        return self.width * self.dtype.itemsize

    @property
    def end(self) -> int:
        return self.start + self.stride * (self.count - 1) + self.size if self.count else self.start

    def read(self, edits: Edits | None = None) -> AnyArray:
        """The numbers (count, width), as they are or are to be. Errors: MeshError when the bytes are not all there."""
        content = self.space.content if edits is None else edits.spaces.get(self.space, self.space.content)
        if self.end > len(content):
            raise MeshError(f"{self.where} reaches to byte {self.end}, but there are {len(content)}: it is damaged")
        return self.of(content)

    def of(self, content: Bits) -> AnyArray:
        """The numbers (count, width) in the bytes of the space, or in changed ones."""
        if not self.count:
            return np.empty((0, self.width), self.dtype)
        strides = self.stride, self.dtype.itemsize
        return np.ndarray((self.count, self.width), self.dtype, content, self.start, strides)


@dataclass(frozen=True)
class Accessor:
    """Rows of numbers (count, width). Two are equal when they are the same numbers at the same places.

    base: where the rows stand, or None for zeros; places: the numbers of those that stand elsewhere, in ``values``.
    """

    count: int
    width: int
    dtype: np.dtype[Any]
    normalized: bool
    base: Rows | None
    places: Rows | None = None
    values: Rows | None = None
    number: int = field(default=0, compare=False)
    where: str = field(default="", compare=False)

    @property
    def all_rows(self) -> list[Rows]:
        return [rows for rows in (self.base, self.places, self.values) if rows]

    @property
    def scale(self) -> float:
        """How many of its whole numbers make one."""
        return float(np.iinfo(self.dtype).max) if self.normalized and self.dtype.kind != "f" else 1.0

    @cached_property
    def listed(self) -> Ints:
        """The rows (k,) that stand elsewhere, ascending. Errors: MeshError when they are not."""
        if self.places is None:
            return np.empty(0, np.int64)
        rows = self.places.read()[:, 0].astype(np.int64)
        if len(rows) and (rows[-1] >= self.count or (np.diff(rows) <= 0).any()):
            raise MeshError(
                f"{self.where}: the rows that its sparse list names are not ascending and below {self.count}"
            )
        return rows

    @property
    def fixed(self) -> str:
        """Why positions cannot all be changed in place, if they cannot."""
        if self.base is None and len(self.listed) < self.count:
            return "some of its positions are zeros that the file does not store (a sparse accessor without a base)"
        return self.kept

    @property
    def kept(self) -> str:
        """Why no number can be changed, if none can."""
        return next((rows.space.fixed for rows in self.all_rows if rows.space.fixed), "")

    def raw(self, edits: Edits | None = None) -> AnyArray:
        """The numbers as the file has them, or is to have them (count, width), to be looked at only.

        Errors: MeshError when the bytes are not there.
        """
        rows = np.zeros((self.count, self.width), self.dtype) if self.base is None else self.base.read(edits)
        if self.values is not None:
            rows = rows.copy()
            rows[self.listed] = self.values.read(edits)
        return rows

    def floats(self, raw: AnyArray | None = None) -> Floats:
        """The numbers as what they stand for."""
        with np.errstate(invalid="ignore"):  # some numbers may be none
            values = (self.raw() if raw is None else raw).astype(np.float64)
        if self.scale != 1.0:
            values /= self.scale
            np.maximum(values, -1.0, out=values)  # as the specification says of -128 and -32768
        return values

    def nearest(self, values: Floats) -> AnyArray:
        """What the file can hold nearest to ``values`` (count, d), by the type of its numbers."""
        if self.dtype.kind == "f":
            largest = float(np.finfo(self.dtype).max)
            return np.clip(values, -largest, largest).astype(self.dtype)
        bounds = np.iinfo(self.dtype)
        lowest = -self.scale if self.normalized and bounds.min < 0 else bounds.min
        return np.clip(np.rint(values * self.scale), lowest, bounds.max).astype(self.dtype)

    def check_holds(self, positions: Floats) -> None:
        """Whether `nearest` is near: what is a little outside stays at the end, as where a mesh fills its grid.

        Errors: MeshError for more than that.
        """
        if self.dtype.kind != "f":
            held, bounds = self.floats(self.nearest(positions)), np.iinfo(self.dtype)
            if np.abs(positions - held).max(initial=0.0) * self.scale > _OUTSIDE * (bounds.max - bounds.min):
                raise MeshError(f"its new positions are beyond what {self.dtype.name} can hold")

    def steps(self, values: Floats) -> Floats:
        """How far apart the numbers are that can stand for ``values`` (n, d), in a shape that broadcasts to it."""
        of_space = self.base.space.steps(self.base.start, self.base.stride, values.shape) if self.base else None
        if of_space is not None:
            return of_space
        if self.dtype.kind == "f":
            with np.errstate(invalid="ignore"):
                return float_steps(values)
        return np.full(self.width, 1.0 / self.scale)

    def write(self, edits: Edits, raw: AnyArray, changed: Bools) -> None:
        """Put the rows of ``raw`` (count, width) that are ``changed`` (count,) where they stand."""
        here = changed.copy()
        here[self.listed] = False
        if self.base is not None:
            rows = self.base.of(edits.of(self.base.space))
            if here.all():  # much faster than by a mask
                rows[...] = raw
            else:
                rows[here] = raw[here]
        if self.values is not None:
            elsewhere = changed[self.listed]
            self.values.of(edits.of(self.values.space))[elsewhere] = raw[self.listed[elsewhere]]


@dataclass(frozen=True)
class Window:
    """The bytes of a buffer view."""

    space: Space
    start: int
    length: int
    stride: int | None


class Views:
    """The buffer views of a glTF."""

    def __init__(self, buffers: Buffers, root: Fields, budget: Budget) -> None:
        self.fields = root.parts("bufferViews", "buffer view")
        self._buffers, self._budget = buffers, budget
        self._windows: dict[int, Window] = {}

    def __len__(self) -> int:
        return len(self.fields)

    def ends(self) -> dict[Buffer, int]:
        """For each buffer where the last view of it ends; views that are damaged, and not used, do not count."""
        ends: dict[Buffer, int] = {}
        for number, fields in enumerate(self.fields):
            try:
                window = self[number]
            except MeshError:
                continue
            buffer = self._buffers[fields.whole("buffer")]
            place = buffer, fields.whole("byteOffset", 0), fields.whole("byteLength")
            for buffer, start, length in (place, *window.space.holds):
                ends[buffer] = max(ends.get(buffer, 0), start + length)
        return ends

    def __getitem__(self, number: int) -> Window:
        if number not in self._windows:
            self._windows[number] = self._window(number, self.fields[number])
        return self._windows[number]

    def _window(self, number: int, fields: Fields) -> Window:
        """Errors: MeshError where a view reaches beyond its buffer."""
        buffer = fields.number_of("buffer", len(self._buffers))
        start, length = fields.whole("byteOffset", 0), fields.whole("byteLength")
        most = self._buffers.fields[buffer].whole("byteLength")
        if start + length > most:
            raise MeshError(f"{fields.where} reaches to byte {start + length} of buffer {buffer}, which has {most}")
        stride = fields.whole("byteStride") if "byteStride" in fields else None
        if packing := Packing.of(number, fields, self._buffers):
            return Window(
                MeshoptSpace(packing, self._buffers, (self._buffers[buffer], start), self._budget), 0, length, stride
            )
        return Window(self._buffers[buffer], start, length, stride or None)


class Accessors:
    """The accessors of a glTF, each understood when it is asked for."""

    def __init__(self, views: Views, root: Fields, budget: Budget) -> None:
        self.fields = root.parts("accessors", "accessor")
        self._views, self._budget = views, budget
        self._known: dict[int, Accessor] = {}

    def __len__(self) -> int:
        return len(self.fields)

    def __getitem__(self, number: int) -> Accessor:
        """Errors: MeshError for one that is no accessor of glTF, or reaches beyond its view."""
        if number not in self._known:
            self._known[number] = self._accessor(number, self.fields[number])
        return self._known[number]

    def _accessor(self, number: int, fields: Fields) -> Accessor:
        count, dtype, name = fields.whole("count"), _dtype(fields), fields.text("type")
        width = _WIDTHS.get(name, 0)
        if name in _MATRICES:  # as bytes, as nothing is read from them here; columns begin at multiples of four
            order = _MATRICES[name]
            width, dtype = order * (order * dtype.itemsize + -order * dtype.itemsize % 4), np.dtype("<u1")
        elif not width:
            raise fields.wrong("type", "SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3 or MAT4")
        base = self._rows(fields, count, width, dtype, strided=True) if "bufferView" in fields else None
        places = values = None
        if "sparse" in fields:
            sparse = fields.part("sparse")
            indices, n_sparse = sparse.part("indices"), sparse.whole("count")
            places = self._rows(indices, n_sparse, 1, _dtype(indices))
            values = self._rows(sparse.part("values"), n_sparse, width, dtype)
        if base is None:
            self._budget.take(count * width * dtype.itemsize)  # zeros, for which the file has no bytes
        return Accessor(count, width, dtype, fields.flag("normalized"), base, places, values, number, fields.where)

    def _rows(self, fields: Fields, count: int, width: int, dtype: np.dtype[Any], *, strided: bool = False) -> Rows:
        """Errors: MeshError where the rows reach beyond their view, or into each other."""
        window, start = self._views[fields.number_of("bufferView", len(self._views))], fields.whole("byteOffset", 0)
        size = width * dtype.itemsize
        stride = (window.stride if strided else None) or size
        if count and start + stride * (count - 1) + size > window.length:
            raise MeshError(f"{fields.where}: {count} rows of {size} bytes reach beyond its buffer view")
        if stride < size:
            raise MeshError(f"{fields.where}: rows of {size} bytes cannot be {stride} apart")
        return Rows(window.space, window.start + start, count, width, dtype, stride, fields.where)


def _dtype(fields: Fields) -> np.dtype[Any]:
    name = TYPES.get(fields.whole("componentType"))
    if name is None:
        raise fields.wrong("componentType", f"one of {', '.join(map(str, TYPES))}")
    return np.dtype(name)
