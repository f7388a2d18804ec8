"""One mark in two layers: in the solid as a whole, and in patches of its surface.

The solid's layer withstands what happens to a whole mesh; a patch needs no more than the part of the surface that
holds it. Each layer carries all the bits by itself. The patches are written last, into the surface as the first layer
left it: their waves are too short for the first to notice, and where they are read the first layer does not matter.
The reader looks at the solid first, so that a whole mesh is read as fast as without patches. What is not read then is a
fragment, or a whole that was changed much. An open surface is taken for the first, and patches are asked before the
solid is searched; a closed one for the second. What comes second is asked too.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from o3dmark.arrays import Bits
from o3dmark.coding.collusion import Mixture
from o3dmark.coding.keys import Key
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface, is_cloud, mesh_arrays, with_vertices
from o3dmark.mesh.welding import mended, open_edges
from o3dmark.methods import METHODS, Depth, Extraction, Method, Progress, silent
from o3dmark.methods.shape_spectrum import method as shape_spectrum
from o3dmark.methods.shape_spectrum.method import ShapeSpectrum
from o3dmark.methods.shape_spectrum.search import Hypotheses
from o3dmark.registry import option

if TYPE_CHECKING:  # the patches' layer is imported when it is asked: a whole mesh is read without it
    from o3dmark.methods.local_patches.method import LocalPatches, Look, Room

_CLEAR = 0.7  # coherence of a reading of the solid from which on patches are not asked
_CERTAIN = 0.9  # the same of the soft bits' mean magnitude, of a reading beside the cover


class Prepared(NamedTuple):
    """A mesh about to be marked: as given, as the solid's writer sees it, and where it has room for patches."""

    mesh: Any
    solid: shape_spectrum.Prepared
    room: "Room"


class Seen:
    """What a mesh shows to either layer; what patches show is worked out when it is first asked for.

    Points show none: the surface through them has its vertices elsewhere each time.
    """

    def __init__(self, whole: Hypotheses, look: "Callable[[Surface], Look] | None") -> None:
        self.whole, self._look = whole, look
        self._patches: Look | None = None

    @property
    def patches(self) -> "Look | None":
        if self._patches is None and self._look is not None:
            self._patches = self._look(self.whole.received)
        return self._patches


