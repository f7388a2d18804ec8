"""Moving a surface so that its projections take given values: the least motion, by Newton's method.

The answer of the projections to the motion of each vertex along its normal has two parts: that of the projections in a
fixed frame, and that of the frame, which is derived from the mesh and moves with it.
"""

from functools import cached_property

import numpy as np
import scipy.sparse as sp

from o3dmark.arrays import Floats
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface
from o3dmark.methods.shape_spectrum.projections import Projections
from o3dmark.solid.frame import FRAME_2026, rules
from o3dmark.solid.solid import Solid, samples
from o3dmark.solid.spectrum import Band, Spectrum

_SPLIT = 0.35  # longest edge of a quadrature triangle, over the shortest wavelength
_POINT = 0.05  # edges below which one point a triangle will do, over the shortest wavelength
_NEWTON_STEPS = 8
_MANY = 20_000  # triangles above which the answer of the projections is lumped at the vertices


def spectrum_of(band: Band, seen: Solid, *, gradient: bool = False) -> Spectrum:
    """The spectrum of a solid as seen in its frame."""
    q = samples(seen, _SPLIT * band.shortest, _POINT * band.shortest)
    return Spectrum.of(band, q.points, q.area_vectors, gradient=gradient)


class Cover:
    """A mesh about to be marked, with its solid: its frame, its projections, and what it costs to change them.

    ``mask`` (n,) above zero says where motion is welcome: twice the mask, twice the motion for the same pull.
    """

    def __init__(self, projections: Projections, surface: Surface, solid: Solid, mask: Floats | None = None) -> None:
        self.projections, self.surface, self.solid = projections, surface, solid
        self._mask = np.ones(len(surface.vertices)) if mask is None else mask
        self.rule = rules(self.solid, FRAME_2026)[0]
        self.frame = self.rule.frames(self.solid)[0]
        self.normals = geometry.unit(self.solid.vertex_area_vectors)  # outward, however the mesh was wound
        self._seen = self.frame.solid(self.solid)
        self._spectrum = spectrum_of(projections.band, self._seen, gradient=True)
        self.values = projections(self._spectrum.values)

    @cached_property
    def response(self) -> Floats:
        """Change of each projection as each vertex moves by one unit of the frame along its normal: (K, n)."""
        frame = self.rule.response(self.solid, self.frame, self.normals)
        return self._direct + (self.projections(self._spectrum.frame_derivative()).T @ frame) * self.solid.movable

    @cached_property
    def _direct(self) -> Floats:
        """The same in a fixed frame."""
        normals = self.frame.directions(self.normals)
        return _direct_response(self.projections, self._seen, normals) * self.solid.movable

    @cached_property
    def _mobility(self) -> Floats:
        """How far a vertex goes for a given pull (n,): the inverse of its area, so that the RMS motion is the least.

        Times the mask.
        """
        area = self._seen.vertex_areas
        return np.where(self.solid.movable, self._mask / np.maximum(area, 1e-3 * area.mean()), 0.0)

    @property
    def _ways(self) -> Floats:
        """The motions (K, n) that are mixed, before mobility: least in sum when they are the response itself.

        The answer of an area frame is as rough as the curvature; creases would fly apart. Without it, they stay smooth.
        """
        return self._direct if self.rule.measure == "area" else self.response

    @cached_property
    def motions(self) -> Floats:
        """How far each vertex goes along its normal, in the mesh's unit, to change one projection by one: (K, n).

        To first order, and without changing the others.
        """
        pull = np.linalg.inv((self.response * self._mobility) @ self._ways.T)
        return np.asarray(self.frame.scale * self._mobility * (pull.T @ self._ways))

    @cached_property
    def cost(self) -> Floats:
        """Q (K, K): a change r of the projections takes a mean square motion of r' Q r, in the mesh's own unit."""
        area = self._seen.vertex_areas
        return np.asarray((self.motions * area) @ self.motions.T / area.sum())

    def moved(self, change: Floats) -> Floats:
        """Vertices (n, 3) after the motions for a ``change`` (K,) of the projections."""
        return np.asarray(self.surface.vertices + (change @ self.motions)[:, None] * self.normals)

    def measured(self, vertices: Floats) -> Floats:
        """The projections (K,) with the mesh's vertices at ``vertices`` (n, 3), in the mesh's own frame then."""
        solid = self.solid.moved(vertices)
        seen = self.rule.near(solid, self.frame).solid(solid)
        return self.projections(spectrum_of(self.projections.band, seen).values)

    def changed(self, change: Floats, accuracy: float) -> tuple[Floats, float]:
        """Vertices (n, 3) whose projections differ from the cover's by ``change`` (K,), and the largest error left.

        The values are those that a reader will measure. Newton's method, its derivative corrected on the way (Broyden
        1965, the first of his methods).
        """
        asked, error, inverse = np.zeros(len(change)), change, np.eye(len(change))
        best = np.array(self.surface.vertices), float(np.abs(change).max())
        for _ in range(_NEWTON_STEPS):
            step = inverse @ error
            asked = asked + step
            vertices = self.moved(asked)
            before, error = error, self.values + change - self.measured(vertices)
            missed = float(np.abs(error).max())
            if missed < best[1]:
                best = vertices, missed
            if missed < accuracy or missed > 2.0 * best[1]:
                break
            answer = inverse @ (before - error)
            inverse += np.outer(step - answer, step @ inverse) / (step @ answer)
        return best


def _direct_response(projections: Projections, seen: Solid, normals: Floats) -> Floats:
    """Change of the projections (K, n) in a fixed frame: the integral of each function times a vertex's motion."""
    n = len(seen.movable)
    if len(seen.triangles) > _MANY:
        lumped = np.einsum("vd,vd->v", seen.vertex_area_vectors, normals)
        return projections.functions(seen.vertices[:n]) * lumped
    q = samples(seen, _SPLIT * projections.band.shortest)
    mine = q.corners < n
    speed = np.einsum("qd,qcd->qc", q.area_vectors, normals[np.where(mine, q.corners, 0)]) * q.weights
    place = np.broadcast_to(np.arange(len(q.points))[:, None], q.corners.shape)
    hats = sp.csr_array((speed[mine], (place[mine], q.corners[mine])), shape=(len(q.points), n))
    return np.asarray((hats.T @ projections.functions(q.points).T).T)
