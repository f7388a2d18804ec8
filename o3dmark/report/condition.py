"""Strengths, as the names of conditions say them."""

import re


def strength(condition: str) -> tuple[float, str] | None:
    """The number that a condition begins with, and its unit: "0.05%" -> (0.05, "%"). A bare number is only a name."""
    found = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*([^\d\s.].*?)\s*", condition)
    return (float(found[1]), found[2]) if found else None


def same(one: str, other: str) -> bool:
    """Whether two names say one condition: number and unit are equal ("0.10%" and "0.1%"), or the names are."""
    return one == other or (strength(one) is not None and strength(one) == strength(other))
