"""The command that lists what there is."""

import sys
from collections.abc import Mapping
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from o3dmark.cli._arguments import Json
from o3dmark.cli._talk import print_result
from o3dmark.errors import SpecError

_COLUMNS = ("option", "type", "default", "meaning")


def list_(
    kind: Annotated[
        str | None, typer.Argument(metavar="KIND", help="methods, attacks, metrics, codes, shapes or profiles.")
    ] = None,
    json: Json = False,
) -> None:
    """What there is, with every option, its default and its unit; without KIND, of which kinds."""
    from o3dmark.registry import describe

    registries = _registries()
    if kind is None:
        print_result({name: list(registry) for name, registry in registries.items()}, json)
        return
    if kind not in registries:
        raise SpecError(f"no list of {kind!r}; there is {', '.join(registries)}")
    registry = registries[kind]
    if isinstance(registry, Mapping):
        print_result({name: each.to_dict() for name, each in registry.items()}, json)
        return
    entries: dict[str, Any] = {
        name: {
            "summary": (registry[name].__doc__ or "").strip().splitlines()[0],
            "options": [dict(zip(_COLUMNS, row, strict=True)) for row in describe(registry[name])],
        }
        for name in registry
    }
    if json:
        print_result(entries, json)
        return
    table = Table("name", *_COLUMNS, box=None, pad_edge=False)
    for name, entry in entries.items():
        table.add_row(name, "", "", "", entry["summary"], style="bold")
        for row in entry["options"]:
            table.add_row("", row["option"], row["type"], str(row["default"]), row["meaning"])
    Console(soft_wrap=not sys.stdout.isatty()).print(table)


def _registries() -> dict[str, Any]:
    from o3dmark.attacks import ATTACKS
    from o3dmark.coding.payload import CODES
    from o3dmark.methods import METHODS
    from o3dmark.metrics import METRICS
    from o3dmark.profiles import PROFILES
    from o3dmark.synthetic import SHAPES

    return {
        "methods": METHODS,
        "attacks": ATTACKS,
        "metrics": METRICS,
        "codes": CODES,
        "shapes": SHAPES,
        "profiles": PROFILES,
    }
