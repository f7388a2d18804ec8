"""MRMS and Hausdorff: axioms, shapes whose distance is an integral by hand, and libigl's values for spot."""

import csv

import numpy as np
import open3d as o3d
import pytest

from fixtures.paths import GOLDEN
from fixtures.shapes import UNIT_SQUARE, mapped, noisy
from o3dmark.errors import MeshError, SpecError
from o3dmark.files import read_mesh
from o3dmark.mesh.proximity import closest_points
from o3dmark.mesh.surface import Surface, mesh_arrays, triangle_mesh
from o3dmark.metrics import METRICS, distance
from o3dmark.metrics.distance import MRMS, Hausdorff, surface_distance

FEW = 20_000


def cube(side):
    return o3d.geometry.TriangleMesh.create_box(side, side, side).translate(np.full(3, -side / 2))


def golden():
    with open(GOLDEN / "metrics_spot.csv") as file:
        return list(csv.DictReader(file))


def test_a_lifted_square_is_everywhere_at_its_height():
    flat = triangle_mesh(*UNIT_SQUARE)
    distance = surface_distance(flat, mapped(flat, lambda v: v + np.array([0, 0, 0.25])), samples=FEW)
    for length in (distance.rms_forward, distance.rms_backward, distance.max_forward, distance.max_backward):
        assert length * np.sqrt(2) == pytest.approx(0.25, rel=1e-12)
    assert distance.diagonal == pytest.approx(np.sqrt(2))


@pytest.mark.parametrize("e", [0.001, 0.1])
def test_a_cube_in_a_larger_one(e):
    L = 1 + 2 * e
    distance = surface_distance(cube(1.0), cube(L), samples=FEW)
    assert distance.rms_forward * np.sqrt(3) == pytest.approx(e, rel=1e-9)
    assert distance.max_forward * np.sqrt(3) == pytest.approx(e, rel=1e-9)
    assert distance.max_backward == pytest.approx(e, rel=1e-9)  # corner to corner, sqrt(3) e
    assert distance.rms_backward * np.sqrt(3) == pytest.approx(np.sqrt(e**2 + 4 * e**3 / (3 * L)), rel=0.02)
    assert distance.mrms == distance.rms_backward
    assert distance.hausdorff == distance.max_backward


@pytest.mark.parametrize("metric", [MRMS(samples=FEW), Hausdorff(samples=FEW)])
class TestAxioms:
    def test_zero_on_identity(self, metric, spot):
        assert metric(spot, spot) == pytest.approx(0, abs=1e-15)

    def test_symmetric_but_for_the_diagonal(self, metric, spot):
        other = noisy(spot, 0.01)
        diagonals = Surface.of(spot).diagonal, Surface.of(other).diagonal
        assert metric(spot, other) * diagonals[0] == pytest.approx(metric(other, spot) * diagonals[1], rel=1e-12)

    def test_grows_with_noise(self, metric, spot):
        values = [metric(spot, noisy(spot, amplitude)) for amplitude in (1e-6, 1e-4, 1e-3, 1e-2)]
        assert 0 < values[0] < 1e-5
        assert values == sorted(values)

    def test_of_both_meshes_moved_and_scaled(self, metric, spot):
        other = noisy(spot, 0.01)
        alike = metric(*(mapped(mesh, lambda v: 1e-3 * v + [5.0, 3, -2]) for mesh in (spot, other)))
        assert alike == pytest.approx(metric(spot, other), rel=1e-9)

    def test_of_both_meshes_turned(self, metric, spot):
        other = noisy(spot, 0.01)
        turn = o3d.geometry.get_rotation_matrix_from_xyz([0.3, 1.0, 2.0])
        turned = [mapped(mesh, lambda v: v @ turn.T) for mesh in (spot, other)]
        lengths = metric(*turned) * Surface.of(turned[0]).diagonal, metric(spot, other) * Surface.of(spot).diagonal
        assert lengths[0] == pytest.approx(lengths[1], rel=1e-9)

    def test_the_same_twice(self, metric, spot):
        other = noisy(spot, 0.01)
        assert metric(spot, other) == metric(spot, other)

    def test_triangles_of_any_kind(self, metric, spot):
        assert metric(spot, spot.subdivide_midpoint(1)) < 1e-12

    def test_a_triangle_soup_is_its_mesh(self, metric, spot):
        other = noisy(spot, 0.01)
        vertices, triangles = mesh_arrays(other)
        soup = triangle_mesh(vertices[triangles].reshape(-1, 3), np.arange(triangles.size).reshape(-1, 3))
        assert metric(spot, soup) == pytest.approx(metric(spot, other), rel=0.02)

    def test_meshes_are_left_alone(self, metric, spot):
        before = mesh_arrays(spot)
        metric(spot, spot)
        assert all(np.array_equal(a, b) for a, b in zip(before, mesh_arrays(spot), strict=True))

    def test_a_mesh_without_triangles_is_refused(self, metric, spot):
        for pair in ((spot, o3d.geometry.TriangleMesh()), (o3d.geometry.TriangleMesh(), spot)):
            with pytest.raises(MeshError, match="no triangle"):
                metric(*pair)


