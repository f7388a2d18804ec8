"""STL: binary, or text of one or several solids; triangles that share no corners, each with a normal."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from o3dmark.arrays import Floats
from o3dmark.errors import MeshError
from o3dmark.files._changes import differs
from o3dmark.files.asset import Asset, Moved, Part
from o3dmark.files.references import Source
from o3dmark.files.stl.binary import BinaryFacets, fits
from o3dmark.files.stl.text import TextFacets, is_text
from o3dmark.mesh import geometry
from o3dmark.mesh.normals import Turns
from o3dmark.mesh.surface import triangle_mesh

if TYPE_CHECKING:
    from o3dmark.mesh.surface import TriangleMesh

_CHUNK = 1 << 13  # facets whose numbers stay in a processor's cache: twice as fast as all at once


class Stl(Asset):
    """An STL file. All solids are one part, and each facet has three vertices of its own, in the order of the file."""

    def __init__(self, source: Source) -> None:
        self.source = source
        content = source.read()
        text = is_text(content) and not fits(content)  # a binary file may begin with "solid" too
        self._facets = TextFacets(self.path, content) if text else BinaryFacets(self.name, content)
        self._content = content
        corners = self._facets.corners
        self.parts = ()
        if len(corners):
            triangles = np.arange(len(corners)).reshape(-1, 3)
            self.parts = (Part(self.path.stem, corners, triangles, self._facets.steps),)

    @property
    def contents(self) -> frozenset[str]:
        return self._facets.contents

    def with_positions(self, moved: Moved, names: Mapping[str, str] | None = None) -> dict[str, bytes]:
        del names  # no other file holds positions
        self.check(moved)
        if not moved:
            return {self.name: self._content}
        corners = self._facets.rounded(moved[0])
        if (lost := ~np.isfinite(corners) & differs(corners, self._facets.corners)).any():
            raise MeshError(f"{self.name}: a vertex cannot be at {moved[0][lost][0]:g}, which STL cannot hold")
        normals = _turned(self._facets.normals, self._facets.corners, corners)
        return {self.name: self._facets.written(normals, corners)}

    def mesh(self) -> "TriangleMesh":
        """The facets, in which corners at one place are one vertex if their normals are equal, as Open3D reads them."""
        import open3d as o3d

        if not self.parts:
            return o3d.geometry.TriangleMesh()
        normals = np.repeat(self._facets.normals, 3, axis=0)
        kept, vertex = geometry.weld(np.concatenate([self._facets.corners, normals], axis=1))
        mesh = triangle_mesh(self._facets.corners[kept], vertex.reshape(-1, 3))
        if normals.any():
            mesh.vertex_normals = o3d.utility.Vector3dVector(normals[kept])
        return mesh


def _turned(normals: Floats, before: Floats, after: Floats) -> Floats:
    """Normals (m, 3) when corners (3 m, 3) go from ``before`` to ``after``: each turns with its own facet, or stays."""
    result = normals.copy()
    for first in range(0, len(normals), _CHUNK):
        chunk = slice(first, first + _CHUNK)
        corners = [positions[3 * first : 3 * chunk.stop] for positions in (before, after)]
        moves = np.einsum("fk->f", differs(*corners).reshape(-1, 9).view(np.uint8)) > 0  # any() takes five times longer
        square = np.einsum("fk,fk->f", normals[chunk], normals[chunk])
        moves &= (square > 0.0) & (square < np.inf)
        which = np.flatnonzero(moves)
        facets = 3 * which[:, None] + np.arange(3)
        with np.errstate(all="ignore"):  # of numbers that are not finite, or too large to multiply
            start, end = (geometry.unit(geometry.area_vectors(positions, facets)) for positions in corners)
            turned = Turns(start, end)(normals[chunk][which])
            known = np.isfinite(np.einsum("fk,fk->f", turned, turned))
        result[first + which[known]] = turned[known]
    return result
