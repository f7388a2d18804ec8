"""Files that appear under their name complete or not at all, and never in the place of what somebody else put there."""

import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence, Set
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from o3dmark.errors import MeshError, SpecError
from o3dmark.files.asset import Asset
from o3dmark.files.references import Source, inside

_COMPANIONS = {".obj": (".mtl",), ".gltf": (".bin",)}  # what a conversion to these may write beside them


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary path of the same name that takes the place of ``path`` when the block ends well, and else is removed.

    Other files that the block writes beside it (materials, textures) come along; they take the place of others only
    where ``path`` was there before. Errors: MeshError without the folder; SpecError where another file is in the way.
    """
    path = Path(path)
    with _draft_folder(path) as folder:
        draft, was_there = folder / path.name, os.path.lexists(path)
        yield draft
        parts = sorted(folder.iterdir(), key=lambda part: part == draft)  # the file itself last
        for part in parts:
            if part != draft and not was_there and os.path.lexists(path.parent / part.name):
                raise SpecError(f"{path.name} would come with {part.name}, which is there already: choose another name")
        for part in parts:
            os.replace(part, path.parent / part.name)


def check_free(out: Path, *given: Path, overwrite: bool = False) -> None:
    """Whether ``out`` may be written. Errors: SpecError, with a free name, where it is one of ``given``, or exists."""
    if any(_same(out, file) for file in given):
        raise SpecError(f"OUT is a file that was given, and would be lost; {free(out).name} is free")
    if os.path.lexists(out) and not overwrite:
        raise SpecError(f"{out.name} exists, and is left as it is; {free(out).name} is free, or say --overwrite")


@dataclass(frozen=True)
class Destination:
    """Where an asset is to go, decided before anything is computed.

    names: for each file beside it that is made anew, the name it gets; copies: the files beside the original that come
    along as they are; missing: those that it refers to but that are not there; replaced: names of files that may give
    way, because the caller said so.
    """

    path: Path
    names: Mapping[str, str]
    copies: Mapping[str, Path]
    missing: tuple[str, ...] = ()
    replaced: frozenset[str] = frozenset()

    def write(self, files: Mapping[str, bytes]) -> None:
        """Write what `Asset.with_positions` gave, all of it or nothing, the asset itself last.

        Errors: SpecError when a file appeared meanwhile under a name that was free, OSError.
        """
        with _draft_folder(self.path) as folder:
            contents = {**{name: source.read_bytes() for name, source in self.copies.items()}, **files}
            for name, content in contents.items():
                draft = folder / name
                draft.parent.mkdir(parents=True, exist_ok=True)
                draft.write_bytes(content)
            placed: list[Path] = []
            try:
                for name in sorted(contents, key=lambda name: name == self.path.name):
                    target = self.path.parent / name
                    target.parent.mkdir(parents=True, exist_ok=True)
                    _place(folder / name, target, may_replace=name in self.replaced)
                    placed += [target] if name not in self.replaced else []
            except BaseException:
                for target in placed:
                    target.unlink(missing_ok=True)
                raise


def destination(asset: Asset, out: str | Path, *, overwrite: bool = False) -> Destination:
    """Where ``asset`` goes when it is written as ``out``, without touching a file that is there.

    With ``overwrite`` a file at ``out`` gives way, with the files of positions that it refers to; never anything that
    ``asset`` was read from, or refers to. A conversion brings no copies: what it writes holds all that it refers to.
    Errors: SpecError, which names a free path, where a file is in the way; MeshError without the folder, or for a
    reference that leaves the folder of the asset.
    """
    out = Path(out)
    if not out.parent.is_dir():
        raise MeshError(f"there is no folder {str(out.parent)!r} to write {out.name} in")
    beside = {name: inside(asset.path, name) for name in asset.references}
    given = [asset.path, *beside.values()]
    check_free(out, *given, overwrite=overwrite)
    missing = tuple(name for name, source in beside.items() if not source.is_file())
    if out.suffix.lower() != asset.path.suffix.lower():
        for companion in (out.with_suffix(suffix) for suffix in _COMPANIONS.get(out.suffix.lower(), ())):
            check_free(companion, *given)
        return Destination(out, {}, {}, missing, frozenset([out.name] if overwrite else ()))
    same_folder = out.parent.resolve() == asset.path.parent.resolve()
    own = _own_side_files(asset, out, given) if overwrite else frozenset()
    names: dict[str, str] = {}
    for name in asset.changing:
        wanted = inside(out, out.stem + Path(name).suffix if same_folder else name)
        names[name] = free(wanted, {*names.values()}, own).relative_to(out.parent).as_posix()
    copies = {} if same_folder else _copies(asset, out, {name: beside[name] for name in beside if name not in names})
    return Destination(out, names, copies, missing, frozenset({out.name, *own} if overwrite else ()))


def _copies(asset: Asset, out: Path, beside: Mapping[str, Path]) -> dict[str, Path]:
    """What has to be copied beside ``out``: of the files that are there, those that are not there yet."""
    copies = {}
    for name, source in beside.items():
        target = inside(out, name)
        if not source.is_file() or (target.is_file() and target.read_bytes() == source.read_bytes()):
            continue
        if os.path.lexists(target):
            raise SpecError(
                f"{asset.name} refers to {name!r}, but another file of that name lies where it would go;"
                f" an empty folder, like {free(out.with_suffix('')).name}/, would do"
            )
        copies[name] = source
    return copies


def _own_side_files(asset: Asset, out: Path, given: Sequence[Path]) -> frozenset[str]:
    """The files of positions that an asset at ``out``, which is to give way, refers to; but none that was given."""
    try:
        names = type(asset)(Source(out)).changing
    except MeshError:
        return frozenset()
    there = [out.parent / name for name in names]
    kept = [name for name, file in zip(names, there, strict=True) if not any(_same(file, other) for other in given)]
    return frozenset(kept)


def _same(file: Path, other: Path) -> bool:
    return file.exists() and other.exists() and file.samefile(other)


def free(path: Path, taken: Set[str] = frozenset(), own: Set[str] = frozenset()) -> Path:
    """``path`` itself when nothing is there, or else the first of name-1, name-2, ... that is free.

    Names of ``taken`` count as if they were there, those of ``own`` as if they were not.
    """
    number, candidate = 0, path
    while candidate.name in taken or (os.path.lexists(candidate) and candidate.name not in own):
        number += 1
        candidate = path.with_name(f"{path.stem}-{number}{path.suffix}")
    return candidate


def _place(draft: Path, target: Path, *, may_replace: bool) -> None:
    if may_replace:
        os.replace(draft, target)
        return
    try:
        os.link(draft, target)  # unlike a renaming, this never takes the place of a file
    except FileExistsError:
        raise SpecError(f"{target.name} is there by now, and is left as it is") from None
    except OSError:  # a file system without links
        if os.path.lexists(target):
            raise SpecError(f"{target.name} is there by now, and is left as it is") from None
        os.replace(draft, target)


@contextmanager
def _draft_folder(path: Path) -> Iterator[Path]:
    if not path.parent.is_dir():
        raise MeshError(f"there is no folder {str(path.parent)!r} to write {path.name} in")
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".o3dmark-") as folder:
        yield Path(folder)
