"""Which rows of a glTF's bytes lie over each other: numbers that are changed in one place must not change another.

Rows may be interleaved (positions, normals, positions, ...) without having a byte in common, so bytes are compared.
"""

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby

import numpy as np

from o3dmark.arrays import AnyArray
from o3dmark.files.gltf.accessors import Rows
from o3dmark.files.gltf.budget import Budget

OTHERS = -1
"""The owner of all bytes that are not to change."""


def overlaps(owned: Sequence[Sequence[Rows]], others: Iterable[Rows], budget: Budget) -> set[tuple[int, int]]:
    """Pairs of owners, the lower first, that have a byte in common; `OTHERS` is one of them.

    owned: the rows of owner 0, 1, ... Rows that lie over rows that lie over a third may be left out, as long as each of
    them is in some pair. Errors: MeshError when the file is made so that this takes forever.
    """
    claims = [(rows, owner) for owner, all_rows in enumerate(owned) for rows in set(all_rows) if rows.count]
    spaces = {rows.space for rows, _ in claims}
    claims += [(rows, OTHERS) for rows in set(others) if rows.count and rows.space in spaces]
    numbers = {space: number for number, space in enumerate(spaces)}
    claims.sort(key=lambda claim: (numbers[claim[0].space], claim[0].start))
    found: set[tuple[int, int]] = set()
    for _, in_space in groupby(claims, key=lambda claim: numbers[claim[0].space]):
        for cluster in _clusters(in_space):
            found |= _collisions(cluster, budget)
    return found


Claim = tuple[Rows, int]


def _clusters(claims: Iterable[Claim]) -> Iterator[list[Claim]]:
    """Claims of one space, ordered by their first bytes, in runs whose ranges touch each other."""
    cluster: list[Claim] = []
    end = 0
    for claim in claims:
        if cluster and claim[0].start >= end:
            yield cluster
            cluster = []
        cluster.append(claim)
        end = max(end, claim[0].end) if len(cluster) > 1 else claim[0].end
    if cluster:
        yield cluster


def _collisions(cluster: list[Claim], budget: Budget) -> set[tuple[int, int]]:
    """Pairs of owners with a byte in common: each marks its bytes, and sees whose they were."""
    found: set[tuple[int, int]] = set()
    if len({owner for _, owner in cluster}) == 1:
        return found
    first, last = cluster[0][0].start, max(rows.end for rows, _ in cluster)
    owners = sorted({owner for _, owner in cluster if owner != OTHERS})
    number = {owner: place for place, owner in enumerate(owners, start=1)}
    budget.work(last - first)
    marks = np.zeros(last - first, np.min_scalar_type(len(owners)))
    for rows, owner in sorted(cluster, key=lambda claim: claim[1] == OTHERS):
        budget.work(rows.count * rows.size)
        here = _bytes_of(rows, marks, first)
        if here.any():
            seen = {owners[mark - 1] for mark in np.unique(here).tolist() if mark}
            found |= {(min(owner, other), max(owner, other)) for other in seen if other != owner}
        if owner != OTHERS:
            here[...] = number[owner]
    return found


def _bytes_of(rows: Rows, marks: AnyArray, first: int) -> AnyArray:
    """The marks (count, size) of the bytes that rows take, as a view."""
    wide = marks.itemsize
    return np.ndarray(
        (rows.count, rows.size), marks.dtype, marks, (rows.start - first) * wide, (rows.stride * wide, wide)
    )
