"""The files to be traced: as named, those in folders, and those in archives, unpacked for as long as it takes."""

import tarfile
import tempfile
import zipfile
from collections.abc import Iterable, Iterator
from pathlib import Path, PurePosixPath
from typing import IO

from o3dmark.errors import MeshError
from o3dmark.files import ASSETS, CLOUDS

_READ = (*ASSETS, *CLOUDS)
_TAR = (".tar", ".tgz", ".tar.gz", ".tar.bz2", ".tar.xz")
_MOST_FILES = 10_000
_MOST_BYTES = 4 << 30  # in an archive, unpacked
_PIECE = 1 << 20


def suspects(paths: Iterable[str | Path]) -> Iterator[tuple[str, Path | MeshError]]:
    """(name, file) of everything to look at; an error in place of what cannot be opened.

    A file stands for itself; of a folder, and of a ZIP or tar archive, whatever there has the ending of a mesh or point
    cloud. Files of an archive are there until the next is asked for.
    """
    for path in map(Path, paths):
        if path.is_dir():
            for file in sorted(path.rglob("*")):
                if file.is_file() and file.suffix.lower() in _READ:
                    yield str(file), file
        elif _is_archive(path):
            yield from _of_archive(path)
        else:
            yield str(path), path


def _is_archive(path: Path) -> bool:
    return path.is_file() and (path.suffix.lower() == ".zip" or path.name.lower().endswith(_TAR))


def _of_archive(path: Path) -> Iterator[tuple[str, Path | MeshError]]:
    with tempfile.TemporaryDirectory(prefix="o3dmark-") as folder:
        try:
            unpacked = _unpacked(path, Path(folder))
        except (OSError, EOFError, zipfile.BadZipFile, tarfile.TarError, RuntimeError, NotImplementedError) as error:
            yield str(path), MeshError(f"{path.name} is no archive that can be opened: {error}")
            return
        except MeshError as error:
            yield str(path), error
            return
        if not unpacked:
            yield str(path), MeshError(f"{path.name} holds no mesh and no point cloud")
        for name in unpacked:
            yield f"{path}/{name}", Path(folder, name)


def _unpacked(path: Path, folder: Path) -> list[str]:
    """Unpack what stays in the folder; the names of what may be a mesh, in order."""
    names, left = list[str](), _MOST_BYTES
    for name, content in _members(path):
        target = PurePosixPath(name.replace("\\", "/"))
        if target.is_absolute() or ".." in target.parts or ":" in name or "\0" in name:
            continue
        if len(names) >= _MOST_FILES:
            raise MeshError(f"{path.name} holds more than {_MOST_FILES} files; unpack what is to be traced")
        file = folder / target
        file.parent.mkdir(parents=True, exist_ok=True)
        with file.open("wb") as out:
            while piece := content.read(min(_PIECE, left + 1)):
                left -= len(piece)
                if left < 0:
                    raise MeshError(f"{path.name} unpacks to more than {_MOST_BYTES >> 30} GiB; unpack it elsewhere")
                out.write(piece)
        names.append(str(target))
    return sorted(name for name in names if PurePosixPath(name).suffix.lower() in _READ)


def _members(path: Path) -> Iterator[tuple[str, IO[bytes]]]:
    """Name and content of each file in an archive."""
    if path.suffix.lower() == ".zip":
        with zipfile.ZipFile(path) as archive:
            for entry in archive.infolist():
                if not entry.is_dir():
                    with archive.open(entry) as file:
                        yield entry.filename, file
        return
    with tarfile.open(path) as tar:
        for member in tar:
            content = tar.extractfile(member) if member.isfile() else None
            if content is not None:
                yield member.name, content
