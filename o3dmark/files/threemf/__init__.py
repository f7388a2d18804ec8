"""3MF: a zip archive with models in XML, as slicers write them; only the x, y and z of its vertices change.

Everything else of the archive stays byte for byte: the other files, and in a model all but the digits of coordinates
that moved. Lattices, and what else refers to vertices by their numbers, move with them.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from graphlib import CycleError, TopologicalSorter
from typing import TypeAlias
from urllib.parse import unquote

import numpy as np

from o3dmark.arrays import Floats
from o3dmark.errors import MeshError
from o3dmark.files._zip import Archive
from o3dmark.files.asset import STAYS, Asset, Moved, Part
from o3dmark.files.references import Source
from o3dmark.files.text.notation import EXACT, Notation
from o3dmark.files.threemf.model import ModelReader, Place, read_model
from o3dmark.files.threemf.xml import PIECE, XmlReader
from o3dmark.mesh import geometry

_MODEL = "3D/3dmodel.model"  # where it is by custom
_MOST_PLACES = 100_000  # of all objects together; components of components multiply
_PACKAGE = re.compile(r"(.*/)?_rels/|3D/Textures?/|\[Content_Types\]\.xml$|.*(\.model|/)$", re.IGNORECASE)

Key: TypeAlias = tuple[str, str]
"""The entry of a model file, and the id of an object in it."""


@dataclass(frozen=True)
class _Mesh:
    """Where a part stands: the entry of its model file, and which of the objects of that file it is."""

    entry: str
    number: int


class ThreeMf(Asset):
    """A 3MF file. Each object that has a mesh is a part, placed wherever the build uses it; else where it is.

    Errors: MeshError for what is damaged, encrypted, unfolds without bounds or contradicts itself.
    """

    def __init__(self, source: Source) -> None:
        self.source = source
        self._archive = Archive(self.name, source.read())
        self._entries = {name.lower(): name for name in self._archive.names}
        self._root = self._entry(_root(self._archive, self._entries) or _MODEL)
        self._models = self._read_models()
        places = self._placements()
        self._meshes, parts = [], []
        for entry, model in self._models.items():
            for number, item in enumerate(model.objects):
                if item.has_mesh:
                    self._meshes.append(_Mesh(entry, number))
                    given = places[entry, item.id]
                    placements = np.array(given) if given else STAYS
                    name = item.name or f"object {item.id}"
                    parts.append(Part(name, item.vertices, item.triangles, placements=placements))
                item.rows, item.corners = bytearray(), bytearray()
        self.parts = tuple(parts)

    @property
    def contents(self) -> frozenset[str]:
        found = set().union(*(model.contents for model in self._models.values()))
        found |= {"several meshes"} if len(self.parts) > 1 else set()
        found |= {"comments"} if any(model.has_comments for model in self._models.values()) else set()
        placed = any(len(part.placements) > 1 or (part.placements != STAYS).any() for part in self.parts)
        nested = any(item.components for model in self._models.values() for item in model.objects)
        found |= {"nodes"} if placed or nested else set()
        beside = any(not _PACKAGE.match(name) for name in self._archive.names)  # thumbnails, settings of a slicer
        return frozenset(found | ({"metadata"} if beside else set()))

    def with_positions(self, moved: Moved, names: Mapping[str, str] | None = None) -> dict[str, bytes]:  # noqa: ARG002
        self.check(moved)
        changed: dict[str, dict[int, int]] = {}  # for an entry: number of the object -> of the part
        for number, vertices in moved.items():
            if not np.array_equal(vertices, self.parts[number].vertices):
                mesh = self._meshes[number]
                changed.setdefault(mesh.entry, {})[mesh.number] = number
        if not changed:
            return {self.name: self._archive.content}
        new = {entry: partial(self._renewed, entry, parts, moved) for entry, parts in changed.items()}
        return {self.name: self._archive.replaced(new)}

    def _renewed(self, entry: str, parts: Mapping[int, int], moved: Moved) -> Iterable[bytes]:
        fraction = b"." + b"0" * self._models[entry].fraction
        diagonals = {part: geometry.diagonal(self.parts[part].vertices) for part in parts.values()}
        notations = {part: Notation.of(fraction, size) if size else EXACT for part, size in diagonals.items()}

        def renew(number: int, first: int, values: Floats) -> tuple[Floats, Notation] | None:
            part = parts.get(number)
            if part is None:
                return None
            return moved[part][first : first + len(values)], notations[part]

        return ModelReader(f"{self.name}, {entry}", renew).renewed(self._archive.pieces(entry, PIECE))

    def _entry(self, target: str) -> str:
        """The name in the archive of what a file of it refers to. Errors: MeshError when it is not there."""
        for name in (target, unquote(target)):
            found = self._entries.get(name.lstrip("/").lower())
            if found is not None:
                return found
        raise MeshError(f"{self.name} holds no {target!r}, which it needs")

    def _read_models(self) -> dict[str, ModelReader]:
        """The root model and those that it refers to, in the order in which they are met."""
        models: dict[str, ModelReader] = {}
        waiting = [self._root]
        while waiting:
            entry = waiting.pop(0)
            if entry not in models:
                models[entry] = model = read_model(self.path, entry, self._archive.pieces(entry, PIECE))
                components = (place for item in model.objects for place in item.components)
                waiting += {self._entry(path): None for path, _, _ in [*components, *model.items] if path}
        return models

    def _placements(self) -> dict[Key, list[Floats]]:
        """Where each object stands (4, 4), as often as the build and its components use it.

        Errors: MeshError for objects that are part of themselves, are not there, or are used without measure.
        """
        uses = {
            (entry, item.id): [self._use(entry, place) for place in item.components]
            for entry, model in self._models.items()
            for item in model.objects
        }
        users: dict[Key, set[Key]] = {key: set() for key in uses}
        build = [self._use(self._root, place) for place in self._models[self._root].items]
        for user, used in [*uses.items(), (None, build)]:
            for key, _ in used:
                if key not in uses:
                    raise MeshError(f"{self.name} uses object {key[1]} of {key[0]}, which is not there")
                users[key] |= {user} if user else set()
        try:
            order = list(TopologicalSorter(users).static_order())
        except CycleError:
            raise MeshError(f"{self.name} is damaged: an object of it is part of itself") from None
        places: dict[Key, list[Floats]] = {key: [] for key in uses}
        for key, place in build:
            places[key].append(place)
        count = len(build)
        for user in order:
            for key, place in uses[user]:
                count += len(places[user])
                if count > _MOST_PLACES:
                    raise MeshError(f"{self.name} places its objects more than {_MOST_PLACES} times")
                places[key] += [outer @ place for outer in places[user]]
        return places

    def _use(self, entry: str, place: Place) -> tuple[Key, Floats]:
        path, number, transform = place
        return (self._entry(path) if path else entry, number), transform


class _Relationships(XmlReader):
    """Finds what a package says is its model."""

    def __init__(self, title: str) -> None:
        super().__init__(title)
        self.model = ""

    def start(self, name: str, attributes: dict[str, str]) -> None:  # noqa: ARG002
        if attributes.get("Type", "").endswith("/3dmodel") and not self.model:
            self.model = attributes.get("Target", "")


def _root(archive: Archive, entries: Mapping[str, str]) -> str:
    """The model file that the archive names, or "". Errors: MeshError when the place for it is damaged."""
    entry = entries.get("_rels/.rels")
    if entry is None:
        return ""
    relationships = _Relationships(f"{archive.name}, {entry}")
    for _ in relationships.read(archive.pieces(entry, PIECE)):
        pass
    return relationships.model
