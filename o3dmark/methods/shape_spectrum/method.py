"""The mark in function space: the scalar Costa scheme on random projections of the Fourier transform of the solid.

embed      TriangleMesh -> surface -> the cover in its frame -> codewords -> the least motion there -> TriangleMesh
extract    TriangleMesh -> surface -> hypotheses about the frame -> the reading that is nearest to codewords

The cover is the solid that the mesh bounds, seen in a canonical frame, its spectrum, and the key's projections of that.
Each projection is an integral over the solid, so vertices, their order, their number and their noise hardly matter.
Nothing but the key and the options is shared: the quantisation step lies on a ladder that the reader walks (`format`),
and the frame follows from the mesh in hand.

What an attack does to the projections is, in the main, to disturb the frame, to flatten the surface between the
vertices that are left, and to smooth it. The reader therefore tries, in this order and until a reading is beyond doubt:

    as received    the values as they are; then with the frame's seven parameters fitted
    in part        the same of other views of the surface: welded, as wound, one piece, what is seen (see `received`)
    bulging        with one more parameter: how far the surface bulges out between its vertices
    mirrored       and every other way in which the axes may lie
    unsmoothed     the surface before 1, 2, 3 ... passes of umbrella, Taubin or HC smoothing, by their inverse
    undeformed     the solid before it was stretched, sheared, bent or twisted a little (see `deformation`)

A reading is judged by how near its values are to codewords of either bit, a statistic that has a p-value for every
mesh (see `scs.coherence_log10p`). The judgement looks at the values modulo half a period only; given those, under a
wrong key, each bit remains a fair coin. All the readings tried are counted nevertheless.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from o3dmark.arrays import Bits, Floats
from o3dmark.coding.collusion import Mixture
from o3dmark.coding.keys import Key
from o3dmark.errors import CapacityError, MeshError
from o3dmark.mesh.reconstruction import surface_of_points
from o3dmark.mesh.surface import Surface, is_cloud, legacy_cloud, with_vertices
from o3dmark.mesh.welding import mended
from o3dmark.methods import METHODS, Extraction, Method, Progress, silent
from o3dmark.methods.shape_spectrum.decoder import Decoder
from o3dmark.methods.shape_spectrum.format import FORMATS
from o3dmark.methods.shape_spectrum.projections import Projections
from o3dmark.methods.shape_spectrum.search import Hypotheses
from o3dmark.registry import option
from o3dmark.solid.solid import Solid
from o3dmark.solid.spectrum import Band
from o3dmark.threads import one_thread

if TYPE_CHECKING:  # what a reader without the cover needs not, and would wait for, is imported where it is used
    from o3dmark.methods.shape_spectrum.embedder import Cover
    from o3dmark.methods.shape_spectrum.mixture import Remade

_VERTICES_PER_BIT = 8
_MAX_BITS = 128
_CERTAIN = 0.9  # mean of the soft bits' magnitudes beside the cover above which it is not read blindly
_NEAR = 2e-4  # and how near to the marked cover it then is: one that was stretched or bent by 3 % is 1e-3 off
_CLEAR = 0.7  # coherence of a blind reading from which on it is believed instead
_EXPECTED_STEP = 3.7  # as `format`'s unit, over area x diagonal / scale^3: 3.1 to 4.3 on meshes, sheets down to 1.8


class Prepared(NamedTuple):
    """A mesh about to be marked, as given and as the writer of a key's bits sees it."""

    mesh: Any
    cover: "Cover"


