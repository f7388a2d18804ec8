"""Bits in the norms of a semi-regular mesh's coarsest wavelet coefficients, one for each edge of its base mesh.

    TriangleMesh -> lazy wavelets -> base edges in an order -> SCS on the norms of their coefficients -> TriangleMesh

The base mesh does not move, so whatever is measured on it, the order of its edges above all, is what the reader finds.
A bit has a block of successive edges and one dither value of the key. The step is the mean base edge over epsilon;
where a distortion is asked for, it is one of a ladder that the reader walks.
"""

import abc
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from o3dmark.arrays import Bits, Floats, Ints
from o3dmark.coding.keys import Key
from o3dmark.coding.scs import ScalarCosta, bit_vectors, coherence_log10p, vector_coherence
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.semi_regular import Subdivision, Wavelets, analysis, subdivisions, synthesis
from o3dmark.mesh.surface import Surface
from o3dmark.methods import Extraction
from o3dmark.methods._published import PublishedMethod
from o3dmark.registry import option

# Steps over the mean base edge, ascending; a rung of 5 % costs 2.5 % of the margin
_LADDER = np.asarray(1.05 ** -np.arange(120.0)[::-1], np.float64)
_ZERO = 1e-9  # of the mean base edge: a coefficient that has no direction


@dataclass(frozen=True, eq=False)
class Multiresolution:
    """A semi-regular mesh: its subdivisions, the coarsest first, and its wavelets."""

    levels: tuple[Subdivision, ...]
    wavelets: Wavelets

    @classmethod
    def of(cls, surface: Surface) -> "Multiresolution":
        """Errors: MeshError for a surface that is not semi-regular."""
        levels = subdivisions(surface)
        return cls(levels, analysis(surface.vertices, levels))

    @property
    def edges(self) -> Ints:
        """The base mesh's edges (e, 2)."""
        return self.levels[0].edges

    @cached_property
    def base(self) -> Surface:
        """The base mesh."""
        number = np.arange(len(self.wavelets.base))
        return Surface(self.wavelets.base.copy(), self.levels[0].triangles.copy(), number)

    @cached_property
    def lengths(self) -> Floats:
        """Lengths (e,) of the base edges."""
        ends = self.wavelets.base[self.edges]
        return np.asarray(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1))

    @cached_property
    def norms(self) -> Floats:
        """Norm (e,) of the coefficient of each base edge, over the mean base edge."""
        return np.asarray(np.linalg.norm(self.wavelets.details[0], axis=1) / self.lengths.mean())

    @cached_property
    def edge_area_vectors(self) -> Floats:
        """Sum (e, 3) of the area vectors of the base triangles on each edge: its un-normalised normal."""
        pairs, side = geometry.numbered_edges(self.levels[0].triangles)
        sums = geometry.sum_at_vertices(self.base.area_vectors, side, len(pairs))
        own = np.sort(self.edges, axis=1)
        rank = np.lexsort((own[:, 1], own[:, 0]))  # as `numbered_edges` has them
        vectors = np.empty_like(sums)
        vectors[rank] = sums
        return vectors

    def with_norms(self, norms: Floats) -> Floats:
        """The vertices (n, 3) with other ``norms`` (e,); a coefficient that is zero grows along its edge's normal."""
        unit = geometry.unit(self.wavelets.details[0])
        flat = self.norms < _ZERO
        unit[flat] = geometry.unit(self.edge_area_vectors)[flat]
        detail = norms[:, None] * self.lengths.mean() * unit
        return synthesis(replace(self.wavelets, details=(detail, *self.wavelets.details[1:])), self.levels)


@dataclass(frozen=True)
class WaveletNormsMethod(PublishedMethod):
    """A bit in the norms of the coefficients of a block of base edges."""

    edges_per_bit: ClassVar[int] = 4
    least: ClassVar[float] = float(_LADDER[0])
    needs_semi_regular: ClassVar[bool] = True

    epsilon: float = option(16.0, "the step is the mean base edge over epsilon, unless mrms is given")
    gamma: float = option(1.0, "share of the way to the codeword; 1: plain quantisation (QIM)")

    def __post_init__(self) -> None:
        super().__post_init__()
        ScalarCosta(1.0, self.gamma)  # says what is wrong with it

    @property
    def strength(self) -> float:
        return 1.0 / self.epsilon if self.epsilon > 0 else 0.0

    @property
    def ladder(self) -> Floats | None:
        """See `PublishedMethod.ladder`."""
        return None if self.mrms is None else _LADDER

    @abc.abstractmethod
    def order(self, mesh: Multiresolution) -> Ints:
        """The base edges (c,) that carry bits, by number, in an order that the mark leaves as it is."""

    def capacity(self, mesh: Any) -> int:
        """A bit for every four base edges that carry bits. Errors: MeshError for a mesh that is not semi-regular."""
        return len(self.order(Multiresolution.of(Surface.of(mesh)))) // self.edges_per_bit

    def writer(self, surface: Surface, message: Bits, key: Key) -> Callable[[float], Floats]:
        """See `PublishedMethod.writer`; the strength is the step over the mean base edge."""
        mesh = Multiresolution.of(surface)
        edge = self.order(mesh)
        bit, dither = self._carried(len(edge), len(message), key)

        def moved(step: float) -> Floats:
            norms = mesh.norms.copy()
            new = ScalarCosta(step, self.gamma).embed(norms[edge], message[bit], dither)
            norms[edge] = np.where(new < 0.0, new + step, new)
            return mesh.with_norms(norms)

        return moved

    def observe(self, mesh: Any) -> Multiresolution | None:
        """See `Method.observe`; None for a mesh that is not semi-regular."""
        if mesh is None or isinstance(mesh, Multiresolution):
            return mesh
        surface = Surface.of(mesh)
        try:
            return Multiresolution.of(surface)
        except MeshError:
            return None

    def read(self, seen: Multiresolution | None, n_bits: int, key: Key) -> Extraction:
        """See `PublishedMethod.read`: of the steps the one at which norms agree best with the key's dither."""
        if seen is None:
            return Extraction(np.zeros(n_bits), view="not a semi-regular mesh")
        edge = self.order(seen)
        bit, dither = self._carried(len(edge), n_bits, key)
        steps = np.array([self.strength]) if self.ladder is None else self.ladder
        vectors = bit_vectors(seen.norms[edge], dither, bit, steps, n_bits, np.ones(len(edge)))
        best = int(np.argmin(coherence_log10p(vectors)))
        coherence = vector_coherence(vectors[best])
        return Extraction(-vectors[best].real, len(steps), step=float(steps[best]), coherence=coherence)

    def _carried(self, n_edges: int, n_bits: int, key: Key) -> tuple[Ints, Floats]:
        """Which bit each edge of the order carries (c,), and the key's dither there (c,), in periods."""
        bit = np.arange(n_edges) * n_bits // max(n_edges, 1)
        return bit, key.stream(f"{self.name}/dither").uniform(n_bits)[bit]
