"""Lists of different lengths, one after the other in bytes or words: compiled by numba, row by row.

``data`` is an array of bytes (uint8), or of numbers each of which is a word (float64); places and sizes are counted in
its items.
"""

import numpy as np
from numba import njit

NOT_WHOLE = -(1 << 62)  # stands for a word that is no whole number: neither a length nor a vertex


@njit(cache=True, nogil=True)
def _unsigned(data, at, size, big):  # type: ignore[no-untyped-def]
    if size == 1:
        number = np.int64(data[at])
        return number if number == data[at] else np.int64(NOT_WHOLE)
    value = np.int64(0)
    for k in range(size):
        value = value << 8 | np.int64(data[at + (k if big else size - 1 - k)])
    return value


@njit(cache=True, nogil=True)
def walk(data, start, rows, sizes, items, signed, big, which, places, lengths):  # type: ignore[no-untyped-def]
    """Goes through rows of properties, each a number of ``sizes`` or, where ``items`` > 0, a list of such after it.

    Returns how many whole rows there are, where they end, and the length of the list that is negative, or 0. For
    property ``which``, if not -1, ``places`` (rows,) and ``lengths`` (rows,) are filled.
    """
    at = start
    for row in range(rows):
        begin = at
        for k in range(len(sizes)):
            if sizes[k] > len(data) - at:
                return row, begin, 0
            length = np.int64(1)
            if items[k] > 0:
                length = _unsigned(data, at, sizes[k], big)
                if signed[k] and length >> (8 * sizes[k] - 1):
                    length -= np.int64(1) << 8 * sizes[k]
                if length < 0:
                    return row, begin, length
                at += sizes[k]
                if length > (len(data) - at) // items[k]:
                    return row, begin, 0
            if k == which:
                places[row] = at
                lengths[row] = length
            at += length * items[k] if items[k] > 0 else sizes[k]
    return rows, at, 0


@njit(cache=True, nogil=True)
def gather(data, places, lengths, size, big, out):  # type: ignore[no-untyped-def]
    """All items of lists, one after the other: their bits, without a sign."""
    done = 0
    for row in range(len(places)):
        for k in range(lengths[row]):
            out[done] = _unsigned(data, places[row] + k * size, size, big)
            done += 1


@njit(cache=True, nogil=True)
def fans(items, lengths, out):  # type: ignore[no-untyped-def]
    """Polygons as triangles (m, 3) about their first corners."""
    at, done = 0, 0
    for length in lengths:
        for k in range(1, length - 1):
            out[done, 0] = items[at]
            out[done, 1] = items[at + k]
            out[done, 2] = items[at + k + 1]
            done += 1
        at += length


@njit(cache=True, nogil=True)
def strips(items, lengths, out):  # type: ignore[no-untyped-def]
    """Strips as triangles, every second one turned; after a -1 another strip begins. Returns how many there are."""
    at, done = 0, 0
    for length in lengths:
        corners = 0  # of the present strip
        for k in range(at, at + length):
            corners = corners + 1 if items[k] != -1 else 0
            if corners > 2:
                odd = (corners - 3) % 2
                out[done, 0] = items[k - 2 + odd]
                out[done, 1] = items[k - 1 - odd]
                out[done, 2] = items[k]
                done += 1
        at += length
    return done
