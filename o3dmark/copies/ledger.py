"""The ledger of copies: an SQLite file, each row tied to all before it by the chain of `chain`.

It says what was given to whom, and holds no secret: a codeword follows from the owner's key and the name of the copy.

    copies    number, asset, source, name, made, profile, n_bits, mrms, files, head    a row a copy
    ledger    copies, head                                                             one row: how many, the latest head
"""

import os
import sqlite3
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Literal

from o3dmark.copies.chain import COLUMNS, EMPTY, Copy, Entry, Row, entered, misfit
from o3dmark.errors import LedgerError

APPLICATION = 0x6F33646D  # "o3dm", in the header of the file
FORMAT = 1  # user_version in the header; another is another format
SCHEMA = (
    "CREATE TABLE copies (number INTEGER PRIMARY KEY, asset TEXT NOT NULL, source TEXT NOT NULL, name TEXT NOT NULL,"
    " made TEXT NOT NULL, profile TEXT NOT NULL, n_bits INTEGER NOT NULL, mrms TEXT NOT NULL, files TEXT NOT NULL,"
    " head TEXT NOT NULL, UNIQUE (asset, name))",
    "CREATE TABLE ledger (copies INTEGER NOT NULL, head TEXT NOT NULL)",
)
_COLUMNS = ", ".join((*COLUMNS, "head"))
_WAIT = 10.0  # seconds for another process to finish what it is writing

# A rollback journal, and not a write-ahead log: between transactions all is in one file, so that a ledger can be copied,
# sent and time-stamped as it lies there, while what a log still holds stays behind without a word. EXTRA, and not FULL:
# the end of a transaction is the removal of its journal, and only EXTRA makes the folder remember that through a loss of
# power. Killed at any moment, the next opening rolls back what was not committed.
_SETTINGS = ("PRAGMA journal_mode = DELETE", "PRAGMA synchronous = EXTRA")


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
        """The ledger at ``path``. Writable, it is made where nothing is there; ``wait``, in seconds, for other writers."""
        self.path = Path(path)
        if writable:
            _check_writable(self.path)
            if not os.path.lexists(self.path):
                _create(self.path)
        elif not self.path.is_file():
            raise LedgerError(f"there is no ledger at {str(self.path)!r}")
        if self.path.is_file() and not self.path.stat().st_size:  # which SQLite takes for a database without tables
            raise LedgerError(_damaged(self.path, "an empty file"))
        with self._explained():
            self._connection = _connect(self.path, wait)
        try:
            with self._explained():
                self._check_format()
                # Reading, too, opens for writing where that is allowed: only so can what a kill left be rolled back.
                for setting in _SETTINGS if writable else ("PRAGMA query_only = ON",):
                    self._connection.execute(setting)
        except BaseException:
            self.close()
            raise

    def add(self, entries: Iterable[Entry]) -> list[Copy]:
        """Enter copies in their order, all or none; they are on the disk when this returns.

        Errors: LedgerError, also for a name that its asset has already.
        """
        made = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
        copies: list[Copy] = []
        with self._transaction("IMMEDIATE"):
            number, head = self._last()
            for entry in entries:
                copies.append(entered(entry, number + len(copies) + 1, made, copies[-1].head if copies else head))
                self._insert(copies[-1])
            if copies:
                self._connection.execute("UPDATE ledger SET copies = ?, head = ?", (copies[-1].number, copies[-1].head))
        return copies

    def copies(self, asset: str | None = None) -> list[Copy]:
        """All copies, or those of an asset (SHA-256), by number. Errors: LedgerError where the chain is broken."""
        return [copy for copy in self.sound().copies() if asset in (None, copy.asset)]

    @property
    def head(self) -> str:
        """The head (64 hexadecimal digits) of all copies. Errors: LedgerError where the chain is broken."""
        return self.sound().latest

    def stored(self) -> Stored:
        """What lies in the file, sound or not. Errors: LedgerError where SQLite cannot read it."""
        with self._transaction("DEFERRED"):
            found = self._connection.execute("PRAGMA integrity_check(1)").fetchone()[0]
            if found != "ok":
                raise LedgerError(_damaged(self.path, found))
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

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _last(self) -> tuple[int, str]:
        last = self._connection.execute("SELECT number, head FROM copies ORDER BY number DESC LIMIT 1").fetchone()
        if (last or (0, EMPTY)) != (state := self._state()):
            raise LedgerError(_broken(self.path, "its last copy is not the one that it states"))
        return state

    def _state(self) -> tuple[int, str]:
        states = self._connection.execute("SELECT copies, head FROM ledger").fetchall()
        if len(states) != 1:
            raise LedgerError(_damaged(self.path, f"it states its head {len(states)} times"))
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

    def _check_format(self) -> None:
        application, version = (self._number(f"PRAGMA {name}") for name in ("application_id", "user_version"))
        if application != APPLICATION:
            raise LedgerError(f"{str(self.path)!r} is an SQLite file of another program, and no ledger of copies")
        if version != FORMAT:
            raise LedgerError(
                f"{self.path.name} is a ledger of format {version}, and this o3dmark knows format {FORMAT}: update it"
            )
        schema = self._connection.execute(
            "SELECT sql FROM sqlite_schema WHERE sql IS NOT NULL ORDER BY rowid"
        ).fetchall()
        if tuple(sql for (sql,) in schema) != SCHEMA:
            raise LedgerError(_damaged(self.path, "another program has changed its tables"))

    def _number(self, query: str) -> int:
        return int(self._connection.execute(query).fetchone()[0])

    @contextmanager
    def _transaction(self, kind: Literal["DEFERRED", "IMMEDIATE"]) -> Iterator[None]:
        with self._explained():
            self._connection.execute(f"BEGIN {kind}")
            try:
                yield
                self._connection.execute("COMMIT")
            finally:
                if self._connection.in_transaction:  # SQLite has ended it by itself where the disk is full
                    self._connection.execute("ROLLBACK")

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.ProgrammingError:  # of this file, and not of the ledger
            raise
        except sqlite3.Error as error:
            raise LedgerError(_explanation(self.path, error)) from error


