"""What writer and reader of patches share beside the key and the options: a frozen, dated agreement.

Change a number of a published format, and every mark that was written with it is lost; add a new one under a new date
instead. What only tunes the writer stands in `places` and `embedder`, what only tunes the reader in `search`.
"""

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from o3dmark.arrays import Floats, Ints


@dataclass(frozen=True)
class PatchFormat:
    """The agreement: what a patch measures, which radii and strengths there are, and what its coefficients carry.

    A radius is a power of ``ratio``, in the file's own unit. A cylinder reaches ``half_height`` radii up and down, and
    the weight of what it holds falls from ``lid`` of that on; the axis is the mean normal within ``normal_radius``
    radii, found in so many ``passes``. Functions end smoothly from ``rim`` on, and surfaces up to ``degree`` leave
    them at zero. ``n_real`` coefficients at least, of which so many are ``carriers`` of bits. ``strengths`` are the
    quantisation steps, over the cube of the radius.
    """

    ratio: float
    half_height: float
    lid: float
    normal_radius: float
    passes: int
    rim: float
    degree: int
    n_real: int
    carriers: int
    strengths: tuple[float, ...]
    stream: str

    def rungs(self, low: float, high: float) -> list[float]:
        """The radii from ``low`` to ``high``, ascending."""
        first, last = (np.log(limit) / np.log(self.ratio) for limit in (low, high))
        return [self.ratio**power for power in range(int(np.ceil(first)), int(np.floor(last)) + 1)]

    def nearest_rung(self, radius: float) -> float:
        """The radius of the ladder that is nearest to one, as ratios go."""
        return float(self.ratio ** np.rint(np.log(radius) / np.log(self.ratio)))

    def shares(self, n_bits: int) -> list[Ints]:
        """Which bits (carriers,) patches of each kind carry.

        All in one kind where they fit, over and over; else in overlapping runs, evenly spread.
        """
        if n_bits <= self.carriers:
            return [np.resize(np.arange(n_bits), self.carriers)]
        starts = np.rint(np.linspace(0, n_bits - self.carriers, -(-n_bits // self.carriers))).astype(np.int64)
        return [start + np.arange(self.carriers) for start in starts]


def smooth_end(x: Floats, start: float) -> tuple[Floats, Floats]:
    """1 up to ``start``, then down to 0 at 1 by a cubic that is flat at both ends; and its derivative."""
    s = np.clip((x - start) / (1.0 - start), 0.0, 1.0)
    return 1.0 - s * s * (3.0 - 2.0 * s), -6.0 * s * (1.0 - s) / (1.0 - start)


FORMATS = MappingProxyType(
    {
        # 40 carriers hold the 34 bits of a message of four bytes. A strength moves a surface by about as much of the
        # radius; what nobody sees there hangs on how rough it is.
        "2026": PatchFormat(
            ratio=2**0.5,
            half_height=0.8,
            lid=0.7,
            normal_radius=0.8,
            passes=2,
            rim=0.75,
            degree=3,
            n_real=56,
            carriers=40,
            strengths=(0.006, 0.004, 0.0027, 0.0018),
            stream="local-patches",
        ),
    }
)
