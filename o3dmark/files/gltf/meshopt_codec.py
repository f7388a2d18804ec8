"""Bytes as meshoptimizer compresses them, and the filters that keep vectors in few bits.

The codec is the library's, which is an extra. It leaves encoding to the exponential and octahedral filters to us, who
have to keep what a file has: its exponents, and how many bits a direction has.
Source: EXT_meshopt_compression (appendix B: filters).
"""

from typing import Any

import numpy as np

from o3dmark.arrays import AnyArray, Bits, Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.files.gltf.extra import library

STRIDES = {"NONE": range(4, 257, 4), "OCTAHEDRAL": (4, 8), "QUATERNION": (8,), "EXPONENTIAL": range(4, 257, 4)}
_MANTISSA_BITS = 24  # of a number under the exponential filter, sign included; the other eight are its exponent
_LARGEST = (1 << (_MANTISSA_BITS - 1)) - 1
_LEAST_EXPONENT, _GREATEST_EXPONENT = -128, 127


def decoded(where: str, packed: bytes, mode: str, count: int, stride: int) -> Bits:
    """The rows (count, stride) that are compressed, before any filter. Errors: MeshError for damaged ones."""
    tool = library("meshoptimizer", where)
    try:
        if mode == "ATTRIBUTES":
            return tool.decode_vertex_buffer(count, stride, packed, dtype=np.dtype((np.uint8, stride)))
        decode = tool.decode_index_buffer if mode == "TRIANGLES" else tool.decode_index_sequence
        indices = decode(count, 4, packed).astype(f"<u{stride}")
        return indices.view(np.uint8).reshape(count, stride)
    except (RuntimeError, ValueError) as error:
        raise MeshError(f"{where} is damaged: meshoptimizer says {str(error)!r}") from None


def encoded(where: str, rows: Bits, version: int) -> bytes:
    """Rows (count, stride) compressed as attributes, in the codec's version 0 or 1."""
    tool = library("meshoptimizer", where)
    usual = tool.decode_vertex_version(tool.encode_vertex_buffer(np.zeros((1, 4), np.uint8), 1, 4))
    tool.encode_vertex_version(version)
    try:
        return tool.encode_vertex_buffer(rows, *rows.shape)
    finally:  # a setting of the whole library, on which others count
        tool.encode_vertex_version(usual)


def version_of(where: str, packed: bytes) -> int:
    """The version of the codec that attributes are compressed in."""
    return int(library("meshoptimizer", where).decode_vertex_version(packed))


def unfiltered(where: str, rows: Bits, name: str) -> Bits:
    """Rows (count, stride) as a filter's numbers stand for them. Errors: MeshError for a filter that is not known."""
    tool: Any = library("meshoptimizer", where)
    filters = {
        "OCTAHEDRAL": tool.decode_filter_oct,
        "QUATERNION": tool.decode_filter_quat,
        "EXPONENTIAL": tool.decode_filter_exp,
    }
    if name == "NONE" or not len(rows):
        return rows
    if name not in filters:
        raise MeshError(f"{where} is compressed with the filter {name!r}, which is not read here")
    if rows.shape[1] not in STRIDES[name]:
        raise MeshError(f"{where}: the filter {name} is not for rows of {rows.shape[1]} bytes")
    return filters[name](rows, *rows.shape)


def filtered(rows: Bits, name: str, old: Bits) -> Bits:
    """What decodes to ``rows`` (n, stride), or to what is nearest; as coarse as the ``old`` filtered rows are."""
    if name == "OCTAHEDRAL":
        return _octahedral(rows, old)
    if name == "EXPONENTIAL":
        values = rows.view("<f4").astype(np.float64)
        mantissas, exponents = mantissas_of(values, exponents_of(old))
        words = (exponents << _MANTISSA_BITS) | (mantissas & ((1 << _MANTISSA_BITS) - 1))
        return words.astype("<i8").astype("<u4").view(np.uint8)
    return rows


def exponents_of(rows: Bits) -> Ints:
    """The exponents (n, d) of numbers under the exponential filter, in rows of 4 d bytes."""
    return (np.ascontiguousarray(rows).view("<i4") >> _MANTISSA_BITS).astype(np.int64)


def mantissas_of(values: Floats, exponents: Ints) -> tuple[Ints, Ints]:
    """Whole numbers and exponents of two whose products are nearest to values, with the exponents given where they do.

    A number too large for its exponent gets a larger one.
    """
    size = np.where(values == 0.0, _LEAST_EXPONENT, np.frexp(values)[1] - (_MANTISSA_BITS - 1))
    needed = np.minimum(np.maximum(exponents, size), _GREATEST_EXPONENT)
    mantissas = np.rint(np.ldexp(values, -needed))
    over = np.abs(mantissas) > _LARGEST  # rounded up to the next power of two
    needed = np.where(over, needed + 1, needed)
    return np.rint(np.ldexp(values, -needed)).astype(np.int64), needed


def _octahedral(rows: Bits, old: Bits) -> Bits:
    """Directions x, y, z (n, 3) and a fourth number, as the filter keeps them: folded to two, with the old third."""
    kind = "<i1" if rows.shape[1] == 4 else "<i2"
    kept = old.view(kind).copy()
    vectors = rows.view(kind)[:, :3].astype(np.float64)
    sums = np.abs(vectors).sum(axis=1, keepdims=True)
    x, y = np.divide(vectors[:, :2], sums, out=np.zeros((len(vectors), 2)), where=sums > 0).T
    below = vectors[:, 2] < 0.0
    folded = np.where(below, (1.0 - np.abs(y)) * _sign(x), x), np.where(below, (1.0 - np.abs(x)) * _sign(y), y)
    kept[:, :2] = np.rint(np.stack(folded, axis=1) * kept[:, 2:3].astype(np.float64))
    return kept.view(np.uint8)


def _sign(values: AnyArray) -> Floats:
    return np.where(values >= 0.0, 1.0, -1.0)