def _connect(path: Path, wait: float) -> sqlite3.Connection:
    """A connection that makes no file, and begins no transaction by itself."""
    return sqlite3.connect(f"{path.resolve().as_uri()}?mode=rw", uri=True, timeout=wait, isolation_level=None)


def _create(path: Path) -> None:
    """Make an empty ledger that appears whole or not at all, and not in the place of one made meanwhile."""
    try:
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=".o3dmark-") as folder:
            draft = Path(folder, path.name)
            with closing(sqlite3.connect(draft)) as connection, connection:
                for line in (*SCHEMA, f"PRAGMA application_id = {APPLICATION}", f"PRAGMA user_version = {FORMAT}"):
                    connection.execute(line)
                connection.execute("INSERT INTO ledger VALUES (0, ?)", (EMPTY,))
            try:
                os.link(draft, path)
            except FileExistsError:
                return
            except OSError:  # a file system without links
                if not os.path.lexists(path):
                    os.replace(draft, path)
    except sqlite3.Error as error:
        raise LedgerError(_explanation(path, error)) from error
    except OSError as error:
        raise LedgerError(f"cannot make {path.name} in {str(path.parent)!r}: {error.strerror}") from None


def _check_writable(path: Path) -> None:
    folder = path.resolve().parent
    if not folder.is_dir():
        raise LedgerError(f"there is no folder {str(folder)!r} for the ledger {path.name}")
    for place in [folder, *([path] if path.exists() else [])]:
        if not os.access(place, os.W_OK):
            raise LedgerError(
                f"{str(place)!r} is read-only: a ledger, and the folder that it lies in, must be writable to enter copies"
            )


def _explanation(path: Path, error: sqlite3.Error) -> str:
    """What an error of SQLite means for who has the ledger, and what to do."""
    match getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF:  # what the module finds itself has no code
        case sqlite3.SQLITE_NOTADB:
            return f"{str(path)!r} is no ledger of copies: not an SQLite file"
        case sqlite3.SQLITE_BUSY | sqlite3.SQLITE_LOCKED:
            return f"{path.name} is being written by another process: wait until it has finished, or stop it"
        case sqlite3.SQLITE_FULL:
            return f"there is no room on the disk of {path.name}: nothing was entered; make room and repeat the command"
        case sqlite3.SQLITE_READONLY | sqlite3.SQLITE_CANTOPEN | sqlite3.SQLITE_PERM:
            if path.resolve().with_name(f"{path.resolve().name}-journal").exists():
                return (
                    f"{path.name} was interrupted while it was written, and may not be repaired here: copy it, with"
                    f" {path.name}-journal, to a folder that can be written to"
                )
            return f"{str(path)!r} may not be opened ({error}): check the rights of the file and of its folder"
        case sqlite3.SQLITE_CORRUPT:
            return _damaged(path, str(error))
        case _:
            return f"{path.name} cannot be used ({error}): check the disk, and take a backup before going on"


def _broken(path: Path, why: str) -> str:
    return (
        f"the chain of {path.name} is broken: {why}. Nothing can be concluded from it; take the last backup that"
        " `o3dmark ledger verify` finds whole"
    )


def _damaged(path: Path, why: str) -> str:
    return f"{path.name} is damaged ({why}): take the last backup that `o3dmark ledger verify` finds whole"
