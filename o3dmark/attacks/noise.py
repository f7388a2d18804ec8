"""Random displacement of every vertex."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from o3dmark.arrays import Floats, Ints
from o3dmark.attacks import ATTACKS, Attack
from o3dmark.attacks._carry import checked_arrays, copied, moved
from o3dmark.mesh import geometry
from o3dmark.registry import option


@ATTACKS.register("noise")
@dataclass(frozen=True)
class Noise(Attack):
    """Independent noise at every vertex; with A = amplitude times the mean vertex distance to the mean of all vertices:

    uniform     each coordinate gets U(-A, A): the benchmark's noise, quoted there as 0.05 to 0.5 %
    gaussian    each coordinate gets N(0, A^2)
    normal      the vertex moves by N(0, A^2) along its normal: a scanner's depth error

    Vertices at equal positions move alike unless ``seams`` is false.
    Source: Wang et al. 2010, A benchmark for 3D mesh watermarking, "noise addition".
    """

    amplitude: float = option(
        0.001, "A, as a share of the mean vertex distance to the centre (0.001 is 0.1 %); 0: none"
    )
    kind: Literal["uniform", "gaussian", "normal"] = option("uniform", "distribution of the displacement")
    seams: bool = option(True, "keep seams closed: vertices at equal positions move alike")

    def __post_init__(self) -> None:
        if not (np.isfinite(self.amplitude) and self.amplitude >= 0):
            raise ValueError(f"amplitude should be 0 or more, not {self.amplitude}")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        vertices, triangles = checked_arrays(mesh)
        if not self.amplitude:
            return copied(mesh)
        kept, place = geometry.weld(vertices) if self.seams else (np.arange(len(vertices)), np.arange(len(vertices)))
        A = self.amplitude * np.linalg.norm(vertices - vertices.mean(axis=0), axis=1).mean()
        return moved(mesh, vertices + A * self._unit_noise(vertices[kept], place[triangles], rng)[place])

    def _unit_noise(self, vertices: Floats, triangles: Ints, rng: np.random.Generator) -> Floats:
        if self.kind == "uniform":
            return rng.uniform(-1.0, 1.0, vertices.shape)
        if self.kind == "gaussian":
            return rng.standard_normal(vertices.shape)
        normals = geometry.unit(geometry.vertex_area_vectors(vertices, triangles))
        return normals * rng.standard_normal((len(vertices), 1))
