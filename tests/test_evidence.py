"""The page of evidence: what a trace found, for others to read; names cannot inject anything, no secret is in it."""

import os
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from fixtures.command_line import run
from fixtures.shapes import mapped, rotation
from o3dmark.attacks import attack_all
from o3dmark.coding.identities import codeword
from o3dmark.coding.keys import Key
from o3dmark.copies import Ledger, Tracer, issue
from o3dmark.copies.issuing import asset_key
from o3dmark.evidence import Evidence
from o3dmark.files import read_mesh, write_mesh, write_shape
from o3dmark.mesh.patch import Patch
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays, point_cloud
from o3dmark.methods.local_patches import places

HOSTILE = '<script>alert("x")</script>&\'"><img src=x onerror=alert(1)>'


class Page(HTMLParser):
    """The tags of a page, their attributes, and all that is text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += attributes

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.fixture(scope="module")
def shop(spot: TriangleMesh, key: Key, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("shop")
    write_mesh(folder / "spot.ply", spot)
    with Ledger(folder / "copies.db", writable=True) as ledger:
        list(issue(folder / "spot.ply", [HOSTILE, "b2"], key, ledger, folder / "out", profile="robust-2026"))
        leaked = next(copy for copy in ledger.copies() if copy.name == HOSTILE)
    write_mesh(folder / "leak.stl", read_mesh(folder / "out" / leaked.file))
    return folder


@pytest.fixture(scope="module")
def page(shop: Path, key: Key) -> str:
    with Ledger(shop / "copies.db") as ledger:
        tracer = Tracer.of(ledger.copies(), [key])
    evidence = Evidence(shop / "out")
    evidence.add(f"{HOSTILE}.stl", shop / "leak.stl", tracer.trace(read_mesh(shop / "leak.stl")))
    evidence.add("spot.ply", shop / "spot.ply", tracer.trace(read_mesh(shop / "spot.ply")))
    evidence.write(shop / "out.html", [shop / "copies.db"], "o3dmark trace leak.stl")
    return (shop / "out.html").read_text()


def test_it_says_what_was_found_and_how_sure_it_is(page: str, shop: Path) -> None:
    text = Page(page).text
    assert f"Found: the copy of {HOSTILE}. The chance that this is a mistake is 1 in 10^1" in text
    assert "None of your copies." in text
    assert "64 of 64 bits agree" in text
    assert "o3dmark trace leak.stl" in text
    with Ledger(shop / "copies.db") as ledger:
        (copy, _), head = ledger.copies(), ledger.head
    assert all(digits in text for digits in (copy.digest, copy.asset, copy.made, head))


def test_names_cannot_inject_anything(page: str) -> None:
    parsed = Page(page)
    assert "script" not in parsed.tags
    assert not [name for name, _ in parsed.attributes if name.startswith("on")]
    assert all(value.startswith("data:image/jpeg") for name, value in parsed.attributes if name == "src" and value)


def test_it_loads_nothing(page: str) -> None:
    parsed = Page(page)
    assert not {"link", "iframe", "object", "script"} & set(parsed.tags)
    assert "url(" not in page
    assert not [value for name, value in parsed.attributes if name == "href" and not (value or "").startswith("#")]
    assert parsed.tags.count("img") == 1  # of the copy that was found, and of no other


def test_no_key_and_no_codeword_is_in_it(page: str, shop: Path, key: Key) -> None:
    with Ledger(shop / "copies.db") as ledger:
        copy = ledger.copies()[0]
    own = asset_key(key, copy.asset)
    word = "".join(map(str, codeword(own, copy.name, 64)))
    assert not any(secret in page for secret in (key.secret.hex(), own.secret.hex(), word))


def test_what_cannot_be_drawn_is_said(shop: Path, key: Key, tmp_path: Path) -> None:
    with Ledger(shop / "copies.db") as ledger:
        tracer = Tracer.of(ledger.copies(), [key])
    evidence = Evidence(tmp_path)
    evidence.add("leak.stl", shop / "leak.stl", tracer.trace(read_mesh(shop / "leak.stl")))
    evidence.write(tmp_path / "out.html", [shop / "copies.db"], "o3dmark trace")
    assert "cannot be drawn beside each other" in Page((tmp_path / "out.html").read_text()).text


@pytest.fixture(scope="module")
def torn(spot: TriangleMesh, key: Key, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a ledger, two copies of spot with patches, and a part of the first's, moved."""
    folder = tmp_path_factory.mktemp("torn")
    write_mesh(folder / "spot.ply", spot)
    with pytest.MonkeyPatch.context() as patch, Ledger(folder / "copies.db", writable=True) as ledger:
        patch.setattr(places, "_LOOKED_AT", 250)
        list(issue(folder / "spot.ply", ["b1", "b2"], key, ledger, folder / "out", profile="layered-2026"))
        leaked = next(copy for copy in ledger.copies() if copy.name == "b1")
    part = attack_all(read_mesh(folder / "out" / leaked.file), ["crop:share=0.3"], 1)
    write_mesh(folder / "leak.ply", mapped(part, lambda v: v @ rotation(5).T + 3.0))
    key.save(folder / "owner.key")
    return folder


