"""Moving a surface so that its projections take given values: the least motion, by Newton's method.

The answer of the projections to the motion of a vertex has two parts: that of the projections in a fixed frame, and
that of the frame, which is derived from the mesh and moves with it. What a motion costs is told by `motion.metric`.
"""

from collections.abc import Callable, Iterable, Iterator
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from o3dmark.arrays import Floats
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface
from o3dmark.methods.shape_spectrum.codewords import Comb, Plan
from o3dmark.methods.shape_spectrum.lattice import Lattice
from o3dmark.methods.shape_spectrum.projections import Projections
from o3dmark.motion.metric import Motions
from o3dmark.motion.visibility import Visibility
from o3dmark.solid.frame import FrameFormat, rules
from o3dmark.solid.quadrature import samples
from o3dmark.solid.solid import Solid, normal_square
from o3dmark.solid.spectrum import LONGEST_EDGE, Spectrum, band_rule

# Fourteen marks on bimba, cup, ant, vase, flower, cat_7949 and octa_flower (two keys each) chose these:
INITIAL_RATIO = 0.99  # real motion over the planned one, until some were carried out and their mean is known
_LIMIT_MARGIN = 0.995  # of the limit: the exact distance was up to 0.2 % above the first-order one
_MAX_RATIO = 1.2  # what one solution that went astray may count for in that mean
_MAX_CANDIDATES = 16  # plans carried out before the mesh is refused: the seventh at the latest was accepted
_NEWTON_TOLERANCE = 1e-3  # of a step, a 250th of the margin
_NEWTON_STEPS = 8  # 2 to 6 were taken by those accepted
_UNLOOKED = 1.15  # of what may be seen, above which a plan is passed by: two of like size differed by a tenth
_NEARLY_SEEN = 0.8  # of the same, above which the motion itself is looked at and not its plan alone
_LUMPED_TRIANGLES = 20_000  # above, the derivative is lumped at the vertices, which small triangles allow
_MIN_AREA_SHARE = 1e-3  # of the mean vertex area, so that slivers do not fly off


class Limits(NamedTuple):
    """What a motion may be at most: its RMS, in the mesh's unit, and what is seen of it (see `Visibility`)."""

    rms: float
    jnd: float


