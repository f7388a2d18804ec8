"""STL: binary, or text of one or several solids; triangles that share no corners, each with a normal."""

from collections.abc import Mapping

import numpy as np
import open3d as o3d

from o3dmark.arrays import Floats
from o3dmark.errors import MeshError
from o3dmark.files._changes import differs
from o3dmark.files._stl_binary import BinaryFacets, fits
from o3dmark.files._stl_text import TextFacets, is_text
from o3dmark.files.asset import Asset, Moved, Part
from o3dmark.files.references import Source
from o3dmark.mesh import geometry
from o3dmark.mesh.normals import Turns
from o3dmark.mesh.surface import TriangleMesh, triangle_mesh


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
        return {self.name: self._facets.written(self._turned(corners), corners)}

    def mesh(self) -> TriangleMesh:
        """The facets, in which corners at one place are one vertex if their normals are equal, as Open3D reads them."""
        if not self.parts:
            return TriangleMesh()
        normals = np.repeat(self._facets.normals, 3, axis=0)
        kept, vertex = geometry.weld(np.concatenate([self._facets.corners, normals], axis=1))
        mesh = triangle_mesh(self._facets.corners[kept], vertex.reshape(-1, 3))
        if normals.any():
            mesh.vertex_normals = o3d.utility.Vector3dVector(normals[kept])
        return mesh

    def _turned(self, after: Floats) -> Floats:
        """The normals (m, 3) when the corners are at ``after``: each turns with its own facet."""
        normals, before = self._facets.normals, self._facets.corners
        moves = differs(after, before).reshape(-1, 9).any(axis=1)
        moves &= np.isfinite(normals).all(axis=1) & normals.any(axis=1)
        which = np.flatnonzero(moves)
        with np.errstate(all="ignore"):  # of numbers that are not finite, or too large to multiply
            start, end = (
                geometry.unit(geometry.area_vectors(positions, self.parts[0].triangles[which]))
                for positions in (before, after)
            )
            turned = Turns(start, end)(normals[which])
        known = np.isfinite(turned).all(axis=1)
        result = normals.copy()
        result[which[known]] = turned[known]
        return result
