"""Attacks by real tools, and the simulated print and scan."""

import sys

import numpy as np
import open3d as o3d
import pytest
from scipy.spatial import KDTree

from o3dmark.attacks import ATTACKS
from o3dmark.errors import BackendError
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays

TOOLS = {"draco": "DracoPy", "meshopt": "meshoptimizer", "meshopt-simplify": "meshoptimizer"}


@pytest.fixture(autouse=True)
def tool(request: pytest.FixtureRequest) -> None:
    """Skips a test of a tool that is not installed."""
    for name, module in TOOLS.items():
        if f"[{name}" in request.node.name and "missing" not in request.node.name:
            pytest.importorskip(module)


@pytest.mark.parametrize("name", TOOLS)
def test_a_missing_tool_is_named_when_it_is_called(
    monkeypatch: pytest.MonkeyPatch, spot: TriangleMesh, name: str
) -> None:
    monkeypatch.setitem(sys.modules, TOOLS[name], None)
    attack = ATTACKS.make(name)
    with pytest.raises(BackendError, match=r'pip install "o3dmark\[pipeline\]"'):
        attack(spot)


@pytest.mark.parametrize(
    "spec", ["draco:bits=8", "draco:bits=11", "draco:bits=14", "meshopt:bits=10", "meshopt:bits=14"]
)
def test_compression_rounds_to_one_step_for_all_axes(spot: TriangleMesh, spec: str) -> None:
    after = ATTACKS.make(spec)(spot)
    v, w = mesh_arrays(spot)[0], mesh_arrays(after)[0]
    step = np.ptp(v, axis=0).max() / (2.0 ** int(spec.split("=")[1]) - 1.0)
    error = np.abs(v - w[KDTree(w).query(v)[1]]).max()
    assert 0.4 * step < error <= 0.5 * step + 1e-6
    levels = (w - w.min(axis=0)) / step
    assert np.abs(levels - np.round(levels)).max() < 0.05
    assert geometry.volume(*mesh_arrays(after)) == pytest.approx(geometry.volume(*mesh_arrays(spot)), rel=0.02)


@pytest.mark.parametrize("spec", ["draco:bits=20", "meshopt:bits=16"])
def test_compression_reorders_and_keeps_the_triangles(spot: TriangleMesh, spec: str) -> None:
    after = ATTACKS.make(spec)(spot)
    (v, t), (w, u) = mesh_arrays(spot), mesh_arrays(after)
    place = KDTree(v).query(w)[1]
    assert sorted(place) == list(range(len(v)))
    assert not np.array_equal(place, np.arange(len(v)))

    def unordered(triangles: np.ndarray) -> list[list[int]]:
        turn = np.argmin(triangles, axis=1)[:, None]
        return sorted(np.take_along_axis(triangles, (np.arange(3) + turn) % 3, axis=1).tolist())

    assert unordered(place[u]) == unordered(t)


@pytest.mark.parametrize("spec", ["draco:bits=16", "meshopt:bits=16", "meshopt-simplify"])
def test_colours_stay_with_their_vertices(spot: TriangleMesh, spec: str) -> None:
    mesh = TriangleMesh(spot)
    colours = np.random.default_rng(0).uniform(size=(2930, 3))
    mesh.vertex_colors = o3d.utility.Vector3dVector(colours)
    after = ATTACKS.make(spec)(mesh)
    nearest = KDTree(mesh_arrays(mesh)[0]).query(mesh_arrays(after)[0])[1]
    assert np.asarray(after.vertex_colors) == pytest.approx(colours[nearest], abs=0.51 / 255)


@pytest.mark.parametrize("spec", ["meshopt-simplify:ratio=0.3", "meshopt-simplify:ratio=0.8"])
def test_simplification_keeps_some_vertices_where_they_are(spot: TriangleMesh, spec: str) -> None:
    after = ATTACKS.make(spec)(spot)
    ratio = float(spec.split("=")[1])
    assert 1.0 - len(after.triangles) / 5856 == pytest.approx(ratio, abs=0.01)
    assert KDTree(mesh_arrays(spot)[0]).query(mesh_arrays(after)[0])[0].max() < 1e-6


@pytest.mark.parametrize("spec", ["meshopt-simplify:ratio=0.8"])
def test_a_soup_is_simplified_as_the_surface_that_it_is(spot: TriangleMesh, spec: str) -> None:
    whole, soup = (ATTACKS.make(spec)(mesh) for mesh in (spot, ATTACKS.make("unweld")(spot)))
    assert len(soup.triangles) == len(whole.triangles)
    assert len(soup.vertices) == len(whole.vertices)


@pytest.mark.parametrize("spec", ["meshopt-simplify:ratio=0.9,error=0.001"])
def test_simplification_stops_at_its_error(spot: TriangleMesh, spec: str) -> None:
    assert len(ATTACKS.make(spec)(spot).triangles) > 0.15 * 5856


def test_printing_and_scanning_keeps_the_shape(spot: TriangleMesh) -> None:
    after = ATTACKS.make("print-scan:cells=60,points=8000,depth=6")(spot, 0)
    v, w = mesh_arrays(spot), mesh_arrays(after)
    size = [geometry.areas(*arrays).sum() ** 0.5 for arrays in (v, w)]
    assert geometry.volume(*w) / size[1] ** 3 == pytest.approx(geometry.volume(*v) / size[0] ** 3, rel=0.1)
    assert len(w[0]) != len(v[0])


def test_thick_layers_leave_steps(spot: TriangleMesh) -> None:
    def roughness(spec: str) -> float:
        vertices, triangles = mesh_arrays(ATTACKS.make(spec)(spot, 0))
        normals = geometry.unit(geometry.area_vectors(vertices, triangles))
        mean = geometry.unit(geometry.vertex_area_vectors(vertices, triangles))[triangles].mean(axis=1)
        return float(1.0 - np.einsum("ij,ij->i", normals, mean).mean())

    few = "print-scan:cells=60,points=8000,depth=6,noise=0,layer="
    assert roughness(few + "0.02") > 1.2 * roughness(few + "0")
