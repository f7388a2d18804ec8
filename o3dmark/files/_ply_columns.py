"""Three numbers of each vertex of a PLY file that belong together, a position or a normal: read, rounded, written."""

import numpy as np
from numpy.typing import NDArray

from o3dmark.arrays import Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.files._changes import differs
from o3dmark.files._ply_header import Property
from o3dmark.files._ply_rows import Body, Rows
from o3dmark.files._text import Notation
from o3dmark.files._words import Numbers, extent_of
from o3dmark.files.asset import float_steps


class Columns:
    """The properties ``names`` of the rows of an element; ``values`` (n, 3), read-only, are their numbers."""

    def __init__(self, rows: Rows, properties: tuple[Property, ...]) -> None:
        self._rows, self._properties = rows, properties
        self.values = np.empty((rows.element.count, len(properties)))
        for column, p in zip(self.values.T, properties, strict=True):
            column[:] = rows.numbers(p)
        self.values.setflags(write=False)

    @classmethod
    def find(cls, rows: Rows, names: tuple[str, ...]) -> "Columns | None":
        """The columns of these names, or None where one is missing."""
        found = [p for name in names if (p := rows.element.find(name)) is not None]
        return cls(rows, tuple(found)) if len(found) == len(names) else None

    @property
    def kinds(self) -> list[str]:
        return [p.kind for p in self._properties]

    @property
    def signed(self) -> bool:
        return not any(kind[0] == "u" for kind in self.kinds)

    @property
    def steps(self) -> Floats:
        """How far apart the numbers are that can stand there (n, 3), or (3,); 0 for fractions in a text."""
        text = not self._rows.body.order
        steps = [
            np.ones(1) if p.kind[0] != "f" else np.zeros(1) if text else float_steps(column, np.dtype(p.kind))
            for column, p in zip(self.values.T, self._properties, strict=True)
        ]
        return np.column_stack(np.broadcast_arrays(*steps))

    def rounded(self, values: Floats, *, clipped: bool = False) -> Floats:
        """The numbers (n, 3) that can stand there next to ``values``.

        Errors: MeshError for a new number that is not finite or, unless ``clipped``, beyond what its type holds.
        """
        result = np.empty_like(self.values)
        for k, kind in enumerate(self.kinds):
            result[:, k] = _rounded(values[:, k], kind, text=not self._rows.body.order, clipped=clipped)
        if not np.isfinite(result).all():
            lost = ~np.isfinite(result) & differs(values, self.values)
            for row, k in np.argwhere(lost)[:1]:
                p = self._properties[k]
                raise MeshError(
                    f"{self._rows.body.name}: a vertex cannot be at {p.name} = {values[row, k]:g},"
                    f" which is no number of its type ({np.dtype(p.kind).name})"
                )
        return result

    def put(self, body: Body, values: Floats) -> None:
        """Write what `rounded` gave into a binary body, the caller's own, where it differs from what is there."""
        rows, changed = self._rows.within(body), differs(values, self.values)
        for k, p in enumerate(self._properties):
            rows.put(p, values[:, k], changed[:, k])

    def changes(
        self, values: Floats, text: bytes, starts: Ints, ends: Ints
    ) -> list[tuple[Ints, Ints, NDArray[np.bytes_]]]:
        """What changes in a text whose words begin and end there, by what `rounded` gave: as `Numbers.changes`."""
        columns = [
            Numbers(text, starts[at := self._rows.places(p)], ends[at], old)
            for p, old in zip(self._properties, self.values.T, strict=True)
        ]
        every = Numbers(
            text,
            np.concatenate([column.starts for column in columns]),
            np.concatenate([column.ends for column in columns]),
            self.values.T.ravel(),
        )
        fractions = every.notation(extent_of(self.values))
        return [
            column.changes(new, fractions if kind[0] == "f" else Notation(0))
            for column, new, kind in zip(columns, values.T, self.kinds, strict=True)
        ]


def _rounded(values: Floats, kind: str, *, text: bool, clipped: bool) -> Floats:
    if kind[0] == "f":
        with np.errstate(over="ignore"):
            return values if text else values.astype(kind).astype(np.float64)
    bounds = np.iinfo(kind)
    whole = np.rint(values)
    if clipped:
        return np.clip(whole, bounds.min, bounds.max)
    return np.where((whole >= bounds.min) & (whole <= bounds.max), whole, np.nan)