class Cover:
    """A mesh about to be marked, with its solid: its frame, its projections, and what it costs to change them.

    ``mask`` (n,) above zero says where motion is welcome: twice the mask, twice the motion for the same pull.
    ``unseen``: whether motions that show cost more than others. Of the d directions in which vertices may go (see
    `Motions`) motions are made up.
    """

    def __init__(
        self,
        projections: Projections,
        surface: Surface,
        solid: Solid,
        form: FrameFormat,
        mask: Floats | None = None,
        *,
        unseen: bool = True,
    ) -> None:
        self.projections, self.surface, self.solid, self._unseen = projections, surface, solid, unseen
        self._mask = np.ones(len(surface.vertices)) if mask is None else mask
        self.rule = rules(self.solid, form)[0]
        self.frame = self.rule.frames(self.solid)[0]
        self.normals = geometry.unit(self.solid.vertex_area_vectors)  # outward, however the mesh was wound
        self._seen = self.frame.solid(self.solid)
        self._points = band_rule(projections.band, self._seen)  # the same for all that it moves to
        self._spectrum = Spectrum.of_solid(projections.band, self._seen, gradient=True, points=self._points)
        self.values = projections(self._spectrum.values)

    def comb(self, bits: ArrayLike) -> Comb:
        """What `plans` wants to know; projection j carries bit j modulo the number of bits."""
        wanted = np.resize(np.asarray(bits, np.float64), len(self.projections))
        return Comb(self.values, wanted, self.projections.dither, self.metric, self.lattice)

    @cached_property
    def motions(self) -> Motions:
        """How vertices may move, as seen in the frame, and what it costs; those of the fans stay where they are.

        The square of a vertex's motion counts with its area, so that the RMS motion is small; less where the mask is.
        """
        area, normals, movable = self._seen.vertex_areas, self.frame.directions(self.normals), self.solid.movable
        weights = np.maximum(area, _MIN_AREA_SHARE * area.mean()) / self._mask
        if not self._unseen:
            return Motions.along(normals, weights, movable)
        n = len(movable)
        triangles = self._seen.triangles[(self._seen.triangles < n).all(axis=1)]
        return Motions.unseen(self._seen.vertices[:n], triangles, normals, weights, movable)

    @cached_property
    def jacobian(self) -> Floats:
        """Change of each projection as vertices go by one unit of the frame in each of the directions: (K, d)."""
        frame = self.projections(self._spectrum.frame_derivative()).T
        axes = (np.broadcast_to(axis, self.normals.shape) for axis in self.frame.axes)
        return self._fixed_frame + self._per_direction(
            frame @ self.rule.response(self.solid, self.frame, axis) for axis in axes
        )

    @cached_property
    def _fixed_frame(self) -> Floats:
        """The same if the frame stayed where it is."""
        return self._per_direction(_jacobians_in_frame(self.projections, self._seen))

    def _per_direction(self, answers: Iterable[Floats]) -> Floats:
        """The answers (K, d) to the directions, from those (K, n) to motions along each axis of the frame."""
        directions = self.motions.directions
        parts = (each @ directions[axis::3] for axis, each in enumerate(answers))
        return np.asarray(sum(parts, np.zeros((len(self.values), directions.shape[1]))))

    @property
    def _pulls(self) -> Floats:
        """The functions (K, d) that motions are made of; the jacobian itself gives the cheapest motion.

        In an area frame it is as rough as the curvature, and creases would fly apart: there, the part of a fixed frame
        is taken, which is smooth.
        """
        return self._fixed_frame if self.rule.measure == "area" else self.jacobian

    @cached_property
    def basis(self) -> Floats:
        """How far to go in each direction, in the mesh's unit, to change one projection by one: (K, d).

        To first order, and without changing the other projections.
        """
        least = self.motions.least(self._pulls)
        return np.asarray(self.frame.scale * (np.linalg.inv(self.jacobian @ least.T).T @ least))

    @cached_property
    def directions(self) -> sp.csr_array:
        """Those of `motions`, in the mesh's axes: (3 n, d)."""
        return sp.kron(sp.eye_array(len(self.normals)), self.frame.axes.T, format="csr") @ self.motions.directions

    @cached_property
    def along_normals(self) -> Floats:
        """The part along the vertices' normals of the motion for each projection: (K, n)."""
        each = np.arange(len(self.normals))[:, None]
        along = geometry.motions_along(each, self.normals[:, None], len(each))
        return np.asarray((along @ self.directions @ self.basis.T).T)

    @cached_property
    def metric(self) -> Floats:
        """Q (K, K): a change r of the projections takes a mean square motion of r' Q r, in the mesh's own unit."""
        return np.asarray(self.basis @ normal_square(self._seen, self.motions.directions) @ self.basis.T)

    @cached_property
    def lattice(self) -> Lattice:
        """The integer changes with the metric for their form. Errors: MeshError where a change costs nothing at all."""
        try:
            return Lattice(self.metric)
        except np.linalg.LinAlgError:
            raise MeshError("the solid hides too little for a mark: parts of it are out of all proportion") from None

    def moved(self, change: Floats) -> Floats:
        """Vertices (n, 3) after the motion for a ``change`` (K,) of the projections, to first order."""
        return np.asarray(self.surface.vertices + (self.directions @ (change @ self.basis)).reshape(-1, 3))

    def size(self, change: Floats) -> float:
        """RMS of the motion that `moved` makes, as `geometry.normal_rms` has it."""
        return float(np.sqrt(change @ self.metric @ change))

    @cached_property
    def _visibility(self) -> Visibility:
        return Visibility(self.surface)

    def jnd(self, change: Floats) -> float:
        """What is seen of the motion that `moved` makes, in just noticeable differences."""
        return self._visibility(self.surface.moved(self.moved(change)))

    def project(self, vertices: Floats) -> Floats:
        """The projections (K,) with the mesh's vertices at ``vertices`` (n, 3), in the mesh's own frame then."""
        solid = self.solid.moved(vertices)
        seen = self.rule.near(solid, self.frame).solid(solid)
        return self.projections(Spectrum.of_solid(self.projections.band, seen, points=self._points).values)

    def solve(self, change: Floats, tolerance: float) -> tuple[Floats, float]:
        """What to ask of `moved` (K,) for projections that differ by ``change`` (K,), and the largest error left.

        The values are those that a reader will measure. Newton's method, its derivative corrected on the way (Broyden
        1965, the first of his methods).
        """
        asked, error, inverse = np.zeros(len(change)), change, np.eye(len(change))
        best = asked, float(np.abs(change).max())
        for _ in range(_NEWTON_STEPS):
            step = inverse @ error
            asked = asked + step
            before, error = error, self.values + change - self.project(self.moved(asked))
            missed = float(np.abs(error).max())
            if missed < best[1]:
                best = asked, missed
            if missed < tolerance or missed > 2.0 * best[1]:
                break
            answer = inverse @ (before - error)
            inverse += np.outer(step - answer, step @ inverse) / (step @ answer)
        return best


