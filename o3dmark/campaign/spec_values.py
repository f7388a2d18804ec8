"""Values of a campaign's TOML file, checked one by one: a SpecError names the key and what should stand there."""

from collections.abc import Collection, Iterator
from difflib import get_close_matches
from types import UnionType
from typing import Any

from o3dmark.errors import SpecError
from o3dmark.registry import Registry, spec_of


class Table:
    """A table of the file, under the keys that lead to it."""

    def __init__(self, content: dict[str, Any], key: str = "") -> None:
        self._content, self._key = content, key

    def __contains__(self, key: str) -> bool:
        return key in self._content

    def items(self) -> Iterator[tuple[str, str, Any]]:
        """(key, name, value) of each line."""
        return ((self.key(name), name, value) for name, value in self._content.items())

    def key(self, name: str) -> str:
        """The name with the keys before it."""
        return f"{self._key}.{name}" if self._key else name

    def check_keys(self, known: Collection[str]) -> None:
        """SpecError for a key that is not known, with the nearest one that is."""
        for key, name, _ in self.items():
            if name not in known:
                close = get_close_matches(name, known, n=1)
                raise SpecError(
                    f"{key}: no such key; " + (f"did you mean {close[0]!r}?" if close else ", ".join(known))
                )

    def value(self, name: str, kind: type | UnionType, default: Any) -> Any:
        """A value of one type."""
        value = self._content.get(name, default)
        if not isinstance(value, kind):
            raise SpecError(f"{self.key(name)}: should be a {getattr(kind, '__name__', kind)}, not {value!r}")
        return value

    def table(self, name: str) -> "Table":
        """A table in this one, empty where there is none."""
        return Table(self.value(name, dict, {}), self.key(name))

    def texts(self, name: str, known: Collection[str] | None = None) -> tuple[str, ...]:
        """A list of texts, each among ``known`` where that is given."""
        return tuple(one_of(self.key(name), text, known) for text in self.value(name, list, []))

    def numbers(self, name: str, default: int, least: int) -> tuple[int, ...]:
        """A whole number, or a list of different ones."""
        value = self._content.get(name, default)
        found = value if isinstance(value, list) else [value]
        if not found or any(type(number) is not int or number < least for number in found):
            raise SpecError(f"{self.key(name)}: should be whole numbers from {least} upwards, not {value!r}")
        if len(set(found)) < len(found):
            raise SpecError(f"{self.key(name)}: a number is given twice in {value!r}")
        return tuple(found)

    def number(self, name: str, default: int) -> int:
        """A whole number from 0 upwards."""
        return self.numbers(name, self.value(name, int, default), least=0)[0]

    def names(
        self, name: str, *, keys: Collection[str] | None = None, values: Collection[str] | None = None
    ) -> dict[str, str]:
        """A table of texts whose keys and values are among those given."""
        table = self.table(name)
        return {one_of(self.key(name), line, keys): one_of(key, text, values) for key, line, text in table.items()}


def one_of(key: str, name: Any, known: Collection[str] | None = None) -> str:
    """``name``, if it is a text and among ``known``, where that is given."""
    if isinstance(name, str) and (known is None or name in known):
        return name
    raise SpecError(f"{key}: should be a text, not {name!r}" if known is None else none_of(key, name, known))


def none_of(key: str, name: Any, known: Collection[str]) -> str:
    """What to say of a name that is not known."""
    return f"{key}: {name!r} is none of {', '.join(known)}"


def checked_spec(registry: Registry[Any], key: str, spec: Any) -> str:
    """The canonical text of a spec."""
    if not isinstance(spec, (str, dict)):
        raise SpecError(f"{key}: should be the text of a {registry.kind}, not {spec!r}")
    try:
        return spec_of(registry.make(spec))
    except SpecError as error:
        raise SpecError(f"{key}: {error}") from None
