"""Independent programs agree about marked files: slow, and left out where a program is not there; see scripts/proof."""

import importlib
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from fixtures.gltf_files import CASES
from fixtures.paths import ROOT, SHARED


@pytest.fixture
def prove(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(ROOT / "scripts" / "proof"))
    return importlib.import_module("prove")


@pytest.fixture
def model(prove: ModuleType, tmp_path: Path) -> Any:
    """Writes one of the models of scripts/proof, and says where."""

    def write(name: str) -> Path:
        path = tmp_path / f"{name}.glb"
        path.write_bytes(importlib.import_module("models").MODELS[name]())
        return path

    return write


@pytest.fixture
def small_cases(prove: ModuleType, tmp_path: Path) -> dict[str, Path]:
    """Where each of the small cases is."""
    return dict(zip(CASES, importlib.import_module("samples").cases(tmp_path), strict=True))


def rows(prove: ModuleType, proof: str, file: Path, folder: Path) -> list[Any]:
    """The rows of a proof; all of them hold. Skips the test where a program is missing."""
    folder.mkdir(exist_ok=True)
    try:
        found = list(prove.rows_of(proof, file, folder))
    except importlib.import_module("programs").MissingError as reason:
        pytest.skip(str(reason))
    assert found
    assert all(row.passed for row in found), [row for row in found if not row.passed]
    return found


def test_a_program_that_is_not_here_is_named(
    prove: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(prove.programs, "HERE", tmp_path)
    monkeypatch.setattr(prove.programs, "ROOT", tmp_path.parent)
    with pytest.raises(prove.MissingError, match=r"trimesh is not here; in .*: pip install"):
        prove.programs.python("trimesh")


def test_a_program_that_fails_or_hangs_is_ended(prove: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    run = prove.programs.run
    assert run(sys.executable, "-c", "print(5)") == "5\n"
    with pytest.raises(prove.FailedError, match="ended with 7: bad"):
        run(sys.executable, "-c", "import sys; print('bad', file=sys.stderr); sys.exit(7)")
    monkeypatch.setattr(prove.programs, "LONGEST", 0.2)
    with pytest.raises(prove.FailedError, match="longer than"):
        run(sys.executable, "-c", "import time; time.sleep(30)")


def test_likeness_is_one_of_equal_pictures_and_falls_with_noise(prove: ModuleType) -> None:
    rng = np.random.default_rng(0)
    picture = np.ones((40, 40, 3))
    picture[10:30, 10:30] = rng.uniform(0.2, 0.8, (20, 20, 3))
    same = prove.likeness(picture, picture)
    assert same.difference == 0.0
    assert same.similarity == pytest.approx(1.0)
    slight, strong = (prove.likeness(picture, picture + s * rng.normal(size=picture.shape)) for s in (0.01, 0.2))
    assert 0.0 < slight.difference < strong.difference
    assert strong.similarity < slight.similarity < 1.0
    there, back = prove.likeness(picture, picture**2), prove.likeness(picture**2, picture)
    assert there == back


@pytest.mark.parametrize(
    ("change", "alike"),
    [
        ({}, True),
        ({"motion": 0.012}, False),  # further than it went
        ({"motion": 0.0}, False),  # not seen at all
        ({"materials": [1, 2]}, False),
        ({"after": [[3, 1], [3, 1]], "motion": None}, False),
        ({"before": [], "after": []}, False),
        ({"refusals": ["x"]}, False),
        ({"refusals": ["x", "x"]}, True),
    ],
)
def test_what_readers_must_see(prove: ModuleType, change: dict[str, Any], alike: bool) -> None:
    seen = {"before": [[3, 1]], "after": [[3, 1]], "materials": [1, 1], "motion": 0.01, "largest": 1.0}
    assert prove._alike(seen | change, 0.01)[0] is alike


@pytest.mark.slow
@pytest.mark.parametrize("name", ["plain", "two_primitives", "quantised", "morph", "instances", "rigged"])
def test_a_marked_file_is_valid_and_is_read_from_what_publishers_write(
    prove: ModuleType, model: Any, tmp_path: Path, name: str
) -> None:
    file = model(name)
    rows(prove, "complaints", file, tmp_path / "here")
    assert len(rows(prove, "published", file, tmp_path / "here")) == len(prove.PUBLISHED)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_small_cases_look_alike_to_validator_and_readers(
    prove: ModuleType, small_cases: dict[str, Path], tmp_path: Path, name: str
) -> None:
    for proof in ("complaints", "readers"):
        rows(prove, proof, small_cases[name], tmp_path / "here")


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["bust.ply", "bust.obj", "bust.off", "bust.stl", "bust.3mf", "rigged.glb", "pair.gltf"]
)
def test_readers_see_only_the_motion(prove: ModuleType, tmp_path: Path, name: str) -> None:
    prove.samples(tmp_path)
    rows(prove, "readers", tmp_path / name, tmp_path / "here")


@pytest.mark.slow
def test_a_compressed_file_is_sound_after_marking(prove: ModuleType, model: Any, tmp_path: Path) -> None:
    assert len(rows(prove, "compressed", model("two_primitives"), tmp_path / "here")) == 2 * len(prove.COMPRESSED)


@pytest.mark.slow
def test_a_browser_draws_the_same_before_and_after(prove: ModuleType, model: Any, tmp_path: Path) -> None:
    rows(prove, "pictures", model("rigged"), tmp_path / "here")
    assert (tmp_path / "here" / prove.PICTURE.name).stat().st_size < 300_000


@pytest.mark.slow
def test_other_peoples_files_look_alike_to_readers(prove: ModuleType, tmp_path: Path) -> None:
    files = [path for path in sorted((SHARED / "cases").glob("*")) if path.suffix in (".glb", ".obj", ".stl", ".3mf")]
    if not files:
        pytest.skip("the files of other people are not here (set O3DMARK_SHARED to the folder that holds them)")
    for number, file in enumerate(files):
        rows(prove, "readers", file, tmp_path / str(number))