@METHODS.register("shape-spectrum")
@dataclass(frozen=True)
class ShapeSpectrum(Method):
    """SCS on keyed projections of the Fourier transform of the solid; blind, and indifferent to the triangulation."""

    claims = (
        "identity",
        "reorder",
        "similarity",
        "noise:amplitude=0.003",
        "quantise:bits=9",
        "smooth:iterations=10",
        "subdivide",
        "simplify:ratio=0.5",
    )

    mrms: float = option(5.8e-4, "distortion aimed at, over the bounding-box diagonal; the ladder's middle hangs on it")
    jnd: float | None = option(1.0, "most that may be seen of it, in just noticeable differences; none: anything")
    lowest: float = option(4.0, "longest waves used, as the number that fit in the box")
    highest: float = option(12.0, "shortest waves used, as the number that fit in the box")
    box: float = option(6.0, "side of the box, over the radius of gyration")
    rungs: int = option(45, "steps that writer and reader know of, each 7 % smaller; slender shapes need more")
    format: Literal["2026"] = option("2026", "what else writer and reader agree on")
    slack: float = option(0.04, "how far from its codeword a value may stay, in steps, where that buys a longer step")
    mask: Literal["none", "saliency"] = option("none", "where the surface moves more: nowhere, or where it is salient")
    motion: Literal["unseen", "least"] = option(
        "unseen", "how the surface moves: so that smooth stays smooth and flat flat, or as little as possible"
    )
    search: bool = option(True, "let the reader fit the frame and undo smoothing")

    def __post_init__(self) -> None:
        if not (self.mrms > 0 and self.box > 0 and 0 < self.lowest < self.highest <= 40 and 0 <= self.slack < 0.25):
            raise ValueError("wants mrms and box above 0, 0 < lowest < highest <= 40, and slack in 0 .. 0.25")
        if self.jnd is not None and not self.jnd > 0:
            raise ValueError(f"jnd should be above 0, or none for no limit, not {self.jnd}")
        if not 1 <= self.rungs <= 200:
            raise ValueError(f"rungs should be 1 to 200, not {self.rungs}")

    finds_pieces = True

    @property
    def quick(self) -> "ShapeSpectrum":
        """See `Method.quick`: the mesh as received, in the frame that it has."""
        return replace(self, search=False) if self.search else self

    @property
    def sight(self) -> "ShapeSpectrum":
        """See `Method.sight`: the band decides what is observed; how far it is looked into is up to the reader."""
        return replace(self, mrms=0.00058, jnd=1.0, rungs=45, slack=0.04, mask="none", motion="unseen", search=True)

    @property
    def limits(self) -> dict[str, float]:
        """See `Method.limits`."""
        return {"mrms": self.mrms} | ({} if self.jnd is None else {"jnd": self.jnd})

    @property
    def takes_reference(self) -> bool:
        """A fragment is read with the cover at hand; a whole mesh needs none."""
        return True

    def embed(self, mesh: Any, bits: ArrayLike, key: Key) -> Any:
        """See `Method.embed`; ``mesh`` may also be a point cloud (see `_clouds`).

        Of the ways within ``mrms`` and ``jnd``, the one with the widest margin is taken.
        """
        message = np.asarray(bits, np.uint8).ravel()
        if is_cloud(mesh):
            from o3dmark.methods._clouds import marked_cloud

            return marked_cloud(self, mesh, message, key)
        if isinstance(mesh, Prepared):
            return _written(mesh, self._change(mesh.cover, message, _unseen))
        prepared = self.prepare(mesh, len(message), key)
        surface = prepared.cover.surface
        reads = partial(self._reads, surface, message, key)
        return _written(prepared, self._change(prepared.cover, message, reads))

    @one_thread()
    def prepare(self, mesh: Any, n_bits: int, key: Key) -> Prepared:
        """See `Method.prepare`."""
        return Prepared(mesh, self.cover(mended(Surface.of(mesh)), key, n_bits))

    @one_thread()
    def extract(self, mesh: Any, n_bits: int, key: Key, *, reference: Any = None) -> Extraction:
        """See `Method.extract`. ``mesh`` may also be a point cloud, best with normals, or what `observe` returns.

        With the unmarked cover as ``reference``, ``mesh`` may be a fragment of the marked mesh (see `fragment`). Where
        that says too little, it is read blindly as well; either has half of the evidence asked for.
        """
        hypotheses, decoder = self.observe(mesh), self.decoder(n_bits, key)
        if reference is None:
            return decoder.read(hypotheses)
        from o3dmark.methods.shape_spectrum.fragment import read_beside

        cover = self.cover(mended(Surface.of(reference)), key, n_bits)
        beside = read_beside(hypotheses.received, cover, self.steps(n_bits), n_bits).times(2)
        if beside.certainty > _CERTAIN and beside.residual is not None and beside.residual < _NEAR:
            return beside
        blind = decoder.read(hypotheses).times(2)
        clear = blind.coherence is not None and blind.coherence > _CLEAR
        return blind if clear or not beside.certainty else beside

    def observe(self, mesh: Any) -> Hypotheses:
        """See `Method.observe`: the hypotheses about a mesh or point cloud, for the readings of any number of keys."""
        if isinstance(mesh, Hypotheses):
            return mesh
        surface = surface_of_points(legacy_cloud(mesh)) if is_cloud(mesh) else Surface.of(mesh)
        return self._hypotheses(surface)

    def remade(self, reference: Any, words: Bits, key: Key) -> "Remade":
        """See `Method.remade`: here, worked out when a mesh is found to be one of the cover's."""
        from o3dmark.methods.shape_spectrum.mixture import Remade

        cover = self.prepare(reference, words.shape[1], key).cover
        return Remade(cover, words, lambda word: self._change(cover, word, _unseen))

    @one_thread()
    def mixture(self, mesh: Any, copies: "Remade", progress: Progress = silent) -> Mixture:
        """See `Method.mixture`: of a mesh whose vertices are those of the cover, moved and in any order."""
        from o3dmark.methods.shape_spectrum.mixture import mixture

        return mixture(Surface.of(mesh), copies, progress)

    def capacity(self, mesh: Any) -> int:
        """A bit for every 8 vertices off the boundary, up to 128."""
        return _room(Solid.of(mended(Surface.of(mesh))))

    @property
    def band(self) -> Band:
        return Band(self.lowest, self.highest, self.box)

    def projections(self, key: Key, n_bits: int) -> Projections:
        """The key's projections: one a bit, or several when the bits are few."""
        return Projections.of(key, self.band, FORMATS[self.format].n_projections(n_bits))

    def steps(self, n_bits: int) -> Floats:
        """The steps that writer and reader know of, largest first."""
        return FORMATS[self.format].steps(self.mrms, n_bits, self.rungs)

    def cover(self, surface: Surface, key: Key, n_bits: int) -> "Cover":
        """An unmarked surface as the writer of a key's bits sees it. Errors: CapacityError if they do not fit."""
        from o3dmark.methods.shape_spectrum.embedder import Cover

        solid = Solid.of(surface)
        if n_bits > (fits := _room(solid)):
            raise CapacityError(n_bits, fits, f"{_VERTICES_PER_BIT} vertices off the boundary a bit")
        mask = None if self.mask == "none" else _mask(surface)
        form, unseen = FORMATS[self.format].frame, self.motion == "unseen"
        return Cover(self.projections(key, n_bits), surface, solid, form, mask, unseen=unseen)

    def decoder(self, n_bits: int, key: Key) -> Decoder:
        """What reads a key's bits from the hypotheses about any mesh."""
        expected = _EXPECTED_STEP * FORMATS[self.format].share(self.mrms, n_bits)
        return Decoder(self.projections(key, n_bits), self.steps(n_bits), n_bits, expected, self.search)

    @one_thread()
    def _change(self, cover: "Cover", message: Bits, reads: Callable[[Floats], bool]) -> Floats:
        """What to ask of `Cover.moved` for the bits; those ways that can be read, as ``reads`` says of vertices.

        Errors: MeshError when there is none.
        """
        from o3dmark.methods.shape_spectrum.codewords import plans
        from o3dmark.methods.shape_spectrum.embedder import INITIAL_RATIO, Limits, least_motion

        limit = self.mrms * cover.surface.diagonal
        choices = plans(cover.comb(message), self.steps(len(message)), self.slack, limit / INITIAL_RATIO)
        change = least_motion(cover, choices, Limits(limit, np.inf if self.jnd is None else self.jnd), reads)
        if change is None:
            seen = "" if self.jnd is None else f" and {self.jnd:g} just noticeable differences"
            eye = "" if self.jnd is None else "; a smaller mrms has finer steps, a larger jnd shows more"
            raise MeshError(
                f"this mesh does not hold {len(message)} bits at an MRMS of {self.mrms} of the diagonal{seen} so that"
                f" they can be read back: it may be too slender for waves of this length, or pass through itself{eye}"
            )
        return change

    def _hypotheses(self, received: Surface) -> Hypotheses:
        return Hypotheses(received, self.band, FORMATS[self.format].frame, search=self.search)

    def _reads(self, surface: Surface, message: Bits, key: Key, vertices: Floats) -> bool:
        """Whether a surface with its vertices moved there (n, 3) tells the bits."""
        hypotheses = self._hypotheses(surface.moved(vertices))
        return np.array_equal(self.decoder(len(message), key).read(hypotheses).bits, message)


def _written(prepared: Prepared, change: Floats) -> Any:
    """The mesh that was prepared, moved for a change (K,)."""
    mesh, cover = prepared
    return with_vertices(mesh, cover.surface, cover.moved(change))


def _unseen(_: Floats) -> bool:
    """For copies that are read back by who asked for them."""
    return True


def _room(solid: Solid) -> int:
    return min(_MAX_BITS, int(solid.movable.sum()) // _VERTICES_PER_BIT)


def _mask(surface: Surface) -> Floats:
    """Mesh saliency of the vertices (n,) over its mean, within a factor of 4 up and down."""
    from o3dmark.mesh.saliency import Saliency

    saliency = Saliency().of_surface(surface)
    return np.asarray(np.clip(saliency / (saliency.mean() or 1.0), 0.25, 4.0))
