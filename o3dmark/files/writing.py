"""Files that appear under their name complete or not at all, and never in the place of what somebody else put there."""

import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from o3dmark.errors import MeshError, SpecError
from o3dmark.files.asset import Asset
from o3dmark.files.references import inside


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary path of the same name that takes the place of ``path`` when the block ends well, and else is removed.

    Other files that the block writes beside it (materials, textures) come along. Errors: MeshError without the folder.
    """
    path = Path(path)
    with _draft_folder(path) as folder:
        draft = folder / path.name
        yield draft
        for part in sorted(folder.iterdir(), key=lambda part: part == draft):  # the file itself last
            os.replace(part, path.parent / part.name)


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

    With ``overwrite`` a file at ``out`` gives way, and what only that file refers to and that holds its positions; what
    ``asset`` was read from, or refers to, never does.
    Errors: SpecError, which names a free path, where a file is in the way; MeshError without the folder, or for a
    reference that leaves the folder of the asset.
    """
    out = Path(out)
    if not out.parent.is_dir():
        raise MeshError(f"there is no folder {str(out.parent)!r} to write {out.name} in")
    beside = {name: inside(asset.path, name) for name in asset.references}
    given = [asset.path, *beside.values()]
    if out.exists() and any(file.exists() and out.samefile(file) for file in given):
        what = "IN" if out.samefile(asset.path) else f"a file that {asset.name} refers to"
        raise SpecError(f"OUT is {what}, which would be lost; {free(out).name} is free")
    if os.path.lexists(out) and not overwrite:
        raise SpecError(f"{out.name} exists, and is left as it is; {free(out).name} is free, or say --overwrite")
    replaced = {out.name}
    same_folder = out.parent.resolve() == asset.path.parent.resolve()
    names = {}
    for name in asset.changing:
        wanted = out.parent / (out.stem + Path(name).suffix if same_folder else name)
        names[name] = free(wanted).relative_to(out.parent).as_posix()
    copies = {}
    for name, source in beside.items():
        if same_folder or name in names or not source.is_file():
            continue
        target = out.parent / name
        if not target.exists():
            copies[name] = source
        elif target.read_bytes() != source.read_bytes():
            raise SpecError(
                f"{asset.name} refers to {name!r}, but another file of that name lies where it would go;"
                f" an empty folder like {free(out.parent / out.stem).name}/ would do"
            )
    missing = tuple(name for name, source in beside.items() if not source.is_file())
    return Destination(out, names, copies, missing, frozenset(replaced if overwrite else ()))


def free(path: Path) -> Path:
    """``path`` itself when nothing is there, or else the first of name-1, name-2, ... that is free."""
    number, candidate = 0, path
    while os.path.lexists(candidate):
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
        raise SpecError(f"{target.name} appeared meanwhile, and is left as it is") from None
    except OSError:  # a file system without links
        if os.path.lexists(target):
            raise SpecError(f"{target.name} appeared meanwhile, and is left as it is") from None
        os.replace(draft, target)


@contextmanager
def _draft_folder(path: Path) -> Iterator[Path]:
    if not path.parent.is_dir():
        raise MeshError(f"there is no folder {str(path.parent)!r} to write {path.name} in")
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".o3dmark-") as folder:
        yield Path(folder)
