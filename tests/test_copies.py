"""Copies: issued to buyers, entered, killed at any moment, and traced to the buyer or to nobody."""

import json
import os
import signal
import subprocess
import sys
import tarfile
import time
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fixtures.command_line import run
from fixtures.paths import ROOT
from o3dmark import copies
from o3dmark.attacks import attack_all
from o3dmark.cli import main
from o3dmark.coding.identities import codeword
from o3dmark.coding.keys import Key
from o3dmark.coding.words import one_in
from o3dmark.copies import Ledger, Tracer, issue, read_buyers, suspects
from o3dmark.copies.buyers import folder_of
from o3dmark.copies.issuing import asset_digest, asset_key
from o3dmark.copies.tracing import Named, Trace
from o3dmark.copies.words import sentence
from o3dmark.errors import BackendError, LedgerError, MeshError, SpecError
from o3dmark.files import open_asset, read_mesh, write_mesh
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays, triangle_mesh

NAMES = ["b1", "b2", "Zoë, 7\nof Bonn", "x" * 300, "b3"]


@pytest.fixture(scope="module")
def asset(tmp_path_factory: pytest.TempPathFactory, spot: TriangleMesh) -> Path:
    path = tmp_path_factory.mktemp("asset") / "spot.ply"
    write_mesh(path, spot)
    return path


