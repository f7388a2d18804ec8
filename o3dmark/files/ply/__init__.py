"""PLY: text or binary of either byte order, with whatever elements and properties it has."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from o3dmark.arrays import Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.files.asset import Asset, Moved, Part
from o3dmark.files.ply.columns import Columns
from o3dmark.files.ply.faces import polygons, strips
from o3dmark.files.ply.header import Header
from o3dmark.files.ply.rows import Body, Rows
from o3dmark.files.references import Source
from o3dmark.files.text.numbers import words
from o3dmark.files.text.polygons import set_colours
from o3dmark.files.text.splicing import spliced
from o3dmark.mesh.normals import turned
from o3dmark.mesh.surface import triangle_mesh

if TYPE_CHECKING:
    from o3dmark.mesh.surface import PointCloud, TriangleMesh

_POSITION, _NORMAL = ("x", "y", "z"), ("nx", "ny", "nz")
_CORNERS = ("vertex_indices", "vertex_index")
_COLOURS = (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"))
_FULL = {"u1": 255.0, "u2": 65535.0, "f4": 1.0, "f8": 1.0}  # the number of full colour
_WORDS = {  # what properties of vertices and faces are; all others are called by their names
    **dict.fromkeys((*_POSITION, *_CORNERS), ""),
    **dict.fromkeys(_NORMAL, "normals"),
    **dict.fromkeys((*_COLOURS[0], *_COLOURS[1], "alpha", "diffuse_alpha"), "colours"),
    **dict.fromkeys(("s", "t", "u", "v", "texture_s", "texture_t", "texture_u", "texture_v"), "texture coordinates"),
    **dict.fromkeys(("texcoord", "texnumber"), "texture coordinates"),
}
_TEXTURE = "TextureFile "  # what a comment begins with that names one


class Ply(Asset):
    """A PLY file. Without faces it is a point cloud, and has no part."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self._content = source.read()
        self._header = Header.of(self.name, self._content)
        self._body = Body.of(source.path, self._header, self._content)
        rows, self._left = _rows(self._body, self._header)
        vertex = rows.get("vertex")
        self._vertex = vertex if vertex is not None and vertex.element.count else None
        self._position = self._columns(_POSITION)
        self._normal = self._columns(_NORMAL)
        if self._vertex is not None and self._position is None:
            raise MeshError(f"{self.name}: its vertices have no numbers {', '.join(_POSITION)}")
        self._triangles, self._most_corners = self._connected(rows)
        self.references = tuple(
            dict.fromkeys(name for c in self._header.comments if (name := c.removeprefix(_TEXTURE).strip()) != c)
        )
        self.parts = ()
        if self.counts[1] and self._position is not None:
            self.parts = (Part(self.path.stem, self._position.values, self._triangles, self._position.steps),)

    @property
    def counts(self) -> tuple[int, int]:
        """(vertices, faces or strips) as the header says."""
        announced = dict.fromkeys(("vertex", "face", "tristrips"), 0)
        for element in reversed(self._header.elements):  # of several of a name the first
            announced[element.name] = element.count
        return announced["vertex"], announced["face"] + announced["tristrips"]

    @property
    def contents(self) -> frozenset[str]:
        found = {f"element {e.name}" for e in self._header.elements if e.name not in ("vertex", "face", "tristrips")}
        for element in self._header.elements:
            if element.name in ("vertex", "face"):
                found |= {_word(element.name, p.name) for p in element.properties} - {""}
        if self._most_corners > 3:
            found.add("polygons")
        if self.references:
            found.add("textures")
        if len(self._header.comments) > len([c for c in self._header.comments if c.startswith(_TEXTURE)]):
            found.add("comments")
        if not self.parts and self._vertex is not None:
            found.add("points")
        return frozenset(found)

    def with_positions(self, moved: Moved, names: Mapping[str, str] | None = None) -> dict[str, bytes]:
        del names  # no other file holds positions
        self.check(moved)
        if not moved or self._position is None:
            return {self.name: self._content}
        position = self._position.rounded(moved[0])
        changes = [(self._position, position)]
        if self._normal is not None and self._normal.signed:
            changes.append((self._normal, self._normal.rounded(self._turned(position), clipped=True)))
        return {self.name: self._bytes(changes) if self._header.order else self._text(changes)}

    def mesh(self) -> "TriangleMesh":
        """The mesh, or without faces just its vertices, with colours and normals of the vertices."""
        import open3d as o3d

        if self._position is None:
            return o3d.geometry.TriangleMesh()
        mesh = triangle_mesh(self._position.values, self._triangles)
        if (colours := self._colours()) is not None:
            set_colours(mesh, colours)
        if self._normal is not None:
            mesh.vertex_normals = o3d.utility.Vector3dVector(self._normal.values.copy())
        return mesh

    def points(self) -> "PointCloud":
        """The vertices, with their colours and normals, whether or not there are faces."""
        import open3d as o3d

        cloud, mesh = o3d.geometry.PointCloud(), self.mesh()
        cloud.points, cloud.colors, cloud.normals = mesh.vertices, mesh.vertex_colors, mesh.vertex_normals
        return cloud

    def _colours(self) -> Floats | None:
        """Colours of the vertices (n, 3) in 0 .. 1, if they have any."""
        for names in _COLOURS:
            if (colours := self._columns(names)) is not None:
                return colours.values / [_FULL.get(kind, 255.0) for kind in colours.kinds]
        return None

    def _columns(self, names: tuple[str, ...]) -> Columns | None:
        return None if self._vertex is None else Columns.find(self._vertex, names)

    def _connected(self, rows: Mapping[str, Rows]) -> tuple[Ints, int]:
        """Triangles of faces and strips (m, 3), and the most corners that a face has."""
        n_vertices = 0 if self._vertex is None else self._vertex.element.count
        faces, most = [np.empty((0, 3), np.int64)], 3
        for name in ("face", "tristrips"):
            corners = rows[name].element.find(*_CORNERS, lists=True) if name in rows else None
            if corners is None or not rows[name].element.count:
                continue
            if name == "face":
                triangles, (fewest, most) = polygons(rows[name], corners, n_vertices)
                if not fewest or (fewest < 3 and self._left):  # whatever stands there was read as a length
                    raise MeshError(
                        f"{self.name} is truncated or damaged: it announces {n_vertices} vertices and"
                        f" {rows[name].element.count} faces, but read so some faces have {fewest} corners"
                    )
            else:
                triangles = strips(rows[name], corners, n_vertices)
            faces.append(triangles)
        return faces[-1] if len(faces) < 3 else np.concatenate(faces), most

    def _turned(self, after: Floats) -> Floats:
        """The normals (n, 3) when the vertices are at ``after``; those that are no direction stay."""
        assert self._position is not None
        assert self._normal is not None
        normals = self._normal.values
        return turned(self._position.values, after, self._triangles, normals)(normals)

    def _bytes(self, changes: list[tuple[Columns, Floats]]) -> bytes:
        assert self._vertex is not None
        rows = self._vertex.copied()
        for columns, values in changes:
            columns.put(rows, values)
        content, head = memoryview(self._content), self._header.size
        return b"".join((content[: head + self._vertex.start], rows.body.data.data, content[head + self._vertex.end :]))

    def _text(self, changes: list[tuple[Columns, Floats]]) -> bytes:
        head, text = self._content[: self._header.size], self._content[self._header.size :]
        places = words(text)
        edits = [edit for columns, values in changes for edit in columns.edits(values, text, places)]
        return head + spliced(text, *edits)


def _rows(body: Body, header: Header) -> tuple[dict[str, Rows], int]:
    """The rows of each element, of several of a name the first; and how many bytes or words the last one leaves."""
    rows, end = dict[str, Rows](), 0
    for element in header.elements:
        placed = Rows.of(body, element, end)
        rows.setdefault(element.name, placed)
        end = placed.end
    return rows, len(body.data) - end


def _word(element: str, name: str) -> str:
    word = _WORDS.get(name, f"property {name}")
    return word if word != "colours" else f"{element} colours"
