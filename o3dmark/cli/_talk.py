"""What commands print: one object on stdout, talk on stderr."""

import json as json_text
import sys
import time
from collections.abc import Iterable, Mapping
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

_FOR_PROGRAMS = {"soft", "log10_p", "patches"}  # of no use in a table


def since(started: float) -> float:
    return round(time.perf_counter() - started, 3)


def print_result(values: Mapping[str, Any], json: bool) -> None:
    """One object on stdout: JSON, or a table of two columns."""
    if json:
        print(json_text.dumps(values))
        return
    table = Table(box=None, show_header=False, pad_edge=False)
    for name, value in values.items():
        if name not in _FOR_PROGRAMS:
            table.add_row(name, Text(printable(_text(value))))
    Console(soft_wrap=True, highlight=False).print(table)


def print_answer(answer: str, values: Mapping[str, Any], told: Iterable[str], json: bool, verbose: bool) -> None:
    """JSON, or a sentence and below it a table: of the values that are ``told``, or ``verbose`` of all."""
    if not json:
        print(printable(answer))
        values = values if verbose else {name: values[name] for name in told}
    print_result(values, json)


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_text(each)}" for name, each in value.items())
    if isinstance(value, Iterable) and not isinstance(value, str):
        return " ".join(_text(each) for each in value)
    return "-" if value is None else str(value)


def printable(text: str) -> str:
    """A text from somebody's file with what would steer a terminal, or break a line, spelled out."""
    return "".join(sign if sign.isprintable() else ascii(sign)[1:-1] for sign in text)


def say(text: str) -> None:
    print(text, file=sys.stderr)
