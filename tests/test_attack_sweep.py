"""The sweep of all attacks over many meshes: what a row says, and that it says so of every attack once."""

import csv
import importlib
import multiprocessing
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from fixtures.paths import GOLDEN, ROOT
from o3dmark.attacks import ATTACKS
from o3dmark.errors import BackendError
from o3dmark.files import write_mesh
from o3dmark.mesh.surface import TriangleMesh


@pytest.fixture
def sweep(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(ROOT / "scripts" / "campaigns"))
    return importlib.import_module("attack_sweep")


def measured(sweep: ModuleType, path: Path, wanted: list[str]) -> list[dict[str, Any]]:
    """What the child would send, without a child."""
    sent: list[dict[str, Any]] = []
    sweep._measure(path, wanted, SimpleNamespace(send=sent.append))
    return sent


def test_every_attack_and_every_named_choice_is_swept_once(sweep: ModuleType) -> None:
    specs = sweep.specs()
    assert len(specs) == len(set(specs))
    assert set(ATTACKS) <= set(specs)
    assert {"noise:kind=normal", "noise:seams=false", "subdivide:scheme=sqrt3", "reformat:format=stl"} <= set(specs)
    assert {"crop:kind=ball", "crop:largest=true", "rescan:surface=pivot", "smooth:weights=cotangent"} <= set(specs)
    for spec in specs:
        ATTACKS.make(spec)


def test_valid_refused_and_failed_are_told_apart(sweep: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    def attack(mesh: TriangleMesh, spec: str) -> dict[str, Any]:
        if spec == "holes":
            raise BackendError("No holes here. Try another mesh.\nMore lines.")
        if spec == "hc":
            raise RuntimeError("unforeseen")
        return real(mesh, spec)

    real = sweep._attacked
    monkeypatch.setattr(sweep, "_attacked", attack)
    read, ok, refused, failed = measured(sweep, GOLDEN / "spot.ply", ["subdivide", "holes", "hc"])
    assert (read["outcome"], read["vertices"], read["triangles"]) == ("ok", 2930, 5856)
    assert (ok["outcome"], ok["reason"], ok["triangles_out"]) == ("ok", "", 4 * 5856)
    assert (refused["outcome"], refused["reason"]) == ("refused", "No holes here.")
    assert (failed["outcome"], failed["reason"]) == ("failed", "RuntimeError: unforeseen")


@pytest.mark.parametrize(("flaw", "reason"), [("nan", "not finite"), ("empty", "no triangle"), ("touched", "changed")])
def test_damage_is_a_failure(sweep: ModuleType, spot: TriangleMesh, flaw: str, reason: str) -> None:
    def attack(mesh: TriangleMesh, _: int) -> TriangleMesh:
        other = mesh if flaw == "touched" else TriangleMesh() if flaw == "empty" else TriangleMesh(mesh)
        if flaw != "empty":
            other.vertices[3] = [float("nan")] * 3 if flaw == "nan" else [9.0, 9.0, 9.0]
        return other

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sweep.ATTACKS, "make", lambda _: attack)
        row = sweep._attacked(TriangleMesh(spot), "damage")
    assert row["outcome"] == "failed"
    assert reason in row["reason"]


def test_a_file_that_cannot_be_read_is_refused_by_name(sweep: ModuleType, tmp_path: Path) -> None:
    path = tmp_path / "bad.ply"
    path.write_text("ply\n")
    (row,) = measured(sweep, path, ["noise"])
    assert row["outcome"] == "refused"
    assert "bad.ply" in row["reason"]
    assert str(tmp_path) not in row["reason"]


def test_a_lost_child_is_a_failure(sweep: ModuleType) -> None:
    def child() -> SimpleNamespace:
        return SimpleNamespace(join=lambda: None, kill=lambda: None, exitcode=-11)

    receiver, sender = multiprocessing.Pipe(duplex=False)
    assert sweep._received(receiver, child(), 0.01) == {"outcome": "failed", "reason": "timeout after 0.01 s"}
    sender.close()
    crashed = sweep._received(receiver, child(), 0.01)
    assert crashed == {"outcome": "failed", "reason": "the process ended with exit code -11"}


def test_small_files_first_and_no_row_twice(
    sweep: ModuleType, tmp_path: Path, spot: TriangleMesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "meshes" / "deeper").mkdir(parents=True)
    write_mesh(tmp_path / "meshes" / "large.ply", spot)
    write_mesh(tmp_path / "meshes" / "deeper" / "small.ply", TriangleMesh.create_icosahedron())
    out = tmp_path / "rows.csv"
    common = ["attack_sweep.py", str(tmp_path / "meshes"), "--out", str(out), "--attacks"]

    def rows(path: Path, wanted: list[str], _: float) -> list[dict[str, Any]]:
        return [{"mesh": path.name, "attack": spec, "outcome": "ok"} for spec in wanted]

    monkeypatch.setattr(sweep, "rows", rows)
    for attacks in (["noise"], ["noise", "weld"], ["noise", "weld"]):
        monkeypatch.setattr(sys, "argv", [*common, *attacks])
        sweep.main()
    with out.open(newline="") as file:
        found = [(row["mesh"], row["attack"]) for row in csv.DictReader(file)]
    assert found == [("small.ply", "noise"), ("large.ply", "noise"), ("small.ply", "weld"), ("large.ply", "weld")]
