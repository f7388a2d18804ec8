"""The array types that the whole package speaks: read-only inside, copied at the border."""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Bools: TypeAlias = NDArray[np.bool_]
Bits: TypeAlias = NDArray[np.uint8]
Complexes: TypeAlias = NDArray[np.complex128]
AnyArray: TypeAlias = NDArray[Any]
