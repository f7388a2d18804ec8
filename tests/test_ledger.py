"""The ledger of copies: what was entered stays, word for word; what has changed is found; a kill leaves it whole."""

import os
import random
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fixtures import ledger_writer
from fixtures.command_line import run
from fixtures.ledger_writer import LARGEST, entry, hexadecimal
from o3dmark.cli import main
from o3dmark.copies import EMPTY, Copy, Entry, Ledger, verify
from o3dmark.copies.chain import COLUMNS, next_head
from o3dmark.copies.storage import FORMAT
from o3dmark.errors import LedgerError

NAMES = ("b1", "b2, Rome", "b3\nthe third", "名前", "b5" * 150)
ANY_NAME = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=300).filter(str.strip)
ANY_LEDGER = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
NOBODY = 65534  # the user of that name


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ledger of NAMES. Do not change it."""
    path = tmp_path_factory.mktemp("whole") / "copies.db"
    with Ledger(path, writable=True) as ledger:
        ledger.add(map(entry, NAMES))
    return path


@pytest.fixture
def path(whole: Path, tmp_path: Path) -> Path:
    """A ledger of NAMES, alone in its folder; the test's own."""
    return Path(shutil.copy(whole, tmp_path))


@pytest.fixture(scope="module")
def growing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ledger to which each example adds an asset."""
    path = tmp_path_factory.mktemp("growing") / "copies.db"
    Ledger(path, writable=True).close()
    return path


def copies(path: Path) -> list[Copy]:
    with Ledger(path) as ledger:
        return ledger.copies()


def misfit(path: Path) -> str | None:
    with Ledger(path) as ledger:
        return verify(ledger).misfit


def tampered(path: Path, *lines: str) -> Path:
    """A copy of the ledger in which another program ran these lines."""
    other = path.with_name("other.db")
    shutil.copy(path, other)
    with closing(sqlite3.connect(other)) as connection, connection:
        for line in lines:
            connection.execute(line)
    return other


# What is entered is there


def test_what_is_entered_comes_back(path: Path) -> None:
    found = copies(path)
    assert [(copy.number, copy.name) for copy in found] == list(enumerate(NAMES, 1))
    for copy in found:
        assert {name: getattr(copy, name) for name in vars(entry(copy.name))} == vars(entry(copy.name))
        assert (copy.file, copy.digest) == copy.files[0]
        assert abs(time.time() - time.mktime(time.strptime(copy.made, "%Y-%m-%dT%H:%M:%SZ")) + time.timezone) < 60


def test_copies_are_numbered_on_whoever_enters_them(path: Path) -> None:
    with Ledger(path, writable=True) as one, Ledger(path, writable=True) as other:
        (a,) = one.add([entry("a")])
        b, c = other.add([entry("b"), entry("c")])
        (d,) = one.add([entry("d")])
        assert [copy.number for copy in (a, b, c, d)] == [6, 7, 8, 9]
        assert one.head == other.head == d.head
        assert one.add([]) == []
    assert copies(path)[5:] == [a, b, c, d]
    assert misfit(path) is None


def test_a_name_is_free_for_each_asset(path: Path) -> None:
    with Ledger(path, writable=True) as ledger:
        ledger.add([entry(NAMES[0], "cup")])
        assert [copy.name for copy in ledger.copies(hexadecimal("cup"))] == [NAMES[0]]
        assert len(ledger.copies(hexadecimal("bust"))) == len(NAMES)
        assert ledger.copies(hexadecimal("horse")) == []


def test_two_ledgers_are_open_at_a_time(path: Path, tmp_path: Path) -> None:
    with Ledger(tmp_path / "second.db", writable=True) as second, Ledger(path) as first:
        second.add([entry(NAMES[0])])
        assert (len(first.copies()), len(second.copies())) == (len(NAMES), 1)


def test_all_are_entered_or_none(path: Path) -> None:
    def three(fails: Exception | None) -> Iterator[Entry]:
        yield entry("x")
        yield entry("y")
        if fails:
            raise fails
        yield entry(NAMES[2])

    before = path.read_bytes()
    with Ledger(path, writable=True) as ledger:
        with pytest.raises(ZeroDivisionError):
            ledger.add(three(ZeroDivisionError()))
        with pytest.raises(LedgerError, match=r"has a copy 'b3\\nthe third' of 'bust\.glb' already"):
            ledger.add(three(None))
        assert [copy.name for copy in ledger.copies()] == list(NAMES)
    assert path.read_bytes() == before


def test_between_writings_all_is_in_one_file(tmp_path: Path) -> None:
    with Ledger(tmp_path / "copies.db", writable=True) as ledger:
        for name in NAMES:
            ledger.add([entry(name)])
            assert os.listdir(tmp_path) == ["copies.db"]
            shutil.copy(tmp_path / "copies.db", tmp_path / "sent.db")
            assert copies(tmp_path / "sent.db")[-1].name == name
            (tmp_path / "sent.db").unlink()


@ANY_LEDGER
@given(names=st.lists(ANY_NAME, min_size=1, max_size=4, unique=True))
def test_names_are_kept_to_the_letter_and_once(growing: Path, names: list[str]) -> None:
    with Ledger(growing, writable=True) as ledger:
        asset = str(len(ledger.copies()))
        ledger.add(entry(name, asset) for name in names)
        assert [copy.name for copy in ledger.copies(hexadecimal(asset))] == names
        with pytest.raises(LedgerError, match="already"):
            ledger.add([entry(names[-1], asset)])
        assert verify(ledger).fits


# What cannot be entered


@pytest.mark.parametrize(
    ("fields", "why"),
    [
        ({"name": ""}, "needs a name"),
        ({"name": " \n\t"}, "needs a name"),
        ({"name": "\udcff"}, "no Unicode text"),
        ({"source": "\udcff.glb"}, "no Unicode text"),
        ({"asset": "A" * 64}, "no SHA-256"),
        ({"asset": "a" * 63}, "no SHA-256"),
        ({"files": ()}, "has no file"),
        ({"files": (("a.glb", "b"),)}, "no SHA-256"),
        *(
            ({"files": ((path, "a" * 64),)}, "does not lie in the folder")
            for path in (
                "",
                "/a.glb",
                "../a.glb",
                "a/../b",
                "a//b",
                "./a",
                "a/",
                "c:a",
                "c:/a",
                "a\\b",
                "a\0",
                "\udcff",
            )
        ),
        ({"mrms": float("nan")}, "distortion of nan"),
        ({"mrms": float("inf")}, "distortion of inf"),
        ({"mrms": -1.0}, "distortion of -1"),
        ({"n_bits": 0}, "0 bits"),
        ({"key": "K" * 16}, "no fingerprint"),
    ],
)
def test_what_is_no_copy_is_refused(fields: dict[str, Any], why: str) -> None:
    with pytest.raises(LedgerError, match=why):
        replace(entry("b1"), **fields)


def test_numbers_of_numpy_are_entered_as_numbers(tmp_path: Path) -> None:
    import numpy as np

    with Ledger(tmp_path / "copies.db", writable=True) as ledger:
        (copy,) = ledger.add([entry("b1", n_bits=np.int64(64), mrms=np.float64(0.1) + np.float64(0.2))])
        assert ledger.copies() == [copy]
    assert (copy.n_bits, copy.mrms) == (64, 0.30000000000000004)


# The chain


def test_the_chain_is_frozen() -> None:
    """The values that JSON.stringify and sha256 of Node 20 give for this row; another one is another format."""
    assert EMPTY == "7bb29eb27385b43ee585400a319dbc5586b28ae2f7cefee17df4622f54d3a3a1"
    name = 'b1, "Rome"\\\n\x01\x7f\u2028名\U0001f600'
    copy = Copy(**vars(entry(name)), number=1, made="2026-11-26T09:30:00Z", head="")
    assert next_head(EMPTY, copy.row) == "2b9f2b43042b25ab9d4d4cb81d160a8957c85e7c0c1b3506c2e7c279a4e01dad"
    assert len(copy.row) == len(COLUMNS)


CHANGES = {
    "asset": repr("b" * 64),
    "source": "'cup.glb'",
    "name": "'b6'",
    "made": "'2026-11-26T09:30:01Z'",
    "profile": "'slender-2026'",
    "key": "'0000000000000000'",
    "n_bits": "65",
    "mrms": "'0.00057'",
    "files": "'[]'",
    "head": repr("0" * 64),
    "number": "77",
}


@pytest.mark.parametrize("number", range(1, len(NAMES) + 1))
@pytest.mark.parametrize("column", CHANGES)
def test_any_change_of_any_field_is_found_and_named(path: Path, number: int, column: str) -> None:
    assert CHANGES.keys() == {*COLUMNS, "head"}
    other = tampered(path, f"UPDATE copies SET {column} = {CHANGES[column]} WHERE number = {number}")
    found = misfit(other)
    assert found
    assert f"number {number} " in found
    with Ledger(other) as ledger, pytest.raises(LedgerError, match=rf"chain of other\.db is broken: number {number} "):
        ledger.copies()
    with Ledger(other) as ledger, pytest.raises(LedgerError, match="broken"):
        _ = ledger.head


@pytest.mark.parametrize("change", ["name = CAST(name AS BLOB)", "n_bits = 64.5", "n_bits = 'x'", "mrms = x'00'"])
def test_a_value_of_another_type_is_a_change(path: Path, change: str) -> None:
    assert "number 2 " in str(misfit(tampered(path, f"UPDATE copies SET {change} WHERE number = 2")))


def swap(*columns: str) -> list[str]:
    """What exchanges columns of rows 2 and 3."""
    other = f"(SELECT {', '.join(columns)} FROM before WHERE before.number = 5 - copies.number)"
    return [
        "CREATE TEMP TABLE before AS SELECT * FROM copies",
        "UPDATE copies SET name = number WHERE number IN (2, 3)",
        f"UPDATE copies SET ({', '.join(columns)}) = {other} WHERE number IN (2, 3)",
    ]


def put_in(number: int) -> str:
    columns = "asset, source, 'x', made, key, profile, 1, mrms, files, head"
    return f"INSERT INTO copies SELECT {number}, {columns} FROM copies LIMIT 1"


@pytest.mark.parametrize(
    ("lines", "first"),
    [
        (["DELETE FROM copies WHERE number = 1"], "number 1 is missing"),
        (["DELETE FROM copies WHERE number = 3"], "number 3 is missing"),
        (["DELETE FROM copies WHERE number = 3", "UPDATE copies SET number = number - 1 WHERE number > 3"],
         "number 3 is not"),
        (["DELETE FROM copies WHERE number = 5"], "number 5 is missing, the first of 1 at the end"),
        (["DELETE FROM copies WHERE number > 2"], "number 3 is missing, the first of 3 at the end"),
        (["DELETE FROM copies"], "number 1 is missing, the first of 5 at the end"),
        (swap(*COLUMNS[1:]), "number 2 "),
        (swap(*COLUMNS[1:], "head"), "number 2 "),
        ([put_in(0)],
         "number 1 is missing; the next one is 0"),
        ([put_in(6)],
         "number 6 "),
        (["UPDATE ledger SET head = 'x'"], "the head that it states is not that of number 5"),
        (["UPDATE ledger SET copies = 4"], "number 5 was put in"),
    ],
)  # fmt: skip
def test_removal_insertion_and_another_order_are_found(path: Path, lines: list[str], first: str) -> None:
    other = tampered(path, *lines)
    assert str(misfit(other)).startswith(first)
    with Ledger(other) as ledger, pytest.raises(LedgerError, match="broken"):
        ledger.copies()


@pytest.mark.parametrize(
    "line",
    [
        "DELETE FROM copies WHERE number = 5",
        "UPDATE ledger SET head = 'x'",
        "UPDATE copies SET number = 6 WHERE number = 5",
    ],
)
def test_nothing_is_added_to_a_chain_without_its_end(path: Path, line: str) -> None:
    other = tampered(path, line)
    before = other.read_bytes()
    with Ledger(other, writable=True) as ledger, pytest.raises(LedgerError, match="broken: its last copy"):
        ledger.add([entry("next")])
    assert other.read_bytes() == before


def forged(path: Path, change: Callable[[list[Entry]], list[Entry]]) -> Path:
    """A ledger that somebody wrote anew, its chain in order."""
    other = path.with_name("forged.db")
    entries = [Entry(**{name: getattr(copy, name) for name in vars(entry("x"))}) for copy in copies(path)]
    with Ledger(other, writable=True) as ledger:
        ledger.add(change(entries))
    return other


def test_a_chain_made_anew_is_found_by_an_earlier_head_alone(path: Path) -> None:
    heads = [EMPTY, *(copy.head for copy in copies(path))]
    other = forged(path, lambda entries: [*entries[:2], replace(entries[2], name="b7"), *entries[3:]])
    for number, head in enumerate(heads):
        with Ledger(path) as mine, Ledger(other) as theirs:
            true, false = verify(mine, head=head.upper()), verify(theirs, head=head)
        assert (true.fits, true.committed) == (True, number)
        if number >= 3:
            assert (false.misfit, false.strange, false.fits, false.committed) == (None, True, False, None)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ("made = 'yesterday'", "yesterday"),
        ("files = 'none'", "Expecting value"),
        (f"""files = '[["../../secret", "{"a" * 64}"]]'""", "does not lie in the folder"),
        ("mrms = 'low'", "could not convert"),
    ],
)
def test_a_chain_in_order_over_rows_that_are_none_is_refused(path: Path, change: str, why: str) -> None:
    """Who writes their own chain can put into it what they like."""
    row = f"SELECT {', '.join(COLUMNS)} FROM copies WHERE number = 5"
    other = tampered(path, f"UPDATE copies SET {change} WHERE number = 5")
    with closing(sqlite3.connect(other)) as connection, connection:
        head = next_head(copies(path)[3].head, connection.execute(row).fetchone())
        connection.execute("UPDATE copies SET head = ? WHERE number = 5", (head,))
        connection.execute("UPDATE ledger SET head = ?", (head,))
    with Ledger(other) as ledger, pytest.raises(LedgerError, match=rf"row 5 .*{why}"):
        ledger.copies()


# The files


def test_files_that_are_missing_or_changed_are_named(path: Path, tmp_path: Path) -> None:
    for copy in copies(path):
        file = tmp_path / "out" / copy.file
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(copy.name)
    names = [copy.file for copy in copies(path)]
    with Ledger(path) as ledger:
        assert verify(ledger, files=tmp_path / "out").fits
        (tmp_path / "out" / names[1]).unlink()
        (tmp_path / "out" / names[3]).write_text("edited")
        found = verify(ledger, files=tmp_path / "out")
    assert (found.missing, found.changed, found.fits, found.misfit) == ((names[1],), (names[3],), False, None)


# Files that are no ledger, and ledgers that cannot be used


def sqlite_file(path: Path, *lines: str) -> None:
    with closing(sqlite3.connect(path)) as connection, connection:
        for line in lines:
            connection.execute(line)


def rewrite(path: Path, change: Callable[[bytes], bytes]) -> None:
    path.write_bytes(change(path.read_bytes()))


SPOILT: dict[str, tuple[Callable[[Path], Any], str]] = {
    "a text": (lambda path: path.write_text("number,name\n1,b1\n" * 100), "no ledger of copies: not an SQLite file"),
    "empty": (lambda path: path.write_bytes(b""), r"is damaged \(an empty file\): take the last backup"),
    "a page cut": (lambda path: rewrite(path, lambda content: content[:3000]), "not an SQLite file|damaged"),
    "cut": (lambda path: rewrite(path, lambda content: content[:-4096]), r"damaged \(.*malformed"),
    "zeros": (lambda path: rewrite(path, lambda content: content[:4096] + bytes(4096) + content[8192:]), "damaged"),
    "no text": (lambda path: rewrite(path, lambda content: content.replace(b"b2, Rome", b"b2, \xff\xfe  ")), "damaged"),
    "another's": (lambda path: (path.unlink(), sqlite_file(path, "CREATE TABLE a (b)")), "of another program"),
    "newer": (lambda path: sqlite_file(path, f"PRAGMA user_version = {FORMAT + 1}"), "of format 2; .* update it"),
    "an index": (lambda path: sqlite_file(path, "CREATE INDEX i ON copies (name)"), "has changed its tables"),
    "half": (lambda path: sqlite_file(path, "DROP TABLE ledger"), "another program has changed its tables"),
    "no head": (lambda path: sqlite_file(path, "DELETE FROM ledger"), "does not state its head"),
    "two heads": (lambda path: sqlite_file(path, "INSERT INTO ledger VALUES (1, '')"), "does not state its head"),
    "no number": (lambda path: sqlite_file(path, "UPDATE ledger SET copies = 'x'"), "does not state its head"),
    "a folder": (lambda path: (path.unlink(), path.mkdir()), "no ledger at"),
}


@pytest.mark.parametrize("writable", [False, True])
@pytest.mark.parametrize("kind", SPOILT)
def test_what_is_no_ledger_is_named_and_left_as_it_is(path: Path, kind: str, writable: bool) -> None:
    spoil, why = SPOILT[kind]
    spoil(path)
    before = path.is_file() and path.read_bytes()
    with pytest.raises(LedgerError, match=why), Ledger(path, writable=writable) as ledger:
        ledger.copies()
    assert (path.is_file() and path.read_bytes()) == before


def test_a_ledger_that_is_not_there_is_made_by_a_writer_alone(tmp_path: Path) -> None:
    with pytest.raises(LedgerError, match="no ledger at"):
        Ledger(tmp_path / "copies.db")
    with pytest.raises(LedgerError, match=r"no folder .*nowhere"):
        Ledger(tmp_path / "nowhere" / "copies.db", writable=True)
    assert os.listdir(tmp_path) == []
    with Ledger(tmp_path / "a b?#%.db", writable=True) as ledger:
        assert (ledger.copies(), ledger.head) == ([], EMPTY)
    assert os.listdir(tmp_path) == ["a b?#%.db"]


@pytest.mark.parametrize("writable", [False, True])
def test_a_locked_ledger_is_waited_for_and_named(path: Path, writable: bool) -> None:
    with Ledger(path, writable=writable, wait=0.05) as ledger, closing(sqlite3.connect(path)) as other:
        other.execute("BEGIN EXCLUSIVE")
        with pytest.raises(LedgerError, match=r"copies\.db is being written by another process: wait"):
            ledger.add([entry("next")]) if writable else ledger.copies()
        other.rollback()
        assert len(ledger.copies()) == len(NAMES)
        assert not writable or ledger.add([entry("next")])


def test_a_reader_cannot_write(path: Path) -> None:
    with Ledger(path) as ledger, pytest.raises(LedgerError, match="opened to be read"):
        ledger.add([entry("next")])
    assert len(copies(path)) == len(NAMES)


def test_on_a_full_disk_nothing_is_entered(path: Path) -> None:
    with Ledger(path, writable=True) as ledger:
        pages = ledger._connection.execute("PRAGMA page_count").fetchone()[0]
        ledger._connection.execute(f"PRAGMA max_page_count = {pages}")
        with pytest.raises(LedgerError, match=r"disk of copies\.db is full: nothing was entered; make room"):
            ledger.add(entry(f"next {number}") for number in range(200))
        assert [copy.name for copy in ledger.copies()] == list(NAMES)
        ledger._connection.execute("PRAGMA max_page_count = 1000000")
        ledger.add(entry(f"next {number}") for number in range(200))
        assert verify(ledger).fits


@contextmanager
def unprivileged() -> Iterator[None]:
    """Who may do everything becomes somebody who may not."""
    root = os.getuid() == 0
    if root:
        os.setresuid(NOBODY, NOBODY, 0)
    try:
        yield
    finally:
        if root:
            os.setresuid(0, 0, 0)


@pytest.fixture
def readable() -> Iterator[Path]:
    """A folder that others can look into, and that nobody but its owner can write to."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o555)
        yield Path(folder)
        Path(folder).chmod(0o755)


