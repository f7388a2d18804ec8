"""The API cannot be misread: kinds go through, answers print, what is wrong says what is right."""

import importlib
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import open3d as o3d
import pytest

import o3dmark
from fixtures.paths import ROOT
from o3dmark.attacks import ATTACKS, Noise, attack_all
from o3dmark.coding.detection import Detection
from o3dmark.coding.keys import Key
from o3dmark.coding.payload import Decoded
from o3dmark.errors import KeyFileError, MeshError, SpecError
from o3dmark.mesh.surface import MeshArrays, TriangleMesh, mesh_arrays
from o3dmark.methods import METHODS, Extraction
from o3dmark.metrics import METRICS
from o3dmark.profiles import PROFILES
from o3dmark.synthetic import SHAPES
from o3dmark.watermark import Reading, Watermark

MARK = PROFILES["robust-2026"]
READ = Detection(np.log10(4.19e-8), 64, 64, 1e-6)


# What comes out is of the kind that went in


@pytest.mark.parametrize("attack", ["noise", "simplify", "reorder", "crop"])
def test_an_attacked_mesh_is_of_the_kind_that_was_given(spot: TriangleMesh, attack: str) -> None:
    tensor = o3d.t.geometry.TriangleMesh.from_legacy(spot, o3d.core.float64)
    for mesh in (spot, tensor, mesh_arrays(spot)):
        done = attack_all(mesh, attack, 1)
        assert type(done) is type(mesh)
    assert attack_all(tensor, attack, 1).vertex.positions.dtype == o3d.core.float64
    same = [mesh_arrays(attack_all(mesh, attack, 1)) for mesh in (spot, tensor, mesh_arrays(spot))]
    for other in same[1:]:
        assert np.allclose(other.vertices, same[0].vertices, rtol=0.0, atol=1e-12)


def test_a_marked_mesh_is_of_the_kind_that_was_given(spot: TriangleMesh, key: Key) -> None:
    tensor = o3d.t.geometry.TriangleMesh.from_legacy(spot, o3d.core.float64)
    for mesh in (tensor, MeshArrays(*mesh_arrays(spot))):
        assert type(MARK.embed(mesh, "mine", key)) is type(mesh)


TYPED = """
import open3d as o3d
from typing import assert_type
from o3dmark import Key, Watermark, attack_all, Reading, Detection
from o3dmark.attacks import Noise
from o3dmark.methods import Layered
from o3dmark.metrics import MRMS

class Kind: ...

mesh, key, mark = Kind(), Key.generate(), Watermark(method=Layered())
assert_type(mark.embed(mesh, "mine", key), Kind)
assert_type(attack_all(mesh, ["noise", Noise(amplitude=0.001)], 1), Kind)
assert_type(Noise()(mesh, 1), Kind)
assert_type(mark.extract(mesh, key), Reading)
assert_type(mark.detect(mesh, key), Detection)
assert_type(MRMS()(mesh, mesh), float)
"""


@pytest.mark.slow
def test_type_checkers_know_it_too(tmp_path: Path) -> None:
    """The kinds of meshes, and the classes that packages let one import."""
    (tmp_path / "typed.py").write_text(TYPED)
    words = ["--config-file", str(ROOT / "pyproject.toml"), str(tmp_path / "typed.py")]
    done = subprocess.run([sys.executable, "-m", "mypy", *words], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


# What can be imported


@pytest.mark.parametrize(
    ("package", "registry"), [("attacks", ATTACKS), ("metrics", METRICS), ("methods", METHODS), ("synthetic", SHAPES)]
)
def test_registered_classes_are_imported_from_their_package(package: str, registry: Any) -> None:
    """By anybody, and by type checkers: the names that these are told are all there are."""
    room = importlib.import_module(f"o3dmark.{package}")
    told = set()
    for line in (ROOT / "o3dmark" / package / "__init__.py").read_text().splitlines():
        if line.startswith("    from o3dmark.") and " as " in line:
            told.add((line.split()[1], line.split()[-1]))
    own = {(registry[name].__module__, registry[name].__name__) for name in registry}
    own = {each for each in own if each[0].startswith("o3dmark.")}
    assert told == own
    for _, name in own:
        assert getattr(room, name).__name__ == name
    with pytest.raises(AttributeError):
        room.NoSuchThing  # noqa: B018


def test_the_front_door_has_what_it_says() -> None:
    names = ("Key", "Watermark", "Reading", "Detection", "view", "PROFILES", "attack_all", "read_mesh", "marking")
    for name in names:
        assert getattr(o3dmark, name) is not None
        assert name in o3dmark.__all__


# How answers print


def test_a_reading_prints_in_one_line_and_as_a_table() -> None:
    found = Reading(Extraction(np.ones(64), view="as received"), Decoded("mine", READ))
    none = Reading(Extraction(np.ones(64)), Decoded(None, Detection(np.log10(0.4), 40, 64, 1e-4)))
    assert repr(found) == "Reading('mine', p=4.2e-08)"
    assert repr(none) == "Reading(none, p=0.4)"
    shown = Reading(found.extraction, Decoded("<b>", READ))._repr_html_()
    assert "&lt;b&gt;" in shown
    assert "1 in 23 million" in shown
    assert shown.count("<tr>") == 4


def test_so_does_a_detection() -> None:
    assert repr(READ) == "Detection(present, p=4.2e-08)"
    assert repr(Detection(-1.0, 40, 64, 1e-6)) == "Detection(absent, p=0.1)"
    assert repr(Detection(-9.0, 40, 64, 1e-6, other="x")) == "Detection(absent, p=1e-09, 'x' reads better)"
    assert "1 in 23 million" in READ._repr_html_()


# What is wrong says what is right


def test_what_is_no_key_is_refused_and_not_repeated(spot: TriangleMesh, key: Key) -> None:
    for wrong in ("my secret words", Path("owner.key"), b"0" * 32, None):
        calls = [
            lambda wrong=wrong: MARK.embed(spot, "mine", wrong),
            lambda wrong=wrong: MARK.embed_bits(spot, [0] * 64, wrong),
            lambda wrong=wrong: MARK.prepare(spot, wrong),
            lambda wrong=wrong: MARK.extract(spot, wrong),
            lambda wrong=wrong: MARK.detect(spot, wrong, "mine"),
        ]
        for call in calls:
            with pytest.raises(KeyFileError, match=r"a Key is wanted, not \w+: Key.load\(path\)") as error:
                call()
            assert "secret" not in str(error.value)


def test_message_and_key_the_wrong_way_round_are_told(spot: TriangleMesh, key: Key) -> None:
    for call in (lambda: MARK.embed(spot, key, "mine"), lambda: MARK.detect(spot, "mine", key)):  # type: ignore[arg-type]
        with pytest.raises(SpecError, match=r"embed\(mesh, message, key\), detect\(mesh, key, message\)"):
            call()
    for wrong in (5, b"mine", None):
        with pytest.raises(SpecError, match="a message is a text, or 'hex:' and digits of bytes, not of type"):
            MARK.embed(spot, wrong, key)  # type: ignore[arg-type]


def test_what_is_no_mesh_is_told_how_to_become_one(spot: TriangleMesh, key: Key) -> None:
    cloud = o3d.geometry.PointCloud(spot.vertices)
    wrong = {"bust.ply": "read_mesh", Path("bust.ply"): "read_mesh", None: "not NoneType"}
    for mesh, remedy in wrong.items():
        for call in (lambda m=mesh: MARK.embed(m, "mine", key), lambda m=mesh: attack_all(m, "noise", 1)):
            with pytest.raises(MeshError, match=remedy):
                call()
    with pytest.raises(MeshError, match="Vector3dVector"):
        attack_all(np.zeros((3, 3)), "noise", 1)
    with pytest.raises(MeshError, match="create_from_point_cloud_poisson"):
        attack_all(cloud, "simplify", 1)


def test_methods_and_codes_are_objects() -> None:
    with pytest.raises(SpecError, match=r"method is 'layered': .* METHODS.make\('layered'\)"):
        Watermark(method="layered")  # type: ignore[arg-type]
    with pytest.raises(SpecError, match=r"CODES.make\('random'\)"):
        Watermark(code="random")  # type: ignore[arg-type]


def test_a_profile_that_is_not_there_names_the_one_that_was_meant() -> None:
    with pytest.raises(SpecError, match=r"^no profile is called 'robust'; did you mean 'robust-2026'\?$"):
        PROFILES["robust"]
    with pytest.raises(KeyError):
        PROFILES["xyzzy"]
    assert PROFILES.get("xyzzy") is None
    assert "robust" not in PROFILES


def test_one_attack_needs_no_list(spot: TriangleMesh) -> None:
    results = [attack_all(spot, each, 1) for each in ("noise", Noise(), ["noise"], [Noise()])]
    for each in results[1:]:
        assert np.array_equal(np.asarray(each.vertices), np.asarray(results[0].vertices))