@pytest.fixture(scope="module")
def shop(asset: Path, key: Key, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a ledger and the copies of spot."""
    folder = tmp_path_factory.mktemp("shop")
    issued(asset, NAMES, key, folder)
    return folder


def issued(asset: Path, names: list[str], key: Key, folder: Path, **options) -> list[copies.Progress]:
    with Ledger(folder / "copies.db", writable=True) as ledger:
        return list(issue(asset, names, key, ledger, folder / "out", profile="robust-2026", **options))


def tracer(folder: Path, *keys: Key, **options) -> Tracer:
    with Ledger(folder / "copies.db") as ledger:
        return Tracer.of(ledger.copies(), keys, **options)


def copy_of(folder: Path, name: str, asset: str = "spot.ply") -> Path:
    return folder / "out" / asset / folder_of(name) / asset


# ---- issuing ----


def test_each_buyer_gets_a_copy_of_the_asset_with_only_its_positions_moved(shop: Path, asset: Path, key: Key) -> None:
    with Ledger(shop / "copies.db") as ledger:
        entered = ledger.copies()
        assert copies.verify(ledger, files=shop / "out").fits
    assert [copy.name for copy in entered] == NAMES
    before = asset.read_bytes()
    for copy in entered:
        content = (shop / "out" / copy.file).read_bytes()
        assert len(content) == len(before)
        assert content != before
        assert copy.asset == asset_digest(open_asset(asset))
        assert 1e-4 < copy.mrms < 5.8e-4
    assert len({copy.digest for copy in entered}) == len(NAMES)
    assert not list((shop / "out").rglob("*.part"))


def test_a_copy_carries_the_codeword_of_its_name_under_the_key_of_the_asset(shop: Path, asset: Path, key: Key) -> None:
    own = asset_key(key, asset_digest(open_asset(asset)))
    extraction = copies.tracing.copies_watermark("robust-2026").extract_bits(read_mesh(copy_of(shop, "b2")), own)
    np.testing.assert_array_equal(extraction.bits, codeword(own, "b2", 64))


def test_what_is_issued_is_not_issued_again_and_more_can_be(asset: Path, key: Key, tmp_path: Path) -> None:
    assert [step.done for step in issued(asset, ["a", "b"], key, tmp_path)] == [0, 1, 2]
    first = copy_of(tmp_path, "a").read_bytes()
    assert [(step.done, step.total) for step in issued(asset, ["a", "b"], key, tmp_path)] == [(2, 2)]
    copy_of(tmp_path, "b").unlink()
    copy_of(tmp_path, "b").parent.rmdir()
    steps = issued(asset, ["b", "c", "a"], key, tmp_path)
    assert steps[-1].copy.name == "c"
    assert steps[0].elsewhere == ("b",)
    assert copy_of(tmp_path, "a").read_bytes() == first


def test_a_copy_that_was_entered_but_not_placed_is_put_in_its_place(asset: Path, key: Key, tmp_path: Path) -> None:
    issued(asset, ["a"], key, tmp_path)
    place = copy_of(tmp_path, "a").parent
    content = (place / "spot.ply").read_bytes()
    os.replace(place, place.with_name(".a.part"))
    place.with_name(".b.part").mkdir()
    place.with_name(".b.part").joinpath("half").write_text("of a file")
    assert issued(asset, ["b"], key, tmp_path)[-1].elsewhere == ()  # a is not in the list, and is not lost all the same
    assert (place / "spot.ply").read_bytes() == content
    assert sorted(path.name for path in place.parent.iterdir() if path.is_dir()) == ["a", "b"]
    assert [path.name for path in place.with_name("b").iterdir()] == ["spot.ply"]


def test_what_is_in_the_way_is_left_alone(asset: Path, key: Key, tmp_path: Path) -> None:
    place = copy_of(tmp_path, "b")
    place.parent.mkdir(parents=True)
    place.write_text("mine")
    with pytest.raises(LedgerError, match="is there, but not in"):
        issued(asset, ["a", "b"], key, tmp_path)
    assert place.read_text() == "mine"


def test_an_asset_that_changed_is_refused(asset: Path, key: Key, tmp_path: Path) -> None:
    changed = tmp_path / "spot.ply"
    changed.write_bytes(asset.read_bytes())
    issued(changed, ["a"], key, tmp_path)
    mesh = read_mesh(changed)
    write_mesh(changed, mesh.translate((1.0, 0.0, 0.0)))
    with pytest.raises(LedgerError, match="changed since"):
        issued(changed, ["b"], key, tmp_path)


def test_another_key_for_the_same_asset_is_refused(asset: Path, key: Key, tmp_path: Path) -> None:
    issued(asset, ["a"], key, tmp_path)
    with pytest.raises(LedgerError, match="another key"):
        issued(asset, ["b"], Key(bytes(32)), tmp_path)


def test_other_parameters_for_the_same_asset_are_refused(asset: Path, key: Key, tmp_path: Path) -> None:
    issued(asset, ["a"], key, tmp_path)
    with pytest.raises(LedgerError, match="go on with these"):
        issued(asset, ["b"], key, tmp_path, n_bits=48)
    with pytest.raises(SpecError, match="no profile"), Ledger(tmp_path / "copies.db", writable=True) as ledger:
        list(issue(asset, ["b"], key, ledger, tmp_path / "out", profile="none"))


def test_what_cannot_be_marked_is_told_and_nothing_is_entered(key: Key, tmp_path: Path) -> None:
    write_mesh(tmp_path / "flat.ply", triangle_mesh(np.eye(3), np.array([[0, 1, 2]])))
    with pytest.raises(MeshError):
        issued(tmp_path / "flat.ply", ["a"], key, tmp_path)
    with Ledger(tmp_path / "copies.db") as ledger:
        assert ledger.copies() == []
    assert [path.name for path in (tmp_path / "out" / "flat.ply").iterdir()] == [".o3dmark.lock"]


def test_a_file_where_the_folder_of_the_copies_should_be_is_told(asset: Path, key: Key, tmp_path: Path) -> None:
    (tmp_path / asset.name).write_bytes(asset.read_bytes())
    with (
        Ledger(tmp_path / "copies.db", writable=True) as ledger,
        pytest.raises(LedgerError, match="a file of that name is there: another --out"),
    ):
        next(issue(asset, ["a"], key, ledger, tmp_path))
    assert (tmp_path / asset.name).read_bytes() == asset.read_bytes()


def test_two_at_a_time_in_one_folder_are_one_too_many(asset: Path, key: Key, tmp_path: Path) -> None:
    with Ledger(tmp_path / "copies.db", writable=True) as ledger:
        first = issue(asset, ["a"], key, ledger, tmp_path / "out", profile="robust-2026")
        next(first)
        second = issue(asset, ["b"], key, ledger, tmp_path / "out", profile="robust-2026")
        with pytest.raises(BackendError, match="another process"):
            next(second)
        first.close()


def test_further_copies_are_made_as_those_that_there_are(asset: Path, key: Key, tmp_path: Path) -> None:
    """By the profile, and of the length, that the ledger names, whatever the default is by then."""
    with Ledger(tmp_path / "copies.db", writable=True) as ledger:
        list(issue(asset, ["a"], key, ledger, tmp_path / "out", profile="robust-2026", n_bits=72))
        list(issue(asset, ["a", "b"], key, ledger, tmp_path / "out"))
        assert {(copy.name, copy.profile, copy.n_bits) for copy in ledger.copies()} == {
            ("a", "robust-2026", 72),
            ("b", "robust-2026", 72),
        }


@pytest.mark.parametrize("kills", [1, pytest.param(200, marks=pytest.mark.slow)])
def test_killed_at_any_moment_nothing_is_lost(kills: int, asset: Path, key: Key, tmp_path: Path) -> None:
    """The ledger is whole, and each copy that is in its place is in it as it is."""
    key.save(tmp_path / "owner.key")
    names = [f"buyer {number}" for number in range(4 * kills)]
    (tmp_path / "buyers.csv").write_text("name\n" + "\n".join(names))
    words = ["issue", asset, "--to", "buyers.csv", "--key", "owner.key", "--ledger", "copies.db", "--out", "out"]
    words += ["--profile", "robust-2026"]
    line = [sys.executable, "-m", "o3dmark", *map(str, words), "--workers", "1"]
    rng = np.random.default_rng(0)
    placed = 0
    for _ in range(kills):
        process = subprocess.Popen(
            line, cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)}, start_new_session=True
        )
        deadline = time.monotonic() + 60.0
        while process.poll() is None and time.monotonic() < deadline and count(tmp_path) <= placed:
            time.sleep(0.01)
        time.sleep(rng.uniform(0.0, 0.4))
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        placed = count(tmp_path)
        with Ledger(tmp_path / "copies.db") as ledger:
            digests = {copy.file: copy.digest for copy in ledger.copies()}
        for file in (tmp_path / "out").glob("spot.ply/[!.]*/spot.ply"):
            name = file.relative_to(tmp_path / "out").as_posix()
            assert copies.verification.digest_of(file) == digests[name]
    assert placed >= kills
    issued(asset, names, key, tmp_path)
    with Ledger(tmp_path / "copies.db") as ledger:
        assert copies.verify(ledger, files=tmp_path / "out").fits
        assert sorted(copy.name for copy in ledger.copies()) == sorted(names)
    assert count(tmp_path) == len(names)


@pytest.mark.parametrize("kills", [1, pytest.param(200, marks=pytest.mark.slow)])
def test_a_trace_killed_at_any_moment_leaves_the_ledger_and_no_half_a_page(
    kills: int, shop: Path, key: Key, tmp_path: Path
) -> None:
    key.save(tmp_path / "owner.key")
    suspect = shop / "out" / "spot.ply" / "b1" / "spot.ply"
    words = ["trace", suspect, "--ledger", shop / "copies.db", "--key", "owner.key", "--report", "page.html"]
    line = [sys.executable, "-m", "o3dmark", *map(str, words), "--overwrite"]
    before = (shop / "copies.db").read_bytes()
    rng = np.random.default_rng(0)
    for _ in range(kills):
        process = subprocess.Popen(
            line,
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            start_new_session=True,
            stdout=subprocess.DEVNULL,
        )
        time.sleep(rng.uniform(0.0, 6.0))
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        assert (shop / "copies.db").read_bytes() == before
        page = tmp_path / "page.html"
        assert not page.exists() or page.read_text().rstrip().endswith("</html>")
    with Ledger(shop / "copies.db") as ledger:
        assert copies.verify(ledger, files=shop / "out").fits


def count(folder: Path) -> int:
    return len(list(folder.glob("out/spot.ply/[!.]*")))


# ---- buyers ----


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("a\nb\n", ["a", "b"]),
        ("id,name\n1,Ann\n2,Bob\n", ["Ann", "Bob"]),
        ('\ufeffName\r\n"Zoë, 7\r\nBonn"\r\n\r\nBob', ["Zoë, 7\r\nBonn", "Bob"]),
        ('"say ""hi"""\n' + "y" * 300, ['say "hi"', "y" * 300]),
    ],
)
def test_names_from_csv(text: str, names: list[str], tmp_path: Path) -> None:
    (tmp_path / "b.csv").write_bytes(text.encode())
    assert read_buyers(tmp_path / "b.csv") == names


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "names nobody"),
        (b"name\n", "names nobody"),
        (b"a\nb\na\n", "line 3: 'a' is on line 1 already"),
        (b"id,name\n1,\n", "line 2: a copy needs a name"),
        (b"id,name\n1\n", "line 2: a copy needs a name"),
        (b"a\xff\n", "not UTF-8"),
        (b'"a\n', "not CSV"),
    ],
)
def test_bad_lists_of_buyers(content: bytes, words: str, tmp_path: Path) -> None:
    (tmp_path / "b.csv").write_bytes(content)
    with pytest.raises(LedgerError, match=words):
        read_buyers(tmp_path / "b.csv")
    with pytest.raises(LedgerError, match="cannot read"):
        read_buyers(tmp_path / "none.csv")


