"""Which numbers of a file are to change: one that is given as it is keeps its very bytes."""

import numpy as np

from o3dmark.arrays import AnyArray, Bools


def differs(new: AnyArray, old: AnyArray) -> Bools:
    """Where numbers are not the same; those that are no number in both are, and so are both zeros."""
    changed = np.asarray(new != old)
    if changed.any():
        changed &= ~(np.isnan(new) & np.isnan(old))
    return changed
