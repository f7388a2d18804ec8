"""The contract of every metric, tested for whatever is registered."""

import numpy as np
import pytest

from fixtures.shapes import mapped
from o3dmark.attacks import ATTACKS
from o3dmark.errors import MeshError
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays, triangle_mesh
from o3dmark.metrics import METRICS, Metric
from o3dmark.registry import describe, spec_of

FEW = {  # the same metric, faster; spot has no planes, but patches that are nearly flat
    "mrms": "mrms:samples=20000",
    "hausdorff": "hausdorff:samples=20000",
    "planes": "planes:tolerance=8,share=0",
}
SPECS = [FEW.get(name, name) for name in METRICS]
VARIANTS = ["msdm2:direction=forward", "msdm2:direction=backward"]
SYMMETRIC = ["fmpd", "msdm2"]
SYMMETRIC_LENGTHS = ["mrms", "hausdorff", "max_displacement", "rms_displacement"]  # but for whose diagonal divides
TRIANGLE_INEQUALITY = ["hausdorff", "max_displacement", "rms_displacement"]


def noisy(mesh: TriangleMesh, amplitude: float, seed: int = 0) -> TriangleMesh:
    return ATTACKS.make({"name": "noise", "amplitude": amplitude})(mesh, seed)


def length(spec: str, one: TriangleMesh, other: TriangleMesh) -> float:
    """A metric over the reference's diagonal, times that diagonal."""
    diagonal = np.linalg.norm(np.ptp(mesh_arrays(one)[0], axis=0))
    return METRICS.make(spec)(one, other) * diagonal


@pytest.mark.parametrize("name", list(METRICS))
def test_every_metric_and_option_explains_itself(name: str) -> None:
    doc = METRICS[name].__doc__ or ""
    assert len(doc) > 80
    assert "Source:" in doc
    for option, _, _, comment in describe(METRICS[name]):
        assert comment, f"{name}: {option} says nothing"


@pytest.mark.parametrize("spec", SPECS + VARIANTS)
class TestEveryMetric:
    def test_is_its_text(self, spec: str) -> None:
        metric = METRICS.make(spec)
        assert isinstance(metric, Metric)
        assert METRICS.make(spec_of(metric)) == metric

    def test_has_its_identity(self, spec: str, spot: TriangleMesh) -> None:
        metric = METRICS.make(spec)
        assert metric(spot, TriangleMesh(spot)) == pytest.approx(metric.identity, abs=1e-12)

    def test_sees_noise_and_more_of_it_as_more(self, spec: str, spot: TriangleMesh) -> None:
        metric = METRICS.make(spec)
        values = [metric(spot, noisy(spot, amplitude)) for amplitude in (1e-4, 5e-4, 1e-3, 3e-3, 5e-3)]
        assert all(isinstance(value, float) for value in values)
        assert all(value > 0 for value in values)
        assert values == sorted(values, reverse=metric.identity > 0)
        assert len(set(values)) == len(values)

    def test_gives_the_same_twice(self, spec: str, spot: TriangleMesh) -> None:
        other = noisy(spot, 1e-3)
        assert METRICS.make(spec)(spot, other) == METRICS.make(spec)(spot, other)

    def test_has_no_unit(self, spec: str, spot: TriangleMesh) -> None:
        metric, other = METRICS.make(spec), noisy(spot, 1e-3)
        alike = metric(*(mapped(mesh, lambda v: 25.4 * v + 3.0) for mesh in (spot, other)))
        assert alike == pytest.approx(metric(spot, other), rel=2e-3)

    def test_leaves_both_meshes_alone(self, spec: str, spot: TriangleMesh) -> None:
        meshes = TriangleMesh(spot), noisy(spot, 1e-3)
        before = [mesh_arrays(mesh) for mesh in meshes]
        METRICS.make(spec)(*meshes)
        for mesh, arrays in zip(meshes, before, strict=True):
            assert all(map(np.array_equal, mesh_arrays(mesh), arrays))

    def test_refuses_what_is_no_surface(self, spec: str, spot: TriangleMesh) -> None:
        vertices, triangles = mesh_arrays(spot)
        hole = vertices.copy()
        hole[7] = np.nan
        beyond = np.vstack([triangles[:-1], [[0, 1, len(vertices)]]])
        for flawed in (triangle_mesh(hole, triangles), triangle_mesh(vertices, beyond), TriangleMesh()):
            for pair in ((spot, flawed), (flawed, spot)):
                with pytest.raises(MeshError):
                    METRICS.make(spec)(*pair)

    def test_says_whether_it_needs_equal_connectivity(self, spec: str, spot: TriangleMesh) -> None:
        metric, finer = METRICS.make(spec), ATTACKS.make("subdivide:scheme=midpoint")(spot)
        if metric.needs_equal_connectivity:
            with pytest.raises(MeshError, match="same triangles"):
                metric(spot, finer)
        else:
            assert 0 <= metric(spot, finer) < 1


@pytest.mark.parametrize("spec", SYMMETRIC)
def test_swapping_the_meshes_changes_nothing(spec: str, spot: TriangleMesh) -> None:
    other = noisy(spot, 3e-3)
    assert METRICS.make(spec)(spot, other) == pytest.approx(METRICS.make(spec)(other, spot), rel=1e-9)


@pytest.mark.parametrize("spec", [FEW.get(name, name) for name in SYMMETRIC_LENGTHS])
def test_lengths_are_symmetric(spec: str, spot: TriangleMesh) -> None:
    other = noisy(spot, 3e-3)
    assert length(spec, spot, other) == pytest.approx(length(spec, other, spot), rel=1e-9)


@pytest.mark.parametrize("spec", [FEW.get(name, name) for name in TRIANGLE_INEQUALITY])
def test_a_detour_is_no_shorter(spec: str, spot: TriangleMesh) -> None:
    between, other = noisy(spot, 2e-3, 1), noisy(spot, 3e-3, 2)
    direct = length(spec, spot, other)
    assert direct <= length(spec, spot, between) + length(spec, between, other)
    assert direct > abs(length(spec, spot, between) - length(spec, between, other))
