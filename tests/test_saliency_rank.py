"""Rank correlation of saliency: of the order alone, and with each vertex paired with the one that it came from."""

import numpy as np
import pytest

from o3dmark.arrays import Floats
from o3dmark.attacks import attack_all
from o3dmark.campaign.saliency_rank import counterparts, rank_correlation
from o3dmark.mesh.surface import TriangleMesh
from o3dmark.synthetic import make


@pytest.fixture(scope="module")
def vase() -> TriangleMesh:
    return make("vase:vertices=1500")


def wave(mesh: TriangleMesh) -> Floats:
    """A number for each vertex that depends on its place alone."""
    return np.sin(np.asarray(mesh.vertices) @ [3.0, 1.0, 2.0])


@pytest.mark.parametrize("attack", ["similarity", "noise:amplitude=0.003", "smooth:iterations=30", "quantise:bits=8"])
def test_counterparts_go_by_number_while_the_triangulation_lasts(vase: TriangleMesh, attack: str) -> None:
    attacked = attack_all(vase, (attack, "similarity"), 5)
    found = counterparts(np.asarray(vase.vertices), np.asarray(attacked.vertices))
    assert found.tolist() == list(range(len(vase.vertices)))


@pytest.mark.parametrize(
    ("attack", "reach"), [("reorder", 0.0), ("crop:share=0.3", 0.0), ("subdivide:scheme=midpoint", 0.501)]
)
def test_counterparts_are_nearest_otherwise(vase: TriangleMesh, attack: str, reach: float) -> None:
    """At the same place, or half an edge away at most."""
    cover, attacked = np.asarray(vase.vertices), np.asarray(attack_all(vase, (attack,), 5).vertices)
    corners = cover[np.asarray(vase.triangles)]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max()
    gaps = np.linalg.norm(cover[counterparts(cover, attacked)] - attacked, axis=1)
    assert len(gaps) == len(attacked)
    assert gaps.max() <= reach * longest + 1e-9


def test_rank_correlation_is_of_the_order_alone(vase: TriangleMesh) -> None:
    before = wave(vase)
    assert rank_correlation(vase, before, vase, np.exp(5 * before)) == pytest.approx(1.0)
    assert rank_correlation(vase, before, vase, -before) == pytest.approx(-1.0)
    noise = np.random.default_rng(0).uniform(size=len(before))
    assert abs(rank_correlation(vase, before, vase, noise) or 1.0) < 0.1
    assert rank_correlation(vase, before, vase, np.ones(len(before))) is None


def test_rank_correlation_follows_vertices_through_renumbering_and_motion(vase: TriangleMesh) -> None:
    shuffled = attack_all(vase, ("reorder",), 3)
    moved = TriangleMesh(shuffled)
    moved.scale(7.0, center=np.array([1.0, 2.0, 3.0]))
    moved.rotate(TriangleMesh.get_rotation_matrix_from_xyz((0.5, 1.0, -2.0)))
    moved.translate((100.0, -20.0, 3.0))
    assert rank_correlation(vase, wave(vase), shuffled, wave(shuffled)) == pytest.approx(1.0)
    assert (rank_correlation(vase, wave(vase), moved, wave(shuffled)) or 0.0) > 0.99
