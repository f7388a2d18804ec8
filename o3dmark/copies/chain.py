"""A copy, and the chain that ties each to all before it: whoever knows a head knows whether a row has changed since.

    head of no copies    SHA-256("o3dmark copies 1")
    head of n copies     SHA-256(the JSON array [head of n - 1 copies, and the columns of row n in their order])

JSON as RFC 8785 writes it (no space, only ", \\ and control characters escaped), in UTF-8, with nothing but texts and
integers in it, for which Python's json does the same; mrms and files are hashed as the texts that the row holds.
"""

import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256

from o3dmark.errors import LedgerError

EMPTY = sha256(b"o3dmark copies 1").hexdigest()
COLUMNS = (
    "number",
    "asset",
    "source",
    "name",
    "made",
    "key",
    "profile",
    "n_bits",
    "mrms",
    "files",
)  # as they are hashed

Row = tuple[int | str, ...]  # the columns, without the head
_DIGEST = re.compile(r"[0-9a-f]{64}")
_FINGERPRINT = re.compile(r"[0-9a-f]{16}")
_MADE = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ")
_canonical = json.JSONEncoder(ensure_ascii=False, separators=(",", ":")).encode


@dataclass(frozen=True)
class Entry:
    """A copy that was made, to be entered in a ledger.

    asset: SHA-256 of the unmarked asset, 64 hexadecimal digits; source: the name of its file; name: whose copy it is,
    any text, unique within the asset; key: the fingerprint of the asset's key, 16 digits, which tells that key from
    others and nothing about it; profile: the published parameters of the mark; n_bits: of its codeword; mrms: the
    distortion, over the bounding-box diagonal; files: the path and SHA-256 of each file of the copy, the main one
    first, the paths relative to the folder that all copies went to, with "/" between names.
    Errors: LedgerError for an empty name, and for what cannot stand in a ledger.
    """

    asset: str
    source: str
    name: str
    key: str
    profile: str
    n_bits: int
    mrms: float
    files: tuple[tuple[str, str], ...]

    def __post_init__(self) -> None:
        if not self.name.strip():
            raise LedgerError("a copy needs a name: the one given is empty")
        for text in (self.source, self.name, self.profile):
            if not _is_unicode(text):
                raise LedgerError(f"{text!r} is no Unicode text and cannot be entered; write it in UTF-8")
        if not self.files:
            raise LedgerError(f"the copy {self.name!r} has no file")
        for digest in (self.asset, *(digest for _, digest in self.files)):
            if not _DIGEST.fullmatch(digest):
                raise LedgerError(f"{digest!r} is no SHA-256 in 64 lower-case hexadecimal digits")
        if not _FINGERPRINT.fullmatch(self.key):
            raise LedgerError(f"{self.key!r} is no fingerprint of a key in 16 lower-case hexadecimal digits")
        for path, _ in self.files:
            if not _stays_inside(path):
                raise LedgerError(f"the path {path!r} does not lie in the folder of the copies, written with '/'")
        if self.n_bits < 1 or not (math.isfinite(self.mrms) and self.mrms >= 0):
            raise LedgerError(f"no mark has {self.n_bits} bits and a distortion of {self.mrms}")
        object.__setattr__(self, "n_bits", int(self.n_bits))  # numpy's numbers have another text
        object.__setattr__(self, "mrms", float(self.mrms))

    @property
    def file(self) -> str:
        """The path of the main file, relative to the folder of the copies."""
        return self.files[0][0]

    @property
    def digest(self) -> str:
        """SHA-256 of the main file."""
        return self.files[0][1]


@dataclass(frozen=True)
class Copy(Entry):
    """An entry in its place: number, counted from 1; made: when it was entered, UTC; head: of the chain up to it."""

    number: int
    made: str
    head: str

    @property
    def row(self) -> Row:
        """What the ledger holds of it, in the order of COLUMNS."""
        texts = {"mrms": repr(self.mrms), "files": _canonical(self.files)}
        return tuple(texts[column] if column in texts else getattr(self, column) for column in COLUMNS)

    @classmethod
    def of_row(cls, row: Row, head: str) -> "Copy":
        """What `row` gave. Errors: LedgerError for columns that hold something else."""
        number, asset, source, name, made, key, profile, n_bits, mrms, files = row
        try:
            pairs = tuple((str(path), str(digest)) for path, digest in json.loads(str(files)))
            if not _MADE.fullmatch(str(made)):
                raise ValueError(made)
            texts = str(asset), str(source), str(name), str(key), str(profile)
            return cls(*texts, int(n_bits), float(mrms), pairs, int(number), str(made), head)
        except (ValueError, TypeError, LedgerError) as error:
            raise LedgerError(f"row {number} of the ledger describes no copy: {error}") from None


def entered(entry: Entry, number: int, made: str, previous: str) -> Copy:
    """The copy of that number, whose head follows from the ``previous`` one."""
    copy = Copy(**vars(entry), number=number, made=made, head="")
    return Copy(**vars(entry), number=number, made=made, head=next_head(previous, copy.row))


def next_head(previous: str, row: Row) -> str:
    """The head (64 hexadecimal digits) after ``row``. Errors: TypeError for bytes in a column."""
    return sha256(_canonical([previous, *row]).encode()).hexdigest()


def misfit(rows: Sequence[Row], heads: Sequence[str], counted: int, latest: str) -> str | None:
    """Why ``rows`` and their ``heads`` are no chain of ``counted`` links that ends at ``latest``; None where they are.

    Names the first row that does not fit: one that was changed, removed, inserted or moved.
    """
    previous = EMPTY
    for place, (row, head) in enumerate(zip(rows, heads, strict=True), 1):
        if row[0] != place:
            return f"number {place} is missing; the next one is {row[0]}"
        if not _follows(previous, row, head):
            return f"number {place} is not what was entered: it was changed, or put in the place of another"
        previous = head
    if len(rows) < counted:
        return f"number {len(rows) + 1} is missing, the first of {counted - len(rows)} at the end"
    if len(rows) > counted:
        return f"number {counted + 1} was put in by another program"
    return None if latest == previous else f"the head that it states is not that of number {counted}"


def _follows(previous: str, row: Row, head: str) -> bool:
    try:
        return next_head(previous, row) == head
    except TypeError:  # raw bytes in a column
        return False


def _is_unicode(text: str) -> bool:
    if text.isascii():  # sooner said
        return True
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def _stays_inside(path: str) -> bool:
    """Whether a relative path names the same file on every system, in the folder that it is relative to."""
    plain = not {"", ".", ".."} & set(path.split("/")) and path[1:2] != ":"
    return plain and "\\" not in path and "\0" not in path and _is_unicode(path)
