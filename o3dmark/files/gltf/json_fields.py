"""Reading a JSON object that nobody has checked: each field is of the kind that is asked for, or an error says which.

fields = Fields("a.glb, accessor 3", {"count": 8})
fields.whole("count")      # 8
fields.text("type")        # MeshError: a.glb, accessor 3: "type" is missing
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any

from o3dmark.errors import MeshError


class Fields:
    """One object of a JSON text; ``where`` names it in errors.

    All methods raise MeshError for a field of another kind, and for one that is missing unless a default is given.
    """

    __slots__ = ("_values", "where")

    def __init__(self, where: str, values: Any) -> None:
        if not isinstance(values, dict):
            raise MeshError(f"{where} is no JSON object")
        self.where, self._values = where, values

    def __contains__(self, key: str) -> bool:
        return key in self._values

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def whole(self, key: str, default: int | None = None) -> int:
        """A whole number that is not negative; 12.0 is one."""
        value = self._get(key, default)
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            raise self.wrong(key, "a whole number, 0 or more")
        return value

    def number_of(self, key: str, length: int) -> int:
        """A number from 0 to ``length`` - 1: which of so many things is meant."""
        value = self.whole(key)
        if value >= length:
            raise self.wrong(key, f"below {length}, as there are no more")
        return value

    def numbers_of(self, key: str, length: int) -> list[int]:
        """A list of numbers from 0 to ``length`` - 1, empty when it is missing."""
        values = self._list(key)
        if not all(isinstance(value, int) and not isinstance(value, bool) and 0 <= value < length for value in values):
            raise self.wrong(key, f"whole numbers below {length}")
        return values

    def text(self, key: str, default: str | None = None) -> str:
        value = self._get(key, default)
        if not isinstance(value, str):
            raise self.wrong(key, "a text")
        return value

    def flag(self, key: str) -> bool:
        """True or false; false when it is missing."""
        value = self._get(key, False)
        if not isinstance(value, bool):
            raise self.wrong(key, "true or false")
        return value

    def floats(self, key: str, default: Sequence[float]) -> list[float]:
        """Finite numbers, as many as the default has."""
        values = self._get(key, list(default))
        if not isinstance(values, list) or len(values) != len(default) or not all(map(_finite, values)):
            raise self.wrong(key, f"{len(default)} finite numbers")
        return [float(value) for value in values]

    def texts(self, key: str) -> list[str]:
        values = self._list(key)
        if not all(isinstance(value, str) for value in values):
            raise self.wrong(key, "a list of texts")
        return values

    def part(self, key: str) -> "Fields":
        """An object in this one, without any field when it is missing."""
        return Fields(f"{self.where}, {key}", self._get(key, {}))

    def parts(self, key: str, singular: str) -> list["Fields"]:
        """A list of objects, empty when it is missing; the first is called ``singular`` 0."""
        return [Fields(f"{self.where}, {singular} {number}", value) for number, value in enumerate(self._list(key))]

    def wrong(self, key: str, wanted: str) -> MeshError:
        return MeshError(f"{self.where}: {key!r} should be {wanted}" if key in self else f"{self.where}: no {key!r}")

    def _list(self, key: str) -> list[Any]:
        values = self._get(key, [])
        if not isinstance(values, list):
            raise self.wrong(key, "a list")
        return values

    def _get(self, key: str, default: Any) -> Any:
        return self._values.get(key, default)


def _finite(value: Any) -> bool:
    try:
        return not isinstance(value, bool) and isinstance(value, int | float) and math.isfinite(value)
    except OverflowError:  # a whole number beyond all floats
        return False
