"""USD (.usd, .usda, .usdc, .usdz) through usd-core: only the points of its meshes change.

In text only the numbers that moved are written, in the binary form only their bytes, in a package only that one file;
the result is read again and compared. Where a file keeps numbers in a way that this cannot be done for (two meshes
share the bytes of one array), the library writes the layer anew: the same scene, but other comments and layout.
"""

import importlib.util
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from o3dmark.arrays import Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.files._zip import Archive
from o3dmark.files.asset import STAYS, Asset, Moved, Part, float_steps
from o3dmark.files.references import Source
from o3dmark.files.usd.text import is_text
from o3dmark.mesh.normals import turned

if TYPE_CHECKING:  # usd-core is an extra
    from o3dmark.files.usd.layers import Edits, Vectors
    from o3dmark.files.usd.scene import Mesh

_ALIGN = 64  # bytes that the files of a package begin at multiples of
_LAYER = re.compile(r"\.usd[ac]?$", re.IGNORECASE)


class Usd(Asset):
    """A USD file. A part is an array of points, wherever it is drawn; that of another layer, or one that changes over
    time, is fixed.

    Normals turn with their surface, and extents that were right are made right again.
    Errors: MeshError without usd-core, for a damaged file, and for a layer that is missing or outside of the folder.
    """

    def __init__(self, source: Source) -> None:
        self.source = source
        content = source.read()
        if importlib.util.find_spec("pxr") is None:
            raise MeshError(f"{self.name}: USD files need another package: pip install o3dmark[usd]")
        from o3dmark.files.usd.contents import PICTURE, assets, contents
        from o3dmark.files.usd.layers import relative, unpacked
        from o3dmark.files.usd.scene import meshes

        self._archive = Archive(self.name, content) if content.startswith(b"PK") else None
        self._entry, files = _layers_of(self._archive) if self._archive else (self.name, {self.name: content})
        self._content = files[self._entry]
        beside = self._in_package if self._archive else source.beside
        with unpacked(self._entry, files, beside) as (layer, others):
            self._meshes = meshes(self.name, layer)
            named = assets(layer)
            words = contents(layer, self._meshes, named)
        if is_text(self._content) and re.search(rb"^\s*#(?!usda)", self._content, re.MULTILINE):
            words.add("comments")
        self._contents = frozenset(words)
        if self._archive is None:
            pictures = [relative(self._entry, name) for name in named if PICTURE.search(name) and "<" not in name]
            self.references = tuple(dict.fromkeys([*others, *pictures]))
        self.parts = tuple(_part(mesh) for mesh in self._meshes)

    @property
    def contents(self) -> frozenset[str]:
        return self._contents

    def with_positions(self, moved: Moved, names: Mapping[str, str] | None = None) -> dict[str, bytes]:  # noqa: ARG002
        self.check(moved)
        edits: dict[str, tuple[Vectors, Vectors]] = {}
        for number, vertices in moved.items():
            edits |= _edits(self.name, self._meshes[number], vertices)
        if not edits:
            return {self.name: self.source.read()}
        from o3dmark.files.usd.layers import rewritten

        content = rewritten(self._entry, self._content, edits)
        if self._archive is None:
            return {self.name: content}
        return {self.name: self._archive.replaced({self._entry: lambda: [content]}, _ALIGN)}

    def _in_package(self, name: str) -> bytes:
        raise MeshError(f"{self.name} needs {name!r}, which is not in it")


def _layers_of(archive: Archive) -> tuple[str, dict[str, bytes]]:
    """The first layer of a package, which is its root, and all by name."""
    names = [name for name in archive.names if _LAYER.search(name)]
    if not names:
        raise MeshError(f"{archive.name} holds no USD layer")
    return names[0], {name: bytes(archive.stored(name)) for name in names}


def _part(mesh: "Mesh") -> Part:
    vertices = mesh.points.astype(np.float64)
    places = np.array(mesh.places) if mesh.places else STAYS
    return Part(mesh.name, vertices, mesh.triangles, float_steps(vertices), places, mesh.fixed)


def _edits(name: str, mesh: "Mesh", vertices: Floats) -> "Edits":
    """What changes when a mesh moves: its points, normals and extent."""
    with np.errstate(over="ignore"):
        after = np.where(vertices == mesh.points, mesh.points, vertices.astype(np.float32))
    if not np.isfinite(after).all():
        raise MeshError(f"{name}, {mesh.name}: its new positions are beyond what float32 holds")
    if np.array_equal(after, mesh.points):
        return {}
    edits = {mesh.path: (mesh.points, after)}
    if mesh.normals is not None:
        path, normals, used = mesh.normals
        new = _turned(mesh, after, normals, used)
        edits |= {} if np.array_equal(new, normals, equal_nan=True) else {path: (normals, new)}
    if mesh.extent is not None and len(mesh.extent[1]) == 2:
        path, extent = mesh.extent
        new = np.array([after.min(axis=0), after.max(axis=0)])
        if not np.array_equal(
            extent, [mesh.points.min(axis=0), mesh.points.max(axis=0)]
        ):  # of a pose, or with a margin
            new = np.array([np.minimum(extent[0], new[0]), np.maximum(extent[1], new[1])])
        edits |= {} if np.array_equal(new, extent) else {path: (extent, new)}
    return edits


def _turned(mesh: "Mesh", after: "Vectors", normals: "Vectors", used: Ints) -> "Vectors":
    """Normals (k, 3), those that triangles use turned as their surface turns; in float32, as they are."""
    drawn = np.unique(used)
    before = normals[drawn].astype(np.float64)
    places = np.searchsorted(drawn, used)
    turns = turned(mesh.points.astype(np.float64), after.astype(np.float64), mesh.triangles, before, places)
    vectors = turns(before)
    result = normals.copy()
    result[drawn] = np.where(vectors == before, normals[drawn], vectors.astype(np.float32))
    return result
