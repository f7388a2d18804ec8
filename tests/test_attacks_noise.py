"""Noise: its distribution, its size, and seams that stay closed."""

import numpy as np
import pytest

from fixtures.attacked import moved, sphere
from o3dmark.attacks import ATTACKS
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface, TriangleMesh, mesh_arrays


def mean_norm(v: np.ndarray) -> float:
    return np.linalg.norm(v - v.mean(axis=0), axis=1).mean()


def test_uniform_noise_fills_its_interval_evenly(spot: TriangleMesh) -> None:
    v = mesh_arrays(spot)[0]
    step = (moved("noise:amplitude=0.005", spot) - v) / (0.005 * mean_norm(v))
    assert np.abs(step).max() <= 1.0 + 1e-9
    assert np.abs(step).max() > 0.99
    assert step.mean(axis=0) == pytest.approx(np.zeros(3), abs=0.04)
    assert step.std(axis=0) == pytest.approx(np.full(3, 3**-0.5), abs=0.02)


def test_noise_scales_with_the_mesh(spot: TriangleMesh) -> None:
    large = TriangleMesh(spot).scale(1000.0, (0.0, 0.0, 0.0))
    assert moved("noise", large) == pytest.approx(1000.0 * moved("noise", spot))


def test_gaussian_noise_has_its_standard_deviation(spot: TriangleMesh) -> None:
    v = mesh_arrays(spot)[0]
    step = (moved("noise:amplitude=0.002,kind=gaussian", spot) - v) / (0.002 * mean_norm(v))
    assert step.std(axis=0) == pytest.approx(np.ones(3), abs=0.04)
    assert np.abs(step).max() > 2.5


def test_noise_along_normals_stays_along_them(spot: TriangleMesh) -> None:
    v = mesh_arrays(spot)[0]
    step = (moved("noise:amplitude=0.002,kind=normal", spot) - v) / (0.002 * mean_norm(v))
    normals = Surface.of(spot).normals
    height = np.einsum("ij,ij->i", step, normals)
    assert step == pytest.approx(height[:, None] * normals, abs=1e-9)
    assert height.std() == pytest.approx(1.0, abs=0.04)


def test_noise_opens_seams_only_when_told_to() -> None:
    soup = ATTACKS.make("unweld")(sphere())
    positions = len(geometry.weld(mesh_arrays(soup)[0])[0])
    assert len(geometry.weld(moved("noise", soup))[0]) == positions
    assert len(geometry.weld(moved("noise:seams=false", soup))[0]) == len(soup.vertices)
