"""Mesh saliency and the scalar Costa scheme: the paper's method, and the synchronisation that makes it blind.

Hamidi, Chetouani, El Haziti, El Hassouni, Cherifi, "A robust blind 3-D mesh watermarking technique based on SCS
quantization and mesh saliency for copyright protection", 2019. In the paper's order:

    TriangleMesh -> saliency -> salient set -> order by the norms of the vertex normals
                 -> SCS on the vertex norms -> reconstruction along the radii -> TriangleMesh

A vertex norm is the distance to the mean of the vertices, over the mean of these distances; the salient set is the
share of vertices with the highest saliency. What the order is made of decides whether the mark can be read:

    rank      the literal text: bit = rank mod m, one dither value a rank, ranks by the norm of the vertex normals.
              Embedding changes these norms, hence the ranks: it cannot be read even without an attack (measured).
    informed  the same mark; the reader takes salient set and ranks from the cover mesh. Not blind.
    sphere    blind, the default. The normals are those of the mesh projected radially onto the unit sphere, which
              moving vertices along their radii cannot change; their norms are averaged over the neighbours; a bit owns
              a block of ranks among all vertices, with one dither value; the reader weighs vertices by their saliency.

The step Q_S (the paper's key2) need not be handed over: it lies on a ladder that the reader walks. Under ``sphere`` the
reader also tries to undo subdivision and umbrella smoothing. It decides by how well each bit's vertices agree with the
key's dither, and counts every try.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from o3dmark.arrays import Bools, Complexes, Floats, Ints
from o3dmark.coding.keys import Key
from o3dmark.coding.scs import ScalarCosta, bit_vectors, coherence_log10p, vector_coherence
from o3dmark.errors import CapacityError, MeshError
from o3dmark.mesh import geometry, registration
from o3dmark.mesh.saliency import Saliency
from o3dmark.mesh.smoothing import InverseSmoothing, umbrella
from o3dmark.mesh.surface import Surface, with_vertices
from o3dmark.methods import METHODS, Extraction, Method
from o3dmark.methods._distortion import MRMS_MARGIN, estimated_mrms
from o3dmark.methods._remembered import Remembered
from o3dmark.registry import option
from o3dmark.threads import one_thread


@dataclass(frozen=True)
class ScsFormat:
    """What writer and reader share beside the key and the options; frozen, as the format of shape-spectrum is.

    The steps, over the mean vertex norm, are a ladder from ``largest`` downwards, each ``ratio`` times the next. The
    key's dither comes from the streams that bear these names.
    """

    largest: float
    ratio: float
    rungs: int
    sphere_stream: str
    rank_stream: str

    @property
    def steps(self) -> Floats:
        """The ladder (rungs,), the largest first."""
        return np.asarray(self.largest * self.ratio ** -np.arange(float(self.rungs)))


FORMATS = MappingProxyType(
    {  # 0.030 costs bimba an MRMS of 5.7e-4 of the diagonal; a rung of 5 % costs 2.5 % of the margin
        "2026": ScsFormat(0.2, 1.05, 80, "saliency-scs/sphere", "saliency-scs/rank"),
    }
)

# What tunes the writer
_VERTICES_PER_BIT = 16

# What tunes the reader
_STOP_LOG10_P = -6.0  # of the p-value below which the reader looks no further, unless the next try may be better:
_MIN_COHERENCE = 0.97  # the coherence above which it cannot be
_FINER = 4  # a 1-to-4 subdivision halves the edges, so four times as many averages reach as far
_STRENGTH, _GAIN = 0.1, 1000.0  # of the benchmark's smoothing; how much of it the reader dares to undo
_PASSES = (3, 6, 10, 15, 20, 25, 30, 35, 40, 45, 50, 56, 63, 70)


@dataclass(frozen=True, eq=False)
class Spherical:
    """A surface in spherical coordinates about the mean of its vertices.

    norms (n,) are over ``unit``, the mean distance to ``centre`` (3,); directions (n, 3) have length one. A vertex
    counts as often in both means as ``counts`` (n,) says; once by default.
    """

    centre: Floats
    unit: float
    norms: Floats
    directions: Floats

    @classmethod
    def of(cls, surface: Surface, counts: Ints | None = None) -> "Spherical":
        centre = np.average(surface.vertices, axis=0, weights=counts)
        distance = np.linalg.norm(surface.vertices - centre, axis=1)
        unit = float(np.average(distance, weights=counts))
        return cls(centre, unit, distance / unit, geometry.unit(surface.vertices - centre))

    def vertices(self, norms: Floats) -> Floats:
        """Positions (n, 3) of the vertices moved along their radii to ``norms`` (n,)."""
        return np.asarray(self.centre + self.unit * norms[:, None] * self.directions)


@dataclass(frozen=True, eq=False)
class Carriers:
    """Which vertex carries which bit: vertex (c,), bit (c,), the key's dither (c,) in periods."""

    vertex: Ints
    bit: Ints
    dither: Floats

    def among(self, chosen: Bools) -> "Carriers":
        """Those whose vertex is ``chosen`` (n,)."""
        kept = chosen[self.vertex]
        return Carriers(self.vertex[kept], self.bit[kept], self.dither[kept])