def put(folder: Path, *files: Path) -> None:
    folder.chmod(0o755)
    for file in files:
        shutil.copy(file, folder)
        (folder / file.name).chmod(0o444)
    folder.chmod(0o555)


def test_in_a_read_only_folder_a_ledger_is_read_and_not_written(path: Path, readable: Path) -> None:
    with unprivileged(), pytest.raises(LedgerError, match="is read-only: to enter copies"):
        Ledger(readable / "new.db", writable=True)
    put(readable, path)
    with unprivileged():
        assert [copy.name for copy in copies(readable / path.name)] == list(NAMES)
        with pytest.raises(LedgerError, match="is read-only: to enter copies"):
            Ledger(readable / path.name, writable=True)
    assert os.listdir(readable) == [path.name]


# Killed at any moment


def interrupted(path: Path, folder: Path) -> list[Path]:
    """Copies of the ledger's file and journal as they lie on the disk within a transaction that has begun to write."""
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute("PRAGMA cache_size = 1")
        connection.execute("BEGIN IMMEDIATE")
        connection.execute("UPDATE copies SET name = name || 'x', source = ?", ("y" * 100_000,))
        files = [path, path.with_name(f"{path.name}-journal")]
        for file in files:
            shutil.copy(file, folder)
        assert (folder / path.name).read_bytes() != path.read_bytes() or b"yyyyy" in (folder / path.name).read_bytes()
        connection.execute("ROLLBACK")
    return [folder / file.name for file in files]


