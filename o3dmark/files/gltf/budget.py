"""How much memory and work a file may ask for, by its size: a file can name the same bytes a million times."""

from o3dmark.errors import MeshError

_MEMORY = 6, 128 << 20  # times the file, and beside: what is made of it at once stays within ten times and 256 MiB
_WORK = 64, 1 << 30


class Budget:
    """What is left for a file of ``size`` bytes; those that it cannot be read without are added when they are read."""

    def __init__(self, name: str, size: int) -> None:
        self.size = size
        self._name, self._memory, self._work = name, 0, 0

    def take(self, n_bytes: int) -> None:
        """Memory that will be held. Errors: MeshError when it is more than honest files of this size need."""
        self._memory += n_bytes
        self._check(self._memory, _MEMORY)

    def work(self, n_bytes: int) -> None:
        """Bytes that will be looked at. Errors: as `take`."""
        self._work += n_bytes
        self._check(self._work, _WORK)

    def _check(self, asked: int, limit: tuple[int, int]) -> None:
        if asked > limit[0] * self.size + limit[1]:
            raise MeshError(
                f"{self._name} uses its {self.size} bytes so often that {asked} would be needed; it is damaged, or made"
                " to exhaust memory"
            )
