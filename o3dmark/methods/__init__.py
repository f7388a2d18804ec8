"""Watermarking methods: each is one file or one package of this folder, found by being there.

Method.embed     mesh, bits, key        -> mesh
Method.extract   mesh, n_bits, key      -> Extraction: soft bits, and how many readings were tried for them
"""

import abc
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from o3dmark.arrays import Bits, Floats, Ints
from o3dmark.coding.collusion import Mixture
from o3dmark.coding.detection import Detection, charge, detect
from o3dmark.coding.keys import Key
from o3dmark.mesh.patch import Patch
from o3dmark.registry import Registry

METHODS: "Registry[Method]" = Registry("method", __name__)
Progress: TypeAlias = Callable[[int, int], None]
"""Is told how much is done, of how much."""


def silent(done: int, of: int) -> None:
    """Progress that nobody watches."""


@dataclass(frozen=True, eq=False)
class Extraction:
    """What a method read: ``soft`` (n_bits,), positive for 1, negative for 0, the magnitude is the trust in it.

    hypotheses   readings (steps, smoothings, frames, ...) among which this one was chosen; p-values are charged for all
    part         what of the mesh was looked at: empty for all of it, "outermost", "piece 2, by area", ...
    view         how it was looked at, in words: "as received", "mirrored", ...
    step         quantisation step of the reading, in the method's unit; None where nothing was read
    smoothing    name of the filter that was undone, None for none; ``passes`` of it
    fitted       whether parameters of the view were fitted to the codewords
    coherence    how near the values are to codewords of either bit: 1 on them, about 0 at random; None if unknown
    residual     how far the mesh is off the reference after all that was fitted, over the diagonal; None without one
    readings     (h, n_bits) soft bits of all readings, where the method keeps them, for those who know the bits
    log10_p      of the probability that values under a wrong key agree so well with codewords, of whatever bits, all
                 that was tried charged; None where the method does not tell
    patches      of the received surface those that spoke, the surest first; none where it spoke as a whole, or not
    charges      (h,) by how much the p-value of each of these grows; the sum of the inverses is 1 at most. None: by
                 ``hypotheses``, or their number
    """

    soft: Floats
    hypotheses: int = 1
    part: str = ""
    view: str = ""
    step: float | None = None
    smoothing: str | None = None
    passes: int = 0
    fitted: bool = False
    coherence: float | None = None
    residual: float | None = None
    readings: Floats | None = None
    charges: Ints | None = None
    log10_p: float | None = None
    patches: tuple[Patch, ...] = ()

    @property
    def bits(self) -> Bits:
        """Hard decisions (n_bits,), 0 or 1."""
        return (self.soft > 0).astype(np.uint8)

    @property
    def note(self) -> str:
        """The fields above as a line for people."""
        undone = f"{self.passes} passes of {self.smoothing} smoothing undone" if self.smoothing else ""
        step = "" if self.step is None else f"step {self.step:.5f}"
        return ", ".join(filter(None, (self.part, self.view, undone, "frame fitted" if self.fitted else "", step)))

    def which(self) -> dict[str, Any]:
        """Which reading it was: the fields that say so, by name, ready for JSON."""
        names = ("part", "view", "step", "smoothing", "passes", "fitted", "coherence")
        return {name: getattr(self, name) for name in names}

    @property
    def certainty(self) -> float:
        """Mean magnitude of the soft bits, 0 to 1: it looks at values modulo half a period, not at what they say."""
        return float(np.abs(self.soft).mean())

    @property
    def charged(self) -> "list[tuple[Floats, int]]":
        """Readings (h, n_bits) that are charged alike, and by how much."""
        if self.readings is None or not len(self.readings):
            return [(self.soft[None], self.hypotheses)]
        if self.charges is None:
            return [(self.readings, max(self.hypotheses, len(self.readings)))]
        return [(self.readings[self.charges == each], int(each)) for each in np.unique(self.charges)]

    def times(self, count: int) -> "Extraction":
        """The same, chosen among those of so many looks of the like."""
        kept = 0 if self.readings is None or self.charges is not None else len(self.readings)
        charges = None if self.charges is None else self.charges * count
        log10_p = None if self.log10_p is None else charge(self.log10_p, count)
        return replace(self, hypotheses=max(self.hypotheses, kept) * count, charges=charges, log10_p=log10_p)

    def beside(self, other: "Extraction") -> "Extraction":
        """The same, preferred to another of the same mesh whose readings may be asked too; both charged already."""
        parts = [(readings, tries) for each in (self, other) for readings, tries in each.charged]
        readings = np.concatenate([readings for readings, _ in parts])
        charges = np.concatenate([np.full(len(readings), tries, np.int64) for readings, tries in parts])
        return replace(self, readings=readings, charges=charges)

    def nearest(self, bits: ArrayLike) -> "Extraction":
        """The reading that agrees best with ``bits`` (n_bits,), 0 or 1; all are charged."""
        if self.readings is None or not len(self.readings):
            return self
        signs = 2.0 * np.asarray(bits, np.float64) - 1.0
        found = []
        for readings, tries in self.charged:
            agreement = readings @ signs / np.maximum(np.linalg.norm(readings, axis=1), 1e-12)
            best = np.asarray(readings[np.argmax(agreement)], np.float64)
            found.append(Extraction(best, tries, view="the reading nearest to the known bits"))
        return min(found, key=lambda each: detect(each.soft, bits, hypotheses=each.hypotheses).log10_p)

    def detect(self, bits: ArrayLike, *, false_positive_rate: float = 1e-6) -> Detection:
        """Test for known ``bits`` (n,): of all readings the one that agrees best, every one charged.

        What the values show whatever their bits is taken into account, where the method tells.
        """
        read = self.nearest(bits)
        found = detect(read.soft, bits, false_positive_rate=false_positive_rate, hypotheses=read.hypotheses)
        if self.log10_p is None:
            return found
        rate, tries, shown = false_positive_rate, self.hypotheses, self.log10_p
        chosen = detect(self.soft, bits, false_positive_rate=rate, hypotheses=tries, shown=shown)
        best = min(found, chosen, key=lambda each: each.log10_p)
        return replace(best, log10_p=charge(best.log10_p, 2))


