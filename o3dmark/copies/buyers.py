"""The names of those who get a copy, from a CSV file, and the folders that are called after them."""

import csv
import hashlib
import re
from collections.abc import Iterator
from pathlib import Path

from o3dmark.errors import LedgerError

_PLAIN = re.compile(r"[a-z0-9][a-z0-9_-]{0,39}")  # the same name on every file system, whatever it does with case
_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)")
_COLUMN = "name"
_LONGEST = 32  # characters of a name that its folder shows


def read_buyers(path: str | Path) -> list[str]:
    """The names in a CSV file: those of its column "name", or else of its first column; in their order.

    Errors: LedgerError for a file that is missing, is not CSV in UTF-8, or has no names, an empty or a repeated one.
    """
    path = Path(path)
    names: dict[str, int] = {}
    for line, name in _cells(path):
        if not name.strip():
            raise LedgerError(f"{path.name}, line {line}: a copy needs a name, and there is none")
        if name in names:
            raise LedgerError(f"{path.name}, line {line}: {name!r} is on line {names[name]} already")
        names[name] = line
    if not names:
        raise LedgerError(f"{path.name} names nobody")
    return list(names)


def _cells(path: Path) -> Iterator[tuple[int, str]]:
    """Line and name of each row that is not blank."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = csv.reader(file, strict=True)
            column, first = 0, True
            for row in rows:
                if not any(row):
                    continue
                heads = [cell.strip().lower() for cell in row]
                if first and _COLUMN in heads:
                    column = heads.index(_COLUMN)
                else:
                    yield rows.line_num, row[column] if column < len(row) else ""
                first = False
    except OSError as error:
        raise LedgerError(f"cannot read {str(path)!r}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise LedgerError(f"{path.name} is not UTF-8; save it so, or names would be misread") from None
    except csv.Error as error:
        raise LedgerError(f"{path.name} is not CSV: {error}") from None


def folder_of(name: str) -> str:
    """The folder of the copy of that name: the name itself where every system can write it, or what is left of it and
    a hash, so that two names never share a folder."""
    if _PLAIN.fullmatch(name) and not _RESERVED.fullmatch(name):
        return name
    shown = re.sub(r"[^a-z0-9]+", "-", name.lower())[:_LONGEST].strip("-")
    digest = hashlib.sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:12]
    return f"{shown}--{digest}" if shown else f"--{digest}"
