"""Similarities, stretches, mirrors, axes and units."""

import numpy as np
import pytest
from scipy.spatial.distance import pdist
from scipy.spatial.transform import Rotation

from fixtures.attacked import moved, volume
from o3dmark.attacks import ATTACKS
from o3dmark.attacks.geometry import random_direction, random_rotation
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays


@pytest.mark.parametrize("seed", range(5))
def test_similarity_keeps_the_ratios_of_distances_and_the_orientation(spot: TriangleMesh, seed: int) -> None:
    after = ATTACKS.make("similarity")(spot, seed)
    some = slice(None, None, 100)
    ratio = pdist(mesh_arrays(after)[0][some]) / pdist(mesh_arrays(spot)[0][some])
    assert np.ptp(ratio) < 1e-9 * ratio.mean()
    assert volume(after) / volume(spot) == pytest.approx(ratio.mean() ** 3)


def test_similarity_stays_within_the_benchmark_s_ranges(spot: TriangleMesh) -> None:
    v = mesh_arrays(spot)[0]
    centre = v.mean(axis=0)
    norm = np.linalg.norm(v - centre, axis=1).mean()
    shifts, scales, angles = [], [], []
    for seed in range(60):
        w = moved("similarity", spot, seed)
        shifts.append((w.mean(axis=0) - centre) / norm)
        scales.append(np.linalg.norm(w - w.mean(axis=0), axis=1).mean() / norm)
        turn = np.linalg.lstsq(v - centre, (w - w.mean(axis=0)) / scales[-1], rcond=None)[0]
        angles.append(np.degrees(np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0))))
    assert 4.0 < np.abs(shifts).max() <= 5.0
    assert 0.1 <= min(scales) < 2.0 < 8.0 < max(scales) <= 10.0
    assert min(angles) < 45.0
    assert max(angles) > 135.0


def test_each_part_of_a_similarity_can_be_switched_off(spot: TriangleMesh) -> None:
    v = mesh_arrays(spot)[0]
    shifted = moved("similarity:rotation=0,smallest=1,largest=1", spot)
    assert np.ptp(shifted - v, axis=0) == pytest.approx(np.zeros(3), abs=1e-12)
    turned = moved("similarity:translation=0,smallest=1,largest=1", spot)
    assert turned.mean(axis=0) == pytest.approx(v.mean(axis=0))
    assert pdist(turned[::100]) == pytest.approx(pdist(v[::100]))
    scaled = moved("similarity:translation=0,rotation=0,smallest=3,largest=3", spot)
    assert scaled == pytest.approx(3.0 * v - 2.0 * v.mean(axis=0))


def test_random_rotations_turn_about_any_axis_by_any_angle_up_to_the_largest() -> None:
    rng = np.random.default_rng(0)
    turns = [Rotation.from_matrix(random_rotation(rng, 2.0)) for _ in range(2000)]
    angles = np.array([turn.magnitude() for turn in turns])
    axes = np.array([turn.as_rotvec() for turn in turns]) / angles[:, None]
    assert angles.max() <= 2.0
    assert angles.mean() == pytest.approx(1.0, abs=0.04)
    assert axes.T @ axes / 2000 == pytest.approx(np.eye(3) / 3.0, abs=0.04)
    assert np.array_equal(random_rotation(rng, 0.0), np.eye(3))


def test_random_directions_are_uniform() -> None:
    rng = np.random.default_rng(0)
    directions = np.array([random_direction(rng) for _ in range(4000)])
    assert np.linalg.norm(directions, axis=1) == pytest.approx(np.ones(4000))
    assert directions.mean(axis=0) == pytest.approx(np.zeros(3), abs=0.05)
    assert directions.T @ directions / 4000 == pytest.approx(np.eye(3) / 3.0, abs=0.03)


def test_stretch_scales_each_axis_by_its_own_factor(spot: TriangleMesh) -> None:
    v = mesh_arrays(spot)[0]
    factors = np.ptp(moved("stretch:amount=0.2", spot), axis=0) / np.ptp(v, axis=0)
    assert len(set(factors)) == 3
    assert (np.abs(factors - 1.0) <= 0.2).all()


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_mirror_is_its_own_inverse_and_stays_outward(spot: TriangleMesh, axis: str) -> None:
    once = ATTACKS.make(f"mirror:axis={axis}")(spot)
    twice = ATTACKS.make(f"mirror:axis={axis}")(once)
    v, w = mesh_arrays(spot)[0], mesh_arrays(once)[0]
    column = "xyz".index(axis)
    assert w[:, column] + v[:, column] == pytest.approx(np.full(len(v), 2.0 * v[:, column].mean()))
    assert np.delete(w, column, axis=1) == pytest.approx(np.delete(v, column, axis=1))
    assert volume(once) == pytest.approx(volume(spot))
    assert mesh_arrays(twice)[0] == pytest.approx(v)


@pytest.mark.parametrize("order", ["xzy", "yxz", "zyx", "yzx", "zxy"])
def test_axes_are_exchanged_and_normals_stay_outward(spot: TriangleMesh, order: str) -> None:
    after = ATTACKS.make(f"axes:order={order}")(spot)
    assert np.array_equal(mesh_arrays(after)[0], mesh_arrays(spot)[0][:, ["xyz".index(letter) for letter in order]])
    assert volume(after) == pytest.approx(volume(spot))


def test_units_multiply(spot: TriangleMesh) -> None:
    assert moved("units:factor=25.4", spot) == pytest.approx(25.4 * mesh_arrays(spot)[0])
    assert moved("units", spot) == pytest.approx(mesh_arrays(spot)[0] / 25.4)