class Depth(NamedTuple):
    """What a reader is to look for beyond what it does by itself, where its method can.

    mirrored     fragments that were mirrored, or turned inside out
    any_scale    fragments whose unit of length was changed
    """

    mirrored: bool = False
    any_scale: bool = False


NO_DEEPER = Depth()


@dataclass(frozen=True)
class Method(abc.ABC):
    """A way to hide bits in a mesh. Options are the fields; a mesh, a key and bits are the data."""

    name: ClassVar[str] = ""
    finds_pieces: ClassVar[bool] = False  # whether it looks by itself at all that a surface may be (see `received`)
    needs_semi_regular: ClassVar[bool] = False  # whether it refuses all but semi-regular meshes (`mesh.semi_regular`)
    claims: ClassVar[tuple[str, ...]] = ()  # attacks that 16 bits must survive: the contract tests

    @property
    def quick(self) -> "Method":
        """The method that only looks at first sight; itself, where there is no difference."""
        return self

    def searching(self, depth: Depth) -> "Method":  # noqa: ARG002
        """The method that looks for these as well; itself, where it does not know the difference."""
        return self

    @property
    def sight(self) -> "Method":
        """A method that observes the same in a mesh: what one has observed another with the same sight takes."""
        return self

    @property
    def layers(self) -> "dict[str, Method]":
        """Methods that each carry the bits in their own way, by name, where this one is made up of several."""
        return {}

    @property
    def local(self) -> "Method | None":
        """What reads patches of the surface, each by itself; None where the surface speaks as a whole alone."""
        return None

    @property
    def limits(self) -> dict[str, float]:
        """What a mark may cost at most, by the name of the metric: "mrms", "jnd", or none of them."""
        return {}

    @property
    def informed(self) -> bool:
        """Whether extraction needs the cover mesh as its reference."""
        return False

    @property
    def takes_reference(self) -> bool:
        """Whether extraction can use the cover mesh as its reference."""
        return self.informed

    @abc.abstractmethod
    def embed(self, mesh: Any, bits: ArrayLike, key: Key) -> Any:
        """A copy of ``mesh`` (Open3D's, `MeshArrays`, or what `prepare` returns) that carries ``bits`` (n,).

        Errors: MeshError for a mesh that cannot carry a mark, CapacityError (says how many fit) for too many bits.
        """

    def prepare(self, mesh: Any, n_bits: int, key: Key) -> Any:  # noqa: ARG002
        """What `embed` finds out of ``mesh`` whatever the bits, once; it takes that in place of the mesh.

        For copies of one mesh that differ in their bits. Such a copy is not read back by `embed`: who asks for it
        reads what he writes. Errors: as in `embed`.
        """
        return mesh

    def observe(self, mesh: Any) -> Any:
        """What ``mesh`` shows whatever the key, worked out once; `extract` takes it in place of the mesh.

        For readings of one mesh under many keys. Errors: MeshError as in `extract`.
        """
        return mesh

    @abc.abstractmethod
    def extract(self, mesh: Any, n_bits: int, key: Key, *, reference: Any = None) -> Extraction:
        """Read ``n_bits`` soft bits. ``reference``, the cover mesh, is for methods that take one; others refuse it."""

    def remade(self, reference: Any, words: Bits, key: Key) -> Any:  # noqa: ARG002
        """The copies of a cover, ``reference``, that carry ``words`` (N, n_bits), for `mixture`.

        Errors: MeshError as in `embed`.
        """
        return None

    def mixture(self, mesh: Any, copies: Any, progress: Progress = silent) -> Mixture:  # noqa: ARG002
        """What ``mesh`` shows of ``copies``, as `remade` returns them; nothing, for methods that cannot say.

        ``progress`` is told how many of how many copies have been made again, where that takes long.
        """
        return Mixture()

    @abc.abstractmethod
    def capacity(self, mesh: Any) -> int:
        """The number of bits that ``mesh`` can carry at most."""


