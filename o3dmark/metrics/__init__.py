"""Distances between a reference mesh and a distorted one: what a mark or an attack costs.

    Metric           reference, distorted   -> float

Every metric is a registered frozen dataclass; zero means no difference, unless its ``identity`` says otherwise.
"""

import abc
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

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


if TYPE_CHECKING:  # every registered class can be imported from here; a test says so
    from o3dmark.metrics.displacement import SNR as SNR
    from o3dmark.metrics.displacement import MaxDisplacement as MaxDisplacement
    from o3dmark.metrics.displacement import RmsDisplacement as RmsDisplacement
    from o3dmark.metrics.distance import MRMS as MRMS
    from o3dmark.metrics.distance import Hausdorff as Hausdorff
    from o3dmark.metrics.fmpd import FMPD as FMPD
    from o3dmark.metrics.msdm import MSDM as MSDM
    from o3dmark.metrics.msdm import MSDM2 as MSDM2
    from o3dmark.metrics.smoothness import Bending as Bending
    from o3dmark.metrics.smoothness import Planes as Planes
    from o3dmark.metrics.smoothness import Reflection as Reflection
    from o3dmark.metrics.visibility import JND as JND


def __getattr__(name: str) -> Any:
    """A registered class by its own name: `from o3dmark.metrics import JND`."""
    return METRICS.class_called(name)


__all__ = ["METRICS", "Metric"]
