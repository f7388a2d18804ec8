"""What writer and reader of a mark share beside the key and the options: a frozen, dated agreement.

Change a number of a published format, and every mark that was written with it is lost; add a new one under a new date
instead. What only tunes the writer stands in `embedder` and `codewords`, what only tunes the reader in `decoder`,
`hypotheses`, `fit` and `fragment`: both may be improved at any time.
"""

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from o3dmark.arrays import Floats
from o3dmark.solid.frame import FRAME_2026, FrameFormat


@dataclass(frozen=True)
class SpectrumFormat:
    """The agreement: what decides the frame, how many projections there are, and which quantisation steps.

    The steps form a ladder, each ``ratio`` times the next; the step in its middle, ``top`` rungs below the largest, is
    ``unit`` times the target distortion over the root of the number of values, which have that distortion to share.
    """

    frame: FrameFormat
    ratio: float
    top: int
    unit: float
    min_projections: int

    def n_projections(self, n_bits: int) -> int:
        """Projections for ``n_bits``: one a bit, or as many on each as it takes to reach the minimum."""
        return n_bits * -(-self.min_projections // n_bits)

    def share(self, mrms: float, n_bits: int) -> float:
        """What one value has of a distortion ``mrms``, in their sum of squares."""
        return mrms / float(np.sqrt(max(n_bits, self.min_projections)))

    def steps(self, mrms: float, n_bits: int, rungs: int) -> Floats:
        """The ladder's steps (rungs,), the largest first; a value is a volume over the cube of the frame's scale."""
        exponents = np.arange(float(self.top), float(self.top) - rungs, -1.0)
        return np.asarray(self.ratio**exponents * self.unit * self.share(mrms, n_bits))


FORMATS = MappingProxyType(
    {
        # 7 % a rung: half a rung off costs 3.5 % of the margin. 32 projections: fewer cannot tell eight parameters of
        # the frame from bits. 265: about the step that 5.8e-4 buys for 64 bits on bimba.
        "2026": SpectrumFormat(frame=FRAME_2026, ratio=1.07, top=14, unit=265.0, min_projections=32),
    }
)
