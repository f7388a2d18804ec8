"""How strong a mark came out, and what held it back: the cap of its profile, or what eyes see."""

from dataclasses import dataclass
from typing import Any, Literal

from o3dmark.marking.embedding import Marked
from o3dmark.methods import Method
from o3dmark.metrics import METRICS
from o3dmark.metrics.displacement import MaxDisplacement
from o3dmark.metrics.distance import surface_distance


@dataclass(frozen=True)
class Strength:
    """What a mark cost, of all marked parts the most: lengths over the diagonal of the part's bounding box.

    jnd   what is seen of it, in just noticeable differences (the metric of that name): 1 is the threshold
    by    which limit of the method the mark is nearer to: "cap", on the MRMS, or "jnd"; None for methods without
    """

    mrms: float
    hausdorff: float
    max_displacement: float
    jnd: float
    by: Literal["cap", "jnd"] | None

    def to_dict(self) -> dict[str, Any]:
        """Ready for JSON; ``by`` as ``strength_by``."""
        lengths = {"mrms": self.mrms, "hausdorff": self.hausdorff, "max_displacement": self.max_displacement}
        return {**lengths, "jnd": self.jnd, "strength_by": self.by}

    @property
    def words(self) -> str:
        """The same as a line for people."""
        seen = f"{self.jnd:.2f} just noticeable differences"
        why = {"cap": ", held back by the cap on the MRMS", "jnd": ", held back by what eyes see", None: ""}[self.by]
        return f"strength: an MRMS of {self.mrms:.2g} of the diagonal and {seen}{why}"


def strength(marked: Marked, method: Method) -> Strength | None:
    """Of an asset marked by a method; None where no part was marked."""
    if not marked.moved:
        return None
    pairs = marked.pairs()
    distances = [surface_distance(*pair) for pair in pairs]
    metric = METRICS.make("jnd")
    seen, mrms = [metric(*pair) for pair in pairs], [each.mrms for each in distances]
    return Strength(
        max(mrms),
        max(each.hausdorff for each in distances),
        max(MaxDisplacement()(*pair) for pair in pairs),
        max(seen),
        _nearest(method, list(zip(mrms, seen, strict=True))),
    )


def _nearest(method: Method, costs: list[tuple[float, float]]) -> Literal["cap", "jnd"] | None:
    """Which limit some part is nearest to, of costs in MRMS and just noticeable differences."""
    limits = method.limits
    if not limits:
        return None
    cap, jnd = (
        max(cost[i] for cost in costs) / limits.get(name, float("inf")) for i, name in enumerate(("mrms", "jnd"))
    )
    return "jnd" if jnd > cap else "cap"
