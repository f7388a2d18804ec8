"""One mark in two layers: in the solid as a whole, and in patches of its surface.

The solid's layer withstands what happens to a whole mesh; a patch needs no more than the part of the surface that
holds it. Each layer carries all the bits by itself. The patches are written last, into the surface as the first layer
left it: their waves are too short for the first to notice, and where they are read the first layer does not matter.
The reader looks at the solid first, so that a whole mesh is read as fast as without patches, and searches it last.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from o3dmark.coding.keys import Key
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface, mesh_arrays, with_vertices
from o3dmark.mesh.welding import mended
from o3dmark.methods import METHODS, Depth, Extraction, Method
from o3dmark.methods.local_patches.method import LocalPatches, Look
from o3dmark.methods.shape_spectrum.method import Prepared, ShapeSpectrum
from o3dmark.methods.shape_spectrum.search import Hypotheses
from o3dmark.registry import option

_CLEAR = 0.7  # coherence of a reading of the solid from which on patches are not asked
_CERTAIN = 0.9  # the same of the soft bits' mean magnitude, of a reading beside the cover


class Seen:
    """What a mesh shows to either layer; what patches show is worked out when it is first asked for."""

    def __init__(self, whole: Hypotheses, look: Callable[[Surface], Look]) -> None:
        self.whole, self._look = whole, look
        self._patches: Look | None = None

    @property
    def patches(self) -> Look:
        if self._patches is None:
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
    def local(self) -> LocalPatches:
        """See `Method.local`: the patches' layer."""
        return self._patches(self.total)

    @property
    def _solid(self) -> ShapeSpectrum:
        return ShapeSpectrum(mrms=self.mrms, jnd=self.jnd, search=self.search)

    def _patches(self, mrms: float) -> LocalPatches:
        return LocalPatches(mrms=mrms, jnd=self.jnd, mirrored=self.mirrored, any_scale=self.any_scale)

    def prepare(self, mesh: Any, n_bits: int, key: Key) -> Any:
        """See `Method.prepare`: for the solid's layer; patches hang on what it does."""
        return self._solid.prepare(mesh, n_bits, key)

    def embed(self, mesh: Any, bits: ArrayLike, key: Key) -> Any:
        """See `Method.embed`. A mesh without room for patches is marked as a solid alone; `layers` tell which were.

        Errors: MeshError also where the solid's layer is not read any more beside the patches.
        """
        message = np.asarray(bits, np.uint8).ravel()
        marked = self._solid.embed(mesh, message, key)
        surface = mended(Surface.of(marked))
        before, triangles = mesh_arrays(mesh.mesh if isinstance(mesh, Prepared) else mesh)
        spent = geometry.motion_mrms(before, mesh_arrays(marked)[0], triangles)
        left = float(np.sqrt(max(self.total**2 - spent**2, 0.0)))
        if not left:
            return marked
        done = self._patches(left).marked(surface, message, key)
        if not done.places:
            return marked
        both = with_vertices(marked, surface, done.vertices)
        if not np.array_equal(self._solid.quick.extract(both, len(message), key).bits, message):
            raise MeshError(
                "patches disturb the solid's layer of this mesh; use shape-spectrum alone, or a lower total"
            )
        return both

    def observe(self, mesh: Any) -> Seen:
        """See `Method.observe`."""
        return mesh if isinstance(mesh, Seen) else Seen(self._solid.observe(mesh), self.local.observe)

    def extract(self, mesh: Any, n_bits: int, key: Key, *, reference: Any = None) -> Extraction:
        """See `Method.extract`. The solid at first sight, then patches, then all that the solid's reader tries.

        With the cover as ``reference`` the solid's reader tries all at once. Of the evidence asked for patches have
        half, and each of the two looks at the solid a quarter.
        """
        seen, solid = self.observe(mesh), self._solid
        sight = solid if reference is not None else solid.quick
        first = sight.extract(seen.whole, n_bits, key, reference=reference)
        if not self.search:
            return first
        clear = first.certainty > _CERTAIN if first.coherence is None else first.coherence > _CLEAR
        if clear:
            return first.times(4)
        patches = self.local.extract(seen.patches, n_bits, key)
        if patches.part:
            return patches.times(2).beside(first.times(4))
        if reference is None:
            first = solid.extract(seen.whole, n_bits, key)
        return first.times(4).beside(patches.times(2))

    def capacity(self, mesh: Any) -> int:
        """That of the solid."""
        return self._solid.capacity(mesh)
