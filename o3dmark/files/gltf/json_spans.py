"""Where a value stands in a JSON text, so that it can be replaced without writing the rest anew.

    spans = JsonSpans(text)
    start, end = spans.of("accessors", 3, "min")
    replaced(text, {(start, end): "[0, 0, 0]"})

Key order, white space, notation of numbers and keys that stand twice all stay as they are.
"""

import json
import re
from collections.abc import Mapping
from typing import Any, TypeAlias

Span: TypeAlias = tuple[int, int]
Step: TypeAlias = str | int

_SPACE = re.compile(r"[ \t\n\r]*")


class JsonSpans:
    """The places of values in a text that the json module has read without complaint.

    Where a key stands twice in an object, the last one counts, as for the json module. What was looked up is
    remembered, so that a thousand accessors cost one pass.
    """

    def __init__(self, text: str, start: int = 0) -> None:
        self._text = text
        self._start = start
        self._decoder = json.JSONDecoder()
        self._inside: dict[int, dict[Step, Span]] = {}

    def of(self, *path: Step) -> Span | None:
        """Where the value at a path of keys and positions begins and ends, or None when it is not there."""
        start = self._skip(self._start)
        span = start, self._decoder.raw_decode(self._text, start)[1] if not path else -1
        for step in path:
            members = self._members(span[0])
            if step not in members:
                return None
            span = members[step]
        return span

    def _members(self, start: int) -> dict[Step, Span]:
        """What an object or a list at ``start`` holds; nothing for other values."""
        if start not in self._inside:
            read = {"{": self._object, "[": self._list}.get(self._text[start])
            self._inside[start] = read(start + 1) if read else {}
        return self._inside[start]

    def _object(self, at: int) -> dict[Step, Span]:
        members: dict[Step, Span] = {}
        at = self._skip(at)
        while self._text[at] != "}":
            key, at = self._decoder.raw_decode(self._text, at)
            begin = self._skip(self._skip(at) + 1)  # behind the colon
            members[key], at = self._value(begin)
        return members

    def _list(self, at: int) -> dict[Step, Span]:
        members: dict[Step, Span] = {}
        at = self._skip(at)
        while self._text[at] != "]":
            members[len(members)], at = self._value(at)
        return members

    def _value(self, begin: int) -> tuple[Span, int]:
        """The span of the value at ``begin``, and where what follows it and its comma stands."""
        end: int = self._decoder.raw_decode(self._text, begin)[1]
        after = self._skip(end)
        return (begin, end), self._skip(after + 1) if self._text[after] == "," else after

    def _skip(self, at: int) -> int:
        space = _SPACE.match(self._text, at)
        return space.end() if space else at


def replaced(text: str, changes: Mapping[Span, str]) -> str:
    """The text with other words at some places that do not overlap."""
    pieces, at = [], 0
    for (start, end), words in sorted(changes.items()):
        pieces += [text[at:start], words]
        at = end
    return "".join([*pieces, text[at:]])


def loads(text: str, start: int) -> tuple[Any, int]:
    """The value that begins at ``start``, and where it ends. Errors: ValueError, whose words say what is wrong."""
    begin = _SPACE.match(text, start)
    try:
        return json.JSONDecoder().raw_decode(text, begin.end() if begin else start)
    except RecursionError:
        raise ValueError("lists within lists, too deep to be read") from None