def test_folders_are_names_that_every_system_can_write_and_no_two_alike() -> None:
    names = [
        "b3",
        "B3",
        "con",
        "CON",
        "a b",
        "a-b",
        "../../etc",
        "",
        " ",
        "é",
        "e\u0301",
        "x" * 300,
        "x" * 299,
        "a/b",
        "\n",
    ]
    folders = [folder_of(name) for name in names]
    assert folders[0] == "b3"
    assert len({folder.lower() for folder in folders}) == len(names)
    assert all(
        len(folder) < 64 and not set(folder) - set("abcdefghijklmnopqrstuvwxyz0123456789_-") for folder in folders
    )


# ---- tracing ----


@pytest.mark.parametrize("name", NAMES)
def test_a_copy_is_traced_after_what_the_world_did_to_it(name: str, shop: Path, key: Key) -> None:
    leaked = attack_all(
        read_mesh(copy_of(shop, name)), ["simplify:ratio=0.3", "similarity", "noise:amplitude=0.001"], 1
    )
    found = tracer(shop, key).trace(leaked)
    assert found.found
    assert found.best.copy.name == name
    assert found.best.log10_p < -9
    assert found.runner_up.log10_p > -2
    assert (found.candidates, found.part) == (len(NAMES), "all of it")


def test_nobody_is_named_of_the_asset_itself_or_of_a_stranger_s_copy(
    shop: Path, asset: Path, key: Key, tmp_path: Path
) -> None:
    issued(asset, ["a stranger"], key, tmp_path)
    for mesh in (read_mesh(asset), read_mesh(copy_of(tmp_path, "a stranger"))):
        assert not tracer(shop, key).trace(mesh).found
    with pytest.raises(LedgerError, match="no copy in the ledger was made with a key that was given"):
        tracer(shop, Key(bytes(32)))
    assert tracer(shop, Key(bytes(32)), key).trace(read_mesh(copy_of(shop, "b1"))).found