@pytest.mark.parametrize("writable", [False, True])
def test_what_a_dead_writer_left_half_done_is_undone(path: Path, tmp_path: Path, writable: bool) -> None:
    (tmp_path / "dead").mkdir()
    file, journal = interrupted(path, tmp_path / "dead")
    with Ledger(file, writable=writable) as ledger:
        assert [copy.name for copy in ledger.copies()] == list(NAMES)
    assert not journal.exists()


def test_where_it_cannot_be_undone_that_is_said(path: Path, tmp_path: Path, readable: Path) -> None:
    (tmp_path / "dead").mkdir()
    put(readable, *interrupted(path, tmp_path / "dead"))
    with unprivileged(), pytest.raises(LedgerError, match=r"was interrupted .* together with copies\.db-journal"):
        copies(readable / path.name)


@contextmanager
def writers() -> Iterator[Callable[[Path, float], int]]:
    """A function that lets a process write to a ledger for some seconds, kills it, and says what it had confirmed."""
    with subprocess.Popen(
        [sys.executable, ledger_writer.__file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as server:
        assert server.stdin
        assert server.stdout

        def write(path: Path, seconds: float) -> int:
            print(seconds, path, file=server.stdin, flush=True)
            confirmed = 0
            while (line := server.stdout.readline()) != "end\n":
                assert line, "the program of the writers has ended"
                confirmed = int(line)
            return confirmed

        yield write


@pytest.mark.parametrize("times", [50, pytest.param(200, marks=pytest.mark.slow)])
def test_killed_again_and_again_the_ledger_opens_fits_and_holds_what_was_confirmed(tmp_path: Path, times: int) -> None:
    path, journal, draw = tmp_path / "copies.db", tmp_path / "copies.db-journal", random.Random(13)
    found, interruptions = list[Copy](), 0
    Ledger(path, writable=True).close()
    with writers() as write:
        for _ in range(times):
            confirmed = max(len(found), write(path, draw.uniform(0.0, 0.04)))
            interruptions += journal.exists()
            with Ledger(path) as ledger:
                assert verify(ledger).fits
                found = ledger.copies()
            assert [copy.name for copy in found] == [str(number) for number in range(1, len(found) + 1)]
            assert confirmed <= len(found) <= confirmed + LARGEST
            assert not found or found[-1].source == str(len(found))  # of copies entered together all are there
    assert interruptions > 0
    assert len(found) > 0


def test_killed_while_it_is_made_a_ledger_is_whole_or_not_there(tmp_path: Path) -> None:
    made = 0
    with writers() as write:
        for number in range(30):
            path = tmp_path / str(number) / "copies.db"
            path.parent.mkdir()
            write(path, 1e-3 * 1.2**number)
            made += path.exists()
            with Ledger(path, writable=True) as ledger:
                assert verify(ledger).fits
    assert made > 0


# The command line


def test_commit_prints_the_head(path: Path, capsys: Any) -> None:
    head = copies(path)[-1].head
    assert run(capsys, "ledger", "commit", path, "--json")[:2] == (0, {"head": head, "copies": len(NAMES)})
    assert words(capsys, "ledger", "commit", path) == (0, f"{head}\n")
    code, result, _ = run(capsys, "ledger", "commit", tampered(path, "UPDATE copies SET n_bits = 1"), "--json")
    assert (code, result["error"]) == (3, "LedgerError")


def test_verify_answers_by_its_exit_code(path: Path, tmp_path: Path, capsys: Any) -> None:
    head = copies(path)[2].head
    code, result, _ = run(capsys, "ledger", "verify", path, "--head", head, "--json")
    assert (code, result["fits"], result["committed"], result["copies"]) == (0, True, 3, len(NAMES))
    code, result, _ = run(capsys, "ledger", "verify", path, "--head", "0" * 64, "--json")
    assert (code, result["fits"], result["strange"]) == (1, False, True)
    code, result, _ = run(capsys, "ledger", "verify", path, "--files", tmp_path, "--json")
    assert (code, len(result["missing"]), result["changed"]) == (1, len(NAMES), [])
    changed = tampered(path, "UPDATE copies SET n_bits = 1 WHERE number = 4")
    code, result, _ = run(capsys, "ledger", "verify", changed, "--head", head, "--files", tmp_path, "--json")
    assert (code, result["fits"], result["committed"], result["missing"]) == (1, False, None, [])
    assert "number 4" in result["misfit"]


def words(capsys: Any, *line: object) -> tuple[int, str]:
    """Exit code and stdout of a command that prints no JSON."""
    with pytest.raises(SystemExit) as leave:
        main([str(word) for word in line])
    return int(leave.value.code or 0), capsys.readouterr().out


def test_verify_speaks_plainly(path: Path, tmp_path: Path, capsys: Any) -> None:
    for copy in copies(path):
        (tmp_path / copy.file).parent.mkdir(exist_ok=True)
        (tmp_path / copy.file).write_text(copy.name)
    lines = ("ledger", "verify", path, "--files", tmp_path, "--head")
    code, text = words(capsys, *lines, copies(path)[2].head)
    assert code == 0
    assert "The chain fits. Copies: 5;" in text
    assert "The commitment is to this ledger, and to its copies up to number 3." in text
    assert "Each file of the copies is in" in text
    first, second = (tmp_path / copy.file for copy in copies(path)[:2])
    first.unlink()
    second.write_text("edited")
    code, text = words(capsys, *lines, "f" * 64)
    assert code == 1
    assert f"The commitment {'f' * 64} is not to this ledger" in text
    assert f"missing: bust/{first.name}\nchanged: bust/{second.name}\n" in text
    code, text = words(capsys, "ledger", "verify", tampered(path, "DELETE FROM copies WHERE number = 2"))
    assert (code, text) == (
        1,
        "The chain is broken: number 2 is missing; the next one is 3. Nothing else was looked at.\n",
    )


@pytest.mark.parametrize(
    "line",
    [
        ["verify", "{path}", "--head", "12"],
        ["verify", "{path}", "--files", "nowhere"],
        ["list", "{path}", "--asset", "bust"],
        ["commit"],
        ["burn", "{path}"],
    ],
)
def test_what_is_typed_wrongly_is_usage(path: Path, line: list[str], capsys: Any) -> None:
    code, result, _ = run(capsys, "ledger", *(word.format(path=path) for word in line), "--json")
    assert (code, result["error"]) == (2, "UsageError")


@pytest.mark.parametrize("command", ["commit", "verify", "list"])
def test_what_is_no_ledger_is_bad_input(tmp_path: Path, command: str, capsys: Any) -> None:
    code, result, _ = run(capsys, "ledger", command, tmp_path / "none.db", "--json")
    assert (code, result["error"]) == (3, "LedgerError")
    assert os.listdir(tmp_path) == []


def test_list_shows_copies_of_all_assets_or_one(path: Path, capsys: Any) -> None:
    with Ledger(path, writable=True) as ledger:
        ledger.add([entry("of the cup", "cup")])
    code, result, _ = run(capsys, "ledger", "list", path, "--json")
    assert (code, [each["name"] for each in result["copies"]]) == (0, [*NAMES, "of the cup"])
    assert set(result["copies"][0]) == {*COLUMNS, "head"}
    asset = hexadecimal("cup")
    code, result, _ = run(capsys, "ledger", "list", path, "--asset", asset[:6].upper(), "--json")
    assert (code, [(each["number"], each["asset"]) for each in result["copies"]]) == (0, [(6, asset)])
    code, result, err = run(capsys, "ledger", "list", path, "--asset", "0" * 64, "--json")
    assert (code, result) == (1, {"copies": []})
    assert "has no copy" in err


@ANY_LEDGER
@given(name=ANY_NAME)
def test_a_name_cannot_steer_the_terminal_or_break_the_table(growing: Path, capsys: Any, name: str) -> None:
    with Ledger(growing, writable=True) as ledger:
        asset = str(len(ledger.copies()))
        *_, copy = ledger.add([entry("[bold]plain[/bold] ", asset), entry(name, asset)])
    code, text = words(capsys, "ledger", "list", growing, "--asset", copy.asset)
    assert code == 0
    header, plain, line = text.removesuffix("\n").split("\n")
    assert header.startswith("number")
    assert " [bold]plain[/bold] " in plain
    assert line.isprintable()
    shown = "".join(sign if sign.isprintable() else ascii(sign)[1:-1] for sign in name)
    assert line.startswith(f"{copy.number:<6}  {shown} ")
