"""Which meshes of a glTF are one part, and what of a part can change without changing something else.

A part is a mesh with all its primitives. Meshes that draw the same positions, or positions that share bytes, are one:
what moves for one of them moves for all.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from o3dmark.arrays import Floats
from o3dmark.errors import MeshError
from o3dmark.files.asset import STAYS, Part
from o3dmark.files.gltf.accessors import Accessor, Accessors, Rows, Views
from o3dmark.files.gltf.budget import Budget
from o3dmark.files.gltf.buffers import Buffer, Space
from o3dmark.files.gltf.draco import Streams
from o3dmark.files.gltf.json_fields import Fields
from o3dmark.files.gltf.overlaps import OTHERS, overlaps
from o3dmark.files.gltf.primitives import Primitive, primitive

_POSITION, _NORMAL, _TANGENT = "POSITION", "NORMAL", "TANGENT"
Role = tuple[str, Accessor]


@dataclass(frozen=True)
class Piece:
    """A primitive in its part: its vertices begin at row ``start``, its triangles are a slice of the part's."""

    primitive: Primitive
    start: int
    triangles: slice


@dataclass(frozen=True)
class Body:
    """What a part is made of: the positions at each row, and the primitives that draw them.

    numbers: for each block of positions the accessors of the file that are it.
    """

    part: Part
    blocks: dict[Accessor, slice]
    numbers: dict[Accessor, set[int]]
    pieces: tuple[Piece, ...]


@dataclass(frozen=True)
class Bodies:
    """All parts of a glTF. ``left``: normals and tangents that stay as they are, as others use their bytes."""

    bodies: tuple[Body, ...]
    left: frozenset[Role]

    def following(self, primitive: Primitive) -> list[Accessor]:
        """The normals of a primitive that turn with it, and its tangents, which turn with them or on their own."""
        lead = (_NORMAL, primitive.normals) if primitive.normals else (_TANGENT, primitive.tangents)
        both = dict.fromkeys([lead, (_TANGENT, primitive.tangents)])
        free = [accessor for name, accessor in both if accessor and (name, accessor) not in self.left]
        return [accessor for accessor in free if not accessor.kept] if lead[1] in free else []


def bodies(root: Fields, views: Views, accessors: Accessors, places: dict[int, list[Floats]], budget: Budget) -> Bodies:
    """The parts of a file whose meshes stand at ``places``. Errors: MeshError for a damaged file."""
    meshes = root.parts("meshes", "mesh")
    streams = Streams(views, budget)
    primitives = [
        [
            found
            for number, fields in enumerate(mesh.parts("primitives", "primitive"))
            if (found := primitive(fields, place, number, accessors, streams))
        ]
        for place, mesh in enumerate(meshes)
    ]
    roles = list(_roles(primitives))
    kept = list(dict.fromkeys(rows.space.holds for _, accessor in roles for rows in accessor.all_rows))
    held = [[_bytes(*place) for place in places_of] for places_of in kept]
    owned = [[rows for rows in (accessor.base, accessor.values) if rows] for _, accessor in roles] + held
    others = _other_rows(root, views, accessors, {rows for each in held for rows in each})
    linked, fixed, left = _judged(roles, kept, overlaps(owned, others, budget))
    groups = _groups(primitives, linked)
    names = _names(meshes)
    made = []
    for group in groups:
        here = [stack for mesh in group for stack in places.get(mesh, [])]
        stands = np.concatenate(here) if here else STAYS
        drawn = [found for mesh in group for found in primitives[mesh]]
        made.append(_body(_joined([names[mesh] for mesh in group]), drawn, stands, fixed, budget))
    return Bodies(tuple(made), frozenset(left | _shared_normals(made)))


def _roles(primitives: Iterable[Sequence[Primitive]]) -> dict[Role, int]:
    """What may change, each thing once, and its number."""
    roles: dict[Role, int] = {}
    for drawn in primitives:
        for one in drawn:
            for name, accessor in ((_POSITION, one.positions), (_NORMAL, one.normals), (_TANGENT, one.tangents)):
                if accessor is not None:
                    roles.setdefault((name, accessor), len(roles))
    return roles


