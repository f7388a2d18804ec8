"""Synthetic shapes: sound meshes, as many vertices as asked for, no symmetry, the same again for the same options."""

import hashlib
import json
from typing import Any

import numpy as np
import pytest

from conftest import ROOT
from o3dmark import geometry
from o3dmark.errors import SpecError
from o3dmark.files import read_mesh
from o3dmark.mesh import Surface, mesh_arrays
from o3dmark.synthetic import SHAPES, Sculpture, make

FOLDER = ROOT / "data_synthetic"
MANIFEST = json.loads((FOLDER / "manifest.json").read_text())
SCULPTURES = [name for name in SHAPES if issubclass(SHAPES[name], Sculpture)]
PRIMITIVES = [name for name in SHAPES if name not in SCULPTURES]
GENUS = {"cup": 1, "torus": 1}
PAPER = {"flower": 2523, "vase": 2527, "cup": 9076, "ant": 7654, "cat": 3534, "bimba": 8857}


def check_sound(mesh: Any, genus: int, components: int = 1) -> None:
    """Closed, manifold, wound outward, of so many pieces and handles, without coincident or unused vertices."""
    assert mesh.is_edge_manifold(allow_boundary_edges=False)
    assert mesh.is_vertex_manifold()
    assert mesh.is_orientable()
    vertices, triangles = mesh_arrays(mesh)
    surface = Surface.of(mesh)
    assert surface.vertices.shape == vertices.shape
    assert surface.triangles.shape == triangles.shape
    assert geometry.volume(vertices, triangles) > 0
    assert len(mesh.cluster_connected_triangles()[1]) == components
    euler = len(vertices) - len(geometry.edges(triangles)) + len(triangles)
    assert euler == 2 * components - 2 * genus


@pytest.mark.parametrize("name", sorted(PAPER))
def test_the_kept_files_are_what_the_manifest_says(name: str) -> None:
    path, entry = FOLDER / f"{name}.ply", MANIFEST[name]
    assert hashlib.sha256(path.read_bytes()).hexdigest() == entry["sha256"]
    mesh = read_mesh(path)
    assert (len(mesh.vertices), len(mesh.triangles)) == (entry["vertices"], entry["triangles"])
    assert abs(len(mesh.vertices) / PAPER[name] - 1) < 0.02
    check_sound(mesh, GENUS.get(name, 0))


@pytest.mark.parametrize("name", sorted(PAPER))
def test_organic_shapes_are_irregular_and_have_no_symmetry(name: str) -> None:
    surface = Surface.of(read_mesh(FOLDER / f"{name}.ply"))
    valence = np.diff(geometry.adjacency(surface.triangles, len(surface.vertices)).indptr)
    assert len(np.unique(valence)) >= 4
    assert np.mean(valence == 6) < 0.8
    offset = surface.vertices - surface.centroid
    weight = surface.vertex_areas / surface.area
    moments, axes = np.linalg.eigh((offset * weight[:, None]).T @ offset)
    assert (np.diff(moments) / moments[1:] > 0.03).all()
    skew = np.abs(weight @ ((offset @ axes) ** 3)) / moments**1.5
    assert np.count_nonzero(skew > 0.01) >= 2  # no mirror plane normal to two of the principal axes


@pytest.mark.parametrize("name", SCULPTURES)
def test_a_sculpture_has_its_registered_kind_and_refuses_nonsense(name: str) -> None:
    with pytest.raises(SpecError):
        SHAPES.make(f"{name}:vertices=5")
    assert SHAPES.make(f"{name}:vertices=1000,seed=3").seed == 3  # type: ignore[attr-defined]


def test_the_same_options_make_the_same_mesh_and_another_seed_another() -> None:
    first, again, other = (mesh_arrays(make("vase:vertices=600", seed)) for seed in (1, 1, 2))
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a, b)
    assert first[0].shape != other[0].shape or not np.allclose(first[0], other[0], atol=1e-3)
    check_sound(make("vase:vertices=600", 2), 0)


@pytest.mark.parametrize("name", [name for name in PRIMITIVES if name != "grid"])
def test_primitives_are_sound(name: str) -> None:
    check_sound(make(name), GENUS.get(name, 0), 2 if name == "two-spheres" else 1)


@pytest.mark.parametrize(
    ("spec", "volume", "area"),
    [
        ("cube", 8.0, 24.0),
        ("tetrahedron", 8.0 / 3.0, 8.0 * 3**0.5),
        ("sphere:cells=60", 4.0 / 3.0 * np.pi, 4.0 * np.pi),
        ("torus:cells=200", 2.0 * np.pi**2 * 0.16, 4.0 * np.pi**2 * 0.4),
        ("cylinder:cells=200", 2.0 * np.pi, 6.0 * np.pi),
        ("two-spheres:cells=60", 4.0 / 3.0 * np.pi * 9.0 / 8.0, 4.0 * np.pi * 5.0 / 4.0),
    ],
)
def test_primitives_have_their_volume_and_area(spec: str, volume: float, area: float) -> None:
    vertices, triangles = mesh_arrays(make(spec))
    assert geometry.volume(vertices, triangles) == pytest.approx(volume, rel=2e-3)
    assert geometry.areas(vertices, triangles).sum() == pytest.approx(area, rel=2e-3)


def test_the_grid_is_open_and_faces_up() -> None:
    vertices, triangles = mesh_arrays(make("grid:cells=4"))
    assert (geometry.area_vectors(vertices, triangles)[:, 2] > 0).all()
    assert geometry.border_vertices(triangles, len(vertices)).sum() == 16