@METHODS.register("layered")
@dataclass(frozen=True)
class Layered(Method):
    """shape-spectrum and local-patches in one mesh; blind, read from the whole or from a fragment."""

    claims = (
        "identity",
        "reorder",
        "similarity",
        "noise:amplitude=0.003",
        "crop:share=0.3",
    )

    mrms: float = option(5.8e-4, "distortion that the solid's layer aims at, over the bounding-box diagonal")
    total: float = option(6e-4, "most distortion by both layers, over the same: patches take what is left, in squares")
    jnd: float = option(1.0, "most that may be seen of either layer, in just noticeable differences")
    search: bool = option(True, "let the reader search, and ask the patches")
    mirrored: bool = option(False, "let it look for mirrored patches, too, and for those turned inside out")
    any_scale: bool = option(False, "let it look for patches of every scale, for fragments whose unit was changed")

    def __post_init__(self) -> None:
        if not (0 < self.mrms < self.total and self.jnd > 0):
            raise ValueError("wants 0 < mrms < total, and jnd above 0")

    finds_pieces = True

    @property
    def quick(self) -> "Layered":
        """See `Method.quick`: the solid at first sight."""
        return replace(self, search=False, mirrored=False, any_scale=False) if self.search else self

    def searching(self, depth: Depth) -> "Layered":
        """See `Method.searching`: of the patches, since the solid is read so without being asked."""
        return replace(self, **depth._asdict())

    @property
    def sight(self) -> Method:
        """See `Method.sight`: that of the solid's layer, whose observations know the surface that patches see."""
        return self._solid.sight

    @property
    def limits(self) -> dict[str, float]:
        """See `Method.limits`: of both layers together."""
        return {"mrms": self.total, "jnd": self.jnd}

    @property
    def takes_reference(self) -> bool:
        """The solid's layer can use the cover."""
        return True

    @property
    def layers(self) -> dict[str, Method]:
        """The solid's, and the patches'."""
        return {"solid": self._solid, "patches": self.local}

    @property
    def local(self) -> "LocalPatches":
        """See `Method.local`: the patches' layer."""
        return self._patches(self.total)

    @property
    def _solid(self) -> ShapeSpectrum:
        return ShapeSpectrum(mrms=self.mrms, jnd=self.jnd, search=self.search)

    def _patches(self, mrms: float) -> "LocalPatches":
        from o3dmark.methods.local_patches.method import LocalPatches

        return LocalPatches(mrms=mrms, jnd=self.jnd, mirrored=self.mirrored, any_scale=self.any_scale)

    def prepare(self, mesh: Any, n_bits: int, key: Key) -> Prepared:
        """See `Method.prepare`."""
        room = self.local.room(mended(Surface.of(mesh)))
        return Prepared(mesh, self._solid.prepare(mesh, n_bits, key), room)

    def embed(self, mesh: Any, bits: ArrayLike, key: Key) -> Any:
        """See `Method.embed`. A mesh without room for patches is marked as a solid alone; `layers` tell which were.

        So is one whose solid's layer would not be read any more beside the patches; and a point cloud, whose points are
        no vertices to find patches from.
        """
        message = np.asarray(bits, np.uint8).ravel()
        if is_cloud(mesh):
            return self._solid.embed(mesh, message, key)
        if isinstance(mesh, Prepared):
            return self._with_patches(mesh.mesh, self._solid.embed(mesh.solid, message, key), message, key, mesh.room)
        marked = self._solid.embed(mesh, message, key)
        both = self._with_patches(mesh, marked, message, key)
        return both if np.array_equal(self._solid.quick.extract(both, len(message), key).bits, message) else marked

    def _with_patches(self, cover: Any, marked: Any, message: Bits, key: Key, room: "Room | None" = None) -> Any:
        """A cover whose solid is marked with patches besides, as many as the budget has left."""
        before, triangles = mesh_arrays(cover)
        spent = geometry.motion_mrms(before, mesh_arrays(marked)[0], triangles)
        left = float(np.sqrt(max(self.total**2 - spent**2, 0.0)))
        if not left:
            return marked
        surface = mended(Surface.of(marked))
        done = self._patches(left).marked(surface, message, key, room)
        return with_vertices(marked, surface, done.vertices) if done.places else marked

    def remade(self, reference: Any, words: Bits, key: Key) -> Any:
        """See `Method.remade`: in the solid's layer."""
        return self._solid.remade(reference, words, key)

    def mixture(self, mesh: Any, copies: Any, progress: Progress = silent) -> Mixture:
        """See `Method.mixture`: by the solid's layer, to which patches are noise."""
        return self._solid.mixture(mesh, copies, progress)

    def observe(self, mesh: Any) -> Seen:
        """See `Method.observe`."""
        if isinstance(mesh, Seen):
            return mesh
        look = None if is_cloud(mesh) else lambda surface: self.local.observe(surface)
        return Seen(self._solid.observe(mesh), look)

    def extract(self, mesh: Any, n_bits: int, key: Key, *, reference: Any = None) -> Extraction:
        """See `Method.extract`. The solid at first sight; then patches, and all that the solid's reader tries.

        With the cover as ``reference`` the solid's reader tries all at once. Of the evidence asked for patches have
        half, and each of the two looks at the solid a quarter, in whatever order they come.
        """
        seen, solid = self.observe(mesh), self._solid
        sight = solid if reference is not None else solid.quick
        first = sight.extract(seen.whole, n_bits, key, reference=reference)
        if not self.search:
            return first
        first = first.times(4)
        if _is_clear(first):
            return first
        whole = reference is None and not open_edges(seen.whole.received)
        if whole:
            first = solid.extract(seen.whole, n_bits, key).times(4)
            if _is_clear(first):
                return first
        patches = None if seen.patches is None else self.local.extract(seen.patches, n_bits, key).times(2)
        if patches is not None and patches.part:
            return patches.beside(first)
        if reference is None and not whole:
            first = solid.extract(seen.whole, n_bits, key).times(4)
        return first if patches is None else first.beside(patches)

    def capacity(self, mesh: Any) -> int:
        """That of the solid."""
        return self._solid.capacity(mesh)


def _is_clear(solid: Extraction) -> bool:
    """Whether patches need not be asked beside what the solid told."""
    return solid.certainty > _CERTAIN if solid.coherence is None else solid.coherence > _CLEAR