def _other_rows(root: Fields, views: Views, accessors: Accessors, held: set[Rows]) -> Iterator[Rows]:
    """All bytes that are used for something that stays: other attributes, indices, images, data of extensions.

    Of an accessor that nobody understands, and of a view without accessors, that is the whole view; of a compressed
    view also where it is kept. One view may be what is ``held``; a second on the same bytes is another use of them.
    """
    movable, other = _uses(root, len(accessors))
    understood = set()
    for number, fields in enumerate(accessors.fields):
        try:
            accessor = accessors[number]
        except MeshError:
            continue
        named = [fields, *(fields.part("sparse").part(name) for name in ("indices", "values") if "sparse" in fields)]
        understood |= {each.whole("bufferView") for each in named if "bufferView" in each}
        if number not in movable or number in other:
            yield from accessor.all_rows
        elif accessor.places:
            yield accessor.places
    for number in range(len(views)):
        try:
            window = views[number]
        except MeshError:
            continue
        taken = [_bytes(*place) for place in window.space.holds]
        if number not in understood:
            taken.append(_bytes(window.space, window.start, window.length))
        for rows in taken:
            if rows in held:
                held.remove(rows)
            else:
                yield rows


def _bytes(space: Space, start: int, length: int) -> Rows:
    return Rows(space, start, length, 1, np.dtype("<u1"), 1)


def _uses(root: Fields, n_accessors: int) -> tuple[set[int], set[int]]:
    """The accessors that are positions, normals or tangents of a primitive, and those that are something else."""
    movable: set[int] = set()
    other: set[int] = set()
    for mesh in root.parts("meshes", "mesh"):
        for fields in mesh.parts("primitives", "primitive"):
            attributes = fields.part("attributes")
            for name in attributes:
                kind = movable if _POSITION in attributes and name in (_POSITION, _NORMAL, _TANGENT) else other
                kind.add(attributes.number_of(name, n_accessors))
            for target in fields.parts("targets", "target"):
                other |= {target.number_of(name, n_accessors) for name in target}
            other |= {fields.number_of("indices", n_accessors)} if "indices" in fields else set()
    for skin in root.parts("skins", "skin"):
        other |= {skin.number_of("inverseBindMatrices", n_accessors)} if "inverseBindMatrices" in skin else set()
    for animation in root.parts("animations", "animation"):
        for sampler in animation.parts("samplers", "sampler"):
            other |= {sampler.number_of(name, n_accessors) for name in ("input", "output")}
    return movable, other


def _judged(
    roles: list[Role], kept: list[tuple[tuple[Buffer, int, int], ...]], collisions: set[tuple[int, int]]
) -> tuple[list[tuple[Accessor, Accessor]], dict[Accessor, str], set[Role]]:
    """Positions that move as one, those that cannot move and why, and what else has to stay.

    The owners that collide are others, one of the roles, or one of the places where spaces are ``kept``, which stand
    for all that is in these spaces.
    """
    n = len(roles)
    spoiled = {kept[owner - n] for owners in collisions for owner in owners if owner >= n}
    pairs = {owners for owners in collisions if max(owners) < n}
    pairs |= {(OTHERS, one) for one, other in collisions if 0 <= one < n <= other}
    pairs |= {
        (OTHERS, place)
        for place, (_, accessor) in enumerate(roles)
        if not spoiled.isdisjoint(rows.space.holds for rows in accessor.all_rows)
    }
    linked: list[tuple[Accessor, Accessor]] = []
    fixed: dict[Accessor, str] = {}
    left: set[Role] = set()
    for one, other in sorted(pairs):
        pair = [roles[number] if number != OTHERS else None for number in (one, other)]
        positions = [role[1] for role in pair if role and role[0] == _POSITION]
        left |= {role for role in pair if role and role[0] != _POSITION}
        if len(positions) == 2:
            linked.append((positions[0], positions[1]))
            if not _alike(*positions):
                fixed |= dict.fromkeys(positions, "its positions share bytes with positions of another form")
        elif positions:
            what = next((f"{role[0]} of a mesh" for role in pair if role and role[0] != _POSITION), "other data")
            fixed[positions[0]] = f"the bytes of its positions are also used for {what}, which would change with them"
    return linked, fixed, left


def _alike(one: Accessor, other: Accessor) -> bool:
    """Whether two accessors see the bytes that they share as the same positions."""
    if one.base is None or other.base is None or one.values or other.values:
        return False
    form = [(each.dtype, each.normalized, each.base and each.base.stride) for each in (one, other)]
    return form[0] == form[1] and (one.base.start - other.base.start) % one.base.stride == 0


