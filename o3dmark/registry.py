"""Named, frozen, JSON-able option objects, and the one-line text that stands for each.

A method, an attack, a metric, a code or a shape is a frozen dataclass whose fields are its options. Registering the
class under a name makes three spellings of the same thing equal:

    Noise(amplitude=0.003)    "noise:amplitude=0.003"    {"name": "noise", "amplitude": 0.003}

Options left out of a spec keep their defaults; options that equal their default are left out of the canonical text.
"""

import dataclasses
import difflib
import importlib
import pkgutil
import types
import typing
from collections.abc import Callable, Iterator
from typing import Any, Generic, TypeVar

from o3dmark.errors import SpecError

T = TypeVar("T")
_BOOLS = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}


class Registry(Generic[T]):
    """The classes of one kind, by name; ``package`` is imported module by module the first time that all are wanted.

    A module that has the name of a class, but for its hyphens, is looked into first: some take long to import.
    """

    def __init__(self, kind: str, package: str | None = None) -> None:
        self.kind = kind
        self._package = package
        self._classes: dict[str, type[T]] = {}

    def register(self, name: str) -> Callable[[type[T]], type[T]]:
        """Class decorator: make a frozen dataclass known under ``name``."""

        def enter(cls: type[T]) -> type[T]:
            if not dataclasses.is_dataclass(cls) or not cls.__dataclass_params__.frozen:  # type: ignore[attr-defined]
                raise TypeError(f"{cls.__name__} must be a frozen dataclass to be registered")
            if name in self._classes:
                raise ValueError(f"two classes want the {self.kind} name {name!r}")
            self._classes[name] = cls
            cls.name = name  # type: ignore[attr-defined]
            return cls

        return enter

    def _discover(self) -> dict[str, type[T]]:
        package, self._package = self._package, None
        if package is not None:
            for module in pkgutil.iter_modules(importlib.import_module(package).__path__):
                if not module.name.startswith("_"):
                    importlib.import_module(f"{package}.{module.name}")
        return self._classes

    def _look_into(self, module: str) -> None:
        """Import one module of the package, if there is one of that name."""
        names = {found.name for found in pkgutil.iter_modules(importlib.import_module(str(self._package)).__path__)}
        if module in names and not module.startswith("_"):
            importlib.import_module(f"{self._package}.{module}")

    def __iter__(self) -> Iterator[str]:
        return iter(sorted(self._discover()))

    def __getitem__(self, name: str) -> type[T]:
        """The class registered under ``name``; SpecError names the nearest ones otherwise."""
        if self._package is not None and name not in self._classes:
            self._look_into(name.replace("-", "_"))
        if name in self._classes:
            return self._classes[name]
        classes = self._discover()
        if name not in classes:
            raise SpecError(f"no {self.kind} is called {name!r}{nearest(name, list(classes))}")
        return classes[name]

    def class_called(self, name: str) -> type[T]:
        """The registered class of that name, "Noise", for packages to let people import it. Errors: AttributeError."""
        if name[:1].isupper():
            for cls in self._discover().values():
                if cls.__name__ == name:
                    return cls
        raise AttributeError(f"no {self.kind} is a class {name!r}")

    def make(self, spec: "str | dict[str, Any] | T") -> T:
        """An object from its text (``"noise:amplitude=0.003"``), its dict, or itself."""
        if isinstance(spec, str):
            name, _, rest = spec.partition(":")
            options: dict[str, Any] = _split_options(spec, rest)
        elif isinstance(spec, dict):
            options = {str(key): value for key, value in spec.items()}
            name = str(options.pop("name", ""))
        else:
            return spec
        cls = self[name.strip()]
        known = {field.name: field for field in dataclasses.fields(cls) if field.init}  # type: ignore[arg-type]
        for option in options:
            if option not in known:
                raise SpecError(f"{self.kind} {name!r} has no option {option!r}{nearest(option, list(known))}")
        hints = typing.get_type_hints(cls)
        values = {option: _convert(name, option, value, hints[option]) for option, value in options.items()}
        try:
            return cls(**values)
        except (ValueError, TypeError) as error:
            raise SpecError(f"{self.kind} {name!r}: {error}") from error


def spec_of(thing: Any) -> str:
    """The canonical text of a registered object: its name and the options that differ from their defaults."""
    options = ",".join(
        f"{field.name}={_text(getattr(thing, field.name))}"
        for field in dataclasses.fields(thing)
        if field.init and getattr(thing, field.name) != field.default
    )
    return f"{thing.name}:{options}" if options else str(thing.name)


def to_dict(thing: Any) -> dict[str, Any]:
    """Name and every option of a registered object, ready for JSON."""
    return {"name": thing.name} | {f.name: getattr(thing, f.name) for f in dataclasses.fields(thing) if f.init}


def describe(cls: type) -> list[tuple[str, str, Any, str]]:
    """(option, type, default, comment) for each option of a registered class, in order."""
    hints = typing.get_type_hints(cls)
    return [
        (f.name, _type_text(hints[f.name]), f.default, f.metadata.get("doc", ""))
        for f in dataclasses.fields(cls)
        if f.init
    ]


def option(default: Any, doc: str) -> Any:
    """A dataclass field with a default and the one comment (unit, what a length is relative to) that users see."""
    return dataclasses.field(default=default, metadata={"doc": doc})


def _split_options(spec: str, rest: str) -> dict[str, str]:
    options: dict[str, str] = {}
    for item in filter(None, (part.strip() for part in rest.split(","))):
        key, equals, value = item.partition("=")
        if not equals:
            raise SpecError(f"{spec!r}: {item!r} should read option=value")
        if key.strip() in options:
            raise SpecError(f"{spec!r}: {key.strip()!r} is given twice")
        options[key.strip()] = value.strip()
    return options


def _convert(owner: str, option: str, value: Any, hint: Any) -> Any:
    kinds = typing.get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
    if type(None) in kinds and (value is None or str(value).lower() in ("none", "auto")):
        return None
    for kind in kinds:
        if typing.get_origin(kind) is typing.Literal:
            chosen = [choice for choice in typing.get_args(kind) if str(choice) == str(value)]
            if chosen:
                return chosen[0]
            continue
        try:
            if kind is bool:
                return _BOOLS[str(value).lower()]
            if kind is int:
                return int(str(value))  # by its text: int(2.7) would drop the rest in silence
            if kind in (float, str):
                return kind(value)
        except (KeyError, ValueError, TypeError):
            continue
    raise SpecError(f"{owner}: {option} should be {_type_text(hint)}, not {value!r}")


def _type_text(hint: Any) -> str:
    if isinstance(hint, types.UnionType):
        return " or ".join(_type_text(kind) for kind in typing.get_args(hint))
    if typing.get_origin(hint) is typing.Literal:
        return "|".join(map(str, typing.get_args(hint)))
    return "none" if hint is type(None) else getattr(hint, "__name__", str(hint))


def _text(value: Any) -> str:
    return "none" if value is None else str(value).lower() if isinstance(value, bool) else str(value)


def nearest(name: str, known: list[str]) -> str:
    """What to say after "there is no ...": the known name that looks like it, or all of them."""
    close = difflib.get_close_matches(name, known, n=1)
    return f"; did you mean {close[0]!r}?" if close else f"; there is {', '.join(sorted(known))}" if known else ""
