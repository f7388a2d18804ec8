"""Who may import whom: downwards only; and one door for each heavy library."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import o3dmark
from fixtures.paths import ROOT

PACKAGE = Path(o3dmark.__file__).parent
FILES = sorted(PACKAGE.rglob("*.py"))

# From the ground up. A module, or a package with all its files, imports from lower lines only, and within itself.
LAYERS = """
    _version arrays errors threads
    registry
    mesh coding
    solid files received motion
    metrics synthetic methods
    watermark
    profiles
    attacks
    marking
    view
    campaign
    copies
    report
    evidence
    cli
    o3dmark __main__
"""
LEVEL = {unit: level for level, line in enumerate(LAYERS.split("\n")) for unit in line.split()}
DOORS = {
    "open3d": {"mesh", "files", "view", "synthetic", "attacks"},
    "pymeshlab": {"attacks._meshlab"},
    "finufft": {"solid.spectrum"},
    "clarabel": {"methods._bin_program"},
    "matplotlib": {"report", "view"},
    "typer": {"cli"},
    "distributed": {"campaign.pool"},
}


def module_of(file: Path) -> str:
    parts = file.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__") or "o3dmark"


def imports(file: Path) -> Iterator[str]:
    """Every module that ``file`` imports, wherever in the file; a relative import is refused."""
    yield from _imported(ast.walk(ast.parse(file.read_text())), file)


def imports_when_run(file: Path) -> Iterator[str]:
    """Those that are more than words for type checkers."""
    tree = ast.parse(file.read_text())
    tree.body = [
        node for node in tree.body if not (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test))
    ]
    yield from _imported(ast.walk(tree), file)


def _imported(nodes: Iterable[ast.AST], file: Path) -> Iterator[str]:
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file.name}:{node.lineno} imports relatively"
            inner = node.module == "o3dmark" or _is_package(str(node.module))
            yield from (f"{node.module}.{name.name}" for name in node.names) if inner else [str(node.module)]


def _is_package(name: str) -> bool:
    head, *rest = name.split(".")
    return head == "o3dmark" and PACKAGE.joinpath(*rest, "__init__.py").exists()


@pytest.mark.parametrize("file", FILES, ids=module_of)
def test_imports_go_downwards(file: Path) -> None:
    unit = module_of(file).split(".")[0]
    assert unit in LEVEL, f"{unit} has no place in LAYERS"
    for name in imports(file):
        head, *rest = name.split(".")
        if head == "o3dmark" and rest and rest[0] != unit:
            assert LEVEL.get(rest[0], len(LEVEL)) < LEVEL[unit], f"{unit} must not import {name}"


def test_no_module_imports_itself_by_a_detour() -> None:
    """Within a room, too: the modules can be put in an order in which each imports only earlier ones."""
    modules = {module_of(file) for file in FILES}
    graph = {
        module_of(file): {known for name in imports_when_run(file) if (known := _module(name, modules))}
        for file in FILES
    }
    order = list(TopologicalSorter({name: found - {name} for name, found in graph.items()}).static_order())
    assert set(order) == modules


def _module(name: str, modules: set[str]) -> str | None:
    """The module of the package that an import names, or has a part of, as `module_of` writes it; None for others."""
    if not name.startswith("o3dmark."):
        return None
    dotted = name.removeprefix("o3dmark.")
    return next((known for known in (dotted, dotted.rpartition(".")[0]) if known in modules), None)


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


@pytest.mark.parametrize("module", ["o3dmark", "o3dmark.cli", "o3dmark.copies.ledger"])
def test_the_front_door_is_light(module: str) -> None:
    heavy = "{'open3d', 'pymeshlab', 'matplotlib', 'scipy'}"
    code = f"import sys, {module}; print(*sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == []
