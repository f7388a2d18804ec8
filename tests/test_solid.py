"""The solid that a mesh bounds: winding, closing, quadrature."""

import numpy as np
import pytest

from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface
from o3dmark.solid.solid import Solid, boundary, fans, normal_rms, oriented, samples


@pytest.fixture(scope="module")
def surface(spot: object) -> Surface:
    return Surface.of(spot)


def volume(solid: Solid) -> float:
    return geometry.volume(solid.vertices, solid.triangles)


def test_a_good_mesh_is_left_alone(surface: Surface) -> None:
    solid = Solid.of(surface)
    assert np.array_equal(solid.triangles, surface.triangles)
    assert solid.movable.all()


def test_winding_is_repaired_whatever_it_was(surface: Surface) -> None:
    rng = np.random.default_rng(0)
    flip = rng.random(len(surface.triangles)) < 0.5
    mixed = np.where(flip[:, None], surface.triangles[:, ::-1], surface.triangles)
    for triangles in (mixed, surface.triangles[:, ::-1]):
        assert geometry.volume(surface.vertices, oriented(surface.vertices, triangles)) == pytest.approx(
            geometry.volume(surface.vertices, surface.triangles)
        )


def test_every_piece_is_turned_outward(surface: Surface) -> None:
    n = len(surface.vertices)
    vertices = np.concatenate([surface.vertices, surface.vertices + 10.0])
    triangles = np.concatenate([surface.triangles, n + surface.triangles[:, ::-1]])
    assert geometry.volume(vertices, oriented(vertices, triangles)) == pytest.approx(
        2.0 * geometry.volume(surface.vertices, surface.triangles)
    )


def test_no_part_of_a_moebius_strip_is_turned_against_another() -> None:
    turn = np.arange(12) * 2.0 * np.pi / 12
    edge = [
        np.stack(
            [
                (1 + s * np.cos(turn / 2)) * np.cos(turn),
                (1 + s * np.cos(turn / 2)) * np.sin(turn),
                s * np.sin(turn / 2),
            ],
            1,
        )
        for s in (-0.3, 0.3)
    ]
    i = np.arange(12)
    j = (i + 1) % 12
    other_i, other_j = np.where(i < 12, 12 + i, i), np.where(j > 0, 12 + j, 0)
    near_j = np.where(j > 0, j, 12)
    triangles = np.concatenate([np.stack([i, near_j, other_i], 1), np.stack([near_j, other_j, other_i], 1)])
    some = np.random.default_rng(0).random((24, 1)) < 0.5
    for winding in (triangles, triangles[:, ::-1], np.where(some, triangles, triangles[:, ::-1])):
        turned = (oriented(np.concatenate(edge), winding) != winding).any(axis=1)
        assert turned.all() or not turned.any()  # all or none


@pytest.mark.parametrize("removed", [1, 40, 700])
def test_fans_close_holes(surface: Surface, removed: int) -> None:
    triangles = surface.triangles[removed:]
    vertices, caps = fans(surface.vertices, triangles)
    closed = np.concatenate([triangles, caps])
    assert len(boundary(triangles, len(vertices))[0]) == len(caps) > 0
    assert not len(boundary(closed, len(vertices))[0])
    assert geometry.area_vectors(vertices, closed).sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)


def test_non_manifold_edges_are_closed_too(surface: Surface) -> None:
    a, b = surface.triangles[0, :2]
    fin = np.array([[a, b, len(surface.vertices)]])
    vertices = np.concatenate([surface.vertices, surface.vertices[[a]] * 1.3])
    solid = Solid.of(Surface.from_arrays(vertices, np.concatenate([surface.triangles, fin])))
    assert not len(boundary(solid.triangles, len(solid.vertices))[0])
    assert not solid.movable[[a, b]].any()


def test_moving_free_vertices_leaves_the_fans_where_they_are(surface: Surface) -> None:
    open_surface = Surface.from_arrays(surface.vertices, surface.triangles[40:])
    solid = Solid.of(open_surface)
    moved = open_surface.vertices + 1e-4 * solid.movable[:, None]
    again = Solid.of(open_surface.moved(moved))
    assert np.array_equal(again.vertices, solid.moved(moved).vertices)
    assert np.array_equal(again.triangles, solid.triangles)


@pytest.mark.parametrize("longest", [1.0, 0.1, 0.03])
def test_samples_integrate_quadratics_exactly(surface: Surface, longest: float) -> None:
    solid = Solid.of(surface)
    exact = samples(solid, 10.0)
    q = samples(solid, longest)
    assert len(q.points) >= len(exact.points)
    assert q.area_vectors.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)
    for f in (lambda x: x[:, 0], lambda x: x[:, 0] * x[:, 1], lambda x: x[:, 2] ** 2):
        assert f(q.points) @ q.area_vectors == pytest.approx(f(exact.points) @ exact.area_vectors, rel=1e-9)
    rebuilt = np.einsum("qc,qcd->qd", q.weights, solid.vertices[q.corners])
    assert rebuilt == pytest.approx(q.points)


def test_no_sampled_triangle_is_longer_than_asked_for(surface: Surface) -> None:
    """The three points of a triangle lie half way from its centroid to its corners."""
    points = samples(Solid.of(surface), 0.02, 0.0).points.reshape(-1, 3, 3)
    sides = 2.0 * np.linalg.norm(points - np.roll(points, 1, axis=1), axis=2)
    assert 0.019 < sides.max() <= 0.02


def test_small_triangles_get_one_point(surface: Surface) -> None:
    assert len(samples(Solid.of(surface), 10.0, 10.0).points) == len(surface.triangles)


def test_the_normal_rms_of_inflating_a_sphere_is_the_step() -> None:
    t, u = np.meshgrid(np.linspace(0, np.pi, 60)[1:-1], np.linspace(0, 2 * np.pi, 100, endpoint=False), indexing="ij")
    v = np.stack([np.sin(t) * np.cos(u), np.sin(t) * np.sin(u), np.cos(t)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(57), np.arange(100), indexing="ij")
    a, b, c, d = 100 * i + j, 100 * i + 100 + j, 100 * i + 100 + (j + 1) % 100, 100 * i + (j + 1) % 100
    triangles = np.concatenate([np.stack(x, axis=-1).reshape(-1, 3) for x in ((a, b, c), (a, c, d))])
    solid = Solid.of(Surface.from_arrays(v, triangles))
    points = solid.vertices[: len(solid.movable)]
    assert normal_rms(solid, 0.01 * points) == pytest.approx(0.01, rel=1e-2)
    assert normal_rms(solid, np.cross([0.0, 0.0, 0.01], points)) < 1e-3
