"""Subdivision connectivity is found whatever the numbering, and lazy wavelets go both ways."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from open3d.geometry import TriangleMesh

from fixtures.shapes import icosphere
from o3dmark.arrays import Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.semi_regular import Subdivision, analysis, coarsened, subdivisions, synthesis
from o3dmark.mesh.surface import Surface, mesh_arrays


def shuffled(vertices: Floats, triangles: Ints, seed: int = 0) -> tuple[Floats, Ints]:
    """Vertices and triangles in another order, triangles turned."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(vertices))
    corners = np.argsort(order)[triangles][rng.permutation(len(triangles))]
    return vertices[order], np.take_along_axis(corners, (rng.integers(3, size=(len(corners), 1)) + np.arange(3)) % 3, 1)


def open_mesh() -> TriangleMesh:
    """Half of an irregular mesh: one boundary."""
    mesh = TriangleMesh.create_sphere(1.0, 6)
    mesh.remove_vertices_by_mask(np.asarray(mesh.vertices)[:, 2] < -0.2)
    return mesh


def two_pieces() -> TriangleMesh:
    return TriangleMesh.create_icosahedron() + TriangleMesh.create_octahedron().translate((5.0, 0.0, 0.0))


@pytest.mark.parametrize("base", [TriangleMesh.create_tetrahedron(), open_mesh(), two_pieces()])
@pytest.mark.parametrize("levels", [1, 3])
def test_a_subdivision_is_found_and_undone(base: TriangleMesh, levels: int) -> None:
    """Whatever the order: a mesh subdivided at midpoints has its own base, and no coefficients."""
    vertices, triangles = shuffled(*mesh_arrays(base.subdivide_midpoint(levels)))
    found = subdivisions(Surface.from_arrays(vertices, triangles))
    assert len(found) == levels
    wavelets = analysis(vertices, found)
    assert {tuple(v) for v in wavelets.base.round(9)} == {tuple(v) for v in np.asarray(base.vertices).round(9)}
    for detail in wavelets.details:
        np.testing.assert_allclose(detail, 0.0, atol=1e-12)
    area = geometry.area_vectors(wavelets.base, found[0].triangles).sum(axis=0)
    np.testing.assert_allclose(area, geometry.area_vectors(*mesh_arrays(base)).sum(axis=0), atol=1e-12)
    assert len(found[0].triangles) == len(base.triangles)


def test_wavelets_go_both_ways() -> None:
    """Analysis and synthesis are exact, and what is changed in a coefficient is what is found there again."""
    vertices, triangles = shuffled(*icosphere(4))
    vertices = vertices + 0.01 * np.random.default_rng(1).normal(size=vertices.shape)
    levels = subdivisions(Surface.from_arrays(vertices, triangles))
    assert [len(level.even) for level in levels] == [12, 42, 162, 642]
    wavelets = analysis(vertices, levels)
    np.testing.assert_allclose(synthesis(wavelets, levels), vertices, atol=1e-15)
    details = tuple(detail + 0.1 * k for k, detail in enumerate(wavelets.details))
    again = analysis(synthesis(replace(wavelets, details=details), levels), levels)
    np.testing.assert_allclose(again.base, wavelets.base, atol=1e-15)
    for found, wanted in zip(again.details, details, strict=True):
        np.testing.assert_allclose(found, wanted, atol=1e-14)


def test_each_odd_vertex_is_a_neighbour_of_both_ends_of_its_edge() -> None:
    _, triangles = shuffled(*icosphere(2))
    level = coarsened(triangles, 162)
    assert isinstance(level, Subdivision)
    neighbours = geometry.adjacency(triangles, 162)
    ends = level.even[level.edges]
    assert (neighbours[level.odd, ends[:, 0]] == 1).all()
    assert (neighbours[level.odd, ends[:, 1]] == 1).all()
    pairs = geometry.edges(level.triangles)
    assert {tuple(pair) for pair in np.sort(level.edges, axis=1)} == {tuple(pair) for pair in pairs}


def flipped_edge(triangles: Ints) -> Ints:
    """The first triangle and its neighbour across an edge with the other diagonal."""
    a, b, c = triangles[0]
    other = next(k for k in range(1, len(triangles)) if {a, b} <= set(triangles[k]))
    d = next(v for v in triangles[other] if v not in (a, b))
    changed = triangles.copy()
    changed[0], changed[other] = (a, d, c), (d, b, c)
    return changed


def test_what_no_subdivision_made_is_refused(spot: Any) -> None:
    vertices, triangles = icosphere(3)
    turned = triangles.copy()
    turned[5] = turned[5][::-1]
    torus = mesh_arrays(TriangleMesh.create_torus(1.0, 0.4, 12, 8))  # all vertices regular: any could be even
    for points, corners in (
        mesh_arrays(spot),
        (vertices, triangles[:-1]),
        (vertices, flipped_edge(triangles)),
        (vertices, turned),
        torus,
    ):
        with pytest.raises(MeshError, match="not semi-regular"):
            subdivisions(Surface.from_arrays(points, corners))
