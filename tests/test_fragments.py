"""Aligning a fragment with the whole: from any pose and scale, and nothing else is aligned."""

import numpy as np
import pytest

from o3dmark.attacks import attack_all
from o3dmark.mesh import similarity
from o3dmark.mesh.fragments import poses
from o3dmark.mesh.surface import Surface, TriangleMesh, mesh_arrays, triangle_mesh

MOVED = "similarity:smallest=0.2,largest=5"


def misplaced(pose: np.ndarray, fragment: Surface, truth: Surface, size: float) -> float:
    """RMS distance of a fragment's vertices from where they belong, over ``size``."""
    offset = similarity.apply(pose, fragment.vertices) - truth.vertices
    return float(np.sqrt(np.mean(np.sum(offset**2, axis=1)))) / size


def cropped(mesh: TriangleMesh, share: float, noise: str, seed: int) -> tuple[Surface, Surface]:
    """A fragment as received, and where its vertices were."""
    attacks = [f"crop:share={share}", noise, MOVED]
    return Surface.of(attack_all(mesh, attacks, rng=seed)), Surface.of(attack_all(mesh, attacks[:1], rng=seed))


@pytest.mark.parametrize(("share", "seed"), [pytest.param(0.1, 0, marks=pytest.mark.slow), (0.6, 1)])
def test_a_fragment_is_aligned_with_where_it_was(spot: TriangleMesh, share: float, seed: int) -> None:
    whole = Surface.of(spot)
    fragment, truth = cropped(spot, share, "noise:amplitude=0.002", seed)
    found = poses(fragment, whole)
    assert misplaced(found[0], fragment, truth, whole.diagonal) < 2e-3
    assert np.array_equal(found, poses(fragment, whole)) or share < 0.5  # once is enough: it takes its time


def test_a_shape_that_repeats_itself_has_several_poses(spot: TriangleMesh) -> None:
    """Two cows side by side: what is cut from one may be from either."""
    vertices, triangles = mesh_arrays(spot)
    turned = vertices @ np.array([[-1.0, 0, 0], [0, 1, 0], [0, 0, -1]]) + [3.0, 0.0, 0.0]
    both = triangle_mesh(np.concatenate([vertices, turned]), np.concatenate([triangles, triangles + len(vertices)]))
    found = poses(Surface.of(attack_all(spot, ["crop:share=0.3", MOVED], rng=0)), Surface.of(both))
    assert len(found) == 2


def test_what_belongs_nowhere_is_not_aligned(spot: TriangleMesh) -> None:
    assert poses(Surface.of(TriangleMesh.create_torus(1.0, 0.4, 40, 20)), Surface.of(spot)) == []
