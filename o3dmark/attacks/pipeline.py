"""What happens to a mesh on its way through real tools: compression for the web, and printing followed by scanning.

Draco and meshoptimizer are an extra: pip install "o3dmark[pipeline]". Both tools store float32 and their own order of
vertices and triangles. Vertex colours go through, texture coordinates are dropped.
"""

import importlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from o3dmark.arrays import Ints
from o3dmark.attacks import ATTACKS, Attack
from o3dmark.attacks._carry import checked_arrays, colours_of, copied, made, moved
from o3dmark.attacks.geometry import Similarity, random_direction
from o3dmark.attacks.reextraction import Resample, Rescan
from o3dmark.attacks.smoothing import Smooth
from o3dmark.errors import BackendError
from o3dmark.mesh.surface import Surface, mesh_arrays
from o3dmark.registry import option


@ATTACKS.register("draco")
@dataclass(frozen=True)
class Draco(Attack):
    """Compressed by Google's Draco and decompressed: one step for all axes, the longest extent / (2^bits - 1).

    A coordinate moves by half a step at most. Draco's own default is 11 bits, glTF exporters use 14.
    Source: google/draco, by way of DracoPy.
    """

    bits: int = option(11, "bits a coordinate, 1 to 30")

    def __post_init__(self) -> None:
        if not 1 <= self.bits <= 30:
            raise ValueError(f"bits should be 1 to 30, not {self.bits}")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:  # noqa: ARG002
        vertices, triangles = checked_arrays(mesh)
        draco, colours = _tool("DracoPy"), colours_of(mesh)
        rgb = None if colours is None else np.round(255.0 * np.clip(colours, 0.0, 1.0)).astype(np.uint8)
        data = draco.encode(vertices, triangles.astype(np.uint32), quantization_bits=self.bits, colors=rgb)
        back = draco.decode(data)
        rgb = None if rgb is None else back.colors[:, :3] / 255.0
        return made(mesh, back.points.astype(np.float64), back.faces.astype(np.int64), rgb)


@ATTACKS.register("meshopt")
@dataclass(frozen=True)
class Meshopt(Attack):
    """As gltfpack stores a mesh: integer positions, one step for all axes, in an order made for the graphics card.

    The step is the longest extent / (2^bits - 1); unused vertices go. The vertex and index buffers pass meshoptimizer's
    vertex-cache and vertex-fetch orders and its codec. Source: zeux/meshoptimizer, gltfpack -vp.
    """

    bits: int = option(14, "bits a coordinate, 1 to 16; gltfpack's default is 14")

    def __post_init__(self) -> None:
        if not 1 <= self.bits <= 16:
            raise ValueError(f"bits should be 1 to 16, not {self.bits}")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:  # noqa: ARG002
        vertices, triangles = checked_arrays(mesh)
        tool = _tool("meshoptimizer")
        order, corners = _card_order(tool, triangles, len(vertices))
        low = vertices[order].min(axis=0)
        step = float(np.ptp(vertices[order], axis=0).max()) / (2.0**self.bits - 1.0)
        rows = np.zeros((len(order), 4), np.uint16)  # the codec wants rows of a multiple of four bytes
        rows[:, :3] = np.round((vertices[order] - low) / step)
        row = np.dtype((np.uint16, 4))
        back = tool.decode_vertex_buffer(len(rows), 8, tool.encode_vertex_buffer(rows, len(rows), 8), dtype=row)
        index = tool.decode_index_buffer(
            corners.size, 4, tool.encode_index_buffer(corners.ravel(), vertex_count=len(rows))
        )
        colours = colours_of(mesh)
        return made(
            mesh,
            low + step * back[:, :3].astype(np.float64),
            index.reshape(-1, 3).astype(np.int64),
            None if colours is None else colours[order],
        )