def test_a_mixture_of_three_names_no_fourth(shop: Path, asset: Path, key: Key) -> None:
    a, b, c = (mesh_arrays(read_mesh(copy_of(shop, name)))[0] for name in ("b1", "b2", "b3"))
    mixed = triangle_mesh(a + b - c, mesh_arrays(read_mesh(asset))[1])
    found = tracer(shop, key).trace(mixed)
    assert not found.found or found.best.copy.name in ("b1", "b2", "b3")


def test_every_candidate_reading_view_and_pass_is_charged(shop: Path, key: Key) -> None:
    mesh = read_mesh(copy_of(shop, "b1"))
    found = tracer(shop, key).trace(mesh)
    assert found.candidates == len(NAMES)
    steps, views, passes = 45, 1, 3
    charged = np.log10(len(NAMES) * steps * views * passes)
    assert found.best.log10_p == pytest.approx(-64 * np.log10(2) + charged, abs=1.0)  # all bits, not all trusted alike
    with Ledger(shop / "copies.db") as ledger:
        more = [replace(copy, name=f"{copy.name} {number}") for copy in ledger.copies() for number in range(20)]
        crowd = Tracer.of([*ledger.copies(), *more], [key]).trace(mesh)
    assert crowd.best.log10_p == pytest.approx(found.best.log10_p + np.log10(21), abs=1e-9)


def test_a_fragment_is_traced_beside_the_asset(shop: Path, asset: Path, key: Key) -> None:
    fragment = attack_all(read_mesh(copy_of(shop, "b2")), ["crop:share=0.3,largest=true", "similarity"], 1)
    assert not tracer(shop, key).trace(fragment).found
    found = tracer(shop, key, reference=open_asset(asset)).trace(fragment)
    assert (found.found, found.informed) == (True, True)
    assert found.best.copy.name == "b2"


