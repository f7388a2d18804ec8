"""Distances between a reference mesh and a distorted one: what a mark or an attack costs.

    Metric           reference, distorted   -> float

Every metric is a registered frozen dataclass; zero means no difference, unless its ``identity`` says otherwise.
"""

import abc
from dataclasses import dataclass
from typing import Any, ClassVar

from o3dmark.registry import Registry

METRICS: "Registry[Metric]" = Registry("metric", __name__)


@dataclass(frozen=True)
class Metric(abc.ABC):
    """A distance between two meshes. Options are the fields."""

    name: ClassVar[str] = ""
    needs_equal_connectivity: ClassVar[bool] = False
    identity: ClassVar[float] = 0.0  # the value for two equal meshes; infinite where more is better (SNR)

    @abc.abstractmethod
    def __call__(self, reference: Any, distorted: Any) -> float:
        """The distance of ``distorted`` from ``reference`` (Open3D triangle meshes).

        Errors: MeshError when a mesh is unusable or, where ``needs_equal_connectivity``, the triangles differ.
        """


__all__ = ["METRICS", "Metric"]
