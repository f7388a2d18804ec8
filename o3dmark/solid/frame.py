"""A canonical frame: where a solid is, how large it is and which way it faces, told by its moments alone.

    origin   the centroid
    scale    the radius of gyration: root of the trace of the second moment over the mass
    axes     the principal axes, the longest extent last; their signs make the third moments positive, but for the least
             sure of them, which makes the frame right-handed

The moments are those of the volume, which noise does not bias, or, for thin sheets, whose volume says little, those of
the surface. Where two principal moments are nearly equal their axes are arbitrary, and a complex moment of higher
order turns the frame about the third (a `Turn`). What is chosen is a `Rule`; a reader who meets a border case is given
all the rules that it might have been.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from o3dmark.arrays import Floats
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.solid.moments import Measure, complex_moment, moments, response, third_moments
from o3dmark.solid.solid import Solid

_THIN = 0.025  # volume over (area x radius of gyration of the surface) below which a solid is a sheet
_EQUAL = 0.1  # relative difference of principal moments below which other moments may turn the frame better
_ROUND = 0.05  # and below which, if all three differ by less, the solid is as round as a ball
_BORDER = 1.2  # a factor within which the reader doubts its own choice between rules
_LEAST_TURN = 0.03  # vertex noise, over the scale, that would turn the frame by a radian
_LEAST_SKEW = 0.03  # skewness below which its sign may be lost
_WHOLE = 1e-6  # how exactly a rotation permutes the axes to be taken for a permutation
_FAVOUR = 12.0  # how much better a turn must be than the principal axes, which have fewer symmetric positions


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
        return Solid(self.points(solid.vertices), solid.triangles, solid.free)

    def shifted(self, motion: Floats) -> "Frame":
        """The frame after a small ``motion`` (7,): translation, rotation vector, log scale; all as seen in it."""
        a, b, c = motion[3:6]
        angle = float(np.linalg.norm(motion[3:6]))
        cross = np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]])
        sine, versine = np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2
        turn = np.eye(3) + sine * cross + versine * cross @ cross  # Rodrigues
        origin = self.origin + self.scale * motion[:3] @ self.axes
        return Frame(origin, self.scale * float(np.exp(motion[6])), turn.T @ self.axes)


@dataclass(frozen=True)
class Turn:
    """The complex moment of w^order |w|^(2 radial) z^axial that turns a frame about its axis number ``axis``.

    w = x + i y are the coordinates in the plane, in cyclic order after z, the one along the axis.
    """

    axis: int
    order: int
    radial: int = 0
    axial: int = 0

    @property
    def degree(self) -> int:
        return self.order + 2 * self.radial + self.axial

    def __call__(self, points: Floats) -> np.ndarray:
        """The function's values (...,) at points (..., 3)."""
        z = points[..., self.axis]
        w = points[..., (self.axis + 1) % 3] + 1j * points[..., (self.axis + 2) % 3]
        return np.asarray(w**self.order * np.abs(w) ** (2 * self.radial) * z**self.axial)

    def moment(self, seen: Solid, measure: Measure) -> complex:
        return complex_moment(seen, measure, self, self.degree)


_AXES = (2, 0, 0)  # the moment of w^2: what the principal axes themselves are turned by
_TURNS = (_AXES, (1, 1, 0), (1, 0, 2), (2, 0, 1), (3, 0, 0), (3, 0, 1), (4, 0, 0), (5, 0, 0), (6, 0, 0))


