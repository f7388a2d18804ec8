"""An asset: somebody's file of meshes, which can be written again with nothing but its positions changed.

    asset = open_asset("bust.glb")                     # -> Asset; nothing is written
    asset.parts[0].vertices, asset.parts[0].triangles  # what the mathematics works on
    asset.with_positions({0: moved})                   # -> {"bust.glb": bytes}

A format is a file of this room and a subclass. It keeps the bytes that it was read from, and puts new numbers where
the old ones stand, in their own type, byte order and place.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from o3dmark.arrays import Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.files.references import Source
from o3dmark.mesh.surface import float_steps, triangle_mesh

if TYPE_CHECKING:
    from o3dmark.mesh.surface import TriangleMesh

Moved: TypeAlias = Mapping[int, Floats]
"""For the number of a part its new vertices (n, 3), in the order of `Part.vertices`."""

STAYS = np.eye(4)[None]
STAYS.setflags(write=False)

# What a file may hold beside positions and triangles, in the words that users read when a conversion drops it. A format
# names what is its own in the same manner: "property quality", "extension KHR_materials_ior".
KINDS = (
    "polygons",  # faces of more than three corners
    "lines",
    "points",  # drawn as such; vertices that no triangle uses are none
    "normals",
    "tangents",
    "texture coordinates",
    "second texture coordinates",
    "vertex colours",
    "face colours",
    "materials",
    "textures",
    "names",  # of objects, meshes, solids
    "groups",
    "several meshes",
    "nodes",  # transforms other than none, or a hierarchy
    "skins",
    "animations",
    "morph targets",
    "cameras",
    "lights",
    "metadata",  # copyright, extras, title, units
    "comments",
)


@dataclass(frozen=True, eq=False)
class Part:
    """One mesh of a file, in its own frame; its name is the file's own where that is one mesh, without the ending.

    vertices (n, 3) float64 and triangles (m, 3) int64 (polygons as fans), read-only. ``steps`` (n, 3), or what
    broadcasts to it: how far apart the numbers are that the file can hold there; 0 where as many digits are written as
    are needed. ``placements`` (k, 4, 4): from the part's frame to the scene's, for each use of it. ``fixed`` says why
    its positions cannot be changed in place, if they cannot.
    """

    name: str
    vertices: Floats
    triangles: Ints
    steps: Floats = field(default_factory=lambda: np.zeros(3))
    placements: Floats = field(default_factory=lambda: STAYS)
    fixed: str = ""

    def __post_init__(self) -> None:
        for array in (self.vertices, self.triangles, self.steps, self.placements):
            array.setflags(write=False)


class Asset(ABC):
    """A file of meshes, and what is in it.

    ``references``: the files that it refers to, as paths relative to its folder; ``changing``: those of them that hold
    positions, and are therefore written anew.
    """

    parts: tuple[Part, ...]
    references: tuple[str, ...] = ()
    changing: tuple[str, ...] = ()

    def __init__(self, source: Source) -> None:
        """Errors: MeshError when the file is missing or damaged."""
        self.source = source

    @property
    def path(self) -> Path:
        return self.source.path

    @property
    def name(self) -> str:
        return self.source.name

    @property
    @abstractmethod
    def contents(self) -> frozenset[str]:
        """What is in the file beside positions and triangles, in the words of `KINDS`."""

    @abstractmethod
    def with_positions(self, moved: Moved, names: Mapping[str, str] | None = None) -> dict[str, bytes]:
        """The file, and those that it refers to and that hold positions, with the parts of ``moved`` moved.

        Only the numbers of positions change, and what follows from them: normals turn with the surface, bounds that
        the format demands are made anew. Equal positions given stay equal. ``names``: for a file of ``changing`` the
        name that it is to have instead. The keys are names relative to the folder of the file.
        Errors: MeshError for a fixed part.
        """

    def mesh(self) -> "TriangleMesh":
        """All parts as one Open3D mesh, each at all its places; with the attributes that Open3D has a word for, if any.

        Positions are the file's, in double precision.
        """
        import open3d as o3d

        vertices, triangles = self.placed()
        return triangle_mesh(vertices, triangles) if len(vertices) else o3d.geometry.TriangleMesh()

    def placed(self) -> tuple[Floats, Ints]:
        """All parts at all their places, as one list of vertices (n, 3) and one of triangles (m, 3)."""
        vertices, triangles, count = [np.empty((0, 3))], [np.empty((0, 3), np.int64)], 0
        for part in self.parts:
            for place in part.placements:
                stays = (place == STAYS[0]).all()
                vertices.append(part.vertices if stays else part.vertices @ place[:3, :3].T + place[:3, 3])
                mirrored = np.linalg.det(place[:3, :3]) < 0.0
                triangles.append((part.triangles[:, ::-1] if mirrored else part.triangles) + count)
                count += len(part.vertices)
        return np.concatenate(vertices), np.concatenate(triangles)

    def check(self, moved: Moved) -> None:
        """Errors: MeshError where a part that is to move cannot, or by an array of another shape."""
        for number, vertices in moved.items():
            part = self.parts[number]
            if part.fixed:
                raise MeshError(f"{self.name}, {part.name}: {part.fixed}")
            if vertices.shape != part.vertices.shape:
                raise MeshError(f"{part.name} has positions {part.vertices.shape}, not {vertices.shape}")


__all__ = ["KINDS", "STAYS", "Asset", "Moved", "Part", "float_steps"]
