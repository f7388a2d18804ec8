"""Where an asset goes: nothing that was given, and nothing that somebody else put there, gives way."""

from collections.abc import Mapping
from pathlib import Path

import pytest

from o3dmark.errors import MeshError, SpecError
from o3dmark.files.asset import Asset, Moved
from o3dmark.files.references import Source
from o3dmark.files.writing import check_free, destination, free


class Listed(Asset):
    """A file whose first line names what changes, the second what does not."""

    parts = ()
    contents = frozenset[str]()

    def __init__(self, source: Source) -> None:
        super().__init__(source)
        first, second = source.read().decode().split("\n")
        self.changing = tuple(first.split())
        self.references = (*self.changing, *second.split())

    def with_positions(self, moved: Moved, names: Mapping[str, str] | None = None) -> dict[str, bytes]:
        raise NotImplementedError


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A folder with a scene of one buffer and two pictures, one of which lies deeper and one is missing."""
    folder = tmp_path / "home"
    (folder / "pictures").mkdir(parents=True)
    (folder / "scene.list").write_text("scene.bin\npictures/a.png b.png")
    (folder / "scene.bin").write_text("numbers")
    (folder / "pictures/a.png").write_text("picture")
    return folder


def asset(home: Path) -> Asset:
    return Listed(Source(home / "scene.list"))


def contents(folder: Path) -> dict[str, str]:
    return {file.relative_to(folder).as_posix(): file.read_text() for file in folder.rglob("*") if file.is_file()}


def test_in_its_own_folder_only_what_changes_gets_a_new_name(home: Path) -> None:
    before = contents(home)
    plan = destination(asset(home), home / "marked.list")
    assert (plan.names, plan.copies, plan.missing) == ({"scene.bin": "marked.bin"}, {}, ("b.png",))
    (home / "marked.bin").write_text("somebody's")
    plan = destination(asset(home), home / "marked.list")
    assert plan.names == {"scene.bin": "marked-1.bin"}
    plan.write({"marked.list": b"new", "marked-1.bin": b"moved"})
    new = {"marked.list": "new", "marked-1.bin": "moved", "marked.bin": "somebody's"}
    assert contents(home) == before | new


def test_two_that_change_get_two_names(home: Path) -> None:
    (home / "scene.list").write_text("a.bin b.bin\n")
    names = destination(asset(home), home / "marked.list").names
    assert names == {"a.bin": "marked.bin", "b.bin": "marked-1.bin"}


def test_elsewhere_everything_keeps_its_name_and_comes_along(home: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    plan = destination(asset(home), out / "scene.list")
    assert plan.names == {"scene.bin": "scene.bin"}
    plan.write({"scene.list": b"new", "scene.bin": b"moved"})
    assert contents(out) == {"scene.list": "new", "scene.bin": "moved", "pictures/a.png": "picture"}
    assert contents(home)["scene.bin"] == "numbers"


def test_what_lies_there_already_need_not_come_and_another_is_not_covered(home: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    (out / "pictures").mkdir(parents=True)
    (out / "pictures/a.png").write_text("picture")
    assert not destination(asset(home), out / "scene.list").copies
    (out / "pictures/a.png").write_text("another")
    with pytest.raises(SpecError, match=r"'pictures/a\.png', but another file .* an empty folder, like scene/"):
        destination(asset(home), out / "scene.list", overwrite=True)


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("name", ["scene.list", "scene.bin", "pictures/a.png", "linked.list"])
def test_what_was_given_never_gives_way(home: Path, name: str, overwrite: bool) -> None:
    (home / "linked.list").symlink_to(home / "scene.list")
    with pytest.raises(SpecError, match=r"would be lost; .*-1\..* is free"):
        destination(asset(home), home / name, overwrite=overwrite)


def test_a_file_that_is_there_gives_way_only_when_told_to(home: Path) -> None:
    (home / "marked.list").write_text("somebody's\n")
    with pytest.raises(SpecError, match=r"marked\.list exists.*marked-1\.list is free, or say --overwrite"):
        destination(asset(home), home / "marked.list")
    plan = destination(asset(home), home / "marked.list", overwrite=True)
    plan.write({"marked.list": b"new"})
    assert (home / "marked.list").read_text() == "new"


def test_overwriting_again_leaves_no_trail(home: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    for _ in range(3):
        plan = destination(asset(home), out / "marked.list", overwrite=True)
        plan.write({"marked.list": b"scene.bin\n", "scene.bin": b"moved"})
    assert sorted(contents(out)) == ["marked.list", "pictures/a.png", "scene.bin"]
    plan = destination(asset(home), home / "marked.list", overwrite=True)
    plan.write({"marked.list": b"scene.bin\n", "marked.bin": b"moved"})  # it names a buffer of the original's
    assert destination(asset(home), home / "marked.list", overwrite=True).names == {"scene.bin": "marked-1.bin"}


def test_a_file_that_appears_meanwhile_is_left_and_nothing_else_stays(home: Path) -> None:
    plan = destination(asset(home), home / "marked.list")
    (home / "marked.list").write_text("somebody's")
    before = contents(home)
    with pytest.raises(SpecError, match="is there by now"):
        plan.write({"marked.list": b"new", "marked.bin": b"moved"})
    assert contents(home) == before


def test_a_conversion_brings_no_copies_but_looks_for_its_own_companions(home: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    plan = destination(asset(home), out / "scene.obj")
    assert (plan.names, plan.copies) == ({}, {})
    (out / "scene.mtl").write_text("somebody's")
    with pytest.raises(SpecError, match=r"scene\.mtl exists"):
        destination(asset(home), out / "scene.obj")


def test_references_that_leave_the_folder_are_refused(home: Path) -> None:
    (home / "scene.list").write_text("scene.bin\n../secret.png")
    with pytest.raises(MeshError, match="leaves its folder"):
        destination(asset(home), home / "marked.list")


def test_a_folder_that_is_not_there(home: Path) -> None:
    with pytest.raises(MeshError, match="no folder"):
        destination(asset(home), home / "nowhere" / "marked.list")


def test_free_names(tmp_path: Path) -> None:
    assert free(tmp_path / "a.glb") == tmp_path / "a.glb"
    (tmp_path / "a.glb").touch()
    (tmp_path / "a-1.glb").symlink_to("nowhere")
    assert free(tmp_path / "a.glb").name == "a-2.glb"
    check_free(tmp_path / "b.glb", tmp_path / "a.glb")
    with pytest.raises(SpecError, match=r"a-2\.glb is free"):
        check_free(tmp_path / "a.glb")
    check_free(tmp_path / "a.glb", overwrite=True)
