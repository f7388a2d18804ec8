"""The canonical frame: it moves with the solid, and nothing else moves it."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fixtures.shapes import rotation
from o3dmark.errors import MeshError
from o3dmark.files import read_mesh
from o3dmark.mesh.surface import Surface
from o3dmark.solid.frame import FRAME_2026, Frame, FrameRule, principal, rules
from o3dmark.solid.moments import ComplexMoment, moments, third_moments
from o3dmark.solid.solid import Solid

RULES = [
    FrameRule("volume"),
    FrameRule("area"),
    FrameRule("volume", ComplexMoment(0, 3)),
    FrameRule("area", ComplexMoment(1, 2, 0, 1)),
]
MEASURES = ["volume", "area"]


@pytest.fixture(scope="module")
def solid(spot: object) -> Solid:
    """Spot, sheared: it is nearly mirror-symmetric, which leaves one sign of its frame to chance."""
    surface = Surface.of(spot)
    x, y, z = surface.vertices.T
    return Solid.of(surface.moved(np.stack([x + 0.3 * y**2 + 0.2 * z * x, y + 0.1 * x, z + 0.2 * x], axis=1)))


@pytest.mark.parametrize("rule", RULES, ids=str)
@pytest.mark.parametrize("scale", [1e-2, 1.0, 1e2])
def test_it_is_equivariant_under_similarity(solid: Solid, rule: FrameRule, scale: float) -> None:
    R, t = rotation(1), np.array([3.0, -40.0, 7.0])
    moved = solid.moved(scale * solid.vertices[: len(solid.movable)] @ R.T + t)
    here, there = rule.frames(solid), rule.frames(moved)
    assert len(here) == len(there)
    for a, b in zip(here, there, strict=True):
        assert b.points(moved.vertices) == pytest.approx(a.points(solid.vertices), abs=1e-7)


@pytest.mark.parametrize("rule", RULES, ids=str)
def test_frames_are_right_handed_and_orthonormal(solid: Solid, rule: FrameRule) -> None:
    for frame in rule.frames(solid):
        assert frame.axes @ frame.axes.T == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(frame.axes) == pytest.approx(1.0)


@pytest.mark.parametrize("measure", MEASURES)
def test_seen_in_its_frame_a_solid_is_centred_of_unit_gyration_and_upright(solid: Solid, measure: str) -> None:
    rule = FrameRule(measure)  # type: ignore[arg-type]
    mass, first, second = moments(rule.frames(solid)[0].solid(solid), rule.measure)
    assert first / mass == pytest.approx(np.zeros(3), abs=1e-9)
    assert np.trace(second) / mass == pytest.approx(1.0)
    assert second - np.diag(np.diag(second)) == pytest.approx(np.zeros((3, 3)), abs=1e-9)


def test_a_complex_moment_becomes_real_and_positive(solid: Solid) -> None:
    for rule in RULES[2:]:
        assert rule.moment is not None
        assert len(rule.frames(solid)) == 2 * rule.moment.order
        for frame in rule.frames(solid):
            moment = rule.moment.of(frame.solid(solid), rule.measure)
            assert moment.real > 0
            assert abs(moment.imag) < 1e-6 * moment.real


@pytest.mark.parametrize("rule", RULES, ids=str)
def test_the_response_is_the_derivative(solid: Solid, rule: FrameRule) -> None:
    """Against moving the vertices by a smooth field and deriving the frame anew."""
    frame = rule.frames(solid)[0]
    n = len(solid.movable)
    surface = Surface(solid.vertices[:n].copy(), solid.triangles.copy(), np.arange(n))
    field = np.cos(frame.points(solid.vertices[:n]) @ np.array([1.0, 2.0, 0.5]) + 0.3)
    h = 1e-5
    moved = solid.moved(solid.vertices[:n] + frame.scale * h * field[:, None] * surface.normals)
    there = rule.near(moved, frame)
    turn = frame.axes @ there.axes.T
    found = np.concatenate(
        [
            frame.axes @ (there.origin - frame.origin) / frame.scale,
            0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]),
            [np.log(there.scale / frame.scale)],
        ]
    )
    expected = rule.response(solid, frame, surface.normals) @ field
    assert found / h == pytest.approx(expected, abs=0.05 * np.abs(expected).max())


def test_near_keeps_to_the_branch(solid: Solid) -> None:
    for rule in RULES:
        for frame in rule.frames(solid):
            assert rule.near(solid, frame).axes == pytest.approx(frame.axes, abs=1e-9)


def test_shifted_moves_what_is_seen(solid: Solid) -> None:
    frame = FrameRule("volume").frames(solid)[0]
    x = frame.points(solid.vertices)
    motion = 1e-4 * np.array([1.0, -2.0, 0.5, 0.3, 0.7, -1.0, 0.9])
    expected = x - motion[:3] - np.cross(motion[3:6], x) - motion[6] * x
    assert frame.shifted(motion).points(solid.vertices) == pytest.approx(expected, abs=1e-6)


def test_subdivision_changes_nothing(solid: Solid) -> None:
    v, t = solid.vertices, solid.triangles
    centre = v[t].mean(axis=1)
    c = len(v) + np.arange(len(t))
    finer = np.concatenate([np.stack([t[:, i], t[:, (i + 1) % 3], c], axis=1) for i in range(3)])
    other = Solid(np.concatenate([v, centre]), finer, np.ones(len(v) + len(t), bool))
    for measure in MEASURES:
        a, b = (FrameRule(measure).frames(s)[0] for s in (solid, other))  # type: ignore[arg-type]
        assert b.points(v) == pytest.approx(a.points(v), abs=1e-9)


def test_third_moments_of_a_cone_point_to_its_tip() -> None:
    turn = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn), np.zeros(200)], axis=1)
    v = np.concatenate([ring, [[0, 0, 3.0], [0, 0, 0]]])
    i, j = np.arange(200), (np.arange(200) + 1) % 200
    t = np.concatenate([np.stack([i, j, 0 * i + 200], 1), np.stack([j, i, 0 * i + 201], 1)])
    cone = Solid(v - [0, 0, 0.75], t, np.ones(202, bool))
    mass, first, _ = moments(cone, "volume")
    assert mass == pytest.approx(np.pi, rel=1e-3)
    assert first == pytest.approx(np.zeros(3), abs=1e-9)
    # a cone's height follows a Beta(1, 3) law
    assert third_moments(cone, "volume") == pytest.approx([0.0, 0.0, 0.8607], abs=1e-3)


@pytest.mark.parametrize("name", ["extra/torus_2304.ply", "extra/sphere_16070.ply"])
def test_round_solids_are_refused(shared: Callable[[str], Path], name: str) -> None:
    with pytest.raises(MeshError, match="symmetric"):
        rules(Solid.of(Surface.of(read_mesh(shared(f"meshes/{name}")))), FRAME_2026)


def test_a_flat_surface_is_refused() -> None:
    flat = Surface.from_arrays(
        np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [1, 1, 0.0]]), np.array([[0, 1, 2], [1, 3, 2]])
    )
    with pytest.raises(MeshError, match="no volume"):
        principal(Solid.of(flat), "volume")


def test_thin_sheets_go_by_their_area(solid: Solid) -> None:
    assert rules(solid, FRAME_2026)[0].measure == "volume"
    n = len(solid.movable)
    thin = solid.moved(solid.vertices[:n] * [1.0, 1.0, 0.01])
    assert rules(thin, FRAME_2026)[0].measure == "area"


def test_ambiguities_begin_with_none_and_are_rotations(solid: Solid) -> None:
    n = len(solid.movable)
    both = np.concatenate([solid.vertices[:n], -solid.vertices[:n]])  # a mirror-symmetric pair: no third moments
    pair = Solid(both, np.concatenate([solid.triangles, n + solid.triangles[:, ::-1]]), np.ones(2 * n, bool))
    for each, count in ((solid, 1), (pair, 4)):
        ambiguities = FrameRule("volume").ambiguities(each, FrameRule("volume").frames(each))
        assert len(ambiguities) == count
        assert np.array_equal(ambiguities[0], np.eye(3))
        assert all(np.linalg.det(turn) == pytest.approx(1.0) for turn in ambiguities)


def test_a_fourfold_moment_leaves_all_its_positions_open(solid: Solid) -> None:
    rule = FrameRule("volume", ComplexMoment(2, 4))
    frames = rule.frames(solid)
    ambiguities = rule.ambiguities(solid, frames)
    assert len(ambiguities) == len(frames) == 8
    for turn, frame in zip(ambiguities, frames, strict=True):
        assert turn @ frames[0].axes == pytest.approx(frame.axes, abs=1e-6)


def test_a_frame_is_a_value() -> None:
    still = Frame(np.zeros(3), 1.0, np.eye(3))
    assert np.array_equal(still.points(np.ones((2, 3))), np.ones((2, 3)))
