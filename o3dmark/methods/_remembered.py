"""A sequence that is worked out as it is first asked for, and kept for whoever asks next."""

import itertools
from collections.abc import Iterator
from typing import Generic, TypeVar

T = TypeVar("T")


class Remembered(Generic[T]):
    """What an iterator yields, for any number of passes over it."""

    def __init__(self, source: Iterator[T]) -> None:
        self._source, self._known = source, list[T]()

    def __iter__(self) -> Iterator[T]:
        for position in itertools.count():
            if position == len(self._known):
                self._known += itertools.islice(self._source, 1)
            if position == len(self._known):
                return
            yield self._known[position]
