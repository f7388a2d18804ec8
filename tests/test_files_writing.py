"""Writing: a file is complete or not there at all."""

import open3d as o3d
import pytest

from o3dmark.errors import MeshError, SpecError
from o3dmark.files import replacing, write_mesh


def test_writing_where_it_cannot_be(spot, tmp_path):
    with pytest.raises(MeshError, match=r"no folder .*nowhere"):
        write_mesh(tmp_path / "nowhere" / "a.ply", spot)
    with pytest.raises(MeshError, match=r"cannot write a\.txt.*\.ply"):
        write_mesh(tmp_path / "a.txt", spot)
    assert not list(tmp_path.iterdir())


def half_written(name, mesh):
    """What a full disk does."""
    with open(name, "wb") as file:
        file.write(b"ply\nhalf a head")
    return False


@pytest.mark.parametrize("old", [None, b"what was there"])
def test_a_failing_write_leaves_the_old_file_and_nothing_else(spot, tmp_path, monkeypatch, old):
    path = tmp_path / "a.ply"
    if old:
        path.write_bytes(old)
    monkeypatch.setattr(o3d.io, "write_triangle_mesh", half_written)
    with pytest.raises(MeshError, match=r"could not write a\.ply"):
        write_mesh(path, spot)
    assert [file.read_bytes() for file in tmp_path.iterdir()] == ([old] if old else [])


def test_a_block_that_raises_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "a.json"
    path.write_text("old")

    def write():
        with replacing(path) as draft:
            draft.write_text("new")
            (draft.parent / "beside.txt").write_text("new")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write()
    assert contents(tmp_path) == {"a.json": "old"}


def test_a_block_that_ends_well_replaces_the_file_and_brings_its_companions(tmp_path):
    path = tmp_path / "a.json"
    path.write_text("old")
    with replacing(path) as draft:
        draft.write_text("new")
        (draft.parent / "beside.txt").write_text("beside")
        assert path.read_text() == "old"
    assert contents(tmp_path) == {"a.json": "new", "beside.txt": "beside"}


def contents(folder):
    return {file.name: file.read_text() for file in folder.iterdir()}


def test_companions_take_no_place_but_of_those_of_a_file_that_was_there(tmp_path):
    (tmp_path / "beside.txt").write_text("somebody's")
    with pytest.raises(SpecError, match=r"a\.json would come with beside\.txt"):
        write_two(tmp_path / "a.json")
    assert contents(tmp_path) == {"beside.txt": "somebody's"}
    (tmp_path / "a.json").write_text("old")
    write_two(tmp_path / "a.json")
    assert contents(tmp_path) == {"a.json": "new", "beside.txt": "new"}


def write_two(path):
    with replacing(path) as draft:
        draft.write_text("new")
        (draft.parent / "beside.txt").write_text("new")
