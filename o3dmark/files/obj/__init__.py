"""OBJ: of somebody's file only the vertices that move change, and the normals that turn; all else stays as it is.

Parsed here: Open3D silently drops polygons and negative indices, reads float32 and writes six digits. Its reading is
taken for its textures, at the file's own positions, where nothing of the file is lost.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from o3dmark.errors import MeshError
from o3dmark.files import _open3d
from o3dmark.files._dressing import dressed
from o3dmark.files.asset import Asset, Moved, Part
from o3dmark.files.obj import mtl
from o3dmark.files.obj.text import ObjText
from o3dmark.files.references import Source, inside
from o3dmark.files.text.polygons import fans, set_colours
from o3dmark.files.text.splicing import moved_rows, spliced, turned_rows
from o3dmark.mesh.normals import turned

if TYPE_CHECKING:
    from o3dmark.mesh.surface import TriangleMesh


class Obj(Asset):
    """An OBJ file: one part, whatever objects, groups and materials it is cut into.

    Errors: MeshError for a file without vertices, or a damaged one.
    """

    def __init__(self, source: Source) -> None:
        self.source = source
        self._content = source.read()
        text = ObjText(source.path, self._content)
        self._places, positions = text.vertices()
        self._normal_places, self._normals = text.normals()
        self._colours = text.colours()
        self._contents = text.kinds()
        libraries = mtl.libraries(source, text.libraries())
        counts, corners = text.faces()
        del text  # what follows takes the memory that this took
        triangles, *used = fans(counts, *corners)
        self._used = used[0] if used else None
        self.parts = (Part(self.path.stem, positions, triangles),)
        textures = mtl.textures(source, libraries)
        self.references = tuple(dict.fromkeys(libraries + textures))
        self._contents |= {"textures"} if textures else set()

    @property
    def contents(self) -> frozenset[str]:
        return self._contents

    def with_positions(self, moved: Moved, names: Mapping[str, str] | None = None) -> dict[str, bytes]:  # noqa: ARG002
        """As of any asset. Digits: as many as the file's longest fraction has, and enough for 1e-8 of the diagonal."""
        self.check(moved)
        content, part = self._content, self.parts[0]
        if 0 in moved:
            edits = [moved_rows(content, self._places, part, moved[0])]
            if self._used is not None:
                turns = turned(part.vertices, moved[0], part.triangles, self._normals, self._used)
                edits.append(turned_rows(content, self._normal_places, self._normals, turns(self._normals)))
            content = spliced(content, *edits)
        return {self.name: content}

    def mesh(self) -> "TriangleMesh":
        """As of any asset; or Open3D's reading, which repeats vertices, if it has textures and loses nothing."""
        exact = super().mesh()
        if "texture coordinates" in self.contents and self._is_all_inside():
            mesh = dressed(self.path, exact)
            if mesh is not None:
                return _without_empty_textures(mesh)
        if self._colours is not None:
            set_colours(exact, self._colours)
        return exact

    def _is_all_inside(self) -> bool:
        """Whether Open3D would read what this was read from, and nothing outside of its folder."""
        try:
            return not self.source.files and all(inside(self.path, name) for name in self.references)
        except MeshError:
            return False


def read(path: Path) -> "TriangleMesh":
    """The mesh in an OBJ file. Errors: as of `Obj`."""
    return Obj(Source(path)).mesh()


def write(path: Path, mesh: "TriangleMesh") -> None:
    """Write an OBJ file, with its materials and textures, as Open3D does, its positions with every digit."""
    _open3d.write(path, mesh)
    lines = path.read_text().splitlines()
    rows = [row for row, line in enumerate(lines) if line.startswith("v ")]
    for row, position in zip(rows, np.asarray(mesh.vertices).tolist(), strict=True):
        lines[row] = " ".join(["v", *map(repr, position), *lines[row].split()[4:]])
    path.write_text("\n".join([*lines, ""]))


def _without_empty_textures(mesh: "TriangleMesh") -> "TriangleMesh":
    """Open3D gives every material of an OBJ file a texture, if only an empty one, and next to such it writes none."""
    import open3d as o3d

    full = [number for number, texture in enumerate(mesh.textures) if not texture.is_empty()]
    used = np.asarray(mesh.triangle_material_ids)
    if full and np.isin(used, full).all():
        mesh.textures = [mesh.textures[number] for number in full]
        mesh.triangle_material_ids = o3d.utility.IntVector(np.searchsorted(full, used).astype(np.int32))
    return mesh
