"""Attacks that build another triangulation of the same surface: simplification and remeshing, both by MeshLab."""

# ruff: noqa: ARG002 - attacks without randomness take an rng too

from dataclasses import dataclass
from typing import Any

import numpy as np

from o3dmark.arrays import Bools, Floats, Ints
from o3dmark.attacks import ATTACKS, Attack, _meshlab
from o3dmark.attacks._carry import copied, made
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface
from o3dmark.registry import option

# All parameters are given, since MeshLab takes those left out from the last call in the process. They are its defaults,
# but for two. Without preservetopology a fifth of the meshes tried came back non-manifold. Without planarquadric
# vertices slide about in planes, and which of equal edges goes first decides whether fandisk, halved, is off by 2e-4 or
# 3e-3 of the diagonal; with a weight of 1e-4 it is off by 9e-6, and shapes without planes come out as well as before.
_COLLAPSE = {
    "preservetopology": True,
    "planarquadric": True,
    "planarweight": 1e-4,
    "targetperc": 0.0,
    "qualitythr": 0.3,
    "preserveboundary": False,
    "boundaryweight": 1.0,
    "preservenormal": False,
    "optimalplacement": True,
    "qualityweight": False,
    "autoclean": True,
}
_REMESH = {
    "adaptive": False,
    "selectedonly": False,
    "featuredeg": 30.0,
    "checksurfdist": True,
    **dict.fromkeys(("splitflag", "collapseflag", "swapflag", "smoothflag", "reprojectflag"), True),
}


@ATTACKS.register("simplify")
@dataclass(frozen=True)
class Simplify(Attack):
    """Quadric edge collapse until ``ratio`` of the triangles is gone (of a closed surface: of its edges, too).

    The topology is kept: a manifold stays one. Planes have a weak quadric of their own, or vertices would slide in
    them. It acts on the welded surface; colours are those of the nearest old vertex, texture coordinates are dropped.
    Fewer than four triangles are never asked for, and MeshLab stops early where no edge is left that it may collapse.
    Source: Wang et al. 2010, A benchmark for 3D mesh watermarking, "simplification", 10 to 97.5 %; Garland and
    Heckbert 1997, Surface simplification using quadric error metrics.
    """

    ratio: float = option(0.5, "share of the triangles removed, 0 to 0.999; 0: none")

    def __post_init__(self) -> None:
        if not 0 <= self.ratio <= 0.999:
            raise ValueError(f"ratio should be 0 to 0.999, not {self.ratio}")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        surface = Surface.of(mesh)
        if not self.ratio:
            return copied(mesh)
        return made(mesh, *simplified(surface, self.ratio))


def simplified(surface: Surface, ratio: float, part: Bools | None = None) -> tuple[Floats, Ints]:
    """Vertices and triangles that are left when a ratio of the triangles, or of a ``part`` (m,) of them, is gone."""
    count = len(surface.triangles) if part is None else int(part.sum())
    wanted = {"targetfacenum": max(4, round((1.0 - ratio) * count)), "selected": part is not None}
    collapse = ("meshing_decimation_quadric_edge_collapse", wanted | _COLLAPSE)
    return _meshlab.apply(surface.vertices, surface.triangles, collapse, selected=part)


@ATTACKS.register("remesh")
@dataclass(frozen=True)
class Remesh(Attack):
    """Isotropic explicit remeshing: edges split, collapsed, flipped and relaxed towards one length.

    It acts on the welded surface; colours are those of the nearest old vertex, texture coordinates are dropped.
    Source: Hoppe et al. 1993, Mesh optimization; Botsch and Kobbelt 2004, A remeshing approach to multiresolution
    modeling; as MeshLab does it.
    """

    edge: float | None = option(
        None, "target edge length, as a share of the bounding box's diagonal; none: the mean now"
    )
    iterations: int = option(5, "rounds of split, collapse, flip and relax; 0: none")

    def __post_init__(self) -> None:
        if self.iterations < 0 or not (self.edge is None or 5e-4 <= self.edge <= 0.5):
            raise ValueError("wants iterations >= 0 and edge none or 0.0005 to 0.5")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        surface = Surface.of(mesh)
        if not self.iterations:
            return copied(mesh)
        ends = surface.vertices[geometry.edges(surface.triangles)]
        mean = float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).mean()) / surface.diagonal
        edge = _meshlab.length(mean if self.edge is None else self.edge)
        options = {"iterations": self.iterations, "targetlen": edge, "maxsurfdist": _meshlab.length(0.01)} | _REMESH
        remesh = ("meshing_isotropic_explicit_remeshing", options)
        return made(mesh, *_meshlab.apply(surface.vertices, surface.triangles, remesh))
