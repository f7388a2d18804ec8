"""Marking an asset: each mesh that holds the mark, once, in its own frame; the others are left as they are, and named.

What is returned was read back from the bytes that will be written, numbers rounded as the format rounds them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from o3dmark.arrays import Floats
from o3dmark.coding.keys import Key
from o3dmark.errors import MeshError
from o3dmark.files import Asset, Part, Source, convert, open_asset
from o3dmark.marking.views import views
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import TriangleMesh, check_precision, mesh_arrays, triangle_mesh
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

    def pairs(self) -> list[tuple[TriangleMesh, TriangleMesh]]:
        """For each marked part its mesh before and after."""
        return [
            (mesh_of(self.asset.parts[number]), triangle_mesh(vertices, self.asset.parts[number].triangles))
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
    mark = _Mark(watermark, message, key)
    moved: dict[int, Floats] = {}
    left: dict[int, str] = {}
    errors: dict[int, MeshError] = {}
    for number in range(len(asset.parts)):
        try:
            moved[number] = mark.positions(asset, number)
        except MeshError as error:
            errors[number], left[number] = error, str(error)
    if not moved:
        raise _refusal(asset, errors)
    while moved:
        files = asset.with_positions(moved, names)
        written = open_asset(Source(asset.path, files))
        unread = [number for number in moved if not mark.reads(written.parts[number], asset.parts[number])]
        if not unread:
            named = tuple(Left(asset.parts[number].name, left[number]) for number in sorted(left))
            return _named(Marked(asset, files, moved, named), name or asset.name, mark)
        for number in unread:
            left[number] = _unread(asset.parts[number])
            del moved[number]
    return Marked(asset, {}, {}, tuple(Left(asset.parts[number].name, left[number]) for number in sorted(left)))


def mesh_of(part: Part) -> TriangleMesh:
    """A part as an Open3D mesh, in its own frame."""
    return triangle_mesh(part.vertices, part.triangles)


@dataclass(frozen=True)
class _Mark:
    watermark: Watermark
    message: str | ArrayLike
    key: Key

    def positions(self, asset: Asset, number: int) -> Floats:
        """Where the vertices of a part go. Errors: MeshError for a part that holds no mark."""
        part = asset.parts[number]
        asset.check({number: part.vertices})
        used = part.vertices[geometry.used_vertices(part.triangles)]
        check_precision(part.steps, geometry.diagonal(used) if len(used) else 0.0)
        if isinstance(self.message, str):
            return np.array(self.watermark.embed(mesh_of(part), self.message, self.key).vertices)
        return np.array(self.watermark.embed_bits(mesh_of(part), self.message, self.key).vertices)

    def reads(self, written: Part, cover: Part) -> bool:
        """Whether a written part tells the message."""
        reference = mesh_of(cover) if self.watermark.method.informed else None
        extraction = self.watermark.extract_bits(mesh_of(written), self.key, reference=reference)
        if isinstance(self.message, str):
            return self.watermark.decode(extraction, self.key).message == self.message
        return bool((extraction.bits == np.asarray(self.message)).all())


def _unread(part: Part) -> str:
    step, diagonal = float(np.max(part.steps, initial=0.0)), geometry.diagonal(part.vertices)
    why = "the mark cannot be read back from what would be written"
    if step < _COARSE * diagonal:
        return why
    return (
        f"{why}: its numbers lie {step:.3g} apart, the mesh measures {diagonal:.3g}. Move it to the origin before it is"
        " stored, or store it in a type that holds more digits"
    )


def _named(marked: Marked, name: str, mark: _Mark) -> Marked:
    """The files under the name that they get, in the format that it says; read back once more where it is another."""
    asset = marked.asset
    suffix = Path(name).suffix.lower()
    if suffix == asset.path.suffix.lower():
        files = {name if each == asset.name else each: content for each, content in marked.files.items()}
        return replace(marked, files=files)
    written = open_asset(Source(asset.path, marked.files))
    done = convert(written, asset.path.with_name(name), open_asset)
    if not any(mark.reads(Part("", *mesh_arrays(view.shape)), marked.parts[0]) for view in views(done.asset)):
        why = f"the mark cannot be read back after the conversion to {suffix}"
        return Marked(asset, {}, {}, (*marked.left, *(Left(part.name, why) for part in marked.parts)))
    return replace(marked, files=done.files, dropped=done.dropped)


def _refusal(asset: Asset, errors: Mapping[int, MeshError]) -> MeshError:
    if not errors:
        return MeshError(f"{asset.name} holds no mesh of triangles")
    if len(errors) == 1:
        return next(iter(errors.values()))
    largest = max(errors, key=lambda number: len(asset.parts[number].triangles))
    why = f"none of the {len(errors)} meshes of {asset.name} holds the mark; the largest, {asset.parts[largest].name}"
    return MeshError(f"{why}: {errors[largest]}")