@dataclass(frozen=True, eq=False)
class Guess:
    """What the reader takes a mesh to have gone through: the mesh with that undone, and how to order its vertices.

    ``averages`` of the normal norms over the neighbours; each vertex ``counts`` (n,) times, once by default.
    ``smoothed`` times by the umbrella filter, which is undone in ``surface``.
    """

    view: str
    surface: Surface
    averages: int
    counts: Ints | None = None
    smoothed: int = 0

    @cached_property
    def spherical(self) -> Spherical:
        """The surface in spherical coordinates; its norms carry the bits."""
        return Spherical.of(self.surface, self.counts)

    @cached_property
    def place(self) -> Ints:
        """The place (n,) of each vertex by the descending norm of its normal on the unit sphere."""
        sphere = self.surface.moved(self.spherical.directions)
        norms = np.linalg.norm(sphere.vertex_area_vectors, axis=1)
        for _ in range(self.averages):
            norms = self.surface.neighbour_mean @ norms
        return _places(-norms, self.counts)


class Observation:
    """What a received mesh shows whatever the key: its salient vertices, how far to trust each, and the guesses."""

    def __init__(self, received: Surface, salient: Bools, trust: Floats, guesses: Iterator[Guess]) -> None:
        self.received, self.salient, self.trust = received, salient, trust
        self.guesses = Remembered(guesses)