if TYPE_CHECKING:  # every registered class can be imported from here; a test says so
    from o3dmark.methods.cho2007_mean import Cho2007Mean as Cho2007Mean
    from o3dmark.methods.cho2007_variance import Cho2007Variance as Cho2007Variance
    from o3dmark.methods.hamidi2017 import Hamidi2017 as Hamidi2017
    from o3dmark.methods.hamidi2019 import Hamidi2019 as Hamidi2019
    from o3dmark.methods.layered import Layered as Layered
    from o3dmark.methods.local_patches.method import LocalPatches as LocalPatches
    from o3dmark.methods.nakazawa2010 import Nakazawa2010 as Nakazawa2010
    from o3dmark.methods.rolland2014 import Rolland2014 as Rolland2014
    from o3dmark.methods.saliency_scs import SaliencySCS as SaliencySCS
    from o3dmark.methods.shape_spectrum.method import ShapeSpectrum as ShapeSpectrum
    from o3dmark.methods.son2017 import Son2017 as Son2017
    from o3dmark.methods.wang2008 import Wang2008 as Wang2008
    from o3dmark.methods.zhan2014 import Zhan2014 as Zhan2014


def __getattr__(name: str) -> Any:
    """A registered class by its own name: `from o3dmark.methods import Zhan2014`."""
    return METHODS.class_called(name)


__all__ = ["METHODS", "NO_DEEPER", "Depth", "Extraction", "Method", "Progress", "silent"]
