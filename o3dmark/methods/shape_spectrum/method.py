"""The mark in function space: the scalar Costa scheme on random projections of the Fourier transform of the solid.

    TriangleMesh -> solid -> canonical frame -> spectrum -> keyed projections -> codewords
                 -> the least motion of the surface that takes the projections there -> TriangleMesh

and back: the reader measures the same projections. Each is an integral over the solid, so vertices, their order, their
number and their noise hardly matter. Nothing but the key and the options is shared: the quantisation step lies on a
ladder that the reader walks, and the frame follows from the mesh in hand.

What an attack does to the projections is, in the main, to disturb the frame, to flatten the surface between the
vertices that are left, and to smooth it. The reader therefore tries, in this order and until a reading is beyond doubt:

    as received    the values as they are; then with the frame's seven parameters fitted
    bulging        with one more parameter: how far the surface bulges out between its vertices
    mirrored       and every other way in which the axes may lie
    unsmoothed     the surface before 1, 2, 3 ... passes of umbrella, Taubin or HC smoothing, by their inverse

A reading is judged by how near its values are to codewords of either bit, a statistic that has a p-value for every
mesh (see `scs.coherence_log10p`). The judgement looks at the values modulo half a period only; given those, under a
wrong key, each bit remains a fair coin. All the readings tried are counted nevertheless.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from o3dmark.arrays import Floats
from o3dmark.coding.keys import Key
from o3dmark.errors import CapacityError, MeshError
from o3dmark.mesh.reconstruction import surface_of_cloud
from o3dmark.mesh.saliency import Saliency
from o3dmark.mesh.surface import PointCloud, Surface, with_vertices
from o3dmark.methods import METHODS, Extraction, Method
from o3dmark.methods.shape_spectrum.codewords import Plan, plans
from o3dmark.methods.shape_spectrum.decoder import Reader
from o3dmark.methods.shape_spectrum.embedder import Cover
from o3dmark.methods.shape_spectrum.fragment import read_fragment
from o3dmark.methods.shape_spectrum.hypotheses import Sights
from o3dmark.methods.shape_spectrum.projections import Projections
from o3dmark.registry import option
from o3dmark.solid.solid import Solid, normal_rms
from o3dmark.solid.spectrum import Band

_TOP = 14.0  # the power of 1.07 at the top of the ladder of steps; at 0 is the one that the options suggest
_SPREAD = 265.0  # steps over mrms / sqrt(bits), in the middle of the ladder; lengths over the radius of gyration
_USUAL = 3.7  # steps over the same times the extent, as meshes take them: 3.1 to 4.3, thin sheets down to 1.8
_LEAST_PROJECTIONS = 32  # fewer could not tell the frame's seven parameters
_VERTICES_A_BIT = 8
_MOST_BITS = 128
_HOPE = 0.9  # the real motion over the planned one, before any was carried out: folds and creases save some
_SAFE = 0.995  # of the limit, for what a first-order distance leaves out
_WILD = 1.2  # and as much as one of them that went astray may count for
_TRIES = 16  # plans carried out before the mesh is refused
_EXACT = 1e-3  # of a step: where Newton's method may stop


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
    lowest: float = option(4.0, "longest waves used, as the number that fit in the box")
    highest: float = option(12.0, "shortest waves used, as the number that fit in the box")
    box: float = option(6.0, "side of the box, over the radius of gyration")
    slack: float = option(0.04, "how far from its codeword a value may stay, in steps, where that buys a longer step")
    rungs: int = option(45, "steps that writer and reader know of, each 7 % smaller; slender shapes need more")
    mask: Literal["none", "saliency"] = option("none", "where the surface moves more: nowhere, or where it is salient")
    search: bool = option(True, "let the reader fit the frame and undo smoothing")

    def __post_init__(self) -> None:
        if not (self.mrms > 0 and self.box > 0 and 0 < self.lowest < self.highest <= 40 and 0 <= self.slack < 0.25):
            raise ValueError("wants mrms and box above 0, 0 < lowest < highest <= 40, and slack in 0 .. 0.25")
        if not 1 <= self.rungs <= 200:
            raise ValueError(f"rungs should be 1 to 200, not {self.rungs}")

    @property
    def takes_reference(self) -> bool:
        """A fragment is read with the cover at hand; a whole mesh needs none."""
        return True

    def embed(self, mesh: Any, bits: ArrayLike, key: Key) -> Any:
        """See `Method.embed`. Of the ways that keep within ``mrms``, the one with the widest margin is taken."""
        surface, message = Surface.of(mesh), np.asarray(bits, np.uint8).ravel()
        cover = self.cover(surface, key, len(message))
        wanted = np.resize(message, len(cover.projections)).astype(np.float64)
        limit, real = self.mrms * surface.diagonal, [_HOPE]  # real motions over planned ones
        for plan in self._plans(cover, wanted, limit / _HOPE):
            if len(real) > _TRIES:
                break
            if plan.size * float(np.mean(real)) > limit:
                continue
            vertices, missed = cover.changed(plan.change, _EXACT * plan.step)
            size = normal_rms(cover.solid, vertices - surface.vertices)
            real.append(min(size / plan.size, _WILD))
            good = missed < 10.0 * _EXACT * plan.step and size <= _SAFE * limit
            if good and self._reads(surface.moved(vertices), message, key):
                return with_vertices(mesh, surface, vertices)
        raise MeshError(
            f"this mesh does not hold {len(message)} bits at an MRMS of {self.mrms} of the diagonal so that they can be"
            " read back; a slender one may with shorter waves and more rungs (lowest=8,highest=24,rungs=60, as profile"
            " slender-2026 has them), others with fewer bits, another mrms, or self-intersections repaired"
        )

    def extract(self, mesh: Any, n_bits: int, key: Key, *, reference: Any = None) -> Extraction:
        """See `Method.extract`. ``mesh`` may also be a point cloud, best with normals.

        With the unmarked cover as ``reference``, ``mesh`` may be a fragment of the marked mesh (see `_informed`).
        """
        if reference is None:
            return self.reader(n_bits, key).read(self.sights(mesh))
        cover = self.cover(Surface.of(reference), key, n_bits)
        return read_fragment(_surface(mesh), cover, self.steps(n_bits), n_bits)

    def capacity(self, mesh: Any) -> int:
        """A bit for every 8 vertices off the borders, up to 128."""
        return _room(Solid.of(Surface.of(mesh)))

    @property
    def band(self) -> Band:
        return Band(self.lowest, self.highest, self.box)

    def projections(self, key: Key, n_bits: int) -> Projections:
        """The key's projections: one a bit, or several when the bits are few."""
        return Projections.of(key, self.band, n_bits * max(1, _LEAST_PROJECTIONS // n_bits))

    def cover(self, surface: Surface, key: Key, n_bits: int) -> Cover:
        """An unmarked surface as the writer of a key's bits sees it. Errors: CapacityError if they do not fit."""
        solid = Solid.of(surface)
        if n_bits > (fits := _room(solid)):
            raise CapacityError(n_bits, fits, f"{_VERTICES_A_BIT} vertices off the borders a bit")
        mask = None if self.mask == "none" else _mask(surface)
        return Cover(self.projections(key, n_bits), surface, solid, mask)

    def steps(self, n_bits: int) -> Floats:
        """The steps that writer and reader know of, largest first; a value is a volume over the scale cubed."""
        return np.asarray(1.07 ** np.arange(_TOP, _TOP - self.rungs, -1.0) * _SPREAD * self._per_value(n_bits))

    def _per_value(self, n_bits: int) -> float:
        """The distortion allowed, shared out among the values in their sum of squares."""
        return self.mrms / float(np.sqrt(max(n_bits, _LEAST_PROJECTIONS)))

    def reader(self, n_bits: int, key: Key) -> Reader:
        """What reads a key's bits from the sights of any mesh."""
        usual = _USUAL * self._per_value(n_bits)
        return Reader(self.projections(key, n_bits), self.steps(n_bits), n_bits, usual)

    def sights(self, mesh: Any) -> Sights:
        """What there is to see in a mesh or point cloud, for the readers of any number of keys."""
        return Sights(_surface(mesh), self.band, search=self.search)

    def _plans(self, cover: Cover, wanted: Floats, limit: float) -> list[Plan]:
        steps = self.steps(len(wanted))
        return plans(cover.values, wanted, cover.projections.dither, steps, cover.cost, self.slack, limit)

    def _reads(self, marked: Surface, message: NDArray[np.uint8], key: Key) -> bool:
        seen = Sights(marked, self.band, search=self.search)
        return np.array_equal(self.reader(len(message), key).read(seen).bits, message)


def _room(solid: Solid) -> int:
    return min(_MOST_BITS, int(solid.movable.sum()) // _VERTICES_A_BIT)


def _surface(mesh: Any) -> Surface:
    """The surface of a mesh, or through a point cloud."""
    is_cloud = isinstance(mesh, PointCloud)  # type: ignore[misc]
    return surface_of_cloud(mesh) if is_cloud else Surface.of(mesh)


def _mask(surface: Surface) -> Floats:
    """Mesh saliency of the vertices (n,) over its mean, within a factor of 4 up and down."""
    saliency = Saliency().of_surface(surface)
    return np.asarray(np.clip(saliency / (saliency.mean() or 1.0), 0.25, 4.0))
