"""A canonical frame: where a solid is, how large it is and which way it faces, computed from its moments.

    origin   the centroid
    scale    the radius of gyration: root of the trace of the second moment over the mass
    axes     the principal axes, the longest extent last; their signs make the third moments positive, except that the
             axis with the smallest third moment is flipped where needed to make the frame right-handed

The moments are those of the volume, which noise does not bias, or, for thin sheets, whose volume says little, those of
the surface. Where two principal moments are nearly equal, noise turns their axes at will; a complex moment of higher
order then turns the frame about the third axis. Which of these applies is a `FrameRule`. The writer takes the first
rule that fits; the reader of an attacked mesh gets all rules that might have been the writer's first.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy

from o3dmark.arrays import Complexes, Floats
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.solid.moments import ComplexMoment, Measure, moments, response, third_moments
from o3dmark.solid.solid import Solid

_AXES = (2, 0, 0)  # order, radial and axial power of the moment w^2, whose angle the principal axes are
_STEP = 1e-4  # of central differences, in radians and units of the frame: an error of 1e-8
# These serve the reader's search only: they say which other positions of the axes are worth a try.
_UNSURE_SKEWNESS = 0.03  # noise of 0.5 % and rounding to 8 bits move skewness by 0.007 (on thin flower by 0.04)
_SKEWNESS_RATIO = 1.2  # of the two smallest, one of which is flipped; 30 passes of smoothing move bimba's by a tenth
_PERMUTATION = 1e-6  # largest error of an entry for a rotation to be taken for a permutation of the axes


@dataclass(frozen=True)
class FrameFormat:
    """What decides the frame of a solid. Writer and reader must share it: change a value, and marks become unreadable.

    The meshes named are some of the 95 on which the thresholds were chosen, at the values that they have.
    """

    # volume over (area x radius of gyration) below which area moments decide: flower's petals 0.009, cup's wall 0.048
    thin: float = 0.025
    # relative difference of principal moments: no axes where all three are below; cubes and spheres 0.000, cheese 0.14
    round: float = 0.05
    # the same: complex moments compete where one is below; vase 0.01, and smoothing moves it by 0.03
    equal: float = 0.1
    # order, radial and axial power of the complex moments that compete, see `ComplexMoment`
    moments: tuple[tuple[int, int, int], ...] = (
        _AXES,
        (1, 1, 0),
        (1, 0, 2),
        (2, 0, 1),
        (3, 0, 0),
        (3, 0, 1),
        (4, 0, 0),
        (5, 0, 0),
        (6, 0, 0),
    )
    # vertex noise, over the scale, that turns it by a radian: not used where that is less; bearing 0.027, cogs 0.086
    least_noise: float = 0.03
    # how many times steadier than the axes a moment must be, since it leaves more positions open; pig 11, botijo 32
    favour_axes: float = 12.0
    # factor within which the next choice is a rule too; simplification to a fifth moves scores by 14 %, noise by 3 %.
    # The reader tries them all. The writer takes the first, so that this decides only where the first has no moment.
    close: float = 1.2


FRAME_2026 = FrameFormat()


@dataclass(frozen=True, eq=False)
class Frame:
    """origin (3,), scale, axes (3, 3): orthonormal rows. A point x is seen at axes (x - origin) / scale."""

    origin: Floats
    scale: float
    axes: Floats

    def points(self, points: Floats) -> Floats:
        """Points (n, 3) as seen in the frame."""
        return np.asarray((points - self.origin) @ self.axes.T / self.scale)

    def directions(self, vectors: Floats) -> Floats:
        """Vectors (n, 3) turned into the frame, not scaled."""
        return np.asarray(vectors @ self.axes.T)

    def solid(self, solid: Solid) -> Solid:
        """A solid as seen in the frame."""
        return Solid(self.points(solid.vertices), solid.triangles, solid.movable)

    def shifted(self, motion: Floats) -> "Frame":
        """The frame after a small ``motion`` (7,): translation, rotation vector, log scale; all as seen in it."""
        turn = scipy.spatial.transform.Rotation.from_rotvec(motion[3:6]).as_matrix()
        origin = self.origin + self.scale * motion[:3] @ self.axes
        return Frame(origin, self.scale * float(np.exp(motion[6])), turn.T @ self.axes)


@dataclass(frozen=True)
class FrameRule:
    """How to derive a frame from a solid: from which moments, and what turns it where two of them are nearly equal."""

    measure: Measure
    moment: ComplexMoment | None = None

    def frames(self, solid: Solid) -> list[Frame]:
        """The frames that the rule allows, likeliest first: one; with a complex moment all its symmetric positions."""
        upright = self._signed(solid, principal(solid, self.measure)[0])
        if self.moment is None:
            return [upright]
        frames = list(self._turned(solid, upright))
        skew = [third_moments(frame.solid(solid), self.measure) for frame in frames]
        plane = (self.moment.axis + 1) % 3
        return [frames[i] for i in np.argsort([-s[plane] - 100.0 * (s[self.moment.axis] > 0) for s in skew])]

    def near(self, solid: Solid, frame: Frame) -> Frame:
        """The allowed frame nearest to ``frame``: for a solid that has been moved a little."""
        base = principal(solid, self.measure)[0]
        signs = np.sign(np.einsum("ij,ij->i", base.axes, frame.axes))
        base = replace(base, axes=base.axes * np.where(signs == 0, 1.0, signs)[:, None])
        if self.moment is None:
            return base
        if np.linalg.det(base.axes) < 0:  # within the plane of equal moments the axes are arbitrary
            base.axes[(self.moment.axis + 1) % 3] *= -1.0
        return max(self._turned(solid, base), key=lambda f: float(np.sum(f.axes * frame.axes)))

    def response(self, solid: Solid, frame: Frame, normals: Floats) -> Floats:
        """How far the frame moves when a vertex moves by one unit of the frame along its normal: (7, n_mesh).

        ``normals`` (n_mesh, 3) as in the mesh. Rows as in `Frame.shifted`; to first order, by lumping at vertices.
        """
        seen, normal = frame.solid(solid), frame.directions(normals)
        mass, _, second = moments(seen, self.measure)
        variance = np.diag(second) / mass  # its trace is one

        def polynomials(x: Floats) -> Floats:
            products = x[..., [0, 1, 2, 1, 2, 0]] * x[..., [0, 1, 2, 2, 0, 1]]
            return np.concatenate([np.ones_like(x[..., :1]), x, products], axis=-1)

        change = response(seen, normal, self.measure, polynomials).T / mass
        spread = change[4:7] - variance[:, None] * change[0]
        turning = np.zeros((3, len(normals)))
        off = np.array([[0, 9, 8], [9, 0, 7], [8, 7, 0]])  # where x y, x z and y z stand in ``change``
        for axis in range(3) if self.moment is None else (self.moment.axis,):
            b, c = (axis + 1) % 3, (axis + 2) % 3
            plane = variance[axis] * np.eye(2) - second[np.ix_([b, c], [b, c])] / mass
            tilt = np.linalg.solve(plane, change[off[axis, [b, c]]])  # how the axis leans towards b and c
            turning[c], turning[b] = tilt[0], -tilt[1]
        rows = np.concatenate([change[1:4], turning, 0.5 * spread.sum(axis=0, keepdims=True)])
        if self.moment is not None:
            rows[3 + self.moment.axis] = self._angle_response(self.moment, seen, normal, rows)
        return np.asarray(rows, np.float64)

    def ambiguities(self, solid: Solid, frames: list[Frame]) -> list[Floats]:
        """By which permutations and flips of the axes (3, 3) the first of ``frames`` may be wrong, the identity first.

        Without a complex moment, half turns where third moments are too small to be sure of; with one, its symmetric
        positions.
        """
        if self.moment is not None:
            turns = [frame.axes @ frames[0].axes.T for frame in frames]
            return [np.rint(turn) for turn in turns if np.abs(turn - np.rint(turn)).max() < _PERMUTATION]
        skew = np.abs(third_moments(frames[0].solid(solid), self.measure))
        order = np.argsort(skew)
        found = [np.eye(3)]
        for a, b in ((0, 1), (0, 2), (1, 2)):
            signs = np.ones(3)
            signs[order[[a, b]]] = -1.0
            swapped = a == 0 and skew[order[b]] < _SKEWNESS_RATIO * skew[order[0]]
            if skew[order[b]] < _UNSURE_SKEWNESS or swapped:
                found.append(np.diag(signs))
        return found

    def _signed(self, solid: Solid, base: Frame) -> Frame:
        """The principal axes with the signs that make third moments positive, right-handed."""
        skew = third_moments(base.solid(solid), self.measure)
        axes = base.axes * np.where(skew < 0, -1.0, 1.0)[:, None]
        if np.linalg.det(axes) < 0:
            axes[np.argmin(np.abs(skew))] *= -1.0
        return replace(base, axes=axes)

    def _turned(self, solid: Solid, base: Frame) -> Iterator[Frame]:
        """The frame turned until its complex moment is real and positive, in all ways; ``base`` is right-handed."""
        assert self.moment is not None
        axis, order = self.moment.axis, self.moment.order
        other = base.axes.copy()
        other[[axis, (axis + 2) % 3]] *= -1.0  # upside down
        for start in (base, replace(base, axes=other)):
            angle = float(np.angle(self.moment.of(start.solid(solid), self.measure)))
            for part in range(order):
                motion = np.zeros(7)
                motion[3 + axis] = (angle + 2.0 * np.pi * part) / order
                yield start.shifted(motion)

    def _angle_response(self, moment: ComplexMoment, seen: Solid, normal: Floats, rows: Floats) -> Floats:
        """Rotation about the moment's axis (n_mesh,) that keeps it real while the frame makes the other motions."""

        def function(x: Floats) -> Complexes:
            return moment.function(x)[..., None]

        here = moment.of(seen, self.measure)
        total = response(seen, normal, self.measure, function)[:, 0]
        still = Frame(np.zeros(3), 1.0, np.eye(3))
        for part in range(6):
            if part != 3 + moment.axis:
                motion = np.zeros(7)
                motion[part] = _STEP
                ahead, back = (moment.of(still.shifted(m).solid(seen), self.measure) for m in (motion, -motion))
                total = total + (ahead - back) / (2.0 * _STEP) * rows[part]
        return np.asarray(np.imag(total / here) / moment.order)