@dataclass(frozen=True)
class Rule:
    """How to derive a frame from a solid: which moments, and the turn where two of them are nearly equal."""

    measure: Measure
    turn: Turn | None = None

    def frames(self, solid: Solid) -> list[Frame]:
        """The frames that the rule allows, likeliest first: one, or with a turn all its symmetric positions."""
        upright = self._signed(solid, principal(solid, self.measure)[0])
        if self.turn is None:
            return [upright]
        frames = list(self._turned(solid, upright))
        skew = [third_moments(frame.solid(solid), self.measure) for frame in frames]
        plane = (self.turn.axis + 1) % 3
        return [frames[i] for i in np.argsort([-s[plane] - 100.0 * (s[self.turn.axis] > 0) for s in skew])]

    def near(self, solid: Solid, frame: Frame) -> Frame:
        """The allowed frame nearest to ``frame``: for a solid that has been moved a little."""
        base = principal(solid, self.measure)[0]
        signs = np.sign(np.einsum("ij,ij->i", base.axes, frame.axes))
        base = replace(base, axes=base.axes * np.where(signs == 0, 1.0, signs)[:, None])
        if self.turn is None:
            return base
        if np.linalg.det(base.axes) < 0:  # within the plane of equal moments the axes are arbitrary
            base.axes[(self.turn.axis + 1) % 3] *= -1.0
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
        for axis in range(3) if self.turn is None else (self.turn.axis,):
            b, c = (axis + 1) % 3, (axis + 2) % 3
            plane = variance[axis] * np.eye(2) - second[np.ix_([b, c], [b, c])] / mass
            tilt = np.linalg.solve(plane, change[off[axis, [b, c]]])  # how the axis leans towards b and c
            turning[c], turning[b] = tilt[0], -tilt[1]
        rows = np.concatenate([change[1:4], turning, 0.5 * spread.sum(axis=0, keepdims=True)])
        if self.turn is not None:
            rows[3 + self.turn.axis] = self._turn_response(seen, normal, rows)
        return np.asarray(rows, np.float64)

    def doubts(self, solid: Solid, frames: list[Frame]) -> list[Floats]:
        """How the first of `frames` may lie wrong by whole axes: rotations (3, 3) that permute and flip, first none.

        Without a turn, half turns where third moments are too small to be sure of; with one, its symmetric positions.
        """
        if self.turn is not None:
            turns = [frame.axes @ frames[0].axes.T for frame in frames]
            return [np.rint(turn) for turn in turns if np.abs(turn - np.rint(turn)).max() < _WHOLE]
        skew = np.abs(third_moments(frames[0].solid(solid), self.measure))
        order = np.argsort(skew)
        found = [np.eye(3)]
        for a, b in ((0, 1), (0, 2), (1, 2)):
            signs = np.ones(3)
            signs[order[[a, b]]] = -1.0
            if skew[order[b]] < _LEAST_SKEW or (a == 0 and skew[order[b]] < _BORDER * skew[order[0]]):
                found.append(np.diag(signs))
        return found

    def _signed(self, solid: Solid, base: Frame) -> Frame:
        skew = third_moments(base.solid(solid), self.measure)
        axes = base.axes * np.where(skew < 0, -1.0, 1.0)[:, None]
        if np.linalg.det(axes) < 0:
            axes[np.argmin(np.abs(skew))] *= -1.0
        return replace(base, axes=axes)

    def _turned(self, solid: Solid, base: Frame) -> Iterator[Frame]:
        """The frame turned until its complex moment is real and positive, in all ways; ``base`` is right-handed."""
        assert self.turn is not None
        other = base.axes.copy()
        other[[self.turn.axis, (self.turn.axis + 2) % 3]] *= -1.0  # upside down
        for start in (base, replace(base, axes=other)):
            angle = float(np.angle(self.turn.moment(start.solid(solid), self.measure)))
            for part in range(self.turn.order):
                motion = np.zeros(7)
                motion[3 + self.turn.axis] = (angle + 2.0 * np.pi * part) / self.turn.order
                yield start.shifted(motion)

    def _turn_response(self, seen: Solid, normal: Floats, rows: Floats) -> Floats:
        """Rotation about the turn's axis (n_mesh,) that keeps the complex moment real, the other motions given."""
        assert self.turn is not None
        turn = self.turn

        def value(x: Floats) -> Floats:
            return turn(x)[..., None]

        here = turn.moment(seen, self.measure)
        total = response(seen, normal, self.measure, value)[:, 0]
        step, still = 1e-4, Frame(np.zeros(3), 1.0, np.eye(3))
        for part in range(6):
            if part != 3 + turn.axis:
                motion = np.zeros(7)
                motion[part] = step
                slope = turn.moment(still.shifted(motion).solid(seen), self.measure) - turn.moment(
                    still.shifted(-motion).solid(seen), self.measure
                )
                total = total + slope / (2.0 * step) * rows[part]
        return np.asarray(np.imag(total / here) / turn.order)


def rules(solid: Solid) -> list[Rule]:
    """The rules that fit a solid, best first; more than one where the choice is close.

    Errors: MeshError for a solid without volume, or as symmetric as a ball or a torus.
    """
    found: list[Rule] = []
    for measure in _measures(solid):
        frame, (a, b, c) = principal(solid, measure)
        gaps = np.array([abs(b - c) / (b + c), abs(c - a) / (c + a), abs(a - b) / (a + b)])
        if gaps.max() < _ROUND:
            continue
        if gaps.min() > _EQUAL:
            found.append(Rule(measure))
        else:
            found += [Rule(measure, turn) for turn in _turns(frame.solid(solid), measure, int(np.argmin(gaps)))]
    if not found:
        raise MeshError(
            "the solid is as symmetric as a ball, a cube or a torus: nothing in its shape tells which way it faces;"
            " a mark on its vertices (saliency-scs) or a small added feature is the remedy"
        )
    return found


def principal(solid: Solid, measure: Measure) -> tuple[Frame, Floats]:
    """The frame of the principal axes, of any sign, and the variance (3,) along each, of sum one, ascending."""
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


def _measures(solid: Solid) -> list[Measure]:
    """Volume or area moments; both, the better first, where the choice is close."""
    frame, _ = principal(solid, "area")
    thickness = geometry.volume(solid.vertices - frame.origin, solid.triangles) / (solid.area * frame.scale)
    order: list[Literal["volume", "area"]] = ["volume", "area"] if thickness >= _THIN else ["area", "volume"]
    return order if _THIN / _BORDER < thickness < _THIN * _BORDER else order[:1]


def _turns(seen: Solid, measure: Measure, axis: int) -> list[Turn | None]:
    """The turns whose angle noise disturbs least, best first; None, the principal axes, wins where it comes close."""
    x, area = seen.vertices[: len(seen.free)], seen.vertex_areas
    scored: list[tuple[float, Turn | None]] = []
    for powers in _TURNS:
        turn = Turn(axis, *powers)
        noise = float(np.sqrt(np.sum(np.abs(turn(x)) ** 2 * area**2)))  # of the moment, for vertex noise of one
        score = turn.order * abs(turn.moment(seen, measure)) / noise
        if score > _LEAST_TURN:
            scored.append((_FAVOUR * score, None) if powers == _AXES else (score, turn))
    scored.sort(key=lambda pair: -pair[0])
    return [turn for score, turn in scored if score * _BORDER > scored[0][0]]
