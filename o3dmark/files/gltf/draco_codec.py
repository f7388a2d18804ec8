"""Meshes as Google's Draco compresses them: decoded, and encoded again in as many bits.

The codec is DracoPy, an extra. It does not say in how many bits numbers were kept, so that is found out: for normals
and texture coordinates the numbers of bits are tried, and one is taken only when it gives back the same numbers. What
cannot be given back so is kept as float32, which takes more bytes and loses nothing. Vertices and corners keep their
order, for which Draco writes corners uncompressed.
Source: Draco bitstream specification 2.2.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from o3dmark.arrays import AnyArray, Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.files.gltf.extra import library

_POSITION, _NORMAL, _TEXTURE = 0, 1, 3
_TYPES = {1: "<i1", 2: "<u1", 3: "<i2", 4: "<u2", 5: "<i4", 6: "<u4", 9: "<f4"}
_WRITTEN = ("float32", "uint8", "uint16", "uint32")  # the types that DracoPy encodes

_MAGIC = b"DRACO\x02\x02\x01"  # version 2.2, which is what glTF has; a mesh, not a point cloud
_METADATA = 0x8000
_TRIED = range(2, 17)  # bits of normals and texture coordinates
_LEVEL = 7  # of compression, 0 to 10: makes no difference where the order is kept
_SAMPLE = 1000  # rows that tell numbers of bits apart; then all are compared


@dataclass(frozen=True)
class Attribute:
    """Numbers (n, d) of the vertices, and what they are for: positions, normals, ..."""

    kind: int
    numbers: AnyArray


@dataclass(frozen=True)
class DracoMesh:
    """Triangles (m, 3) uint32, and attributes by their ids in the stream. ``others``: how many more it has."""

    triangles: AnyArray
    attributes: dict[int, Attribute]
    others: int = 0

    @property
    def first(self) -> int:
        """The id of the positions."""
        return next(number for number, each in self.attributes.items() if each.kind == _POSITION)

    @property
    def positions(self) -> AnyArray:
        return self.attributes[self.first].numbers

    @property
    def can_be_written(self) -> bool:
        """Whether DracoPy has a way to encode all that is in it."""
        types = {each.numbers.dtype.name for each in self.attributes.values()}
        return not self.others and types <= set(_WRITTEN) and self.positions.dtype == np.float32


def decoded(where: str, packed: bytes) -> DracoMesh:
    """Errors: MeshError for a damaged stream, or one that is no mesh."""
    draco = library("DracoPy", where)
    try:
        mesh = draco.decode(packed)
        triangles = np.asarray(mesh.faces, "<u4").reshape(-1, 3)
    except Exception as error:  # the library raises many kinds, and its mesh without triangles has no faces
        raise MeshError(f"{where} cannot be decoded: DracoPy says {str(error)!r}") from None
    attributes = {}
    for each in mesh.attributes:
        if each["data_type"] in _TYPES:
            numbers = np.ascontiguousarray(each["data"], _TYPES[each["data_type"]])
            attributes[int(each["unique_id"])] = Attribute(int(each["attribute_type"]), numbers)
    found = DracoMesh(triangles, attributes, len(mesh.attributes) - len(attributes))
    if not any(each.kind == _POSITION for each in attributes.values()):
        raise MeshError(f"{where} has no positions that can be read")
    return found


def counts(where: str, packed: bytes) -> tuple[int, int]:
    """How many triangles, and how many vertices at least, a stream announces. Errors: MeshError when it is no mesh."""
    try:
        if not packed.startswith(_MAGIC):
            raise ValueError
        reader = _Reader(packed, len(_MAGIC))
        edgebreaker = reader.byte()
        if (reader.byte() | reader.byte() << 8) & _METADATA:
            reader.skip_metadata()
        if not edgebreaker:
            return reader.number(), reader.number()
        reader.byte()  # how the surface was walked
        vertices = reader.number()
        return reader.number(), vertices
    except (IndexError, ValueError):
        raise MeshError(f"{where} is no mesh that Draco 2.2 wrote, or damaged") from None


@dataclass(frozen=True)
class Encoded:
    """A stream, what it holds, and the new id of each old one."""

    packed: bytes
    mesh: DracoMesh
    ids: dict[int, int]


def encoded(where: str, mesh: DracoMesh, changed: Mapping[int, AnyArray], bits: int) -> Encoded:
    """The mesh with other numbers for some attributes, and its positions in so many bits.

    Errors: MeshError when the library does not give the rest back as it was.
    """
    exact = {}
    for kind in (_NORMAL, _TEXTURE):
        number = next((number for number, each in mesh.attributes.items() if each.kind == kind), None)
        if number is not None and (found := _bits(where, mesh, number)):
            exact[number] = found
    kept = set(mesh.attributes) - set(changed) - {mesh.first}
    wanted = changed.get(mesh.first, mesh.positions).astype(np.float64)
    for choice in (exact, {}):
        packed = _written(where, mesh, changed, bits, choice)
        back = decoded(where, packed)
        ids = _ids(mesh, back, choice)
        same = all(np.array_equal(back.attributes[ids[n]].numbers, mesh.attributes[n].numbers) for n in kept)
        if same and np.array_equal(back.triangles, mesh.triangles) and _near(back.positions, wanted, bits):
            return Encoded(packed, back, ids)
    raise MeshError(
        f"{where}: DracoPy does not write back what it has read; `gltf-transform copy IN OUT` decompresses it"
    )


def _near(positions: AnyArray, wanted: Floats, bits: int) -> bool:
    """Whether positions (n, 3) are within a step of those wanted; they are not where float32 cannot tell 1 / step."""
    if positions.shape != wanted.shape:
        return False
    step = float(np.ptp(wanted, axis=0).max()) / ((1 << bits) - 1)
    noise = 4.0 * float(np.spacing(np.float32(np.abs(wanted).max())))
    return bool((np.abs(positions - wanted) <= step + noise).all())


def _written(
    where: str, mesh: DracoMesh, changed: Mapping[int, AnyArray], bits: int, exact: Mapping[int, int]
) -> bytes:
    """The stream; normals and texture coordinates of ``exact`` in so many bits, all else as it is.

    Positions get a grid over their own box: an origin that is given, Draco rounds to six decimals.
    """
    numbers = {number: changed.get(number, each.numbers) for number, each in mesh.attributes.items()}
    options: dict[str, Any] = {}
    for number, n_bits in exact.items():
        name = "normal" if mesh.attributes[number].kind == _NORMAL else "tex_coord"
        options[f"{name}_quantization_bits"] = n_bits
        options["normals" if name == "normal" else name] = numbers[number].astype(np.float64)
    generic = {number: values for number, values in numbers.items() if number not in exact and number != mesh.first}
    return library("DracoPy", where).encode(
        numbers[mesh.first].astype(np.float64),
        mesh.triangles,
        quantization_bits=bits,
        compression_level=_LEVEL,
        preserve_order=True,
        generic_attributes=generic or None,
        **options,
    )


def _ids(mesh: DracoMesh, back: DracoMesh, exact: Mapping[int, int]) -> dict[int, int]:
    """Under which id each attribute is found again."""
    by_kind = {each.kind: number for number, each in back.attributes.items()}
    moved = {number: by_kind[mesh.attributes[number].kind] for number in (mesh.first, *exact)}
    return {number: moved.get(number, number) for number in mesh.attributes}


def _bits(where: str, mesh: DracoMesh, number: int) -> int:
    """The number of bits in which normals or texture coordinates come back as they are; 0 when there is none."""
    attribute = mesh.attributes[number]
    width = 3 if attribute.kind == _NORMAL else 2
    if attribute.numbers.dtype != np.float32 or attribute.numbers.shape[1] != width:
        return 0
    rows = _sample(attribute.numbers)
    triangles = np.arange(len(rows) // 3 * 3, dtype=np.uint32).reshape(-1, 3)
    sample = DracoMesh(
        triangles, {0: Attribute(_POSITION, np.zeros((len(rows), 3))), 1: Attribute(attribute.kind, rows)}
    )
    for bits in _TRIED if len(triangles) else ():
        back = decoded(where, _written(where, sample, {}, 2, {1: bits}))
        if any(each.kind == attribute.kind and np.array_equal(each.numbers, rows) for each in back.attributes.values()):
            return bits
    return 0


def _sample(numbers: AnyArray) -> AnyArray:
    """Some of the rows, and those that span their box."""
    spread: Ints = np.linspace(0, len(numbers) - 1, min(_SAMPLE, len(numbers))).astype(np.int64)
    return numbers[np.unique(np.concatenate([spread, numbers.argmin(axis=0), numbers.argmax(axis=0)]))]


class _Reader:
    """Numbers of a stream, one after the other. All methods raise IndexError at its end."""

    def __init__(self, content: bytes, at: int) -> None:
        self._content, self._at = content, at

    def byte(self) -> int:
        self._at += 1
        return self._content[self._at - 1]

    def number(self) -> int:
        """A whole number of one to five bytes, seven bits each. Errors: ValueError for a longer one."""
        value = 0
        for shift in range(0, 35, 7):
            byte = self.byte()
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                return value
        raise ValueError

    def skip_metadata(self) -> None:
        """Notes on attributes and on the mesh: names with values, and more of the same within."""
        n_attributes = self.number()
        for place in range(n_attributes + 1):
            if place < n_attributes:
                self.number()
            waiting, inner = 1, False
            while waiting:
                if inner:
                    self._skip(self.byte())
                for _ in range(self.number()):
                    self._skip(self.byte())
                    self._skip(self.number())
                waiting += self.number() - 1
                inner = True

    def _skip(self, n_bytes: int) -> None:
        self._at += n_bytes
        if self._at > len(self._content):
            raise IndexError
