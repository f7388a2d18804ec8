"""Whether an eye can tell two meshes apart by their shading, in just noticeable differences (see `motion`)."""

from dataclasses import dataclass
from typing import Any, ClassVar

from o3dmark.metrics import METRICS, Metric
from o3dmark.metrics.displacement import paired
from o3dmark.motion.visibility import Visibility
from o3dmark.registry import option


@METRICS.register("jnd")
@dataclass(frozen=True)
class JND(Metric):
    """How many just noticeable differences the shading changes by, at the place that 95 % of the surface stay below.

    1 is at the threshold: half of the viewers who look for it there would find it. Normals are compared in bands of
    scale; the threshold of each follows from how sensitive eyes are to such waves, and rises with the reference's own
    contrast there. Needs the same triangles over the same vertices in the same order. Matt surfaces only: a mirror
    shows far smaller changes, see `reflection`. Source: Mannos and Sakrison 1974, The effects of a visual fidelity
    criterion on the encoding of images (sensitivity); Legge and Foley 1980, Contrast masking in human vision.
    """

    needs_equal_connectivity: ClassVar[bool] = True

    angle: float = option(30.0, "degrees that the mesh's diagonal takes up to the eye")
    share: float = option(0.95, "of the surface, that stays below the value")

    def __post_init__(self) -> None:
        if not (0 < self.angle <= 180 and 0 < self.share <= 1):
            raise ValueError("wants angle in 0 .. 180 degrees and share in 0 .. 1")

    def __call__(self, reference: Any, distorted: Any) -> float:
        pair = paired(reference, distorted)
        return Visibility(pair.surface, self.angle)(pair.moved, self.share)
