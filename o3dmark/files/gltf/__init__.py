"""glTF and GLB: the file of a scene comes back with only its positions changed, in their own type and place.

What changes in the text is the least and greatest position that accessors announce. Every other word, chunk and byte
stays: materials, images, skins, animations, morph targets, extras, extensions that nobody here knows.
"""

from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from o3dmark.arrays import AnyArray, Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.files._dressing import dressed
from o3dmark.files.asset import Asset, Moved
from o3dmark.files.gltf.accessors import Accessor, Accessors, Views
from o3dmark.files.gltf.budget import Budget
from o3dmark.files.gltf.buffers import Buffer, Buffers, Edits, file_of
from o3dmark.files.gltf.container import Container
from o3dmark.files.gltf.contents import check_extensions, contents
from o3dmark.files.gltf.json_fields import Fields
from o3dmark.files.gltf.parts import Bodies, Body, Piece, bodies
from o3dmark.files.gltf.scene import placements
from o3dmark.files.references import Source, inside
from o3dmark.mesh.normals import turned

if TYPE_CHECKING:
    from o3dmark.mesh.surface import TriangleMesh

_SCENE = 10, 256 << 20  # bytes of a scene as one mesh: times the file, and beside
_OPEN3D_HAS = {"normals", "texture coordinates", "vertex colours", "materials", "textures"}