def rules(solid: Solid, form: FrameFormat) -> list[FrameRule]:
    """The rules that fit a solid, best first; more than one where the choice is close.

    Errors: MeshError for a solid without volume, or as symmetric as a ball or a torus.
    """
    found: list[FrameRule] = []
    for measure in _measures(solid, form):
        frame, (a, b, c) = principal(solid, measure)
        gaps = np.array([abs(b - c) / (b + c), abs(c - a) / (c + a), abs(a - b) / (a + b)])
        if gaps.max() < form.round:
            continue
        if gaps.min() > form.equal:
            found.append(FrameRule(measure))
        else:
            found += [FrameRule(measure, m) for m in _moments(frame.solid(solid), measure, int(np.argmin(gaps)), form)]
    if not found:
        raise MeshError(
            "the solid is as symmetric as a ball, a cube or a torus: nothing in its shape tells which way it faces;"
            " a mark on its vertices (saliency-scs) or a small added feature is the remedy"
        )
    return found


def principal(solid: Solid, measure: Measure) -> tuple[Frame, Floats]:
    """The frame of the principal axes, of any sign, and the variance (3,) along each, of sum one, ascending.

    Errors: MeshError for a solid without volume, or a surface within a plane.
    """
    near = solid.vertices.mean(axis=0)  # far from the origin, moments would lose their digits
    mass, first, second = moments(solid, measure, near)
    if not mass > (1e-9 * solid.area**1.5 if measure == "volume" else 0.0):
        raise MeshError("the surface encloses no volume; close it, or give it thickness")
    mean = first / mass
    variance, vectors = np.linalg.eigh(second / mass - np.outer(mean, mean))
    if not variance[0] > 0:
        raise MeshError(
            "the surface lies in a plane, or is so tangled that its volumes cancel: there is no solid to mark"
        )
    spread = float(variance.sum())
    return Frame(near + mean, float(np.sqrt(spread)), vectors.T.copy()), variance / spread


