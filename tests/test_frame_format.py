"""The choice of the frame is part of the format: a mark is read in the frame it was written in, or not at all.

Each threshold is held between two solids, a little below and a little above it. If one of these tests fails, marks on
solids like these can no longer be read.
"""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import brentq

from fixtures.shapes import column, cuboid
from o3dmark.arrays import Floats
from o3dmark.errors import MeshError
from o3dmark.mesh.surface import Surface
from o3dmark.solid.frame import FRAME_2026, FrameRule, principal, rules
from o3dmark.solid.moments import ComplexMoment, moments, third_moments
from o3dmark.solid.solid import Solid

MEASURES = ["volume", "area"]


def star(points: int, depth: float, stretch: float = 1.0) -> Solid:
    """A column whose cross-section has so many points, stretched along x."""
    solid = column(starry(points, depth))
    return Solid(solid.vertices * [stretch, 1.0, 1.0], solid.triangles, solid.movable)


def starry(points: int, depth: float) -> Callable[[Floats, Floats], np.ndarray]:
    """The cross-section of a star: its angles, and whatever heights, to x + i y."""
    return lambda angle, _: np.exp(1j * angle) * (1.0 + depth * np.cos(points * angle))


def steadiness(solid: Solid, moment: ComplexMoment) -> float:
    """Vertex noise, over the scale, that turns the frame about the z axis by a radian."""
    seen = principal(solid, "volume")[0].solid(solid)
    noise = np.linalg.norm(moment.function(seen.vertices[: len(seen.movable)]) * seen.vertex_areas)
    return float(moment.order * abs(moment.of(seen, "volume")) / noise)


def chosen(solid: Solid) -> list[ComplexMoment | None]:
    return [rule.moment for rule in rules(solid, FRAME_2026)]


# Volume or area


def thickness(box: np.ndarray) -> float:
    """Volume over (area times the surface's radius of gyration) of a box with sides (3,), in closed form."""
    faces = np.prod(box) / box  # area of a face across each axis
    square = (faces.sum() * box**2 / 3 + 2.0 * faces * box**2 / 3) / 4.0  # of a coordinate, over half of the surface
    return float(np.prod(box) / (2.0 * faces.sum()) / np.sqrt(square.sum() / faces.sum()))


@pytest.mark.parametrize(
    ("wanted", "measures"),
    [
        (0.0202, ["area"]),
        (0.0214, ["area", "volume"]),
        (0.0247, ["area", "volume"]),
        (0.0253, ["volume", "area"]),
        (0.0294, ["volume", "area"]),
        (0.0306, ["volume"]),
        (0.0590, ["volume"]),
    ],
)
def test_thin_sheets_go_by_their_area_and_border_cases_by_both(wanted: float, measures: list[str]) -> None:
    """Thin is below 0.025; within a factor of 1.2 of that the reader is given both rules, the writer's first."""
    thin = brentq(lambda side: thickness(np.array([2.0, 3.0, side])) - wanted, 0.01, 1.0)
    assert [rule.measure for rule in rules(cuboid(2.0, 3.0, thin), FRAME_2026)] == measures


# Principal axes or a complex moment


@pytest.mark.parametrize(("gap", "refused"), [(0.049, True), (0.051, False)])
def test_solids_as_round_as_a_ball_are_refused(gap: float, refused: bool) -> None:
    solid = cuboid(1.0, 1.0, np.sqrt((1.0 + gap) / (1.0 - gap)))
    if refused:
        with pytest.raises(MeshError, match="symmetric"):
            rules(solid, FRAME_2026)
    else:
        assert chosen(solid) == [ComplexMoment(2, 4)]


@pytest.mark.parametrize(("gap", "expected"), [(0.098, [None, ComplexMoment(2, 5)]), (0.102, [None])])
def test_only_nearly_equal_moments_are_turned_by_others(gap: float, expected: list[ComplexMoment | None]) -> None:
    """A star that says clearly which way it faces is asked up to a relative difference of 0.1 of its moments."""

    def difference(stretch: float) -> float:
        a, b, _ = principal(star(5, 0.7, stretch), "volume")[1]
        return float(b - a) / (a + b)

    stretch = brentq(lambda s: difference(s) - gap, 1.05, 1.2, xtol=1e-4)
    assert chosen(star(5, 0.7, stretch)) == expected


@pytest.mark.parametrize(("wanted", "refused"), [(0.029, True), (0.031, False)])
def test_a_moment_whose_angle_is_lost_in_noise_is_not_used(wanted: float, refused: bool) -> None:
    depth = brentq(lambda d: steadiness(star(3, d), ComplexMoment(2, 3)) - wanted, 1e-4, 0.01, xtol=1e-6)
    if refused:
        with pytest.raises(MeshError, match="symmetric"):
            rules(star(3, depth), FRAME_2026)
    else:
        assert chosen(star(3, depth)) == [ComplexMoment(2, 3)]