class Gltf(Asset):
    """A .gltf or .glb file; which of the two it is, its first bytes say.

    A part is a mesh with all its primitives, or several that draw the same positions. A skinned mesh is one in its bind
    pose, morph targets and instances go with it. Quantised positions move on their grid, to its rim at most. What is
    compressed is compressed again alike (see `_gltf_meshopt`, `_gltf_draco`), or fixed.
    Normals and tangents turn with their surface. They stay as they are where several parts use them, or where their
    bytes are used for something else.
    Errors: MeshError for a damaged file, a missing one beside it, or a required extension that is not known.
    """

    def __init__(self, source: Source) -> None:
        self.source = source
        content = source.read()
        self._container = Container.of(source.name, content)
        self._root = Fields(source.name, self._container.value)
        _check_version(self._root)
        check_extensions(self._root)
        budget = self._budget = Budget(source.name, len(content))
        self._buffers = Buffers(source, self._container, self._root, budget)
        self._views = Views(self._buffers, self._root, budget)
        accessors = Accessors(self._views, self._root, budget)
        places = placements(self._root, accessors, budget)
        self._bodies: Bodies = bodies(self._root, self._views, accessors, places, budget)
        self.parts = tuple(body.part for body in self._bodies.bodies)
        images = [image.text("uri") for image in self._root.parts("images", "image") if "uri" in image]
        self.references = tuple(dict.fromkeys([*self._buffers.files, *filter(None, map(file_of, images))]))
        self.changing = tuple(dict.fromkeys(buffer.file for buffer in self._moving_buffers() if buffer.file))

    @cached_property
    def contents(self) -> frozenset[str]:
        return contents(self._root, self._container.value)

    def with_positions(self, moved: Moved, names: Mapping[str, str] | None = None) -> dict[str, bytes]:
        self.check(moved)
        edits = Edits(ends=self._views.ends())
        for number, vertices in moved.items():
            self._move(edits, self._bodies.bodies[number], vertices)
        edits.put_back()
        for number, vertices in moved.items():
            self._bound(edits, self._bodies.bodies[number], vertices)
        return self._buffers.written(edits, names or {}, self.changing)

    def mesh(self) -> "TriangleMesh":
        """As of any asset, with the textures, colours and normals that Open3D reads in the file, if any."""
        exact = super().mesh()
        return self._dressed(exact) or exact

    def placed(self) -> tuple[Floats, Ints]:
        """As of any asset. Errors: MeshError where the parts stand at so many places that they exhaust memory."""
        rows = [len(part.placements) * (len(part.vertices) + 2 * len(part.triangles)) for part in self.parts]
        if 24 * sum(rows) > _SCENE[0] * self._budget.size + _SCENE[1]:
            raise MeshError(
                f"{self.name}: its {len(self.parts)} meshes stand at {sum(len(part.placements) for part in self.parts)}"
                " places, which is too much for one mesh; save those that are wanted in a file of their own"
            )
        with np.errstate(all="ignore"):  # places may be as far away as numbers go
            return super().placed()

    def _dressed(self, exact: "TriangleMesh") -> "TriangleMesh | None":
        """Open3D's reading, where it has more than positions and follows nothing out of the folder."""
        if not self.contents & _OPEN3D_HAS or self.source.files or not self.path.is_file():
            return None
        try:
            for name in self.references:
                inside(self.path, name)
        except MeshError:
            return None
        return dressed(self.path, exact)

    def _moving_buffers(self) -> Iterable[Buffer]:
        """The buffers that hold positions, normals or tangents that can change."""
        for body in self._bodies.bodies:
            if body.part.fixed:
                continue
            follow = [each for piece in body.pieces for each in self._bodies.following(piece.primitive)]
            for accessor in (*body.blocks, *follow):
                for rows in accessor.all_rows:
                    yield from rows.space.buffers

    def _move(self, edits: Edits, body: Body, vertices: Floats) -> None:
        """Write the positions (n, 3) of a part, and its normals and tangents."""
        if not np.isfinite(vertices).all():
            raise MeshError(f"{self.name}, {body.part.name}: its new positions are not all finite")
        changed = vertices != body.part.vertices
        if not changed.any():
            return
        after = body.part.vertices.copy()
        for block, rows in body.blocks.items():
            if changed[rows].any():
                block.check_holds(vertices[rows][changed[rows].any(axis=-1)])
                raw = np.where(changed[rows], block.nearest(vertices[rows]), block.raw())
                block.write(edits, raw, np.logical_or.reduce(changed[rows].T))
                after[rows] = block.floats(raw)
        self._turn(edits, body, after)

    def _bound(self, edits: Edits, body: Body, vertices: Floats) -> None:
        """Replace what accessors of positions announce as their least and greatest numbers, where it is not true."""
        for block, rows in body.blocks.items():
            if (vertices[rows] == body.part.vertices[rows]).all():
                continue
            columns = np.ascontiguousarray(block.raw(edits).T)
            for number in body.numbers[block]:
                self._announce(edits, ("accessors", number, "min"), columns.min(axis=1))
                self._announce(edits, ("accessors", number, "max"), columns.max(axis=1))

    def _announce(self, edits: Edits, path: tuple[str, int, str], numbers: AnyArray) -> None:
        """Put numbers (3,) at a place of the text, if there are some that are not the same."""
        if self._buffers.span(*path) is None:
            return
        if self._buffers.span(*path, 2) is None or self._buffers.span(*path, 3):  # not three numbers
            edits.words[path] = f"[{', '.join(map(str, numbers))}]"
            return
        for axis, number in enumerate(numbers):
            if not _says(self._buffers.raw(*path, axis), number):
                edits.words[*path, axis] = str(number)

    def _turn(self, edits: Edits, body: Body, after: Floats) -> None:
        """Turn the normals and tangents of a part whose positions have become ``after`` (n, 3).

        Tangents turn as the normals of their vertices do, or on their own where there are none.
        """
        pieces = [piece for piece in body.pieces if self._bodies.following(piece.primitive)]
        if not pieces:
            return
        table = _Table(accessor for piece in pieces for accessor in self._bodies.following(piece.primitive)[:1])
        drawn = dict.fromkeys(
            (piece.triangles.start, piece.triangles.stop, self._shift(piece, table)) for piece in pieces
        )
        triangles = np.concatenate([body.part.triangles[start:stop] for start, stop, _ in drawn])
        if not len(triangles):
            return
        used = np.concatenate([body.part.triangles[start:stop] + shift for start, stop, shift in drawn])
        turns = turned(body.part.vertices, after, triangles, table.vectors, used)
        _write(edits, table.rows, table.vectors, turns(table.vectors))
        for followers in self._followers(pieces, table):
            vectors = np.zeros_like(table.vectors)
            for accessor, rows in followers.items():
                vectors[rows] = _finite_vectors(accessor)
            _write(edits, followers, vectors, turns(vectors))

    def _shift(self, piece: Piece, table: "_Table") -> int:
        """From the rows of a piece's positions to those of its normals in a table."""
        return table.rows[self._bodies.following(piece.primitive)[0]].start - piece.start

    def _followers(self, pieces: Iterable[Piece], table: "_Table") -> list[dict[Accessor, slice]]:
        """The tangents that turn with normals at rows of a table, in turns: one normal may serve several tangents."""
        rounds: list[dict[Accessor, slice]] = []
        placed: set[Accessor] = set()
        for piece in pieces:
            lead, *tangents = self._bodies.following(piece.primitive)
            for accessor in tangents:
                if accessor in placed:
                    continue
                placed.add(accessor)
                rows = table.rows[lead]
                free = next((one for one in rounds if rows not in one.values()), None)
                if free is None:
                    rounds.append(free := {})
                free[accessor] = rows
        return rounds


