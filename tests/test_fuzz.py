"""The fuzzer judges rightly: its seeds come through, and what a parser must not do is seen."""

import importlib
from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from fixtures.paths import ROOT
from o3dmark.errors import MeshError
from o3dmark.files import ASSETS
from o3dmark.files.asset import Part

NAMES = ("obj", "off", "ply", "stl", "glb", "gltf", "3mf", "3mf-model", "usda", "usdc", "usdz")
TRIANGLE = Part("", np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))


@pytest.fixture
def targets(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    return importlib.import_module("fuzz_targets")


def test_every_format_is_a_target(targets: ModuleType) -> None:
    assert set(targets.TARGETS) == set(NAMES)
    assert {target.suffix for target in targets.TARGETS.values()} == set(ASSETS) - {
        ".usd"
    }  # which is one of the others


@pytest.mark.parametrize("name", NAMES)
def test_seeds_come_through(targets: ModuleType, name: str) -> None:
    target = targets.TARGETS[name]
    refused = []
    seeds = [seed for seed in target.seeds() if len(seed) < 20_000]
    for seed in seeds:
        try:
            target.journey(seed)
        except MeshError as error:
            refused.append(error)
    assert seeds
    assert not refused


@pytest.mark.parametrize("name", NAMES)
def test_what_is_no_file_of_the_format_is_refused(targets: ModuleType, name: str) -> None:
    with pytest.raises(MeshError):
        targets.TARGETS[name].journey(b"\x00nothing of the kind")


@pytest.mark.parametrize(
    "after",
    [
        (),
        (replace(TRIANGLE, triangles=TRIANGLE.triangles[:, ::-1].copy()),),
        (replace(TRIANGLE, vertices=TRIANGLE.vertices[:2].copy()),),
        (replace(TRIANGLE, vertices=TRIANGLE.vertices + 1e-4),),
        (replace(TRIANGLE, vertices=np.full((3, 3), np.nan)),),
    ],
)
def test_what_was_not_written_is_seen(targets: ModuleType, after: Any) -> None:
    targets.compare((TRIANGLE,), (TRIANGLE,), {})
    with pytest.raises(targets.WrongError):
        targets.compare((TRIANGLE,), after, {})


def test_the_motion_stays_in_the_box_of_the_triangles(targets: ModuleType) -> None:
    vertices = np.random.default_rng(0).uniform(-3.0, 5.0, (100, 3))
    vertices[99] = 1e9  # no triangle uses it
    moved = targets.waved(Part("", vertices, np.arange(99).reshape(-1, 3)))
    assert (moved[99] == vertices[99]).all()
    assert (moved.min(axis=0) >= vertices.min(axis=0)).all()
    assert (moved[:99].max(axis=0) <= vertices[:99].max(axis=0)).all()
    assert 1e-4 < np.abs(moved - vertices).max() < 1e-2
