"""What a file refers to: never followed out of the folder that the file is in."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath, PureWindowsPath

from o3dmark.errors import MeshError

_LONGEST = 4096, 255  # of a path, and of each name in it, in bytes: more is no file, and takes long to resolve


@dataclass(frozen=True)
class Source:
    """A file and those beside it; ``files`` stand in, by their names relative to its folder, for what lies there."""

    path: Path
    files: Mapping[str, bytes] = field(default_factory=dict)

    @property
    def name(self) -> str:
        return self.path.name

    def check_there(self) -> None:
        """Errors: MeshError when the file is not there."""
        if self.name not in self.files and not self.path.is_file():
            raise MeshError(f"no file at {str(self.path)!r}")

    def read(self) -> bytes:
        """The file itself. Errors: MeshError when it is not there, or empty."""
        self.check_there()
        content = self.files[self.name] if self.name in self.files else self.path.read_bytes()
        if not content:
            raise MeshError(f"{self.name} is empty")
        return content

    def beside(self, name: str) -> bytes:
        """A file that it cannot be read without. Errors: MeshError as `inside`, and when it is missing."""
        if name in self.files:
            return self.files[name]
        target = inside(self.path, name)
        if not target.is_file():
            raise MeshError(f"{self.name} needs {name!r}, which is not there")
        return target.read_bytes()


def inside(path: Path, name: str) -> Path:
    """The file that ``path`` refers to by a relative name, whether it is there or not.

    Errors: MeshError for a name that leaves the folder of ``path`` (by its root, a drive, "..", a scheme, or a link),
    and for one that no file can have.
    """
    plain = name.replace("\\", "/")
    parts = PurePosixPath(plain).parts
    lengths = [len(part.encode(errors="replace")) for part in parts]
    if sum(lengths) + len(lengths) > _LONGEST[0] or max(lengths, default=0) > _LONGEST[1] or "\0" in plain:
        raise MeshError(f"{path.name} refers to {name[:40]!r}..., which no file can be called")
    leaves = not parts or ".." in parts or plain.startswith("/") or bool(PureWindowsPath(name).drive) or "://" in plain
    try:
        target = path.parent / plain
        leaves = leaves or not target.resolve().is_relative_to(path.parent.resolve())
    except (OSError, ValueError):  # no name that a file can have
        leaves = True
    if leaves:
        raise MeshError(
            f"{path.name} refers to {name!r}, which leaves its folder; this is never followed."
            " Put what it refers to beside it, and let it say so"
        )
    return target