def _measures(solid: Solid, form: FrameFormat) -> list[Measure]:
    """Volume or area moments; both, the better first, where the choice is close."""
    frame, _ = principal(solid, "area")
    thickness = geometry.volume(solid.vertices - frame.origin, solid.triangles) / (solid.area * frame.scale)
    order: list[Measure] = ["volume", "area"] if thickness >= form.thin else ["area", "volume"]
    return order if form.thin / form.close < thickness < form.thin * form.close else order[:1]


def _moments(seen: Solid, measure: Measure, axis: int, form: FrameFormat) -> list[ComplexMoment | None]:
    """The moments whose angle noise disturbs least, best first; None, for the principal axes, is favoured."""
    x, area = seen.vertices[: len(seen.movable)], seen.vertex_areas
    scored: list[tuple[float, ComplexMoment | None]] = []
    for powers in form.moments:
        moment = ComplexMoment(axis, *powers)
        noise = float(np.sqrt(np.sum(np.abs(moment.function(x)) ** 2 * area**2)))  # of the moment, for vertex noise 1
        score = moment.order * abs(moment.of(seen, measure)) / noise
        if score > form.least_noise:
            scored.append((form.favour_axes * score, None) if powers == _AXES else (score, moment))
    scored.sort(key=lambda pair: -pair[0])
    return [moment for score, moment in scored if score * form.close > scored[0][0]]
