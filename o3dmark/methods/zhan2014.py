"""A bit in the mean of each bin of fluctuations of the root mean square curvature.

Zhan, Li, Yang, Wu, "A blind watermarking algorithm for 3D mesh models based on vertex curvature", Journal of Zhejiang
University Science C 15, 2014. In its order:

    TriangleMesh -> principal curvatures -> their root mean square in each vertex's window, less the mean around: F
                 -> bins of ordered F -> powers, as Cho et al. have them -> motion along normals -> TriangleMesh

Where vertices move by h along their normals, F changes by about J h: the normal curvature along an edge of length l
that joins vertices i and j changes by -2 (h_i - h_j) / l^2. The least motion with J h = F' - F is taken, a few times.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, lsmr

from o3dmark.arrays import Bits, Floats
from o3dmark.coding.keys import Key
from o3dmark.mesh import curvature
from o3dmark.mesh.surface import Surface
from o3dmark.methods import METHODS, Extraction
from o3dmark.methods._norm_bins import Bins, BinsMethod, Mean, check_filled, modulated, soft_bits
from o3dmark.methods._published import Deal
from o3dmark.registry import option

_ITERATIONS = 30  # of a least-squares solution: what it leaves is long waves, which cost most and matter least


@dataclass(frozen=True, eq=False)
class Fluctuations:
    """F (n,): the root mean square curvature of a vertex's window less the mean of that over the window."""

    surface: Surface
    window: int

    @cached_property
    def bent(self) -> curvature.Curvature:
        return curvature.taubin(self.surface.vertices, self.surface.triangles)

    @cached_property
    def kappa(self) -> Floats:
        """Root mean square curvature (n,) of each window."""
        return np.asarray(np.sqrt(self.averaged((self.bent.k1**2 + self.bent.k2**2) / 2.0)))

    @cached_property
    def values(self) -> Floats:
        return self.kappa - self.averaged(self.kappa)

    def averaged(self, values: Floats) -> Floats:
        """Means (n,) over windows, which are as many averages over the neighbours."""
        for _ in range(self.window):
            values = self.surface.neighbour_mean @ values
        return values

    def averaged_back(self, values: Floats) -> Floats:
        """The transpose of `averaged`."""
        for _ in range(self.window):
            values = self.surface.neighbour_mean.T @ values
        return values

    def response(self) -> LinearOperator:
        """J (n, n): how F changes when vertices move along their normals, to first order, with the normals at rest."""
        n = len(self.kappa)
        inverse = np.divide(1.0, self.kappa, out=np.zeros(n), where=self.kappa > 0)
        bend = sp.csr_array(sp.diags_array(-self.bent.mean) @ bending(self.surface))

        def forth(height: Floats) -> Floats:
            change = inverse * self.averaged(bend @ height)
            return change - self.averaged(change)

        def back(values: Floats) -> Floats:
            return bend.T @ self.averaged_back(inverse * (values - self.averaged_back(values)))

        return LinearOperator((n, n), matvec=forth, rmatvec=back, dtype=np.float64)


@METHODS.register("zhan2014")
@dataclass(frozen=True)
class Zhan2014(BinsMethod):
    """A bit in the mean of each bin of curvature fluctuations (Zhan, Li, Yang and Wu 2014); blind.

    Invariant to similarities and to the order of vertices and triangles; it needs no centre, so moving a part of the
    mesh leaves the rest as it is. Cannot survive what changes the curvature of single vertices: other connectivity,
    subdivision, smoothing, or noise above a hundredth of the edges.

    Reconstructed: the curvature's estimate, the window, bins of equally many vertices, alpha, and how the motion is
    found. The robustness to noise that is published was not had with any of these. The key is ours.
    """

    claims = ("identity", "reorder", "similarity")
    mean: ClassVar[Mean] = Mean()

    alpha: float = option(0.1, "by how much a bin's mean differs from 1/2, in bin widths")
    window: int = option(2, "averages over the neighbours that make a window")
    steps: int = option(5, "Newton steps of the motion")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.window < 1 or self.steps < 1:
            raise ValueError(f"window and steps must be at least 1, not {self.window} and {self.steps}")

    def writer(self, surface: Surface, message: Bits, key: Key) -> Callable[[float], Floats]:
        """See `PublishedMethod.writer`."""
        held = Deal.of(self.name, len(message), key).written(message)
        cover = Fluctuations(surface, self.window)
        check_filled(cover.values, Bins.equal_count(cover.values, len(held)))
        J = cover.response()

        def moved(alpha: float) -> Floats:
            height = np.zeros(len(surface.vertices))
            for _ in range(self.steps):
                bent = surface.moved(surface.vertices + height[:, None] * surface.normals)
                F = Fluctuations(bent, self.window).values
                target = modulated(F, Bins.equal_count(F, len(held)), self.mean, held, alpha)
                height += lsmr(J, target - F, maxiter=_ITERATIONS)[0]
            return np.asarray(surface.vertices + height[:, None] * surface.normals)

        return moved

    def observe(self, mesh: Any) -> Fluctuations:
        """See `Method.observe`."""
        return mesh if isinstance(mesh, Fluctuations) else Fluctuations(Surface.of(mesh), self.window)

    def read(self, seen: Fluctuations, n_bits: int, key: Key) -> Extraction:
        """See `PublishedMethod.read`."""
        soft = soft_bits(seen.values, Bins.equal_count(seen.values, n_bits), self.mean)
        return Extraction(Deal.of(self.name, n_bits, key).read(soft))


def bending(surface: Surface) -> sp.csr_array:
    """The matrix (n, n) that gives how much less curved each vertex gets, in H, when vertices move along normals."""
    n, i = len(surface.vertices), surface.triangles[:, [0, 0, 1, 1, 2, 2]].ravel()
    j = surface.triangles[:, [1, 2, 2, 0, 0, 1]].ravel()
    square = np.sum((surface.vertices[j] - surface.vertices[i]) ** 2, axis=1)
    weight = np.repeat(surface.areas, 6)
    weight /= np.bincount(i, weight, minlength=n)[i] * square / 2.0
    around = sp.csr_array((weight, (i, j)), shape=(n, n))
    return sp.csr_array(sp.diags_array(np.asarray(around.sum(axis=1))) - around)