@METHODS.register("saliency-scs")
@dataclass(frozen=True)
class SaliencySCS(Method):
    """SCS on the norms of salient vertices (Hamidi et al. 2019), under one of three synchronisations."""

    claims = ("identity", "reorder", "similarity", "noise:amplitude=0.003", "quantise:bits=9", "smooth:iterations=10")

    sync: Literal["sphere", "rank", "informed"] = option("sphere", "what orders the vertices")
    mrms: float = option(6e-4, "distortion aimed at when no step is given, over the bounding-box diagonal")
    step: float | None = option(None, "Q_S over the mean vertex norm; none: the ladder's largest step within mrms")
    lam: float | None = option(None, "lambda of Q_S = N_av / lambda, which the reader recomputes; overrides step")
    gamma: float = option(0.7, "share of the way to the codeword; the paper has 0.5")
    share: float = option(0.7, "salient share of the vertices; 1: without saliency")
    salient: Literal["count", "range"] = option("count", "share of the vertices, or saliency >= (1 - share) max")
    sigma: float = option(2.0, "fine scale of the saliency, in units of epsilon")
    epsilon: float = option(0.003, "unit of sigma, over the bounding-box diagonal")
    passes: int = option(8, "averages of the normal norms over the neighbours (sphere)")
    format: Literal["2026"] = option("2026", "what else writer and reader agree on")
    search: bool = option(True, "let the reader undo subdivision and smoothing (sphere)")

    def __post_init__(self) -> None:
        ScalarCosta(self.step or 1.0, self.gamma)  # says what is wrong with them
        if not 0 < self.share <= 1:
            raise ValueError(f"share must lie in (0, 1], not {self.share}")
        if min(self.mrms, self.sigma, self.epsilon, self.lam or 1.0) <= 0 or self.passes < 0:
            raise ValueError("mrms, sigma, epsilon and lam must be positive, passes not negative")

    @property
    def limits(self) -> dict[str, float]:
        """See `Method.limits`: none where the step is given."""
        return {} if self.step or self.lam else {"mrms": self.mrms}

    @property
    def informed(self) -> bool:
        return self.sync == "informed"

    @one_thread()
    def embed(self, mesh: Any, bits: ArrayLike, key: Key) -> Any:
        """See `Method.embed`. Salient vertices move along their radii, by gamma Q_S / 2 at most; the others stay."""
        surface = Surface.of(mesh)
        message = np.asarray(bits, np.uint8).ravel()
        if len(message) > (fits := self.capacity(mesh)):
            raise CapacityError(len(message), fits, f"{_VERTICES_PER_BIT} salient vertices a bit")
        salient = self.salient_set(self.saliency(surface))
        guess = Guess("as received", surface, self.passes)
        carriers = self._order(guess, salient, len(message), key).among(salient)
        spherical = guess.spherical

        def reconstructed(step: float) -> Floats:
            scs, moved = ScalarCosta(step, self.gamma), carriers.vertex
            vertices, norms = surface.vertices.copy(), spherical.norms.copy()
            norms[moved] = scs.embed(norms[moved], message[carriers.bit], carriers.dither)
            vertices[moved] = spherical.vertices(norms)[moved]  # the others keep every bit of their coordinates
            return vertices

        for step in self._steps(surface, salient):  # the largest first
            vertices = reconstructed(step)
            if self.step or self.lam or estimated_mrms(surface, vertices) <= MRMS_MARGIN * self.mrms:
                return with_vertices(mesh, surface, vertices)
        raise MeshError(f"no step meets an MRMS of {self.mrms} of the diagonal; ask for a larger one")

    @one_thread()
    def extract(self, mesh: Any, n_bits: int, key: Key, *, reference: Any = None) -> Extraction:
        """See `Method.extract`. Only sync=informed takes a ``reference``, the cover mesh, and it needs it."""
        if (reference is None) == self.informed:
            needs = "needs the cover mesh as" if reference is None else "is blind and takes no"
            raise MeshError(f"saliency-scs with sync={self.sync} {needs} reference")
        seen = self.observe(mesh)
        best, least, tried, clear = Extraction(np.zeros(n_bits)), np.inf, 0, False
        for guess in seen.guesses:
            if reference is None:
                carriers = self._order(guess, seen.salient, n_bits, key)
            else:
                carriers = self._order_of_cover(Surface.of(reference), seen.received, n_bits, key)
            steps = self._steps(guess.surface, seen.salient)
            values, weights = guess.spherical.norms[carriers.vertex], seen.trust[carriers.vertex]
            vectors = bit_vectors(values, carriers.dither, carriers.bit, steps, n_bits, weights)
            log_p = coherence_log10p(vectors)
            tried += len(steps)
            better = log_p.min() < least
            if better:
                least, rung = float(log_p.min()), int(log_p.argmin())
                best = _extraction(guess, vectors[rung], float(steps[rung]))
                clear = best.coherence is not None and best.coherence > _MIN_COHERENCE
            if least + np.log10(tried) < _STOP_LOG10_P and (clear or not better):
                break
        return replace(best, hypotheses=tried)

    def observe(self, mesh: Any) -> Observation:
        """See `Method.observe`."""
        if isinstance(mesh, Observation):
            return mesh
        received = Surface.of(mesh)
        saliency = self.saliency(received)
        return Observation(received, self.salient_set(saliency), self._trust(saliency), self._guesses(received))

    def capacity(self, mesh: Any) -> int:
        """A bit for every 16 salient vertices."""
        return int(self.share * len(Surface.of(mesh).vertices)) // _VERTICES_PER_BIT

    # The steps of the paper, in its order

    def saliency(self, surface: Surface) -> Floats:
        """The paper's saliency (n,): one scale."""
        return Saliency(scales=(self.sigma,), epsilon=self.epsilon).of_surface(surface)

    def salient_set(self, saliency: Floats) -> Bools:
        """True (n,) at the salient vertices, "the 70 % maximum values of saliency vector"."""
        if self.salient == "range":
            return np.asarray(saliency >= (1.0 - self.share) * saliency.max())
        return _places(-saliency) < self.share * len(saliency)

    def _order(self, guess: Guess, salient: Bools, n_bits: int, key: Key) -> Carriers:
        """Vertices in the descending order of their normal norms, and the bit and the dither that each place gives."""
        if self.sync != "sphere":
            return self._by_rank(guess.surface, salient, n_bits, key)
        total = len(guess.place) if guess.counts is None else guess.counts.sum()
        bit = guess.place * n_bits // total
        dither = key.stream(FORMATS[self.format].sphere_stream).uniform(n_bits)
        return Carriers(np.arange(len(bit)), bit, dither[bit])

    def _by_rank(self, surface: Surface, salient: Bools, n_bits: int, key: Key) -> Carriers:
        """The literal text: the i-th salient vertex by descending normal norm carries bit i mod m, the i-th dither."""
        vertex = np.flatnonzero(salient)
        norms = np.linalg.norm(surface.vertex_area_vectors[vertex], axis=1)
        vertex = vertex[np.argsort(-norms, kind="stable")]
        dither = key.stream(FORMATS[self.format].rank_stream).uniform(len(vertex))
        return Carriers(vertex, np.arange(len(vertex)) % n_bits, dither)

    def _order_of_cover(self, cover: Surface, received: Surface, n_bits: int, key: Key) -> Carriers:
        order = self._by_rank(cover, self.salient_set(self.saliency(cover)), n_bits, key)
        match = registration.match_vertices(cover.vertices, received.vertices)
        return Carriers(match[order.vertex], order.bit, order.dither)

    def _steps(self, surface: Surface, salient: Bools) -> Floats:
        """The quantisation steps Q_S to try, over the mean vertex norm, in descending order."""
        if self.lam is not None:
            normals = np.linalg.norm(surface.vertex_area_vectors[salient], axis=1)
            return np.array([normals.mean() / Spherical.of(surface).unit ** 2 / self.lam])
        return FORMATS[self.format].steps if self.step is None else np.array([self.step])

    # What the blind reader adds

    def _trust(self, saliency: Floats) -> Floats:
        """The weight (n,) of each vertex: near one in the salient set, near zero out of it, gradual at its edge."""
        if self.sync != "sphere" or self.share == 1.0:
            return np.ones(len(saliency))
        return np.asarray(1.0 / (1.0 + np.exp((_places(-saliency) / len(saliency) - self.share) / 0.1)))

    def _guesses(self, received: Surface) -> Iterator[Guess]:
        """What may have been done to the mesh, likeliest first."""
        yield Guess("as received", received, self.passes)
        if self.sync == "sphere" and self.search:
            if received.multiplicity.max() > 1:
                yield Guess("rounded until vertices met", received, self.passes, received.multiplicity)
            yield Guess("subdivided once", received, _FINER * self.passes)
            inverse = InverseSmoothing(received)
            for n in _PASSES:
                surface = received.moved(inverse.undo(umbrella(n, _STRENGTH), _GAIN))
                yield Guess("as received", surface, self.passes, smoothed=n)


def _extraction(guess: Guess, vectors: Complexes, step: float) -> Extraction:
    """What the agreements (n_bits,) of a guess say at one step."""
    return Extraction(
        -vectors.real,
        view=guess.view,
        step=step,
        smoothing="umbrella" if guess.smoothed else None,
        passes=guess.smoothed,
        coherence=vector_coherence(vectors),
    )


def _places(values: Floats, counts: Ints | None = None) -> Ints:
    """The place (n,) of each value in the ascending order, when each stands ``counts`` (n,) times in it, or once."""
    order = np.argsort(values, kind="stable")
    sizes = np.ones(len(values), np.int64) if counts is None else counts[order]
    places = np.empty(len(values), np.int64)
    places[order] = np.cumsum(sizes) - sizes
    return places
