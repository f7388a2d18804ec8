"""Any surface as the boundary of a solid: winding and closing."""

import numpy as np
import pytest
from scipy.optimize import brentq

from o3dmark.arrays import Floats, Ints
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface
from o3dmark.solid.closing import boundary, fans, oriented


@pytest.fixture(scope="module")
def surface(spot: object) -> Surface:
    return Surface.of(spot)


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


def bent_sheet(angle: float) -> tuple[Floats, Ints]:
    """A unit square bent to an arc of ``angle`` about the y axis, wound so that its closed volume is negative."""
    n = 30
    turn, y = np.meshgrid(angle * np.linspace(-0.5, 0.5, n), np.linspace(0.0, 1.0, n), indexing="ij")
    vertices = np.stack([np.sin(turn) / angle, y, np.cos(turn) / angle], axis=-1).reshape(-1, 3)
    i = (n * np.arange(n - 1)[:, None] + np.arange(n - 1)).ravel()
    return vertices, np.concatenate([np.stack([i, i + 1, i + n], 1), np.stack([i + 1, i + n + 1, i + n], 1)])


def flatness(vertices: Floats, triangles: Ints) -> float:
    """Volume of an open piece, coned to the mean of its boundary's midpoints, over the power 3/2 of its area."""
    apex = vertices[np.stack(boundary(triangles, len(vertices)))].mean(axis=(0, 1))
    return geometry.volume(vertices - apex, triangles) / geometry.areas(vertices, triangles).sum() ** 1.5


@pytest.mark.parametrize("limit", [0.0295, 0.0305])
def test_a_piece_that_is_nearly_flat_keeps_its_winding(surface: Surface, limit: float) -> None:
    """Nearly flat is below 0.03. This is part of the format: marks on open sheets depend on it."""
    angle = brentq(lambda a: -flatness(*bent_sheet(a)) - limit, 0.1, 2.0)
    vertices, sheet = bent_sheet(angle)
    triangles = np.concatenate([surface.triangles, len(surface.vertices) + sheet])
    found = oriented(np.concatenate([surface.vertices, vertices]), triangles)[len(surface.triangles) :]
    assert np.array_equal(found - len(surface.vertices), sheet[:, ::-1] if limit > 0.03 else sheet)