class _Table:
    """The vectors (k, 3) of several accessors, one below the other, and the rows of each."""

    def __init__(self, accessors: Iterable[Accessor]) -> None:
        self.rows: dict[Accessor, slice] = {}
        count = 0
        for accessor in accessors:
            if accessor not in self.rows:
                self.rows[accessor] = slice(count, count := count + accessor.count)
        self.vectors = np.empty((count, 3))
        for accessor, rows in self.rows.items():
            self.vectors[rows] = _finite_vectors(accessor)


def _finite_vectors(accessor: Accessor) -> Floats:
    """The first three numbers of each row (k, 3); zeros where they are not finite, so that nothing turns them."""
    vectors = accessor.floats()[:, :3]
    vectors[~np.isfinite(vectors).all(axis=1)] = 0.0
    return vectors


def _write(edits: Edits, places: Mapping[Accessor, slice], before: Floats, after: Floats) -> None:
    """Put vectors (k, 3) that have turned where they stand; those that the file cannot tell apart keep their bytes."""
    for accessor, rows in places.items():
        old, new = accessor.nearest(before[rows]), accessor.nearest(_unit_again(accessor, before[rows], after[rows]))
        changed = (old != new).any(axis=1)
        if changed.any():
            raw = accessor.raw().copy()
            raw[:, :3] = np.where(changed[:, None], new, raw[:, :3])
            accessor.write(edits, raw, changed)


def _unit_again(accessor: Accessor, before: Floats, after: Floats) -> Floats:
    """Vectors (k, 3) that have turned on a grid; those that were of unit length but for their rounding are so again.

    Else the errors of two roundings would add up, and a validator complains.
    """
    if accessor.scale == 1.0:
        return after
    lengths = np.linalg.norm(before, axis=1)
    unit = np.abs(lengths - 1.0) <= np.sqrt(3.0) / 2.0 / accessor.scale
    unit &= (before != after).any(axis=1)
    return np.where(unit[:, None], after / np.maximum(lengths, 0.5)[:, None], after)


def _says(words: str, number: np.generic) -> bool:
    """Whether a JSON number is the one that a file holds."""
    try:
        with np.errstate(all="ignore"):
            return bool(number.dtype.type(float(words)) == number)
    except (ValueError, OverflowError):
        return False


def _check_version(root: Fields) -> None:
    """Errors: MeshError for another glTF than 2."""
    if "asset" not in root:
        raise MeshError(f"{root.where} is no glTF 2.0: it has no 'asset'")
    version = root.part("asset").text("version", "")
    if version.partition(".")[0] != "2":
        raise MeshError(f"{root.where} is glTF {version!r}; 2.0 is read. Export it again as glTF 2.0")
