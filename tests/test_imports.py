"""What a command imports: no library that takes long to load and that it does not use."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from fixtures.paths import GOLDEN
from o3dmark.coding.keys import Key
from o3dmark.files import read_mesh, write_mesh

MARKED = GOLDEN / "marks" / "robust.ply"
MESSAGE = json.loads((MARKED.parent / "manifest.json").read_text())[MARKED.name]["message"]
PICTURES_AND_TOOLS = {"open3d", "matplotlib", "pymeshlab", "trimesh"}
KINDS = ("methods", "attacks", "metrics", "codes", "shapes", "profiles")
_RUN = """
import sys
from o3dmark.cli import main
try:
    main(sys.argv[1:])
except SystemExit as end:
    print(end.code, *sorted({name.partition(".")[0] for name in sys.modules}), file=sys.stderr)
"""


def imported(*words: object) -> set[str]:
    """The packages in memory after a command that ends well."""
    line = [sys.executable, "-c", _RUN, *map(str, words)]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    code, *packages = done.stderr.splitlines()[-1].split()
    assert code == "0", done.stderr
    return set(packages)


@pytest.fixture
def owner(tmp_path: Path, key: Key) -> Path:
    key.save(tmp_path / "owner.key")
    return tmp_path / "owner.key"


def test_help_imports_no_arrays() -> None:
    assert not imported("--help") & {*PICTURES_AND_TOOLS, "numpy", "scipy", "numba"}
    assert not imported("extract", "--help") & {*PICTURES_AND_TOOLS, "numpy", "scipy", "numba"}


@pytest.mark.parametrize("kind", KINDS)
def test_lists_import_what_they_list(kind: str) -> None:
    assert not imported("list", kind) & PICTURES_AND_TOOLS


@pytest.mark.parametrize("ending", [".ply", ".obj", ".off", ".stl", ".glb"])
@pytest.mark.parametrize("words", [(), ("--profile", "robust-2026")], ids=["any profile", "a profile"])
def test_a_mark_is_read_on_arrays_alone(tmp_path: Path, owner: Path, ending: str, words: tuple[str, ...]) -> None:
    source = MARKED
    if ending != MARKED.suffix:
        source = tmp_path / f"marked{ending}"
        write_mesh(source, read_mesh(MARKED))
    unwanted = {*PICTURES_AND_TOOLS, "numba"}
    assert not imported("extract", source, "--key", owner, *words) & unwanted
    assert not imported("detect", source, "--key", owner, "--message", MESSAGE, *words) & unwanted


@pytest.mark.parametrize("words", [(), ("--profile", "robust-2026")], ids=["any profile", "a profile"])
def test_a_mark_is_written_without_open3d(tmp_path: Path, owner: Path, words: tuple[str, ...]) -> None:
    command = ("embed", MARKED, tmp_path / "out.ply", "--key", owner, "--message", "me")
    assert not imported(*command, *words) & PICTURES_AND_TOOLS


def test_a_copy_is_issued_and_traced_without_open3d(tmp_path: Path, owner: Path) -> None:
    (tmp_path / "buyers.csv").write_text("name\nb1\n")
    common = ("--ledger", tmp_path / "copies.db", "--key", owner)
    words = ("--to", tmp_path / "buyers.csv", "--out", tmp_path, "--profile", "robust-2026", "--workers", 1)
    assert not imported("issue", MARKED, *words, *common) & PICTURES_AND_TOOLS
    (copy,) = (tmp_path / MARKED.name).rglob(MARKED.name)
    assert not imported("trace", copy, *common) & {*PICTURES_AND_TOOLS, "numba"}


def test_what_needs_open3d_imports_it(tmp_path: Path) -> None:
    """So that the tests above would see it."""
    assert "open3d" in imported("attack", MARKED, tmp_path / "out.ply", "identity")
