"""Three numbers of each vertex of a PLY file that belong together, a position or a normal: read, rounded, written."""

import numpy as np

from o3dmark.arrays import Floats
from o3dmark.errors import MeshError
from o3dmark.files._changes import differs
from o3dmark.files.asset import float_steps
from o3dmark.files.ply.header import Property
from o3dmark.files.ply.rows import Rows
from o3dmark.files.text.notation import Notation, extent_of
from o3dmark.files.text.numbers import Numbers
from o3dmark.files.text.splicing import Edit
from o3dmark.files.text.words import Places


class Columns:
    """The properties ``names`` of the rows of an element; ``values`` (n, 3), read-only, are their numbers."""

    def __init__(self, rows: Rows, properties: tuple[Property, ...]) -> None:
        self._rows, self._properties = rows, properties
        self.values = np.empty((rows.element.count, len(properties)))
        with np.errstate(invalid="ignore"):  # of what is no number
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
        if not self._rows.body.order:
            return np.array([float(kind[0] != "f") for kind in self.kinds])
        if len(set(self.kinds)) == 1:
            return _steps(self.values, self.kinds[0])
        return np.column_stack([_steps(column, kind) for column, kind in zip(self.values.T, self.kinds, strict=True)])

    def rounded(self, values: Floats, *, clipped: bool = False) -> Floats:
        """The numbers (n, 3) that can stand there next to ``values``.

        Errors: MeshError for a new number that is not finite or, unless ``clipped``, beyond what its type holds.
        """
        text = not self._rows.body.order
        if len(set(self.kinds)) == 1:
            result = _rounded(values, self.kinds[0], text=text, clipped=clipped)
        else:
            columns = zip(values.T, self.kinds, strict=True)
            result = np.column_stack([_rounded(column, kind, text=text, clipped=clipped) for column, kind in columns])
        if not np.isfinite(result).all():
            lost = ~np.isfinite(result) & differs(values, self.values)
            for row, k in np.argwhere(lost)[:1]:
                p = self._properties[k]
                raise MeshError(
                    f"{self._rows.body.name}: a vertex cannot be at {p.name} = {values[row, k]:g},"
                    f" which is no number of its type ({np.dtype(p.kind).name})"
                )
        return result

    def put(self, rows: Rows, values: Floats) -> None:
        """Write what `rounded` gave into rows that were `copied`, where it differs from what is there."""
        changed = differs(values, self.values)
        for k, p in enumerate(self._properties):
            rows.put(p, values[:, k], changed[:, k])

    def edits(self, values: Floats, text: bytes, places: Places) -> list[Edit]:
        """What changes in a text whose words stand at ``places``, by what `rounded` gave."""
        at = [places[self._rows.places(p)] for p in self._properties]
        columns = [Numbers(text, where, old) for where, old in zip(at, self.values.T, strict=True)]
        every = np.concatenate(at)
        order = np.argsort(every[:, 0])
        numbers = Numbers(text, every[order], self.values.T.ravel()[order])
        fractions = numbers.notation(extent_of(self.values) or extent_of(values))
        return [
            column.edit(new, fractions if kind[0] == "f" else Notation(0))
            for column, new, kind in zip(columns, values.T, self.kinds, strict=True)
        ]


def _steps(values: Floats, kind: str) -> Floats:
    if kind[0] != "f":
        return np.ones_like(values)
    return float_steps(values, np.float32 if kind == "f4" else np.float64)


def _rounded(values: Floats, kind: str, *, text: bool, clipped: bool) -> Floats:
    if kind[0] == "f":
        with np.errstate(over="ignore"):
            return values if text else values.astype(kind).astype(np.float64)
    bounds = np.iinfo(kind)
    whole = np.rint(values)
    if clipped:
        return np.clip(whole, bounds.min, bounds.max)
    return np.where((whole >= bounds.min) & (whole <= bounds.max), whole, np.nan)
