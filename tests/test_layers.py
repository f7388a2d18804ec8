"""Who may import whom: downwards only; and one door for each heavy library."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import o3dmark
from fixtures.paths import ROOT

PACKAGE = Path(o3dmark.__file__).parent
FILES = sorted(PACKAGE.rglob("*.py"))

# From the ground up. A module, or a package with all its files, imports from lower lines only, and within itself.
LAYERS = """
    _version arrays errors
    registry
    mesh coding
    solid files
    attacks metrics synthetic methods
    watermark
    profiles
    view
    campaign
    report
    cli
    o3dmark __main__
"""
LEVEL = {unit: level for level, line in enumerate(LAYERS.split("\n")) for unit in line.split()}
DOORS = {
    "open3d": {"mesh", "files", "view", "synthetic", "attacks"},
    "pymeshlab": {"attacks._meshlab"},
    "finufft": {"solid.spectrum"},
    "matplotlib": {"report", "view"},
    "typer": {"cli"},
    "distributed": {"campaign.pool"},
}


def module_of(file: Path) -> str:
    parts = file.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__") or "o3dmark"


def imports(file: Path) -> Iterator[str]:
    """Every module that ``file`` imports, wherever in the file; a relative import is refused."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file.name}:{node.lineno} imports relatively"
            if node.module == "o3dmark":
                yield from (f"o3dmark.{name.name}" for name in node.names)
            else:
                yield str(node.module)


@pytest.mark.parametrize("file", FILES, ids=module_of)
def test_imports_go_downwards(file: Path) -> None:
    unit = module_of(file).split(".")[0]
    assert unit in LEVEL, f"{unit} has no place in LAYERS"
    for name in imports(file):
        head, *rest = name.split(".")
        if head == "o3dmark" and rest and rest[0] != unit:
            assert LEVEL.get(rest[0], len(LEVEL)) < LEVEL[unit], f"{unit} must not import {name}"


@pytest.mark.parametrize("file", FILES, ids=module_of)
def test_heavy_libraries_have_one_door(file: Path) -> None:
    module = module_of(file)
    for name in imports(file):
        doors = DOORS.get(name.split(".")[0], {module})
        assert module in doors or module.split(".")[0] in doors, f"{module} must not import {name}"


def test_the_architecture_page_has_the_same_layers() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    shown: dict[int, set[str]] = {}
    for number, names in re.findall(r"^\| (\d+) \| ((?:`\w+`(?:, )?)+) \|", page, re.MULTILINE):
        shown.setdefault(int(number), set()).update(re.findall(r"`(\w+)`", names))
    assert shown == dict(enumerate((set(line.split()) for line in LAYERS.strip().splitlines()), start=1))


def test_the_walk_sees_lazy_imports(tmp_path: Path) -> None:
    (tmp_path / "lazy.py").write_text(
        "def f():\n    import a.b\n    from o3dmark import c\n    from o3dmark.d import e\n"
    )
    assert list(imports(tmp_path / "lazy.py")) == ["a.b", "o3dmark.c", "o3dmark.d"]


@pytest.mark.parametrize("module", ["o3dmark", "o3dmark.cli"])
def test_the_front_door_is_light(module: str) -> None:
    heavy = "{'open3d', 'pymeshlab', 'matplotlib', 'scipy'}"
    code = f"import sys, {module}; print(*sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == []
