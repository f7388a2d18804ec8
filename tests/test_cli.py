"""The command line: JSON contract, exit codes, secrets kept, nothing half written."""

import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import open3d as o3d
import pytest

from fixtures.command_line import run
from fixtures.paths import GOLDEN
from o3dmark.cli import commands
from o3dmark.coding.keys import Key
from o3dmark.files import read_mesh, write_mesh
from o3dmark.mesh.patch import Patch
from o3dmark.mesh.surface import Surface, TriangleMesh, triangle_mesh

MESSAGE = "o3d!"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, carrier: Any) -> Path:
    """A folder with a key, a cover, and the cover marked with MESSAGE."""
    from o3dmark.watermark import Watermark

    path = tmp_path_factory.mktemp("cli")
    key, cover = Key.generate(), carrier
    key.save(path / "owner.key")
    write_mesh(path / "cover.ply", cover)
    write_mesh(path / "marked.ply", Watermark().embed(cover, MESSAGE, key))
    return path


@pytest.fixture
def fragment(tmp_path: Path, key: Key) -> Path:
    """Half of a bust, which two patches tell; the key is beside it."""
    path = tmp_path / "fragment.ply"
    shutil.copy(GOLDEN / "marks" / "fragment.ply", path)
    key.save(path.with_suffix(".key"))
    return path


def test_keygen_makes_a_private_key_and_keeps_an_old_one(tmp_path: Path, capsys: Any) -> None:
    file = tmp_path / "a.key"
    assert run(capsys, "keygen", file, "--json")[:2] == (0, {"output": str(file)})
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    before = file.read_text()
    code, result, err = run(capsys, "keygen", file, "--json")
    assert (code, result["error"], file.read_text()) == (3, "KeyFileError", before)
    assert before.strip()[-64:] not in err


def test_embed_and_extract(folder: Path, tmp_path: Path, capsys: Any) -> None:
    out, key = tmp_path / "out.ply", folder / "owner.key"
    code, result, err = run(capsys, "embed", folder / "cover.ply", out, "--key", key, "--message", MESSAGE, "--json")
    assert (code, err) == (0, "")
    assert out.exists()
    assert "the cap holds it back" in result["strength"]
    wanted = "output method n_bits message mrms hausdorff max_displacement jnd strength_by verified seconds".split()  # noqa: SIM905
    assert set(wanted) <= set(result)
    assert result["verified"] is True
    assert 0 < result["mrms"] <= 6e-4
    assert (0 < result["jnd"] <= 1, result["strength_by"]) == (True, "cap")
    assert result["mrms"] < result["hausdorff"] <= result["max_displacement"] * 1.001
    code, result, _ = run(capsys, "extract", out, "--key", key, "--json")
    assert code == 0
    wanted = "found message bits soft corrected_bits p_value method seconds".split()  # noqa: SIM905
    assert set(wanted) <= set(result)
    assert (result["found"], result["message"], result["corrected_bits"]) == (True, MESSAGE, 0)
    assert len(result["bits"]) == len(result["soft"]) == 64
    assert result["bits"] == "".join("1" if soft > 0 else "0" for soft in result["soft"])


def test_raw_bits(folder: Path, tmp_path: Path, capsys: Any) -> None:
    out, key, bits = tmp_path / "out.ply", folder / "owner.key", "0110100110010110"
    assert run(capsys, "embed", folder / "cover.ply", out, "--key", key, "--bits", bits)[0] == 0
    code, result, _ = run(capsys, "extract", out, "--key", key, "--n-bits", 16, "--raw", "--json")
    assert (code, result["bits"]) == (0, bits)


def test_detect_says_yes_and_no(folder: Path, capsys: Any) -> None:
    mesh, key = folder / "marked.ply", folder / "owner.key"
    code, result, _ = run(capsys, "detect", mesh, "--key", key, "--message", MESSAGE, "--json")
    assert (code, result["present"], result["matches"], result["n_bits"]) == (0, True, 64, 64)
    assert result["p_value"] <= result["false_positive_rate"] == 1e-6
    words = ("--message", "else", "--profile", "robust-2026", "--json")
    code, result, _ = run(capsys, "detect", mesh, "--key", key, *words)
    assert (code, result["present"]) == (1, False)


def test_what_of_the_surface_spoke_is_told(folder: Path, fragment: Path, capsys: Any) -> None:
    """The patches of a fragment, on its surface; none of a mesh that spoke as a whole."""
    words = (fragment, "--key", fragment.with_suffix(".key"), "--profile", "layered-2026")
    code, result, _ = run(capsys, "extract", *words, "--json")
    assert (code, result["message"], result["part"]) == (0, "part", "fragment: 2 patches")
    surface = Surface.of(read_mesh(fragment))
    assert len(result["patches"]) == 2
    for patch in result["patches"]:
        assert list(patch) == ["centre", "axis", "radius", "half_height"]
        near = Patch(*map(np.array, patch.values())).holds(surface.vertices)
        assert 75 < np.count_nonzero(near) < 0.5 * len(near)
        assert (surface.normals[near] @ patch["axis"]).mean() > 0.5
    known = run(capsys, "detect", *words, "--message", "part", "--json")[1]
    raw = run(capsys, "extract", *words, "--raw", "--json")[1]
    assert known["patches"] == result["patches"]
    assert known["layer"] == result["layer"] == "local"
    assert [each["radius"] for each in raw["patches"]] == pytest.approx([each["radius"] for each in result["patches"]])
    words = (folder / "marked.ply", "--key", folder / "owner.key", "--profile", "robust-2026", "--json")
    whole = run(capsys, "extract", *words)[1]
    assert (whole["patches"], whole["layer"]) == ([], "global")


def test_a_wrong_key_is_a_no_without_a_message(folder: Path, tmp_path: Path, capsys: Any) -> None:
    run(capsys, "keygen", tmp_path / "other.key")
    words = ("--key", tmp_path / "other.key", "--profile", "robust-2026", "--json")
    code, result, err = run(capsys, "extract", folder / "marked.ply", *words)
    assert (code, result["found"], result["message"]) == (1, False, None)
    assert MESSAGE not in err


def test_a_mark_that_the_eye_holds_back_says_so(folder: Path, tmp_path: Path, key: Key, capsys: Any) -> None:
    """With one key: of a random one the next weaker step may lie nearer to the cap, and is then said to."""
    key.save(tmp_path / "fixed.key")
    words = ("--message", MESSAGE, "--method", "shape-spectrum:jnd=0.2", "--json")
    out = tmp_path / "out.ply"
    code, result, err = run(capsys, "embed", folder / "cover.ply", out, "--key", tmp_path / "fixed.key", *words)
    assert (code, result["strength_by"]) == (0, "jnd")
    assert result["strength"] in err
    assert "so much less it survives" in err


def test_what_cannot_be_read_back_is_not_kept(folder: Path, tmp_path: Path, capsys: Any) -> None:
    out = tmp_path / "out.ply"
    words = ("--message", MESSAGE, "--method", "saliency-scs:sync=rank", "--json")
    code, result, err = run(capsys, "embed", folder / "cover.ply", out, "--key", folder / "owner.key", *words)
    assert (code, result["verified"], result["output"]) == (1, False, None)
    assert "nothing was written" in err
    assert "--profile layered-2026 holds this message in this mesh" in err
    assert list(tmp_path.iterdir()) == []


def test_the_cover_is_never_overwritten(folder: Path, capsys: Any) -> None:
    before = (folder / "cover.ply").read_bytes()
    words = ("--key", folder / "owner.key", "--message", MESSAGE, "--json")
    code, result, _ = run(capsys, "embed", folder / "cover.ply", folder / "cover.ply", *words)
    assert (code, result["error"]) == (2, "SpecError")
    assert "cover-1.ply is free" in result["message"]
    assert (folder / "cover.ply").read_bytes() == before


def test_a_mesh_too_small(folder: Path, tmp_path: Path, capsys: Any) -> None:
    write_mesh(tmp_path / "small.ply", TriangleMesh.create_sphere(resolution=12))
    words = ("--key", folder / "owner.key", "--message", MESSAGE, "--json")
    code, result, _ = run(capsys, "embed", tmp_path / "small.ply", tmp_path / "out.ply", *words)
    assert (code, result["error"]) == (3, "CapacityError")
    assert "carries" in result["message"]
    assert not (tmp_path / "out.ply").exists()


@pytest.mark.parametrize(
    ("words", "code", "error"),
    [
        (["extract", "nowhere.ply", "--key", "nokey", "--json"], 3, "KeyFileError"),
        (["extract", "nowhere.ply", "--json"], 2, "UsageError"),
        (["attack", "nowhere.ply", "out.ply", "tickle", "--json"], 2, "SpecError"),
        (["attack", "nowhere.ply", "out.ply", "noise:loud=1", "--json"], 2, "SpecError"),
        (["attack", "nowhere.ply", "out.ply", "identity", "--json"], 3, "MeshError"),
        (["list", "nonsense", "--json"], 2, "SpecError"),
        (["embed", "a.ply", "b.ply", "--key", "k", "--json"], 2, "UsageError"),
        (["nonsense", "--json"], 2, "UsageError"),
        (["synth", "unicorn", "out.ply", "--json"], 2, "SpecError"),
    ],
)
def test_errors_are_one_line_and_one_object(
    words: list[str], code: int, error: str, capsys: Any, tmp_path: Path, monkeypatch: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    left, result, err = run(capsys, *words)
    assert (left, result["error"]) == (code, error)
    assert result["message"]
    assert "Traceback" not in err
    assert not list(tmp_path.iterdir())


def test_attack_and_compare(folder: Path, tmp_path: Path, capsys: Any) -> None:
    out = tmp_path / "attacked.ply"
    specs = ("similarity", "noise:amplitude=0.001")
    code, result, _ = run(capsys, "attack", folder / "marked.ply", out, *specs, "--seed", 4, "--json")
    assert (code, result["vertices"]) == (0, 8857)
    assert len(result["attacks"]) == 2
    again = tmp_path / "again.ply"
    run(capsys, "attack", folder / "marked.ply", again, *specs, "--seed", 4)
    assert out.read_bytes() == again.read_bytes()
    code, result, _ = run(capsys, "compare", folder / "cover.ply", folder / "marked.ply", "--json")
    assert code == 0
    assert {"mrms", "hausdorff", "msdm", "msdm2"} <= set(result)
    simple = tmp_path / "simple.ply"
    run(capsys, "attack", folder / "marked.ply", simple, "simplify:ratio=0.5")
    code, result, _ = run(
        capsys, "compare", folder / "cover.ply", simple, "--metric", "mrms", "--metric", "msdm", "--json"
    )
    assert (code, result["msdm"]) == (0, None)
    assert result["mrms"] > 0


def test_compare_says_why_a_metric_is_null(folder: Path, tmp_path: Path, capsys: Any) -> None:
    path = tmp_path / "speck.ply"
    ball = o3d.geometry.TriangleMesh.create_icosahedron().subdivide_loop(5)
    vertices, triangles = np.asarray(ball.vertices), np.asarray(ball.triangles)
    far, n = [[1e4, 0.0, 0.0], [1e4, 1.0, 0.0], [1e4, 0.0, 1.0]], len(vertices)
    write_mesh(path, triangle_mesh(np.vstack([vertices, far]), np.vstack([triangles, [[n, n + 1, n + 2]]])))
    both = ("--metric", "msdm2", "--metric", "mrms:samples=1000", "--json")
    code, result, talk = run(capsys, "compare", path, path, *both)
    assert (code, result["msdm2"], result["mrms:samples=1000"]) == (0, None, pytest.approx(0.0, abs=1e-12))
    assert talk.startswith("msdm2: most of the mesh lies in one window")
    code, result, _ = run(capsys, "compare", path, path, *both[:2], "--json")
    assert (code, result["error"]) == (3, "MeshError")


def test_saliency_as_numbers_colours_and_picture(folder: Path, tmp_path: Path, capsys: Any) -> None:
    code, result, _ = run(capsys, "saliency", folder / "cover.ply", "--out", tmp_path / "s.npy", "--json")
    assert code == 0
    values = np.load(tmp_path / "s.npy")
    assert (result["min"], result["max"]) == (values.min(), values.max())
    for name in ("s.ply", "s.png"):
        assert run(capsys, "saliency", folder / "cover.ply", "--scales", "2", "--out", tmp_path / name)[0] == 0
        assert (tmp_path / name).stat().st_size > 1000


def test_view_draws_without_a_display(folder: Path, tmp_path: Path, capsys: Any, monkeypatch: Any) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    png = tmp_path / "v.png"
    words = (folder / "cover.ply", folder / "marked.ply", "--scalars", "distance")
    code, result, _ = run(capsys, "view", *words, "--png", png, "--json")
    assert (code, result["patches"]) == (0, None)
    assert png.read_bytes().startswith(b"\x89PNG")
    mirror = png.with_stem("mirror")
    assert run(capsys, "view", *words[:2], "--png", mirror, "--zebra", "--json")[0] == 0
    assert mirror.read_bytes() != png.read_bytes()
    for wrong in (words, words[:2]):
        code, result, _ = run(capsys, "view", *wrong, "--zebra", "--json")
        assert (code, result["error"]) == (2, "SpecError")
    code, result, _ = run(capsys, "view", *words, "--json")
    assert (code, result["error"]) == (3, "BackendError")


def test_view_from_a_side_and_exaggerated(folder: Path, tmp_path: Path, capsys: Any) -> None:
    meshes, pictures = (folder / "cover.ply", folder / "marked.ply"), []
    for number, words in enumerate(((), ("--exaggerate", "50"), ("--camera", "back"), ("--camera", "-30,10,z"))):
        png = tmp_path / f"{number}.png"
        assert run(capsys, "view", *meshes, "--png", png, *words)[0] == 0
        pictures.append(png.read_bytes())
    assert len(set(pictures)) == len(pictures)
    write_mesh(tmp_path / "other.ply", read_mesh(meshes[0]).simplify_quadric_decimation(1000))
    wrong = {
        ("--exaggerate", "9", "--png", tmp_path / "a.png"): (3, "MeshError", "no displacement"),
        ("--exaggerate", "nan", "--png", tmp_path / "a.png"): (2, "SpecError", "like 50"),
        ("--camera", "above", "--png", tmp_path / "a.png"): (2, "SpecError", "AZIMUTH,ELEVATION"),
        ("--camera", "top"): (2, "SpecError", "not for the window"),
        ("--scalars", "weight", "--png", tmp_path / "a.png"): (2, "SpecError", "saliency or distance"),
    }
    for words, (code, name, text) in wrong.items():
        said = run(capsys, "view", meshes[0], tmp_path / "other.ply", *words, "--json")
        assert (said[0], said[1]["error"]) == (code, name)
        assert text in said[1]["message"]
    assert not (tmp_path / "a.png").exists()


def test_view_writes_a_page_of_meshes_and_clouds(folder: Path, tmp_path: Path, capsys: Any) -> None:
    html, cloud = tmp_path / "look.html", tmp_path / "cloud.ply"
    o3d.io.write_point_cloud(str(cloud), o3d.geometry.PointCloud(read_mesh(folder / "cover.ply").vertices))
    words = ("view", folder / "cover.ply", folder / "marked.ply", cloud, "--html", html)
    code, result, talk = run(capsys, *words, "--scalars", "distance", "--exaggerate", "20", "--json")
    assert (code, result["output"], result["html"]) == (0, str(html), str(html)), talk
    text = html.read_text(encoding="utf-8")
    assert '"look": "displacement"' in text
    assert '"factor": 20.0' in text
    assert "distance from cover.ply, % of the bounding-box diagonal" in text
    assert "mesh saliency, no unit" in text
    assert run(capsys, *words, "--json")[1]["error"] == "SpecError"  # it is there already
    assert html.read_text(encoding="utf-8") == text


def test_view_shows_the_patches_that_a_key_finds(folder: Path, fragment: Path, tmp_path: Path, capsys: Any) -> None:
    key, profile = ("--key", fragment.with_suffix(".key")), ("--profile", "layered-2026")
    png = tmp_path / "patches.png"
    code, result, _ = run(capsys, "view", fragment, *key, "--png", png, "--json")
    assert (code, result["output"]) == (0, str(png))
    (found,) = result["patches"]
    told = run(capsys, "extract", fragment, *key, *profile, "--raw", "--json")[1]["patches"]
    assert [each["radius"] for each in found] == pytest.approx([each["radius"] for each in told])
    before, other = png.read_bytes(), ("--png", png, "--overwrite")
    assert before.startswith(b"\x89PNG")
    for words in (key, (*key, *other, "--zebra"), (*profile, *other), (*key, "--profile", "robust-2026", *other)):
        code, result, _ = run(capsys, "view", fragment, *words, "--json")
        assert (code, result["error"]) == (2, "SpecError")
    assert png.read_bytes() == before


@pytest.mark.parametrize("kind", ["methods", "attacks", "metrics", "codes", "shapes", "profiles"])
def test_list_names_everything(kind: str, capsys: Any) -> None:
    code, result, _ = run(capsys, "list", kind, "--json")
    assert code == 0
    assert result
    assert run(capsys, "list", kind)[0] == 0


def test_every_command_takes_json() -> None:
    for name, command in commands().items():
        assert "json" in {parameter.name for parameter in command.params}, name
        assert command.help, name


@pytest.mark.parametrize("program", [[Path(sys.executable).with_name("o3dmark")], [sys.executable, "-m", "o3dmark"]])
def test_as_a_program(program: list[str | Path], tmp_path: Path) -> None:
    """The installed command, and the package: exit code, and neither traceback nor chatter."""
    done = subprocess.run(
        [*program, "extract", "nowhere.ply", "--key", "nokey"],
        cwd=tmp_path,
        env=os.environ,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 3
    assert done.stdout == ""
    assert len(done.stderr.strip().splitlines()) == 1
