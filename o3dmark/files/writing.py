"""Files that appear under their name complete or not at all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from o3dmark.errors import MeshError


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary path of the same name that takes the place of ``path`` when the block ends well, and else is removed.

    Other files that the block writes beside it (materials, textures) come along. Errors: MeshError without the folder.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise MeshError(f"there is no folder {str(path.parent)!r} to write {path.name} in")
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".o3dmark-") as folder:
        draft = Path(folder) / path.name
        yield draft
        for part in sorted(Path(folder).iterdir(), key=lambda part: part == draft):  # the file itself last
            os.replace(part, path.parent / part.name)
