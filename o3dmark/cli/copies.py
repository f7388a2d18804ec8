"""The commands of copies: ledger commit, ledger verify, ledger list."""

import re
import sys
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from o3dmark.cli._arguments import Json
from o3dmark.cli._talk import print_result, printable, say

if TYPE_CHECKING:
    from o3dmark.copies import Copy, Verification

LedgerFile = Annotated[Path, typer.Argument(metavar="LEDGER", help="The file of the ledger.")]
_SHOWN = 12  # digits of an asset's 64 in a table
_NO_TERMINAL = 100_000  # columns of a pipe: names are as long as they are

ledger = typer.Typer(
    name="ledger",
    help="The ledger of copies: what was given to whom.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@ledger.command()
def commit(source: LedgerFile, json: Json = False) -> None:
    """Print the head of the ledger, 64 hexadecimal digits, to be time-stamped elsewhere; a broken chain has none."""
    from o3dmark.copies import Ledger

    with Ledger(source) as opened:
        stored = opened.sound()
    if json:
        print_result({"head": stored.latest, "copies": len(stored.rows)}, json)
    else:
        print(stored.latest)


@ledger.command()
def verify(
    source: LedgerFile,
    head: Annotated[str | None, typer.Option(metavar="HEX", help="An earlier commitment: is it to this one?")] = None,
    files: Annotated[
        Path | None, typer.Option(metavar="DIR", help="The folder of the copies: is each as it was entered?")
    ] = None,
    json: Json = False,
) -> None:
    """Has anything in the ledger changed since it was entered? Exit code 0 when all fits, 1 when something does not."""
    from o3dmark import copies

    if head is not None and not re.fullmatch(r"[0-9a-fA-F]{64}", head):
        raise typer.BadParameter(f"a commitment is 64 hexadecimal digits, and {head!r} is none")
    if files is not None and not files.is_dir():
        raise typer.BadParameter(f"there is no folder {str(files)!r}")
    with copies.Ledger(source) as opened:
        found = copies.verify(opened, head=head, files=files)
    if json:
        print_result(found.to_dict(), json)
    else:
        for line in _words(found, head, files):
            print(printable(line))
    if not found.fits:
        raise typer.Exit(1)


@ledger.command("list")
def list_(
    source: LedgerFile,
    asset: Annotated[
        str | None, typer.Option(metavar="HEX", help="Copies of this one only: its SHA-256, or how that begins.")
    ] = None,
    json: Json = False,
) -> None:
    """The copies of a ledger, or of one asset; exit code 1 when that one has none."""
    from o3dmark.copies import Ledger

    begin = (asset or "").lower()
    if not re.fullmatch(r"[0-9a-f]{0,64}", begin):
        raise typer.BadParameter(f"the SHA-256 of an asset is hexadecimal, and {asset!r} is not")
    with Ledger(source) as opened:
        copies = [copy for copy in opened.copies() if copy.asset.startswith(begin)]
    if json:
        print_result({"copies": [asdict(copy) for copy in copies]}, json)
    else:
        _print_table(copies)
    if begin and not copies:
        say(f"{source.name} has no copy of an asset whose SHA-256 begins with {begin}")
        raise typer.Exit(1)


def _print_table(copies: "list[Copy]") -> None:
    """The copies, a line each; folded to the width of a terminal, and never cut off."""
    table = Table(box=None, pad_edge=False)
    for column in ("number", "name", "made", "source", "asset", "mrms", "file"):
        table.add_column(column, overflow="fold")
    for copy in copies:
        row = (copy.number, copy.name, copy.made, copy.source, copy.asset[:_SHOWN], f"{copy.mrms:.4g}", copy.file)
        table.add_row(*(Text(printable(str(cell))) for cell in row))
    Console(width=None if sys.stdout.isatty() else _NO_TERMINAL).print(table)


def _words(found: "Verification", head: str | None, files: Path | None) -> Iterator[str]:
    if found.misfit:
        yield f"The chain is broken: {found.misfit}. Nothing else was looked at."
        return
    yield f"The chain fits. Copies: {found.copies}; head: {found.head}"
    if head is not None and found.strange:
        yield f"The commitment {head} is not to this ledger: the chain never had that head."
    elif head is not None:
        yield f"The commitment is to this ledger, and to its copies up to number {found.committed}."
    if files is not None and not (found.missing or found.changed):
        yield f"Each file of the copies is in {files}, as it was entered."
    yield from (f"missing: {path}" for path in found.missing)
    yield from (f"changed: {path}" for path in found.changed)
