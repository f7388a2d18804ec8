"""What a file refers to is looked for in its own folder only."""

from pathlib import Path

import pytest

from o3dmark.errors import MeshError
from o3dmark.files.references import Source, inside


@pytest.mark.parametrize("name", ["a.bin", "deep/er/a.bin", "deep\\a.bin", "./a.bin", "..a.bin", "a..b/c", "ü %.bin"])
def test_names_below_the_folder_are_followed(tmp_path: Path, name: str) -> None:
    assert inside(tmp_path / "mesh.gltf", name) == tmp_path / name.replace("\\", "/")


@pytest.mark.parametrize(
    "name",
    [
        *("", ".", "..", "../a.bin", "deep/../../a.bin", "..\\a.bin", "deep\\..\\a.bin", "/etc/passwd", "\\etc\\x"),
        *("C:/a.bin", "c:a.bin", "//host/a.bin", "file:///etc/passwd", "https://host/a.bin"),
    ],
)
def test_names_that_leave_it_are_refused_and_said(tmp_path: Path, name: str) -> None:
    with pytest.raises(MeshError, match=r"mesh\.gltf refers to .* leaves its folder"):
        inside(tmp_path / "mesh.gltf", name)


def test_a_link_out_of_the_folder_is_no_way_out(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    (tmp_path / "secret.bin").write_bytes(b"secret")
    (folder / "a.bin").symlink_to(tmp_path / "secret.bin")
    (folder / "up").symlink_to(tmp_path)
    for name in ("a.bin", "up/secret.bin"):
        with pytest.raises(MeshError, match="leaves its folder"):
            Source(folder / "mesh.gltf").beside(name)


def test_a_source_reads_its_file_and_those_beside_it(tmp_path: Path) -> None:
    (tmp_path / "mesh.gltf").write_bytes(b"mesh")
    (tmp_path / "a.bin").write_bytes(b"numbers")
    source = Source(tmp_path / "mesh.gltf")
    assert (source.read(), source.beside("a.bin")) == (b"mesh", b"numbers")
    with pytest.raises(MeshError, match=r"mesh\.gltf needs 'b\.bin', which is not there"):
        source.beside("b.bin")
    with pytest.raises(MeshError, match="no file at"):
        Source(tmp_path / "other.gltf").read()
    (tmp_path / "empty.gltf").touch()
    with pytest.raises(MeshError, match=r"empty\.gltf is empty"):
        Source(tmp_path / "empty.gltf").read()


def test_given_bytes_stand_in_for_what_lies_there(tmp_path: Path) -> None:
    source = Source(tmp_path / "mesh.gltf", {"mesh.gltf": b"new", "a.bin": b"other"})
    assert (source.read(), source.beside("a.bin")) == (b"new", b"other")
    with pytest.raises(MeshError, match="which is not there"):
        source.beside("c.bin")


@pytest.mark.parametrize("name", ["a\0b", 256 * "a", 2000 * "ab/"])
def test_names_that_no_file_has_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(MeshError, match=r"mesh\.gltf refers to .* no file can be called"):
        inside(tmp_path / "mesh.gltf", name)
