"""Marking an asset: each mesh that holds the mark, once, in its own frame; the others are left as they are, and named.

What is returned was read back from the bytes that will be written, numbers rounded as the format rounds them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from o3dmark.arrays import Floats
from o3dmark.coding.keys import Key
from o3dmark.errors import ConversionError, MeshError
from o3dmark.files import Asset, Part, Source, convert, open_asset
from o3dmark.marking.views import views
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import MeshArrays, check_precision, mesh_arrays
from o3dmark.watermark import Watermark

_COARSE = 1 / 4096  # of the diagonal: numbers further apart, 12 bits, are named where a mark cannot be read back


@dataclass(frozen=True)
class Left:
    """A part that was left as it is, and why."""

    part: str
    why: str


@dataclass(frozen=True, eq=False)
class Marked:
    """A marked asset.

    files     what is to be written, by name; none when no part could be read back
    moved     the new positions of the marked parts, by their number
    left      the parts that were left as they are
    dropped   what another format than the asset's does not hold
    """

    asset: Asset
    files: Mapping[str, bytes]
    moved: Mapping[int, Floats]
    left: tuple[Left, ...] = ()
    dropped: tuple[str, ...] = ()

    @property
    def verified(self) -> bool:
        """Whether the message was read from what is to be written."""
        return bool(self.files)

    @property
    def parts(self) -> list[Part]:
        """The parts that were marked."""
        return [self.asset.parts[number] for number in self.moved]

    def pairs(self) -> list[tuple[MeshArrays, MeshArrays]]:
        """For each marked part its mesh before and after."""
        return [
            (mesh_of(self.asset.parts[number]), MeshArrays(vertices, self.asset.parts[number].triangles))
            for number, vertices in self.moved.items()
        ]


def embed(
    asset: Asset,
    watermark: Watermark,
    message: str | ArrayLike,
    key: Key,
    *,
    name: str | None = None,
    names: Mapping[str, str] | None = None,
) -> Marked:
    """Mark every part of an asset that holds ``message``, a text, or raw bits (n,) past the code.

    ``name``: the file to be written; another ending than the asset's is a conversion. ``names``: those of files beside
    it (see `Asset.with_positions`). A part that refuses the mark, or whose written numbers do not tell it, is left.
    Errors: MeshError when every part refuses, with the reason of the largest; SpecError as `Watermark.embed`.
    """
    return Edition(asset, watermark, key, keep=False).copy(message, name=name, names=names)


class Edition:
    """An asset about to be marked, once or in many copies: what does not hang on the message is found out once."""

    def __init__(self, asset: Asset, watermark: Watermark, key: Key, *, keep: bool = True) -> None:
        """``keep`` what the copies share: some 2 kB of memory a vertex, of all parts."""
        self.asset, self.watermark, self.key = asset, watermark, key
        self._keep = keep
        self._prepared: dict[int, Any] = {}

    def copy(
        self, message: str | ArrayLike, *, name: str | None = None, names: Mapping[str, str] | None = None
    ) -> Marked:
        """One marked copy: as `embed`, which has the same arguments and errors."""
        moved, left = self._moved(message)
        checked: set[int] = set()
        while moved:
            files = self.asset.with_positions(moved, names)
            written = open_asset(Source(self.asset.path, files))
            unread = [number for number in moved if not self._reads(written.parts[number], number, message)]
            if not unread:
                return self._named(Marked(self.asset, files, moved, self._left(left)), name, message)
            for number in unread:
                again = None if number in checked else self._moved_otherwise(number, moved[number], message)
                checked.add(number)
                if again is None:
                    del moved[number]
                    left[number] = _unread(self.asset.parts[number])
                else:
                    moved[number] = again
        return Marked(self.asset, {}, {}, self._left(left))

    def _moved(self, message: str | ArrayLike) -> tuple[dict[int, Floats], dict[int, str]]:
        """Where the vertices of the parts go, by number, and why others are left. Errors: MeshError when all are."""
        moved: dict[int, Floats] = {}
        errors: dict[int, MeshError] = {}
        for number in range(len(self.asset.parts)):
            try:
                moved[number] = self._embedded(self._prepare(number), message)
            except MeshError as error:
                errors[number] = error
        if not moved:
            raise _refusal(self.asset, errors)
        return moved, {number: str(error) for number, error in errors.items()}

    def _prepare(self, number: int) -> Any:
        """What marking needs of a part. Errors: MeshError for a part that holds no mark."""
        if number in self._prepared:
            return self._prepared[number]
        part = self.asset.parts[number]
        self.asset.check({number: part.vertices})
        used = part.vertices[geometry.used_vertices(part.triangles)]
        check_precision(part.steps, geometry.diagonal(used) if len(used) else 0.0)
        prepared = self.watermark.prepare(mesh_of(part), self.key)
        if self._keep:
            self._prepared[number] = prepared
        return prepared

    def _embedded(self, mesh: Any, message: str | ArrayLike) -> Floats:
        """The vertices (n, 3) of a mesh, or of what was prepared of it, with the message. Errors: MeshError."""
        if isinstance(message, str):
            return np.array(self.watermark.embed(mesh, message, self.key).vertices)
        return np.array(self.watermark.embed_bits(mesh, message, self.key).vertices)

    def _moved_otherwise(self, number: int, vertices: Floats, message: str | ArrayLike) -> Floats | None:
        """Other vertices for a part that was not read back; None where rounding is to blame, or there are none."""
        part = self.asset.parts[number]
        if self._reads(replace(part, vertices=vertices), number, message):
            return None
        try:
            return self._embedded(mesh_of(part), message)  # what is not prepared is read back before it is returned
        except MeshError:
            return None

    def _reads(self, written: Part, number: int, message: str | ArrayLike) -> bool:
        """Whether a part, as it was written or converted, tells the message."""
        reference = mesh_of(self.asset.parts[number]) if self.watermark.method.informed else None
        extraction = self.watermark.extract_bits(mesh_of(written), self.key, reference=reference)
        if isinstance(message, str):
            return self.watermark.decode(extraction, self.key).message == message
        return bool((extraction.bits == np.asarray(message)).all())

    def _left(self, left: Mapping[int, str]) -> tuple[Left, ...]:
        return tuple(Left(self.asset.parts[number].name, left[number]) for number in sorted(left))

    def _named(self, marked: Marked, name: str | None, message: str | ArrayLike) -> Marked:
        """The files under the name that they get, in the format that it says; if another, read back once more."""
        own = self.asset.name
        suffix = Path(name or own).suffix.lower()
        if suffix == self.asset.path.suffix.lower():
            files = {name or own if each == own else each: content for each, content in marked.files.items()}
            return replace(marked, files=files)
        written = open_asset(Source(self.asset.path, marked.files))
        try:
            done = convert(written, self.asset.path.with_name(str(name)), open_asset)
        except MeshError as error:
            raise ConversionError(f"{error}; as {self.asset.path.suffix} it can be marked all the same") from None
        first = next(iter(marked.moved))
        shapes = (Part("", *mesh_arrays(view.shape)) for view in views(done.asset, self.watermark.method))
        if not any(self._reads(shape, first, message) for shape in shapes):
            why = f"the mark cannot be read back after the conversion to {suffix}"
            return Marked(self.asset, {}, {}, (*marked.left, *(Left(part.name, why) for part in marked.parts)))
        return replace(marked, files=done.files, dropped=done.dropped)


def mesh_of(part: Part) -> MeshArrays:
    """A part as a mesh, in its own frame."""
    return MeshArrays(part.vertices, part.triangles)


def _unread(part: Part) -> str:
    step, diagonal = float(np.max(part.steps, initial=0.0)), geometry.diagonal(part.vertices)
    why = "the mark cannot be read back from what would be written"
    if step < _COARSE * diagonal:
        return why
    return (
        f"{why}: its numbers lie {step:.3g} apart, the mesh measures {diagonal:.3g}. Move it to the origin before it is"
        " stored, or store it in a type that holds more digits"
    )


def _refusal(asset: Asset, errors: Mapping[int, MeshError]) -> MeshError:
    if not errors:
        return MeshError(f"{asset.name} holds no mesh of triangles")
    if len(errors) == 1:
        return next(iter(errors.values()))
    largest = max(errors, key=lambda number: len(asset.parts[number].triangles))
    why = f"none of the {len(errors)} meshes of {asset.name} holds the mark; the largest, {asset.parts[largest].name}"
    return MeshError(f"{why}: {errors[largest]}")
