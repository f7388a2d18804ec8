"""The mark in patches of the surface: a fragment that holds one of them tells the message.

embed      TriangleMesh -> surface -> places -> the cheapest motion in each patch -> TriangleMesh
extract    TriangleMesh -> surface -> every place, at every angle -> the patches that agree with the key -> bits

A patch is what a cylinder holds that stands on the surface; what it measures hangs on nothing outside (`measuring`).
The scalar Costa scheme acts on its coefficients of functions on the disk (`disk`), some of which are pilots, by which
the reader knows a patch, its place and its angle (`codewords`, `search`). Writer and reader share the key, the options
and a ladder of radii in the file's own unit, so that a part is as easily read as the whole, in any pose, cut out,
pasted or joined to other things; a fragment at another scale is not found.

The writer sets patches where they are found again and not seen, each as strong as its surroundings hide (`places`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from o3dmark.arrays import Ints
from o3dmark.coding.detection import together
from o3dmark.coding.keys import Key
from o3dmark.errors import CapacityError, MeshError
from o3dmark.mesh.reconstruction import surface_of_points
from o3dmark.mesh.surface import Surface, is_cloud, legacy_cloud, with_vertices
from o3dmark.mesh.welding import mended
from o3dmark.methods import METHODS, Depth, Extraction, Method
from o3dmark.methods.local_patches.codewords import Share
from o3dmark.methods.local_patches.format import FORMATS, PatchFormat
from o3dmark.methods.local_patches.measuring import Sampled
from o3dmark.methods.local_patches.places import Limits, Marked, candidates, spread, written
from o3dmark.methods.local_patches.search import (
    OUTSIDE,
    REVERSED,
    Hit,
    Seen,
    Side,
    believed,
    mean_edge,
    radii,
    radii_of_any_scale,
)
from o3dmark.registry import option
from o3dmark.threads import one_thread

_MAX_BITS = 128
_COARSE = 0.2  # mean edge over the radius, above which a larger one is taken
_NOISY, _CLEAN = 0.1, 0.97  # agreement over the highest, below and above which patches weigh alike


class Room(NamedTuple):
    """The vertices (k,) where a surface has room for patches, and of which radius."""

    radius: float
    places: Ints


@dataclass(frozen=True, eq=False)
class Look:
    """What a surface shows at each radius where it may have patches, in its own unit of length."""

    form: PatchFormat
    surface: Surface
    seen: tuple[Seen, ...]

    @classmethod
    def at(cls, form: PatchFormat, surface: Surface) -> "Look":
        """Of a surface as it is."""
        seen = tuple(Seen(Sampled(form, surface, radius)) for radius in radii(form, surface))
        return cls(form, surface, seen)

    @cached_property
    def any_scale(self) -> tuple[Seen, ...]:
        """The same in any unit."""
        return tuple(Seen(Sampled(self.form, self.surface, radius)) for radius in radii_of_any_scale(self.surface))


@METHODS.register("local-patches")
@dataclass(frozen=True)
class LocalPatches(Method):
    """SCS in patches of the surface, each of which carries the bits; blind, and read from fragments too."""

    claims = ("identity", "reorder", "similarity:smallest=1,largest=1", "crop:share=0.3", "quantise:bits=12")

    mrms: float = option(4e-4, "most distortion, over the bounding-box diagonal: patches are written until then")
    jnd: float = option(1.0, "most that may be seen of a patch, nearly, in just noticeable differences")
    radius: float = option(0.068, "of patches, over the root of the surface's area; the nearest of the ladder is taken")
    format: Literal["2026"] = option("2026", "what else writer and reader agree on")
    search: bool = option(True, "let the reader look at every radius, and not at that of a whole surface alone")
    mirrored: bool = option(False, "let it also look at surfaces as if mirrored, or turned inside out")
    any_scale: bool = option(False, "let it try every scale, for fragments whose unit was changed")

    def __post_init__(self) -> None:
        if not (self.mrms > 0 and self.jnd > 0 and 0.01 <= self.radius <= 0.5):
            raise ValueError("wants mrms and jnd above 0, and radius in 0.01 .. 0.5")

    @property
    def quick(self) -> "LocalPatches":
        """See `Method.quick`: a surface that may be whole."""
        return replace(self, search=False, mirrored=False, any_scale=False) if self.search else self

    def searching(self, depth: Depth) -> "LocalPatches":
        """See `Method.searching`."""
        return replace(self, **depth._asdict())

    @property
    def sight(self) -> "LocalPatches":
        """See `Method.sight`: the format decides what is observed."""
        return LocalPatches(format=self.format)

    @property
    def local(self) -> "LocalPatches":
        """See `Method.local`."""
        return self

    def embed(self, mesh: Any, bits: ArrayLike, key: Key) -> Any:
        """See `Method.embed`. Errors: MeshError also where no patch fits, or none that nobody sees."""
        surface = mended(Surface.of(mesh))
        marked = self.marked(surface, np.asarray(bits, np.uint8).ravel(), key)
        if not marked.places:
            raise MeshError(
                "no patch of the surface holds the bits unseen: it may be too thin or too coarse for patches, or so"
                " smooth that they would show (the option jnd)"
            )
        return with_vertices(mesh, surface, marked.vertices)

    @one_thread()
    def room(self, surface: Surface) -> Room:
        """Where a surface that is yet to be moved a little has room for patches, whatever the key and the bits."""
        sampled = Sampled(FORMATS[self.format], surface, self.radius_on(surface))
        return Room(sampled.radius, candidates(sampled))

    @one_thread()
    def marked(self, surface: Surface, bits: np.ndarray, key: Key, room: Room | None = None) -> Marked:
        """A surface with all the patches that it takes, maybe none. Errors: CapacityError for too many bits.

        ``room``: that of what it was before a little motion; None: it is looked for everywhere.
        """
        if len(bits) > _MAX_BITS:
            raise CapacityError(len(bits), _MAX_BITS)
        form, most = FORMATS[self.format], Limits(self.mrms * surface.diagonal, self.jnd)
        radius, places = room or Room(self.radius_on(surface), spread(surface))
        return written(Sampled(form, surface, radius), Share.all_of(key, form, len(bits)), bits, most, places)

    def radius_on(self, surface: Surface) -> float:
        """The radius of the patches that a surface gets, in its unit."""
        form = FORMATS[self.format]
        radius, edge = form.nearest_rung(self.radius * np.sqrt(surface.area)), mean_edge(surface)
        while edge > _COARSE * radius:
            radius *= form.ratio
        return radius

    @one_thread()
    def extract(self, mesh: Any, n_bits: int, key: Key, *, reference: Any = None) -> Extraction:
        """See `Method.extract`. ``mesh`` may also be a point cloud, or what `observe` returns."""
        if reference is not None:
            raise MeshError("local-patches reads without a reference")
        look, shares = self.observe(mesh), Share.all_of(key, FORMATS[self.format], n_bits)
        candidates: list[Hit] = []
        for seen, sides, times in self._looks(look):
            here = seen.candidates(shares, times, sides)
            candidates += here
            if hits := believed(here):
                return _told(hits, candidates, n_bits)
        candidates.sort(key=lambda hit: hit.log10_p)
        return _told(candidates[:1], candidates, n_bits)

    def _looks(self, look: Look) -> Iterator[tuple[Seen, Sequence[Side], int]]:
        """Where to look, how, and among how many; every stage that is asked for has as much of the evidence."""
        stages: list[tuple[tuple[Seen, ...], Sequence[Side]]]
        stages = [(look.seen if self.search else self._likely(look), (OUTSIDE,))]
        if self.search and self.mirrored:
            stages.append((look.seen, REVERSED))
        if self.search and self.any_scale:
            stages.append((look.any_scale, (OUTSIDE, *REVERSED) if self.mirrored else (OUTSIDE,)))
        for seen, sides in stages:
            yield from ((each, sides, len(seen) * len(stages)) for each in seen)

    def _likely(self, look: Look) -> tuple[Seen, ...]:
        """What is seen at the radius that patches have if the surface is whole."""
        if not look.seen:
            return ()
        radius = self.radius_on(look.seen[0].sampled.surface)
        return tuple(seen for seen in look.seen if np.isclose(seen.sampled.radius, radius))

    def observe(self, mesh: Any) -> Look:
        """See `Method.observe`."""
        if isinstance(mesh, Look):
            return mesh
        surface = surface_of_points(legacy_cloud(mesh)) if is_cloud(mesh) else Surface.of(mesh)
        return Look.at(FORMATS[self.format], mended(surface))

    def capacity(self, mesh: Any) -> int:  # noqa: ARG002
        """128 bits, of any mesh that holds a patch at all."""
        return _MAX_BITS


def _told(hits: Sequence[Hit], candidates: Sequence[Hit], n_bits: int) -> Extraction:
    """What patches say together, and what each of the candidates says alone: half of the evidence asked for is theirs.

    Candidates are chosen by where values stand within half a period, so that their bits are fair coins still.
    """
    total, trust = np.zeros(n_bits), np.zeros(n_bits)
    for hit in hits:
        clean = np.clip(hit.agreement / hit.share.most, _NOISY, _CLEAN)
        weight = clean / (1.0 - clean**2)
        total += weight * hit.share.soft(hit.phase, n_bits)
        trust += weight * np.bincount(hit.share.bit, minlength=n_bits)
    soft = np.divide(total, trust, out=np.zeros(n_bits), where=trust > 0.0)
    alone = [hit.share.soft(hit.phase, n_bits) for hit in candidates]
    charges = np.array([2] + [2 * len(candidates)] * len(candidates), np.int64)
    readings = np.array([soft, *alone])
    kinds = {hit.share.kind for hit in hits}
    surest = [min(hit.log10_p for hit in hits if hit.share.kind == kind) for kind in kinds]
    spoke = tuple(hit.patch.cylinder for hit in believed(hits))
    words = f"{len(spoke)} patch" + "es" * (len(spoke) > 1) if spoke else ""
    return Extraction(
        soft,
        hypotheses=2,
        part=words,
        view="as received",
        step=hits[0].strength if hits else None,
        readings=readings,
        charges=charges,
        log10_p=together(surest) if hits else 0.0,
        patches=spoke,
    )
