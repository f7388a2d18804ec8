"""How strong a mark came out, and what held it back: the cap of its profile, or what eyes see."""

import math
from dataclasses import dataclass
from typing import Any, Literal

from o3dmark.marking.embedding import Marked
from o3dmark.methods import Method


@dataclass(frozen=True)
class Strength:
    """What a mark cost, of all marked parts the most: lengths over the diagonal of the part's bounding box.

    jnd   what is seen of it, in just noticeable differences (the metric of that name): 1 is the threshold
    by    which limit of the method the mark is nearer to: "cap", on the MRMS, or "jnd"; None for methods without
    cap   that limit on the MRMS; None for methods without
    """

    mrms: float
    hausdorff: float
    max_displacement: float
    jnd: float
    by: Literal["cap", "jnd"] | None
    cap: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """Ready for JSON; ``by`` as ``strength_by``."""
        lengths = {"mrms": self.mrms, "hausdorff": self.hausdorff, "max_displacement": self.max_displacement}
        return {**lengths, "jnd": self.jnd, "strength_by": self.by}

    @property
    def words(self) -> str:
        """The same as a line for people."""
        seen = f"an MRMS of {self.mrms:.2g} of the diagonal, {self.jnd:.2f} just noticeable differences"
        if self.by is None or self.cap is None:
            return seen
        if self.by == "cap":
            return f"{seen}; the cap holds it back"
        return (
            f"{seen}; what eyes see holds it back, at {self.mrms / self.cap:.0%} of the cap: so much less it survives"
        )


def strength(marked: Marked, method: Method) -> Strength | None:
    """Of an asset marked by a method; None where no part was marked."""
    if not marked.moved:
        return None
    from o3dmark.metrics import METRICS
    from o3dmark.metrics.displacement import MaxDisplacement
    from o3dmark.metrics.distance import surface_distance

    pairs = marked.pairs()
    distances = [surface_distance(*pair) for pair in pairs]
    metric = METRICS.make("jnd")
    seen, mrms = [metric(*pair) for pair in pairs], [each.mrms for each in distances]
    return Strength(
        max(mrms),
        max(each.hausdorff for each in distances),
        max(MaxDisplacement()(*pair) for pair in pairs),
        max(seen),
        _nearest(method, max(mrms), max(seen)),
        method.limits.get("mrms"),
    )


def _nearest(method: Method, mrms: float, jnd: float) -> Literal["cap", "jnd"] | None:
    """Which limit of the method what a mark cost is nearest to."""
    limits = method.limits
    if not limits:
        return None
    return "jnd" if jnd / limits.get("jnd", math.inf) > mrms / limits.get("mrms", math.inf) else "cap"
