"""Answers for people: probabilities in words, and small tables for notebooks."""

import html
from collections.abc import Mapping

_NAMES = {3: "thousand", 6: "million", 9: "billion", 12: "trillion"}
_NAMED_UP_TO = 15  # powers of ten that have a name here; beyond, 10^18 says more


def mistaken(log10_p: float) -> str:
    """A sentence: how probable it is that what was found is not there."""
    return f"The chance that this is a mistake is {one_in(log10_p)}."


def one_in(log10_p: float) -> str:
    """A probability (its log10) as "1 in 24 million", rounded so that it never sounds rarer than it is."""
    power = -log10_p
    if power >= _NAMED_UP_TO:
        return f"1 in 10^{int(power)}"
    steps = int(power // 3) * 3
    count = int(10.0 ** (power - steps) + 1e-9)
    return f"1 in {count} {_NAMES[steps]}" if steps else f"1 in {max(count, 1)}"


def table(rows: Mapping[str, str]) -> str:
    """An HTML table of two columns, as notebooks show one."""
    cells = (f"<tr><th>{html.escape(name)}</th><td>{html.escape(value)}</td></tr>" for name, value in rows.items())
    return f"<table>{''.join(cells)}</table>"