def test_one_evaluation_gives_both(spot):
    other = noisy(spot, 0.01)
    distance = surface_distance(spot, other, samples=FEW)
    assert distance.mrms == MRMS(samples=FEW)(spot, other)
    assert distance.hausdorff == Hausdorff(samples=FEW)(spot, other)
    assert distance.rms_forward <= distance.mrms <= distance.hausdorff


def test_the_seed_changes_little_and_more_samples_less(spot):
    other = noisy(spot, 0.01)
    spread = [
        np.ptp([MRMS(samples=samples, seed=seed)(spot, other) for seed in range(4)]) / MRMS()(spot, other)
        for samples in (2_000, 30_000)
    ]
    assert 0 < spread[1] < spread[0] < 0.1
    assert spread[1] < 0.01


def test_hausdorff_is_at_least_a_lone_spike(spot):
    vertices, triangles = mesh_arrays(spot)
    vertices[17] += [0, 0, 3.0]
    spiky = triangle_mesh(vertices, triangles)
    assert Hausdorff(samples=1)(spot, spiky) * Surface.of(spot).diagonal > 2


@pytest.mark.parametrize("spec", ["mrms:samples=0", "hausdorff:samples=-5"])
def test_no_samples_are_refused(spec, spot):
    with pytest.raises((SpecError, ValueError), match="samples"):
        METRICS.make(spec)(spot, spot)


@pytest.mark.parametrize("pair", sorted({row["pair"] for row in golden()}))
def test_agrees_with_libigl(pair, spot):
    distance = surface_distance(spot, read_mesh(GOLDEN / f"{pair}.ply"))
    ours = {
        "RMS_fwd": distance.rms_forward,
        "RMS_bwd": distance.rms_backward,
        "max_fwd": distance.max_forward,
        "max_bwd": distance.max_backward,
        "MRMS": distance.mrms,
        "HD": distance.hausdorff,
    }
    assert set(ours) <= {row["metric"] for row in golden() if row["pair"] == pair}
    for row in golden():
        if row["pair"] == pair and row["metric"] in ours:
            assert "libigl 2.6.3" in row["program"]
            assert ours[row["metric"]] * distance.diagonal == pytest.approx(float(row["oracle"]), rel=0.01), row


@pytest.mark.slow
def test_agrees_with_libigl_on_all_pairs(shared):
    with open(shared("oracle/pairs.csv")) as file:
        pairs = {row["pair"]: (row["original"], row["distorted"]) for row in csv.DictReader(file)}
    with open(shared("oracle/metrics.csv")) as file:
        rows = [row for row in csv.DictReader(file) if "libigl" in row["tool"] and row["metric"] in ("MRMS", "HD")]
    found = {}
    for row in rows:
        if row["pair"] not in found:
            meshes = (read_mesh(shared(f"oracle/pairs/{name}.ply")) for name in pairs[row["pair"]])
            found[row["pair"]] = surface_distance(*meshes)
        distance = found[row["pair"]]
        ours = {"MRMS": distance.mrms, "HD": distance.hausdorff}[row["metric"]] * distance.diagonal
        assert ours == pytest.approx(float(row["value"]), rel=0.03), row
    assert len(found) >= 40


def test_mrms_and_hausdorff_search_once(monkeypatch, spot):
    searches = []
    monkeypatch.setattr(distance, "closest_points", lambda *a, **k: searches.append(a) or closest_points(*a, **k))
    other = noisy(spot, 1e-3, seed=99)
    mrms, farthest = MRMS(samples=FEW)(spot, other), Hausdorff(samples=FEW)(spot, other)
    assert len(searches) == 2
    assert (mrms, farthest) == (
        surface_distance(spot, other, samples=FEW).mrms,
        surface_distance(spot, other, samples=FEW).hausdorff,
    )
    vertices = np.asarray(other.vertices)
    vertices[0, 0] += 0.1  # in place, as Open3D allows
    assert Hausdorff(samples=FEW)(spot, other) > 2 * farthest
    assert MRMS(samples=FEW, seed=1)(spot, other) != MRMS(samples=FEW, seed=2)(spot, other)


def test_what_cannot_be_measured_in_bounded_time_is_refused_once(monkeypatch, spot):
    searches = []
    monkeypatch.setattr(distance, "closest_points", lambda *a, **k: searches.append(a) or closest_points(*a, **k))
    monkeypatch.setattr(distance, "enough_work", lambda *_: 1_000)
    other = noisy(spot, 1e-3, seed=98)
    for metric in (MRMS(), Hausdorff()):
        with pytest.raises(MeshError, match="bounded time"):
            metric(spot, other)
    assert len(searches) == 1
