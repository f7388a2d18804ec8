"""A method that hides nothing, for campaigns that ask what attacks do to meshes."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from o3dmark.coding.keys import Key
from o3dmark.mesh.surface import TriangleMesh
from o3dmark.methods import METHODS, Extraction, Method


@METHODS.register("nothing")
@dataclass(frozen=True)
class Nothing(Method):
    """The marked mesh is a copy of the cover; what is read says nothing."""

    def embed(self, mesh: Any, bits: ArrayLike, key: Key) -> Any:  # noqa: ARG002
        """See `Method.embed`."""
        return TriangleMesh(mesh)

    def extract(self, mesh: Any, n_bits: int, key: Key, *, reference: Any = None) -> Extraction:  # noqa: ARG002
        """See `Method.extract`."""
        return Extraction(np.zeros(n_bits))

    def capacity(self, mesh: Any) -> int:  # noqa: ARG002
        """As many bits as a campaign may want."""
        return 1 << 20
