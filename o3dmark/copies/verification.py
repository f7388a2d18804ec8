"""Does a ledger fit: its own chain, a head that was committed earlier, the files of its copies?"""

from dataclasses import asdict, dataclass
from hashlib import file_digest
from pathlib import Path
from typing import Any

from o3dmark.copies.chain import EMPTY
from o3dmark.copies.ledger import Ledger


@dataclass(frozen=True)
class Verification:
    """What was found.

    copies: how many the ledger holds; head: the head that it states; misfit: the first row that does not fit, in words;
    committed: how many copies stand behind the earlier head that was asked for; strange: it is in the chain nowhere;
    missing, changed: files of copies that are not there, or hold something else.
    """

    copies: int
    head: str
    misfit: str | None
    committed: int | None = None
    strange: bool = False
    missing: tuple[str, ...] = ()
    changed: tuple[str, ...] = ()

    @property
    def fits(self) -> bool:
        """Whether all that was looked at agrees."""
        return not (self.misfit or self.strange or self.missing or self.changed)

    def to_dict(self) -> dict[str, Any]:
        return {"fits": self.fits} | asdict(self)


def verify(ledger: Ledger, *, head: str | None = None, files: str | Path | None = None) -> Verification:
    """Walk the chain; look for an earlier ``head`` in it, and compare the files that lie in the folder ``files``.

    Of a broken chain no files are compared: what they should be is not known. Errors: LedgerError for a ledger that
    cannot be read, OSError for a file that cannot.
    """
    stored = ledger.stored()
    heads = {each: number for number, each in enumerate((EMPTY, *stored.heads))}
    committed = None if head is None or stored.misfit else heads.get(head.lower())
    strange = head is not None and not stored.misfit and committed is None
    missing, changed = list[str](), list[str]()
    if files is not None and not stored.misfit:
        for path, digest in (pair for copy in stored.copies() for pair in copy.files):
            file = Path(files, path)
            if not file.is_file():
                missing.append(path)
            elif digest_of(file) != digest:
                changed.append(path)
    return Verification(
        len(stored.rows), stored.latest, stored.misfit, committed, strange, tuple(missing), tuple(changed)
    )


def digest_of(path: str | Path) -> str:
    """SHA-256 of a file, 64 hexadecimal digits."""
    with open(path, "rb") as file:
        return file_digest(file, "sha256").hexdigest()
