"""OFF: of somebody's file only the vertices that move change, and the normals that turn; all else stays as it is.

Parsed here: Open3D takes files of one layout only, and writes six digits.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from o3dmark.files import _open3d
from o3dmark.files.asset import Asset, Moved, Part
from o3dmark.files.off import text
from o3dmark.files.references import Source
from o3dmark.files.text.polygons import fans, set_colours
from o3dmark.files.text.splicing import moved_rows, spliced, turned_rows
from o3dmark.mesh.normals import turned

if TYPE_CHECKING:
    from o3dmark.mesh.surface import TriangleMesh


class Off(Asset):
    """An OFF file, whose vertices may have normals, colours and texture coordinates, and its faces colours.

    Errors: MeshError for another kind of file, or a damaged one.
    """

    def __init__(self, source: Source) -> None:
        self.source = source
        self._content = source.read()
        self._text = text.parsed(source.path, self._content)
        (triangles,) = fans(self._text.counts, self._text.corners)
        self.parts = (Part(self.path.stem, self._text.positions, triangles),)

    @property
    def contents(self) -> frozenset[str]:
        return self._text.kinds

    def with_positions(self, moved: Moved, names: Mapping[str, str] | None = None) -> dict[str, bytes]:  # noqa: ARG002
        """As of any asset. Digits: as many as the file's longest fraction has, and enough for 1e-8 of the diagonal."""
        self.check(moved)
        content, part, text = self._content, self.parts[0], self._text
        if 0 in moved:
            edits = [moved_rows(content, text.places, part, moved[0])]
            if text.normals is not None:
                turns = turned(part.vertices, moved[0], part.triangles, text.normals)
                edits.append(turned_rows(content, text.normal_places, text.normals, turns(text.normals)))
            content = spliced(content, *edits)
        return {self.name: content}

    def mesh(self) -> "TriangleMesh":
        """As of any asset, with normals and colours: these in 0 .. 1 or, if any is larger, in 0 .. 255."""
        import open3d as o3d

        mesh, text = super().mesh(), self._text
        if text.normals is not None:
            mesh.vertex_normals = o3d.utility.Vector3dVector(text.normals)
        if text.colours is not None:
            set_colours(mesh, text.colours / (255.0 if text.colours.max(initial=0.0) > 1.0 else 1.0))
        return mesh


def read(path: Path) -> "TriangleMesh":
    """The mesh in an OFF file. Errors: as of `Off`."""
    return Off(Source(path)).mesh()


def write(path: Path, mesh: "TriangleMesh") -> None:
    """Write an OFF file as Open3D does, its positions with every digit."""
    _open3d.write(path, mesh)
    lines = path.read_text().splitlines()
    for row, position in enumerate(np.asarray(mesh.vertices).tolist(), start=2):
        lines[row] = " ".join([*map(repr, position), *lines[row].split()[3:]])
    path.write_text("\n".join([*lines, ""]))