def _groups(primitives: list[list[Primitive]], linked: Iterable[tuple[Accessor, Accessor]]) -> list[list[int]]:
    """Meshes with positions, those that belong together in one list, each list and all lists in the file's order."""
    users: dict[Accessor, list[int]] = defaultdict(list)
    for mesh, drawn in enumerate(primitives):
        for one in drawn:
            users[one.positions].append(mesh)
    leader = list(range(len(primitives)))

    def of(mesh: int) -> int:
        while leader[mesh] != mesh:
            leader[mesh] = leader[leader[mesh]]
            mesh = leader[mesh]
        return mesh

    for meshes in [*users.values(), *((users[one][0], users[other][0]) for one, other in linked)]:
        first = min(map(of, meshes))
        for mesh in meshes:
            leader[of(mesh)] = first
    groups: dict[int, list[int]] = defaultdict(list)
    for mesh, drawn in enumerate(primitives):
        if drawn:
            groups[of(mesh)].append(mesh)
    return list(groups.values())


def _names(meshes: Sequence[Fields]) -> list[str]:
    """What to call each mesh: its name where no other has it, or its number and its name."""
    given = [mesh.text("name", "").encode("utf-8", "replace").decode() for mesh in meshes]
    shown = [name if name.isprintable() else ascii(name)[1:-1] for name in given]
    counts: dict[str, int] = defaultdict(int)
    for name in shown:
        counts[name] += 1
    return [
        (name if counts[name] == 1 else f"mesh {number} '{name}'") if name else f"mesh {number}"
        for number, name in enumerate(shown)
    ]


def _joined(names: list[str]) -> str:
    most = 3
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def _body(name: str, drawn: list[Primitive], stands: Floats, fixed: dict[Accessor, str], budget: Budget) -> Body:
    """One part. Errors: MeshError where bytes are missing, or corners are no vertices."""
    blocks: dict[Accessor, slice] = {}
    numbers: dict[Accessor, set[int]] = defaultdict(set)
    count = 0
    for one in drawn:
        numbers[one.positions].add(one.positions.number)
        if one.positions not in blocks:
            blocks[one.positions] = slice(count, count + one.positions.count)
            count += one.positions.count
    vertices, steps = _vertices(blocks, count, budget)
    pieces: list[Piece] = []
    slices: dict[tuple[Accessor, Accessor | None, int], slice] = {}
    triangles = []
    m = 0
    for one in drawn:
        start = blocks[one.positions].start
        if one.drawn not in slices:
            corners = one.triangles(budget)
            triangles.append(corners + start if start else corners)
            slices[one.drawn] = slice(m, m := m + len(corners))
        pieces.append(Piece(one, start, slices[one.drawn]))
    why = next((fixed.get(block) or block.fixed for block in blocks if fixed.get(block) or block.fixed), "")
    finite = np.isfinite(vertices)
    if not why and not finite.all():
        lost = len(vertices) - int(finite.all(axis=1).sum())
        why = f"{lost} of its {len(vertices)} positions are not finite numbers"
    part = Part(name, vertices, triangles[0] if len(triangles) == 1 else np.concatenate(triangles), steps, stands, why)
    return Body(part, blocks, numbers, tuple(pieces))


def _vertices(blocks: dict[Accessor, slice], count: int, budget: Budget) -> tuple[Floats, Floats]:
    """All positions (n, 3) of blocks, and their steps (n, 3) or what broadcasts to it."""
    budget.take(48 * count)
    if len(blocks) == 1:
        only = next(iter(blocks))
        vertices = only.floats()
        return vertices, only.steps(vertices)
    vertices, steps = np.empty((count, 3)), np.empty((count, 3))
    for block, rows in blocks.items():
        vertices[rows] = block.floats()
        steps[rows] = block.steps(vertices[rows])
    return vertices, steps


def _shared_normals(made: Sequence[Body]) -> set[Role]:
    """Normals and tangents that several parts use: they cannot turn with each of them."""
    users: dict[Role, set[int]] = defaultdict(set)
    for number, body in enumerate(made):
        for piece in body.pieces:
            for name, accessor in ((_NORMAL, piece.primitive.normals), (_TANGENT, piece.primitive.tangents)):
                if accessor is not None:
                    users[name, accessor].add(number)
    return {role for role, parts in users.items() if len(parts) > 1}
