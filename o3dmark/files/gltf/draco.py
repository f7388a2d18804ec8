"""Primitives that Draco has compressed: each of their attributes is a space of its own, and all are encoded at once.

Vertices and triangles keep their order, which morph targets count on, and for which Draco compresses less: a stream may
get three times longer, though shorter than plain numbers. Positions lie on a grid over their box, so where the box
changes, those that did not move are rounded anew, by half a step of the old grid at most.

Source: KHR_draco_mesh_compression.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property

import numpy as np

from o3dmark.arrays import AnyArray, Bits, Floats
from o3dmark.errors import MeshError
from o3dmark.files.asset import float_steps
from o3dmark.files.gltf import draco_codec as codec
from o3dmark.files.gltf.accessors import Accessor, Rows, Views
from o3dmark.files.gltf.budget import Budget
from o3dmark.files.gltf.buffers import Buffer, Edits, Space
from o3dmark.files.gltf.draco_grid import bits_for, step_of
from o3dmark.files.gltf.json_fields import Fields

EXTENSION = "KHR_draco_mesh_compression"
_CORNERS = -1  # stands for the triangles among the attributes
_VERTEX_BYTES = 256  # that decoding takes for a vertex with some attributes


class Stream:
    """A compressed mesh: the bytes of a buffer view."""

    def __init__(self, where: str, view: int, views: Views) -> None:
        window = views[view]
        if not isinstance(window.space, Buffer):
            raise MeshError(f"{where}: its bytes are compressed twice, which nobody reads")
        self.where, self.place = where, (window.space, window.start, window.length)
        self.users: list[tuple[int, int, Fields]] = []
        self.twice = False
        self._view, self._buffer = view, views.fields[view].whole("buffer")
        self._spaces: dict[int, DracoSpace] = {}

    @property
    def packed(self) -> bytes:
        buffer, start, length = self.place
        return buffer.content[start : start + length].tobytes()

    @cached_property
    def mesh(self) -> codec.DracoMesh:
        return codec.decoded(self.where, self.packed)

    @cached_property
    def step(self) -> float:
        """How far apart the positions are on their grid."""
        return step_of(self.mesh.positions.astype(np.float64))

    def space(self, number: int) -> "DracoSpace":
        """The bytes of an attribute. Errors: MeshError when there is none with this id."""
        if number not in self._spaces:
            if number != _CORNERS and number not in self.mesh.attributes:
                raise MeshError(f"{self.where} has no attribute {number} that can be read")
            self._spaces[number] = DracoSpace(self, number)
        return self._spaces[number]

    def put_back(self, edits: Edits) -> None:
        """Encode all attributes again, once, and let the primitives that use them know their new ids."""
        path = "bufferViews", self._view
        if (*path, "byteLength") in edits.words:
            return
        changed = {number: space.numbers_in(edits) for number, space in self._spaces.items() if space in edits.spaces}
        moved = changed.get(self.mesh.first, self.mesh.positions).astype(np.float64)
        new = codec.encoded(self.where, self.mesh, changed, bits_for(moved, self.step))
        for number in changed:
            edits.spaces[self._spaces[number]] = _bytes(new.mesh.attributes[new.ids[number]].numbers)
        edits.replace(self.place, new.packed, self._buffer, path)
        for mesh, primitive, attributes in self.users:
            here = "meshes", mesh, "primitives", primitive, "extensions", EXTENSION, "attributes"
            for name in attributes:
                if new.ids[attributes.whole(name)] != attributes.whole(name):
                    edits.words[*here, name] = str(new.ids[attributes.whole(name)])


class DracoSpace(Space):
    """The numbers of one attribute, as bytes."""

    def __init__(self, stream: Stream, number: int) -> None:
        self._stream, self._number = stream, number
        mesh = stream.mesh
        self.numbers: AnyArray = (
            mesh.triangles.reshape(-1, 1) if number == _CORNERS else mesh.attributes[number].numbers
        )

    @property
    def buffers(self) -> tuple[Buffer, ...]:
        return (self._stream.place[0],)

    @property
    def holds(self) -> tuple[tuple[Buffer, int, int], ...]:
        return (self._stream.place,)

    @property
    def fixed(self) -> str:
        way = "; decompress the file first, with `gltf-transform copy IN OUT`"
        if self._stream.twice:
            return f"Draco holds its positions, and they are in the file uncompressed as well{way}"
        if not self._stream.mesh.can_be_written:
            return f"Draco holds numbers with it of a type that DracoPy does not write{way}"
        return ""

    @cached_property
    def content(self) -> Bits:
        content = _bytes(self.numbers)
        content.setflags(write=False)
        return content

    def numbers_in(self, edits: Edits) -> AnyArray:
        """The numbers (n, d) as they are to be."""
        return edits.of(self).view(self.numbers.dtype).reshape(self.numbers.shape)

    def steps(self, start: int, stride: int, shape: tuple[int, ...]) -> Floats | None:  # noqa: ARG002
        if self._number != self._stream.mesh.first or self.numbers.dtype.kind != "f":
            return None
        return np.maximum(float_steps(self.numbers), self._stream.step)

    def put_back(self, edits: Edits) -> None:
        self._stream.put_back(edits)


class Streams:
    """The compressed meshes of a glTF, each decoded once."""

    def __init__(self, views: Views, budget: Budget) -> None:
        self._views, self._budget = views, budget
        self._streams: dict[int, Stream] = {}

    def accessors(
        self, primitive: Fields, mesh: int, number: int, given: dict[str, Accessor]
    ) -> Iterator[tuple[str, Accessor]]:
        """Those of a primitive's accessors that its stream holds, as its numbers; "indices" is one of them.

        Errors: MeshError for a damaged stream, or one of other lengths than the accessors say.
        """
        if EXTENSION not in primitive.part("extensions"):
            return
        fields = primitive.part("extensions").part(EXTENSION)
        attributes = fields.part("attributes")
        view = fields.number_of("bufferView", len(self._views))
        if view not in self._streams:
            stream = self._streams[view] = Stream(fields.where, view, self._views)
            self._check(stream, given)
        stream = self._streams[view]
        for name in attributes:
            stream.space(attributes.whole(name))  # they are all there
        stream.users.append((mesh, number, attributes))
        for name, accessor in given.items():
            if name == "indices" or name in attributes:
                space = stream.space(_CORNERS if name == "indices" else attributes.whole(name))
                stream.twice |= bool(accessor.all_rows)
                yield name, _in(space, accessor, name)

    def _check(self, stream: Stream, given: dict[str, Accessor]) -> None:
        """Before anything is decoded, and memory taken."""
        buffer, start, length = stream.place
        if start + length > len(buffer.content):
            raise MeshError(f"{stream.where} reaches beyond the {len(buffer.content)} bytes that there are")
        triangles, vertices = codec.counts(stream.where, stream.packed)
        if ("indices" in given and given["indices"].count != 3 * triangles) or vertices > given["POSITION"].count:
            raise MeshError(f"{stream.where} has {triangles} triangles, but its accessors say something else")
        self._budget.take(24 * triangles + _VERTEX_BYTES * max(vertices, given["POSITION"].count))


def _bytes(numbers: AnyArray) -> Bits:
    return np.ascontiguousarray(numbers).reshape(-1).view(np.uint8)


def _in(space: DracoSpace, accessor: Accessor, name: str) -> Accessor:
    """An accessor that finds its numbers in a space."""
    numbers = space.numbers
    dtype = numbers.dtype if name == "indices" else accessor.dtype
    if numbers.shape != (accessor.count, accessor.width) or numbers.dtype != dtype:
        raise MeshError(f"{accessor.where}: Draco has {numbers.shape} numbers {numbers.dtype} for {name}")
    rows = Rows(space, 0, *numbers.shape, dtype, numbers.shape[1] * dtype.itemsize, accessor.where)
    return replace(accessor, dtype=dtype, base=rows, places=None, values=None)
