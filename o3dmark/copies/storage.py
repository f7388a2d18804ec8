"""The SQLite file of a ledger: made whole or not at all, recognised, and its errors in words that say what to do.

table copies    number, asset, source, name, made, key, profile, n_bits, mrms, files, head    a row a copy
table ledger    copies, head                                      one row: how many there are, the latest head
"""

import os
import sqlite3
import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from o3dmark.copies.chain import EMPTY
from o3dmark.errors import LedgerError

APPLICATION = 0x6F33646D  # "o3dm", in the header of the file
FORMAT = 1  # user_version in the header; another is another format
SCHEMA = (
    "CREATE TABLE copies (number INTEGER PRIMARY KEY, asset TEXT NOT NULL, source TEXT NOT NULL, name TEXT NOT NULL,"
    " made TEXT NOT NULL, key TEXT NOT NULL, profile TEXT NOT NULL, n_bits INTEGER NOT NULL, mrms TEXT NOT NULL,"
    " files TEXT NOT NULL, head TEXT NOT NULL, UNIQUE (asset, name))",
    "CREATE TABLE ledger (copies INTEGER NOT NULL, head TEXT NOT NULL)",
)

# A rollback journal, and not a write-ahead log: between transactions all is in one file, so that a ledger can be copied
# and sent as it lies there, while what a log still holds would stay behind without a word. EXTRA, and not FULL: the end
# of a transaction is the removal of its journal, and only EXTRA makes the folder remember that through a loss of power.
# Killed at any moment, the next opening rolls back what was not committed; reading, too, opens for writing where that
# is allowed, for only so can it be rolled back.
_TO_WRITE = ("PRAGMA journal_mode = DELETE", "PRAGMA synchronous = EXTRA")
_TO_READ = ("PRAGMA query_only = ON",)


def connect(path: Path, *, writable: bool, wait: float) -> sqlite3.Connection:
    """A connection to the ledger at ``path`` that begins no transaction by itself; ``wait``: seconds for other writers.

    Errors: LedgerError for what is no ledger of this format.
    """
    if not path.is_file():
        raise LedgerError(f"there is no ledger at {str(path)!r}")
    if not path.stat().st_size:  # which SQLite takes for a database without tables
        raise LedgerError(damaged(path, "an empty file"))
    with explained(path):
        address = f"{path.resolve().as_uri()}?mode=rw"  # which makes no file
        connection = sqlite3.connect(address, uri=True, timeout=wait, isolation_level=None)
        try:
            _check_format(path, connection)
            for setting in _TO_WRITE if writable else _TO_READ:
                connection.execute(setting)
        except BaseException:
            connection.close()
            raise
    return connection


def prepare(path: Path) -> None:
    """Make an empty ledger where nothing is there. Errors: LedgerError where none can be written."""
    folder = path.resolve().parent
    if not folder.is_dir():
        raise LedgerError(f"there is no folder {str(folder)!r} for the ledger {path.name}")
    there = os.path.lexists(path)
    for place in (folder, path) if there else (folder,):
        if os.path.exists(place) and not os.access(place, os.W_OK):
            raise LedgerError(f"{str(place)!r} is read-only: to enter copies, a ledger and its folder must be writable")
    if not there:
        with explained(path):
            _create(path)


@contextmanager
def explained(path: Path) -> Iterator[None]:
    """What SQLite raises, as a LedgerError about the ledger at ``path``."""
    try:
        yield
    except sqlite3.ProgrammingError:  # a fault of the program, and not of the ledger
        raise
    except sqlite3.Error as error:
        raise LedgerError(_explanation(path, error)) from error


def damaged(path: Path, why: str) -> str:
    """The words for a file that cannot be a ledger any more."""
    return f"{path.name} is damaged ({why}): take the last backup that `o3dmark ledger verify` finds whole"


def _create(path: Path) -> None:
    try:
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=".o3dmark-") as folder:
            draft = Path(folder, path.name)
            with closing(sqlite3.connect(draft, isolation_level=None)) as connection:
                connection.execute("BEGIN")
                for line in (*SCHEMA, f"PRAGMA application_id = {APPLICATION}", f"PRAGMA user_version = {FORMAT}"):
                    connection.execute(line)
                connection.execute("INSERT INTO ledger VALUES (0, ?)", (EMPTY,))
                connection.execute("COMMIT")
            _place(draft, path)
    except OSError as error:
        raise LedgerError(f"cannot make {path.name} in {str(path.parent)!r}: {error.strerror}") from None


def _place(draft: Path, path: Path) -> None:
    """Give the draft its name; a ledger that another process made meanwhile stays, and is as good."""
    try:
        os.link(draft, path)
    except FileExistsError:
        return
    except OSError:  # a file system without links
        if not os.path.lexists(path):
            os.replace(draft, path)


def _check_format(path: Path, connection: sqlite3.Connection) -> None:
    application, version = (
        connection.execute(f"PRAGMA {name}").fetchone()[0] for name in ("application_id", "user_version")
    )
    if application != APPLICATION:
        raise LedgerError(f"{str(path)!r} is an SQLite file of another program, and no ledger of copies")
    if version != FORMAT:
        raise LedgerError(f"{path.name} is a ledger of format {version}; this o3dmark knows format {FORMAT}: update it")
    tables = connection.execute("SELECT sql FROM sqlite_schema WHERE sql IS NOT NULL ORDER BY rowid").fetchall()
    if tuple(sql for (sql,) in tables) != SCHEMA:
        raise LedgerError(damaged(path, "another program has changed its tables"))


def _explanation(path: Path, error: sqlite3.Error) -> str:
    """What an error of SQLite means for who has the ledger, and what to do."""
    code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT)  # a text that is no UTF-8 is found without a code
    match code & 0xFF:
        case sqlite3.SQLITE_NOTADB:
            return f"{str(path)!r} is no ledger of copies: not an SQLite file"
        case sqlite3.SQLITE_CORRUPT:
            return damaged(path, str(error))
        case sqlite3.SQLITE_BUSY | sqlite3.SQLITE_LOCKED:
            return f"{path.name} is being written by another process: wait until it has finished, or stop it"
        case sqlite3.SQLITE_FULL:
            return f"the disk of {path.name} is full: nothing was entered; make room and repeat the command"
        case sqlite3.SQLITE_READONLY | sqlite3.SQLITE_CANTOPEN | sqlite3.SQLITE_PERM:
            return _not_allowed(path, error)
        case _:
            return f"{path.name} cannot be used ({error}): check the disk, and make a backup before going on"


def _not_allowed(path: Path, error: sqlite3.Error) -> str:
    journal = Path(f"{path.resolve()}-journal")
    if journal.exists():
        return (
            f"{path.name} was interrupted while it was written, and cannot be restored here: copy it together with"
            f" {journal.name} to a folder that can be written to"
        )
    return f"{str(path)!r} may not be opened ({error}): check the rights of the file and of its folder"
