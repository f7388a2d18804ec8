"""Attacks that leave the shape alone: storing, reading and tidying up a mesh."""

# ruff: noqa: ARG002 - attacks without randomness take an rng too

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from o3dmark import files
from o3dmark.attacks import ATTACKS, Attack
from o3dmark.attacks._carry import checked_arrays, copied, legacy, moved, picked
from o3dmark.mesh import geometry
from o3dmark.registry import option


@ATTACKS.register("identity")
@dataclass(frozen=True)
class Identity(Attack):
    """Nothing happens: the mesh as it is, copied. Source: the control that every table of the field begins with."""

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        return copied(mesh)


@ATTACKS.register("reorder")
@dataclass(frozen=True)
class Reorder(Attack):
    """Vertices and triangles in random order, triangles named from a random corner; the winding is kept.

    Source: Wang et al. 2010, A benchmark for 3D mesh watermarking, "element reordering".
    """

    vertices: bool = option(True, "permute the vertices")
    triangles: bool = option(True, "permute the triangles")
    corners: bool = option(True, "start each triangle at a random corner")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        positions, triangles = checked_arrays(mesh)
        order, source = np.arange(len(positions)), np.arange(len(triangles))
        if self.vertices:
            order = rng.permutation(order)
        if self.triangles:
            source = rng.permutation(source)
        turn = rng.integers(0, 3, len(triangles)) if self.corners else np.zeros(len(triangles), np.int64)
        new_index = np.empty_like(order)
        new_index[order] = np.arange(len(order))
        rows = np.arange(len(triangles))[:, None]
        corners = triangles[source][rows, (np.arange(3) + turn[:, None]) % 3]
        return picked(mesh, order, new_index[corners], source)


@ATTACKS.register("reformat")
@dataclass(frozen=True)
class Reformat(Attack):
    """Saved to a file and read again, in the format of choice.

    ply          binary; positions are exact
    ply-ascii    about six digits
    obj, off     about six digits (`files.write_mesh` writes all of them)
    stl          float32, a triangle soup
    glb          float32, vertices in another order

    PLY and OFF keep colours to 1/255, STL none. Texture coordinates are kept where Open3D keeps them.
    Source: what conversion between programs does; the files are those that Open3D writes and reads.
    """

    format: Literal["ply", "ply-ascii", "obj", "off", "stl", "glb"] = option("obj", "file format")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        import open3d as o3d

        checked_arrays(mesh)
        with tempfile.TemporaryDirectory(prefix="o3dmark-") as folder:
            path = Path(folder) / f"mesh.{self.format.removesuffix('-ascii')}"
            if self.format in ("ply-ascii", "obj", "off"):
                with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
                    o3d.io.write_triangle_mesh(str(path), legacy(mesh), write_ascii=True)
            else:
                files.write_mesh(path, legacy(mesh))
            return files.read_mesh(path)


@ATTACKS.register("float16")
@dataclass(frozen=True)
class Float16(Attack):
    """Coordinates kept in half precision (11 significant bits), relative to the centre of the bounding box.

    They are scaled so that half of the longest side is one: half precision ends at 65504 and its grid is finest at 0.
    A coordinate moves by at most 2^-12 of half of the longest side. Source: IEEE 754, binary16, as graphics cards take
    vertices.
    """

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, _ = checked_arrays(mesh)
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        centre, scale = (low + high) / 2.0, (high - low).max() / 2.0
        return moved(mesh, centre + scale * ((vertices - centre) / scale).astype(np.float16).astype(np.float64))


@ATTACKS.register("weld")
@dataclass(frozen=True)
class Weld(Attack):
    """Vertices at exactly equal positions become one, with the attributes of the first; triangles are all kept.

    Triangles that repeat a corner after that are kept too: their number does not change.
    Source: what importers do to a triangle soup ("merge by distance 0").
    """

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, triangles = checked_arrays(mesh)
        first, place = geometry.weld(vertices)
        return picked(mesh, first, place[triangles], np.arange(len(triangles)))


@ATTACKS.register("unweld")
@dataclass(frozen=True)
class Unweld(Attack):
    """A triangle soup: every triangle has three vertices of its own; unused vertices go. Source: STL files."""

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        _, triangles = checked_arrays(mesh)
        soup = np.arange(3 * len(triangles)).reshape(-1, 3)
        return picked(mesh, triangles.ravel(), soup, np.arange(len(triangles)))
