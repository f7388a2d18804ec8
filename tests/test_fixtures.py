"""What tests share stands in fixtures: a test file that imports another breaks when that one is split or renamed."""

import ast
from pathlib import Path

import pytest

from fixtures.paths import ROOT

FILES = sorted((ROOT / "tests").rglob("*.py"))
TESTS = {file.stem for file in FILES if file.name.startswith(("test_", "bench_", "conftest"))}


def imported(file: Path) -> set[str]:
    """The first name of every module that a file imports."""
    nodes = list(ast.walk(ast.parse(file.read_text())))
    froms = {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)}
    plain = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    return {name.split(".")[0] for name in froms | plain}


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_no_test_file_is_imported(file: Path) -> None:
    assert not imported(file) & TESTS
