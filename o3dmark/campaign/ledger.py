"""The rows of a running campaign on disk: DIR/rows.jsonl, one JSON object a line, to which whole jobs are appended.

Whatever moment the process dies, the next one finds a prefix of what was written: it keeps the jobs whose rows are all
there and drops the rest, so that no row is lost or doubled. A compact folder becomes one that grows again.
"""

import json
import os
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import TracebackType

from o3dmark.campaign.plan import Job
from o3dmark.campaign.row import LINES, TABLE, Row, read_rows
from o3dmark.errors import BackendError, SpecError
from o3dmark.files import replacing

try:
    from fcntl import LOCK_EX, LOCK_NB, flock
except ImportError:  # no such lock on this system: two campaigns in one folder are the user's affair
    flock = None  # type: ignore[assignment]


_LOCK = "rows.lock"


class Ledger:
    """The rows file of a folder, open for appending by one process at a time; ``done`` are the ids it has in full.

    Errors: SpecError when the folder holds rows of other jobs than ``jobs``; BackendError when another process writes.
    """

    def __init__(self, directory: str | Path, jobs: Iterable[Job]) -> None:
        self._path, self._held = Path(directory) / LINES, ExitStack()
        self._path.parent.mkdir(parents=True, exist_ok=True)
        self._held.enter_context(locked(self._path.parent))
        try:
            self.done = self._recover({job.id: len(job.readings) for job in jobs})
            self._file = os.open(self._path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
        except BaseException:
            self._held.close()
            raise

    def append(self, rows: Iterable[Row]) -> None:
        """Add the rows of one job; they are on the disk when this returns."""
        data = _text(rows).encode()
        while data:
            data = data[os.write(self._file, data) :]
        os.fsync(self._file)

    def close(self) -> None:
        """Let another process write."""
        os.close(self._file)
        self._held.close()

    def __enter__(self) -> "Ledger":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _recover(self, sizes: dict[str, int]) -> set[str]:
        rows = list(read_rows(self._path.parent))
        counts = Counter(row.job for row in rows)
        if foreign := counts.keys() - sizes.keys():
            raise SpecError(
                f"{self._path.parent} holds rows of {len(foreign)} jobs that are not in this campaign;"
                " choose another --out"
            )
        done = {job for job, count in counts.items() if count == sizes[job]}
        text = _text(row for row in rows if row.job in done)
        if text != (self._path.read_text(encoding="utf-8") if self._path.exists() else ""):
            with replacing(self._path) as draft:
                draft.write_text(text, encoding="utf-8")
        self._path.with_name(TABLE).unlink(missing_ok=True)
        return done


@contextmanager
def locked(directory: Path, name: str = _LOCK) -> Iterator[None]:
    """Keep a folder to this process. Errors: BackendError when another writes to it."""
    lock = os.open(directory / name, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        if flock is not None:
            try:
                flock(lock, LOCK_EX | LOCK_NB)
            except OSError:
                raise BackendError(f"another process is writing to {directory}") from None
        yield
    finally:
        os.close(lock)


def _text(rows: Iterable[Row]) -> str:
    return "".join(json.dumps(row.to_dict(), allow_nan=False) + "\n" for row in rows)
