"""How a surface may move: hinges against differences, and motions that keep planes plane and creases where they are."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface, TriangleMesh, mesh_arrays
from o3dmark.motion import metric
from o3dmark.motion.hinges import Hinges
from o3dmark.motion.metric import Motions, roughness

Arrays = tuple[np.ndarray, np.ndarray]


@pytest.fixture(scope="module")
def surface(spot: TriangleMesh) -> Surface:
    return Surface.of(spot)


@pytest.fixture(scope="module")
def box() -> Surface:
    return Surface.of(TriangleMesh.create_box().subdivide_midpoint(4))


def unseen(surface: Surface) -> Motions:
    n = len(surface.vertices)
    return Motions.unseen(surface.vertices, surface.triangles, surface.normals, surface.vertex_areas, np.ones(n, bool))


def moved(surface: Surface, motions: Motions, motion: np.ndarray) -> np.ndarray:
    return surface.vertices + (motions.directions @ motion).reshape(-1, 3)


def answer(surface: Surface, function: Callable[[np.ndarray], np.ndarray], motions: Motions) -> np.ndarray:
    """How the integral of a function over the solid answers to each direction (1, d)."""
    ways = function(surface.vertices)[:, None] * geometry.vertex_area_vectors(surface.vertices, surface.triangles) / 3.0
    return (ways.ravel() @ motions.directions)[None]


class TestHinges:
    def test_a_closed_mesh_has_one_for_every_edge(self, surface: Surface) -> None:
        hinges = Hinges.of(surface.triangles)
        assert len(hinges.edge) == len(geometry.edges(surface.triangles)) == len(surface.triangles) * 3 // 2
        corners = np.concatenate([hinges.edge, hinges.opposite], axis=1)
        for side in range(2):
            triangle = np.sort(surface.triangles[hinges.triangle[:, side]], axis=1)
            assert np.array_equal(triangle, np.sort(corners[:, [0, 1, 2 + side]], axis=1))

    def test_open_and_shared_edges_are_none(self) -> None:
        fan = np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4], [0, 2, 5]])
        assert Hinges.of(fan).edge.tolist() == [[0, 2]] or Hinges.of(fan).edge.tolist() == [[2, 0]]

    def test_a_box_is_convex_by_right_angles(self, box: Surface) -> None:
        angles = np.degrees(Hinges.of(box.triangles).angles(box.vertices, box.triangles))
        assert set(np.round(angles)) == {0.0, 90.0}
        inward = Hinges.of(box.triangles[:, ::-1])
        assert np.degrees(inward.angles(box.vertices, box.triangles[:, ::-1])).min() == pytest.approx(-90.0)

    def test_the_slope_of_the_angle_is_that_of_a_small_motion(self, surface: Surface) -> None:
        hinges, motion = Hinges.of(surface.triangles), np.random.default_rng(0).standard_normal(surface.vertices.shape)
        change, _ = hinges.bending(surface.vertices, surface.triangles)
        step = 1e-6 * surface.diagonal
        ahead, back = (hinges.angles(surface.vertices + s * motion, surface.triangles) for s in (step, -step))
        expected, found = (ahead - back) / (2.0 * step), change @ motion.ravel()
        np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max())

    def test_a_rigid_motion_bends_nothing(self, surface: Surface) -> None:
        change, price = Hinges.of(surface.triangles).bending(surface.vertices, surface.triangles)
        turn = np.array([1.0, 2.0, 3.0]) + np.cross([0.3, -0.5, 0.7], surface.vertices)
        assert np.abs(change @ turn.ravel()).max() < 1e-9 * np.abs(change).max()
        assert (price > 0).all()


class TestRoughness:
    def test_none_on_a_plane_nor_over_a_crease(self, box: Surface) -> None:
        assert roughness(box.vertices, box.triangles, Hinges.of(box.triangles)).max() < 1e-7

    def test_more_on_a_smaller_ball_and_on_noise(self) -> None:
        ball = Surface.of(TriangleMesh.create_icosahedron().subdivide_loop(3))
        fine = Surface.of(TriangleMesh.create_icosahedron().subdivide_loop(4))
        coarse, smooth = (
            float(np.median(roughness(s.vertices, s.triangles, Hinges.of(s.triangles)))) for s in (ball, fine)
        )
        assert 0 < smooth < 0.5 * coarse
        noise = 1e-2 * np.random.default_rng(0).standard_normal(fine.vertices.shape)
        assert np.median(roughness(fine.vertices + noise, fine.triangles, Hinges.of(fine.triangles))) > 5 * smooth


class TestMotions:
    def test_along_normals_each_pays_its_weight(self, surface: Surface) -> None:
        weights, movable = np.arange(1.0, len(surface.vertices) + 1.0), np.arange(len(surface.vertices)) % 3 > 0
        motions = Motions.along(surface.normals, weights, movable)
        assert motions.directions.shape == (3 * len(weights), movable.sum())
        step = np.ones(movable.sum())
        there = moved(surface, motions, step)
        np.testing.assert_allclose(there[movable] - surface.vertices[movable], surface.normals[movable], atol=1e-12)
        assert np.array_equal(there[~movable], surface.vertices[~movable])
        np.testing.assert_allclose(motions.least(step[None])[0], 1.0 / weights[movable])

    def test_vertices_of_creases_may_go_anywhere_and_others_along_their_normals(self, box: Surface) -> None:
        motions = unseen(box)
        crease = (np.isclose(np.abs(box.vertices - 0.5), 0.5).sum(axis=1) > 1).sum()
        assert motions.directions.shape[1] == len(box.vertices) + 2 * crease

    def test_planes_stay_plane_and_creases_sharp(self, box: Surface) -> None:
        """To take volume from one end of a box, sides tilt; they would swing along averaged normals."""
        spreads = []
        for motions in (Motions.along(box.normals, box.vertex_areas, np.ones(len(box.vertices), bool)), unseen(box)):
            pull = answer(box, lambda x: np.cos(3.0 * x[:, 0]) * np.sin(2.0 * x[:, 1]), motions)
            motion = motions.least(pull)[0]
            there = moved(box, motions, 0.01 * motion / np.abs(motion).max())
            face = geometry.unit(geometry.area_vectors(there, box.triangles))
            before = np.round(geometry.unit(geometry.area_vectors(box.vertices, box.triangles)))
            spreads.append(max(np.ptp(face[(before == side).all(axis=1)], axis=0).max() for side in np.eye(3)))
        assert spreads[1] < 0.2 * spreads[0]

    def test_the_motion_is_the_cheapest_for_what_it_does(self, surface: Surface) -> None:
        """Of motions with the same effect none has less of the form that `least` inverts."""
        motions = unseen(surface)
        pull = answer(surface, lambda x: np.cos(9.0 * x[:, 0]), motions)
        motion = motions.least(pull)
        other = np.random.default_rng(0).standard_normal(motion.shape)
        other -= motion * (pull @ other.T) / (pull @ motion.T)  # does nothing
        price = motions.least(np.eye(1, motion.shape[1])) @ pull.T  # the form is symmetric: e' M^-1 p = p' M^-1 e
        assert price[0, 0] == pytest.approx(motion[0, 0])
        assert pull @ motion.T > 0
        assert abs((pull @ other.T).item()) < 1e-9 * np.linalg.norm(pull) * np.linalg.norm(other)

    def test_what_is_stiff_bends_less(self, surface: Surface) -> None:
        bent = []
        hinges = Hinges.of(surface.triangles)
        change, price = hinges.bending(surface.vertices, surface.triangles)
        everywhere = np.ones(len(surface.vertices), bool)
        for motions in (Motions.along(surface.normals, surface.vertex_areas, everywhere), unseen(surface)):
            pull = answer(surface, lambda x: np.cos(9.0 * x[:, 0] / surface.diagonal), motions)
            motion = motions.least(pull) / (pull @ motions.least(pull).T)
            bent.append(price @ (change @ (motions.directions @ motion[0])) ** 2)
        assert bent[1] < 0.5 * bent[0]

    def test_of_many_vertices_bending_has_no_price(self, surface: Surface, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(metric, "_MOST", 100)
        assert unseen(surface).directions.shape[1] == len(surface.vertices)
        np.testing.assert_allclose(
            unseen(surface).least(np.ones((1, len(surface.vertices))))[0], 1 / surface.vertex_areas
        )


def test_a_turned_surface_moves_as_the_surface_does(surface: Surface) -> None:
    turn = Rotation.from_euler("xyz", [0.3, 0.7, -0.4]).as_matrix()
    turned = surface.moved(surface.vertices @ turn.T)
    there = []
    for each in (surface, turned):
        motions = unseen(each)
        pull = answer(each, lambda x: np.linalg.norm(x, axis=1), motions)
        there.append((motions.directions @ motions.least(pull)[0]).reshape(-1, 3))
    np.testing.assert_allclose(there[0] @ turn.T, there[1], atol=1e-6 * np.abs(there[0]).max())


def test_arrays_are_left_alone(spot: TriangleMesh) -> None:
    vertices, triangles = (np.array(each) for each in mesh_arrays(spot))
    before = vertices.copy(), triangles.copy()
    surface = Surface.from_arrays(vertices, triangles)
    unseen(surface)
    assert all(np.array_equal(a, b) for a, b in zip(before, (vertices, triangles), strict=True))
