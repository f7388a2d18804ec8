"""A patch: the part of a surface that lies in a cylinder which stands on it."""

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from o3dmark.arrays import Bools, Floats


class Patch(NamedTuple):
    """A cylinder about a ``centre`` (3,) on the surface, in the mesh's unit and coordinates.

    axis (3,), of length one, points outward; across it the cylinder reaches to ``radius``, along it up and down to
    ``half_height``.
    """

    centre: Floats
    axis: Floats
    radius: float
    half_height: float

    def holds(self, points: Floats) -> Bools:
        """Which points (q, 3) lie in the cylinder."""
        offset = points - self.centre
        along = offset @ self.axis
        across = np.linalg.norm(offset - along[:, None] * self.axis, axis=1)
        return np.asarray((across < self.radius) & (np.abs(along) < self.half_height))

    def placed(self, placement: Floats) -> "Patch":
        """The patch of the surface moved by a matrix (4, 4).

        Exact for similarities and reflections. Of what stretches, the cylinder has the mean scale, by volume.
        """
        linear = placement[:3, :3]
        scale = abs(np.linalg.det(linear)) ** (1.0 / 3.0)
        axis = np.linalg.solve(linear.T, self.axis)  # as normals go
        centre = linear @ self.centre + placement[:3, 3]
        return Patch(centre, axis / np.linalg.norm(axis), float(scale * self.radius), float(scale * self.half_height))

    def to_dict(self) -> dict[str, Any]:
        """The fields by name, ready for JSON."""
        return {name: np.asarray(value).tolist() for name, value in self._asdict().items()}


def layer(patches: Sequence[Patch]) -> Literal["local", "global"]:
    """Which layer of a mark spoke, by the patches that did: without any, that of the whole."""
    return "local" if patches else "global"
