"""The ledger of copies: an SQLite file, each row tied to all before it by the chain of `chain`.

It says what was given to whom, and holds no secret: a codeword follows from the owner's key and the name of the copy.
"""

import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

from o3dmark.copies.chain import COLUMNS, EMPTY, Copy, Entry, Row, entered, misfit
from o3dmark.copies.storage import connect, damaged, explained, prepare
from o3dmark.errors import LedgerError

_COLUMNS = ", ".join((*COLUMNS, "head"))
_WAIT = 10.0  # seconds for another process to finish what it is writing


@dataclass(frozen=True)
class Stored:
    """What a ledger holds at one moment, as it lies there: rows and their heads, and what it says of itself."""

    rows: tuple[Row, ...]
    heads: tuple[str, ...]
    counted: int
    latest: str

    @property
    def misfit(self) -> str | None:
        """Why it is no chain; None where it is."""
        return misfit(self.rows, self.heads, self.counted, self.latest)

    def copies(self) -> list[Copy]:
        """The copies of the rows. Errors: LedgerError for a row that describes none."""
        return [Copy.of_row(row, head) for row, head in zip(self.rows, self.heads, strict=True)]


class Ledger:
    """An open ledger; several may be open at a time, in one process or in many.

    Errors: of all that it does LedgerError, which says what is wrong with the file and what to do.
    """

    def __init__(self, path: str | Path, *, writable: bool = False, wait: float = _WAIT) -> None:
        """The ledger at ``path``; writable, it is made where nothing is there. ``wait``: seconds for another writer."""
        self.path, self._writable = Path(path), writable
        if writable:
            prepare(self.path)
        self._connection = connect(self.path, writable=writable, wait=wait)

    def add(self, entries: Iterable[Entry]) -> list[Copy]:
        """Enter copies in their order, all or none; they are on the disk when this returns.

        Errors: LedgerError, also for a name that its asset has already.
        """
        made = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
        if not self._writable:
            raise LedgerError(f"{self.path.name} was opened to be read; open it as writable to enter copies")
        ready, copies = list(entries), list[Copy]()  # others can write while they are still being made
        with self._transaction("IMMEDIATE"):
            count, head = self._last()
            for number, entry in enumerate(ready, count + 1):
                copies.append(entered(entry, number, made, head))
                head = copies[-1].head
                self._insert(copies[-1])
            self._connection.execute("UPDATE ledger SET copies = ?, head = ?", (count + len(copies), head))
        return copies

    def copies(self, asset: str | None = None) -> list[Copy]:
        """All copies, or those of an asset (SHA-256), by number. Errors: LedgerError where the chain is broken."""
        copies = self.sound().copies()
        return copies if asset is None else [copy for copy in copies if copy.asset == asset]

    @property
    def head(self) -> str:
        """The head (64 hexadecimal digits) of all copies. Errors: LedgerError where the chain is broken."""
        return self.sound().latest

    def stored(self) -> Stored:
        """What lies in the file, sound or not. Errors: LedgerError where SQLite cannot read it."""
        with self._transaction("DEFERRED"):
            found = self._connection.execute("PRAGMA integrity_check(1)").fetchone()[0]
            if found != "ok":
                raise LedgerError(damaged(self.path, found))
            rows = self._connection.execute(f"SELECT {_COLUMNS} FROM copies ORDER BY number").fetchall()
            return Stored(tuple(row[:-1] for row in rows), tuple(row[-1] for row in rows), *self._state())

    def sound(self) -> Stored:
        """What lies in the file. Errors: LedgerError where the chain is broken, too."""
        stored = self.stored()
        if stored.misfit:
            raise LedgerError(_broken(self.path, stored.misfit))
        return stored

    def close(self) -> None:
        self._connection.close()

    def __enter__(self) -> "Ledger":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _last(self) -> tuple[int, str]:
        last = self._connection.execute("SELECT number, head FROM copies ORDER BY number DESC LIMIT 1").fetchone()
        if (last or (0, EMPTY)) != (state := self._state()):
            raise LedgerError(_broken(self.path, "its last copy is not the one that it states"))
        return state

    def _state(self) -> tuple[int, str]:
        states = self._connection.execute("SELECT copies, head FROM ledger").fetchall()
        if [type(value) for state in states for value in state] != [int, str]:
            raise LedgerError(damaged(self.path, "it does not state its head"))
        return states[0]

    def _insert(self, copy: Copy) -> None:
        values = (*copy.row, copy.head)
        try:
            self._connection.execute(f"INSERT INTO copies VALUES ({', '.join('?' * len(values))})", values)
        except sqlite3.IntegrityError as error:
            if error.sqlite_errorcode != sqlite3.SQLITE_CONSTRAINT_UNIQUE:
                raise
            raise LedgerError(
                f"{self.path.name} has a copy {copy.name!r} of {copy.source!r} already; each copy needs its own name"
            ) from None

    @contextmanager
    def _transaction(self, kind: Literal["DEFERRED", "IMMEDIATE"]) -> Iterator[None]:
        with explained(self.path):
            self._connection.execute(f"BEGIN {kind}")
            try:
                yield
                self._connection.execute("COMMIT")
            finally:
                if self._connection.in_transaction:  # SQLite has ended it by itself where the disk is full
                    self._connection.execute("ROLLBACK")


def _broken(path: Path, why: str) -> str:
    return (
        f"the chain of {path.name} is broken: {why}. Nothing can be concluded from it; take the last backup that"
        " `o3dmark ledger verify` finds whole"
    )
