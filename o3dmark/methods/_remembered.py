"""A sequence that is worked out as it is first asked for, and kept for whoever asks next."""

from collections.abc import Iterator
from typing import Generic, TypeVar

T = TypeVar("T")


class Remembered(Generic[T]):
    """What an iterator yields, for any number of passes over it."""

    def __init__(self, source: Iterator[T]) -> None:
        self._source, self._known = source, list[T]()

    def __iter__(self) -> Iterator[T]:
        position = 0
        while True:
            if position == len(self._known):
                for new in self._source:
                    self._known.append(new)
                    break
                else:
                    return
            yield self._known[position]
            position += 1