@pytest.mark.parametrize(
    ("ratio", "expected"),
    [
        (9.8, [None]),
        (10.2, [None, ComplexMoment(2, 3)]),
        (11.8, [None, ComplexMoment(2, 3)]),
        (12.2, [ComplexMoment(2, 3), None]),
        (14.2, [ComplexMoment(2, 3), None]),
        (14.6, [ComplexMoment(2, 3)]),
    ],
)
def test_principal_axes_are_favoured(ratio: float, expected: list[ComplexMoment | None]) -> None:
    """A complex moment must be 12 times as steady as they are; within a factor of 1.2 of that the reader gets both."""

    def advantage(stretch: float) -> float:
        solid = star(3, 0.3, stretch)
        return steadiness(solid, ComplexMoment(2, 3)) / steadiness(solid, ComplexMoment(2, 2))

    stretch = brentq(lambda s: advantage(s) - ratio, 1.03, 1.1, xtol=1e-5)
    assert chosen(star(3, 0.3, stretch)) == expected


# The complex moments


def eccentric(t: np.ndarray, z: np.ndarray) -> np.ndarray:
    """A ringed column whose rings stand aside so that only w |w|^2 tells where."""
    radius = 1.0 + 0.4 * np.cos(5.0 * z)
    basis = np.stack([np.ones_like(z), z**2]).reshape(2, -1)
    weight = radius.ravel() ** 2
    part = np.linalg.solve((basis * weight) @ basis.T, (basis * weight) @ weight)
    return radius * np.exp(1j * t) + 0.1 * (weight - part @ basis).reshape(z.shape)


TURNED = {
    (1, 1, 0): eccentric,
    (1, 0, 2): lambda t, z: np.exp(1j * t) + 0.02 * z**2,
    (2, 0, 1): lambda t, z: np.exp(1j * t) * (1.0 + 0.1 * z * np.cos(2.0 * t)),
    (3, 0, 0): starry(3, 0.1),
    (3, 0, 1): lambda t, z: np.exp(1j * t) * (1.0 + 0.1 * z * np.cos(3.0 * t)),
    (4, 0, 0): starry(4, 0.1),
    (5, 0, 0): starry(5, 0.1),
    (6, 0, 0): starry(6, 0.1),
}


@pytest.mark.parametrize("powers", TURNED, ids=str)
def test_every_moment_serves_the_solids_that_it_suits_best(powers: tuple[int, int, int]) -> None:
    """A solid whose two smaller moments are equal is turned about its long axis by this moment and no other."""
    assert chosen(column(TURNED[powers])) == [ComplexMoment(2, *powers)]


def test_flat_solids_are_turned_about_their_short_axis() -> None:
    solid = column(TURNED[3, 0, 0], height=0.5)
    assert chosen(solid) == [ComplexMoment(0, 3)]


@pytest.mark.parametrize("powers", [(1, 0, 2), (3, 0, 0), (2, 0, 1)], ids=str)
def test_the_first_of_a_moments_frames_looks_up_and_leans_to_the_first_axis(powers: tuple[int, int, int]) -> None:
    """The writer takes the first: skewness along the axis above zero, and among those the largest across it."""
    cross = TURNED[powers]
    solid = column(lambda t, z: cross(t, z) * (1.3 + 0.2 * z))  # thicker at one end, so that it has an up
    rule = FrameRule("volume", ComplexMoment(2, *powers))
    skew = np.array([third_moments(frame.solid(solid), "volume") for frame in rule.frames(solid)])
    up = skew[:, 2] > 0
    assert up[0]
    assert up.sum() == len(skew) / 2
    assert skew[0, 0] == pytest.approx(skew[up, 0].max())


# The signs of the axes


@pytest.mark.parametrize("measure", MEASURES)
@pytest.mark.parametrize("mirror", [(1, 1, 1), (-1, 1, 1), (1, -1, 1), (1, 1, -1), (-1, -1, -1)], ids=str)
def test_the_longest_axis_is_last_and_third_moments_are_positive_but_for_the_least_sure(
    spot: object, measure: str, mirror: tuple[int, int, int]
) -> None:
    cover = Surface.of(spot)
    x, y, z = cover.vertices.T
    sheared = np.stack([x + 0.3 * y**2 + 0.2 * z * x, y + 0.1 * x, z + 0.2 * x], axis=1)  # spot is mirror-symmetric
    solid = Solid.of(cover.moved(sheared * mirror))
    frame = FrameRule(measure).frames(solid)[0]  # type: ignore[arg-type]
    skew = third_moments(frame.solid(solid), measure)  # type: ignore[arg-type]
    assert np.linalg.det(frame.axes) == pytest.approx(1.0)
    assert (np.delete(skew, np.argmin(np.abs(skew))) > 0).all()
    extent = np.diag(moments(frame.solid(solid), measure)[2])  # type: ignore[arg-type]
    assert (np.diff(extent) > 0).all()
