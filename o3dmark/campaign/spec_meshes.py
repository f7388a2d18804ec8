"""The meshes that a campaign's TOML file names: in [meshes], in [real], and by patterns in ``files``."""

import hashlib
from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from o3dmark.campaign.plan import Source
from o3dmark.campaign.spec_values import Table, checked_spec, none_of
from o3dmark.errors import SpecError
from o3dmark.files import FORMATS
from o3dmark.synthetic import SHAPES


class Wanted(NamedTuple):
    """A mesh as the file names it, under a key; ``spec`` is a shape or a path in ``folder``."""

    key: str
    name: str
    spec: Any
    folder: Path

    def source(self) -> Source:
        """Where it comes from, looked at. Errors: SpecError for a shape or a file that is not there."""
        if not isinstance(self.spec, str) or Path(self.spec).suffix.lower() not in FORMATS:
            return Source(self.name, checked_spec(SHAPES, self.key, self.spec))
        path = self.folder / self.spec
        try:
            return Source(self.name, str(path.resolve()), hashlib.sha256(path.read_bytes()).hexdigest())
        except OSError as error:
            raise SpecError(f"{self.key}: cannot read {self.spec!r}: {error.strerror}") from None


def wanted_meshes(content: Table, folder: Path, real: Path | None) -> dict[str, Wanted]:
    """All meshes by name; ``real`` is the folder of real meshes. Errors: SpecError for a mesh that needs one."""
    found = {name: Wanted(key, name, spec, folder) for key, name, spec in content.table("meshes").items()}
    found |= {name: Wanted("files", name, path, folder) for name, path in _globbed(content, real or folder, found)}
    for key, name, file in content.table("real").items():
        if real is not None:
            found[name] = Wanted(key, name, file, real)
        elif name not in found:
            raise SpecError(f"{key}: this campaign needs the folder of its real meshes: --meshes FOLDER")
    return found


def chosen(meshes: dict[str, Wanted], only: Collection[str]) -> tuple[Source, ...]:
    """Those of ``only``, in any case; all where that is empty. Errors: SpecError for a name that none has."""
    by_name = {name.casefold(): name for name in meshes}
    for name in only:
        if name.casefold() not in by_name:
            raise SpecError(none_of("--only", name, meshes))
    names = {by_name[name.casefold()] for name in only} or set(meshes)
    return tuple(wanted.source() for name, wanted in meshes.items() if name in names)


def _globbed(content: Table, folder: Path, taken: Collection[str]) -> Iterator[tuple[str, str]]:
    """(name, path) of each mesh file that a pattern matches, the smallest first.

    It is called by its name without ending; with it, or with its folder too, where another would be called so.
    """
    paths = {path.resolve(): None for pattern in content.texts("files") for path in _matching(folder, pattern)}
    found = sorted(paths, key=lambda path: (path.stat().st_size, path.name))
    choices = [(path.stem, path.name, f"{path.parent.name}/{path.name}") for path in found]
    counts = [Counter(names) for names in zip(*choices, strict=True)]
    for path, names in zip(found, choices, strict=True):
        free = [name for count, name in zip(counts, names, strict=True) if count[name] == 1 and name not in taken]
        yield (free or names[-1:])[0], str(path)


def _matching(folder: Path, pattern: str) -> list[Path]:
    try:
        found = [path for path in folder.glob(pattern) if path.suffix.lower() in FORMATS and path.is_file()]
    except (NotImplementedError, ValueError, IndexError):
        found = []
    if not found:
        raise SpecError(
            f"files: no mesh file ({', '.join(FORMATS)}) matches {pattern!r}; a pattern is relative to --meshes FOLDER,"
            " or to the TOML file where none is given"
        )
    return found