def least_motion(cover: Cover, plans: Iterable[Plan], most: Limits, reads: Callable[[Floats], bool]) -> Floats | None:
    """What to ask of `Cover.moved` (K,) for the first plan that arrives at its codewords, keeps within both limits and
    is read back, as ``reads`` says of vertices (n, 3); None when no plan does.

    What is seen grows with the motion, nearly in proportion: a plan that was looked at tells which others to pass by.
    """
    ratios, jnd_per_rms = [INITIAL_RATIO], 0.0
    for plan in plans:
        if len(ratios) > _MAX_CANDIDATES:
            break
        ratio, seen = float(np.mean(ratios)), 0.0
        if plan.size * ratio > most.rms or plan.size * ratio * jnd_per_rms > _UNLOOKED * most.jnd:
            continue
        if np.isfinite(most.jnd):
            seen = ratio * cover.jnd(plan.change)
            jnd_per_rms = seen / (ratio * plan.size)
            if seen > most.jnd:
                continue
        asked, missed = cover.solve(plan.change, _NEWTON_TOLERANCE * plan.step)
        size = cover.size(asked)
        ratios.append(min(size / plan.size, _MAX_RATIO))
        arrived = missed < 10.0 * _NEWTON_TOLERANCE * plan.step and size <= _LIMIT_MARGIN * most.rms
        if arrived and seen > _NEARLY_SEEN * most.jnd:
            arrived = cover.jnd(asked) <= most.jnd
        if arrived and reads(cover.moved(asked)):
            return asked
    return None


def _jacobians_in_frame(projections: Projections, seen: Solid) -> Iterator[Floats]:
    """Change of the projections (K, n) as each vertex moves along x, y and z: the integral of each function there."""
    n = len(seen.movable)
    if len(seen.triangles) > _LUMPED_TRIANGLES:
        functions = projections.functions(seen.vertices[:n])
        yield from (functions * seen.vertex_area_vectors[:, axis] for axis in range(3))
        return
    q = samples(seen, LONGEST_EDGE * projections.band.shortest)
    mine, place = q.corners < n, np.broadcast_to(np.arange(len(q.points))[:, None], q.corners.shape)
    functions = projections.functions(q.points)
    for axis in range(3):
        speed = q.area_vectors[:, axis, None] * q.weights
        hats = sp.csr_array((speed[mine], (place[mine], q.corners[mine])), shape=(len(q.points), n))
        yield np.asarray((hats.T @ functions.T).T)