def test_where_patches_spoke_they_are_told_and_shown(
    torn: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["o3dmark"])
    words = ("trace", torn / "leak.ply", "--ledger", torn / "copies.db", "--key", torn / "owner.key")
    code, line, _ = run(capsys, *words, "--report", torn / "out.html", "--json")
    assert (code, line["copy"], line["layer"]) == (0, "b1", "local")
    vertices = mesh_arrays(read_mesh(torn / "leak.ply"))[0]
    for patch in line["patches"]:
        near = Patch(*map(np.array, patch.values())).holds(vertices)
        assert 30 < np.count_nonzero(near) < 0.7 * len(near)
    page = Page((torn / "out.html").read_text())
    assert "leak.ply: where it was read" in page.text
    assert "Each of them carries bits of the copy by itself" in page.text
    assert page.tags.count("img") == 1


def test_patches_of_what_cannot_be_drawn_are_told(torn: Path, key: Key) -> None:
    with Ledger(torn / "copies.db") as ledger:
        found = Tracer.of(ledger.copies(), [key]).trace(read_mesh(torn / "leak.ply"))
    write_shape(torn / "cloud.ply", point_cloud(mesh_arrays(read_mesh(torn / "leak.ply"))[0]))
    evidence = Evidence()
    evidence.add("cloud.ply", torn / "cloud.ply", found)
    evidence.write(torn / "cloud.html", [torn / "copies.db"], "o3dmark trace")
    page = Page((torn / "cloud.html").read_text())
    assert "They cannot be drawn: " in page.text
    assert "img" not in page.tags


def test_the_command_writes_it_and_overwrites_nothing(
    shop: Path, key: Key, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    key.save(tmp_path / "owner.key")
    words = ["trace", shop / "leak.stl", "--ledger", shop / "copies.db", "--key", tmp_path / "owner.key"]
    monkeypatch.setattr("sys.argv", ["o3dmark", *map(str, words)])
    assert run(capsys, *words, "--report", tmp_path / "out.html", "--json")[0] == 0
    text = (tmp_path / "out.html").read_text()
    assert str(tmp_path) not in text
    assert str(shop) not in text
    code, _, err = run(capsys, *words, "--report", tmp_path / "out.html")
    assert (code, "exists" in err) == (2, True)
    assert run(capsys, *words, "--report", shop / "leak.stl", "--overwrite")[0] == 2
    assert (tmp_path / "out.html").read_text() == text


@pytest.mark.slow
@pytest.mark.parametrize("width", [1280, 390])
def test_a_browser_shows_it_without_scrolling_sideways(page: str, shop: Path, tmp_path: Path, width: int) -> None:
    browser = shutil.which("chromium")
    if browser is None:
        pytest.skip("there is no chromium")
    measure = "<script>document.title = document.documentElement.scrollWidth + ' of ' + innerWidth</script>"
    (tmp_path / "page.html").write_text(page.replace("</body>", measure + "</body>"))
    line = [browser, "--headless", "--no-sandbox", "--disable-gpu", f"--window-size={width},2000", "--dump-dom"]
    shown = subprocess.run(
        [*line, (tmp_path / "page.html").as_uri()],
        capture_output=True,
        text=True,
        timeout=60,
        env=os.environ,
        check=True,
    ).stdout
    whole, seen = map(int, shown.split("<title>")[1].split("</title>")[0].split(" of "))
    assert whole <= seen