def test_suspects_are_files_folders_and_archives(shop: Path, tmp_path: Path) -> None:
    file = copy_of(shop, "b1")
    (tmp_path / "notes.txt").write_text("no mesh")
    with zipfile.ZipFile(tmp_path / "leak.zip", "w") as archive:
        archive.write(file, "a/b/bust.PLY")
        archive.writestr("readme.md", "hello")
        archive.write(file, "../../outside.ply")
    with tarfile.open(tmp_path / "leak.tar.gz", "w:gz") as tar:
        tar.add(file, "bust.ply")
    (tmp_path / "broken.zip").write_bytes(b"PK\3\4 and no more")
    with zipfile.ZipFile(tmp_path / "empty.zip", "w") as archive:
        archive.writestr("readme.md", "hello")
    found = []
    paths = [file, shop / "out", *(tmp_path / name for name in ("leak.zip", "leak.tar.gz", "broken.zip", "empty.zip"))]
    for name, path in suspects(paths):
        found.append(name)
        assert isinstance(path, MeshError) == (Path(name).name in ("broken.zip", "empty.zip"))
        assert isinstance(path, MeshError) or path.read_bytes()[:3] == b"ply"
    assert found[:1] == [str(file)]
    assert len(found) == 1 + len(NAMES) + 4
    assert found[-4:-2] == [f"{tmp_path / 'leak.zip'}/a/b/bust.PLY", f"{tmp_path / 'leak.tar.gz'}/bust.ply"]


def test_an_archive_that_unpacks_to_too_much_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with zipfile.ZipFile(tmp_path / "bomb.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.ply", bytes(2_000_000))
    monkeypatch.setattr("o3dmark.copies.archives._MOST_BYTES", 1_000_000)
    ((_, error),) = suspects([tmp_path / "bomb.zip"])
    assert "unpacks to more than" in str(error)


# ---- words and the command line ----


@pytest.mark.parametrize(
    ("log10_p", "words"),
    [
        (0.0, "1 in 1"),
        (-1.0, "1 in 10"),
        (-3.0, "1 in 1 thousand"),
        (-7.3802, "1 in 23 million"),
        (-9.999999, "1 in 9 billion"),
        (-16.9, "1 in 10^16"),
    ],
)
def test_a_probability_never_sounds_rarer_than_it_is(log10_p: float, words: str) -> None:
    assert one_in(log10_p) == words


def test_answers_are_sentences(shop: Path) -> None:
    with Ledger(shop / "copies.db") as ledger:
        b1 = ledger.copies()[0]
    named = Named(b1, -7.39, 64 * "1")
    assert sentence(Trace(named, None, 5, 1e-6)) == (
        "Found: the copy of b1. The chance that this is a mistake is 1 in 24 million."
    )
    assert sentence(Trace(named, None, 5, 1e-9)) == "None of your copies."
    assert sentence(Trace(None, None, 0, 1e-6)) == "None of your copies: the ledger is empty."


def test_the_commands(asset: Path, key: Key, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    key.save(tmp_path / "owner.key")
    (tmp_path / "buyers.csv").write_text("b1\nb2\n")
    common = ["--ledger", "copies.db", "--key", "owner.key"]
    code, report, _ = run(capsys, "issue", asset, "--to", "buyers.csv", *common, "--workers", "1", "--json")
    assert (code, report["copies"], report["new"], report["ledger"]) == (0, 2, 2, "copies.db")
    assert report["output"] == ["copies/spot.ply/b1/spot.ply", "copies/spot.ply/b2/spot.ply"]
    with pytest.raises(SystemExit) as leave:
        main(["trace", report["output"][1], *common])
    assert not leave.value.code
    assert "spot.ply: Found: the copy of b2. The chance that this is a mistake is 1 in 10^1" in capsys.readouterr().out
    with pytest.raises(SystemExit) as leave:
        main(["trace", *report["output"], "buyers.csv", *common, "--json"])
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert not leave.value.code
    assert [(line["found"], line.get("copy")) for line in lines] == [(True, "b1"), (True, "b2"), (False, None)]
    assert lines[2]["error"] == "MeshError"
    assert {"file", "found", "copy", "copies", "p_value", "runner_up", "part", "layer", "seconds"} <= lines[0].keys()
    assert run(capsys, "trace", "buyers.csv", *common)[0] == 3
    assert run(capsys, "trace", asset, *common)[0] == 1
    code, _, err = run(capsys, "trace", asset, *common, "--reference", report["output"][0])
    assert code == 3
    assert "the reference is marked itself: it is the copy of 'b1'" in err