@ATTACKS.register("meshopt-simplify")
@dataclass(frozen=True)
class MeshoptSimplify(Attack):
    """meshoptimizer's edge collapse until ``ratio`` of the triangles is gone or the error is reached.

    It acts on the welded surface: from a triangle soup, as stored, meshoptimizer removes nothing. The vertices that
    stay do not move, but for float32. Source: Garland and Heckbert 1997, Surface simplification using
    quadric error metrics, as in gltfpack -si.
    """

    ratio: float = option(0.5, "share of the triangles removed, 0 to 0.999; 0: none")
    error: float = option(0.05, "largest deviation, over the longest extent")

    def __post_init__(self) -> None:
        if not 0 <= self.ratio <= 0.999 or not 0 <= self.error <= 1:
            raise ValueError("wants ratio in 0 .. 0.999 and error in 0 .. 1")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:  # noqa: ARG002
        surface = Surface.of(mesh)
        if not self.ratio:
            return copied(mesh)
        tool, positions = _tool("meshoptimizer"), np.ascontiguousarray(surface.vertices, np.float32)
        indices = np.ascontiguousarray(surface.triangles.ravel(), np.uint32)
        target = 3 * max(4, round((1.0 - self.ratio) * len(surface.triangles)))
        chosen = np.zeros_like(indices)
        n = tool.simplify(chosen, indices, positions, target_index_count=target, target_error=self.error)
        used, corners = np.unique(chosen[:n].astype(np.int64), return_inverse=True)
        return made(mesh, positions[used].astype(np.float64), corners.reshape(-1, 3))


@ATTACKS.register("print-scan")
@dataclass(frozen=True)
class PrintScan(Attack):
    """Printed in layers and scanned: a simulation, with no printer's file format in it.

    The solid's surface is resampled, its height along a random direction rounded to layers, the steps melted by two
    passes of smoothing; then it is scanned (`Rescan`), and comes back in another place, size and orientation.
    Source: defined here; no measured printer stands behind the numbers.
    """

    layer: float = option(0.003, "height of a layer, over the bounding box's diagonal; 0: none")
    cells: int = option(120, "cells of the resampling along the longest side")
    noise: float = option(5e-4, "standard deviation of the scan, over the bounding box's diagonal")
    views: int = option(12, "number of scanners around the print")
    points: int = option(40_000, "number of points of the scan")
    depth: int = option(7, "octree depth of the surface through them, 3 to 11")

    def __post_init__(self) -> None:
        if self.layer < 0:
            raise ValueError(f"layer should be 0 or more, not {self.layer}")
        self._scanner()

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        printed = Resample(self.cells).attack(mesh, rng)
        vertices, _ = mesh_arrays(printed)
        up, height = random_direction(rng), self.layer * Surface.of(mesh).diagonal
        if height:
            along = vertices @ up
            along -= along.min()
            vertices += (np.floor(along / height) * height + height / 2.0 - along)[:, None] * up
        melted = Smooth(2, 0.5).attack(moved(printed, vertices), rng)
        return Similarity().attack(self._scanner().attack(melted, rng), rng)

    def _scanner(self) -> Rescan:
        return Rescan(self.points, self.noise, self.views, depth=self.depth)


def _tool(module: str) -> Any:
    try:
        return importlib.import_module(module)
    except (ImportError, OSError) as error:
        raise BackendError(f'{module} is not installed ({error}): pip install "o3dmark[pipeline]"') from None


def _card_order(tool: Any, triangles: Ints, n_vertices: int) -> tuple[Ints, Any]:
    """The old index of each new vertex (k,), and the triangles' corners in new indices (m, 3) uint32."""
    indices = np.ascontiguousarray(triangles.ravel(), np.uint32)
    cached = np.zeros_like(indices)
    tool.optimize_vertex_cache(cached, indices, vertex_count=n_vertices)
    _, first = np.unique(cached, return_index=True)
    order = cached[np.sort(first)].astype(np.int64)  # vertices as the triangles first ask for them
    new_index = np.zeros(n_vertices, np.uint32)
    new_index[order] = np.arange(len(order))
    return order, new_index[cached].reshape(-1, 3)
