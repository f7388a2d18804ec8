"""Simplification and remeshing by MeshLab, and the door to it."""

import numpy as np
import pytest

from fixtures.attacked import is_closed
from o3dmark.attacks import ATTACKS, _meshlab
from o3dmark.errors import BackendError
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface, TriangleMesh, mesh_arrays
from o3dmark.metrics.distance import surface_distance


@pytest.mark.parametrize("ratio", [0.1, 0.5, 0.9, 0.975])
def test_simplification_removes_its_share_of_triangles_and_edges(spot: TriangleMesh, ratio: float) -> None:
    after = ATTACKS.make(f"simplify:ratio={ratio}")(spot)
    assert 1.0 - len(after.triangles) / 5856 == pytest.approx(ratio, abs=1e-3)
    assert 1.0 - len(geometry.edges(mesh_arrays(after)[1])) / 8784 == pytest.approx(ratio, abs=1e-3)
    assert is_closed(after)
    assert geometry.volume(*mesh_arrays(after)) == pytest.approx(geometry.volume(*mesh_arrays(spot)), rel=0.1)


def test_a_soup_is_simplified_as_the_surface_that_it_is(spot: TriangleMesh) -> None:
    soup = ATTACKS.make("unweld")(spot)
    assert len(ATTACKS.make("simplify:ratio=0.5")(soup).vertices) == len(
        ATTACKS.make("simplify:ratio=0.5")(spot).vertices
    )


def test_remeshing_evens_the_edges(spot: TriangleMesh) -> None:
    def edge_lengths(mesh: TriangleMesh) -> np.ndarray:
        vertices, triangles = mesh_arrays(mesh)
        return np.linalg.norm(np.diff(vertices[geometry.edges(triangles)], axis=1)[:, 0], axis=1)

    after = edge_lengths(ATTACKS.make("remesh:edge=0.03")(spot))
    assert after.mean() == pytest.approx(0.03 * Surface.of(spot).diagonal, rel=0.1)
    assert after.std() / after.mean() < 0.6 * edge_lengths(spot).std() / edge_lengths(spot).mean()
    assert edge_lengths(ATTACKS.make("remesh")(spot)).mean() == pytest.approx(edge_lengths(spot).mean(), rel=0.1)


def test_meshlab_keeps_double_precision(spot: TriangleMesh) -> None:
    vertices = mesh_arrays(spot)[0] + 1e-13
    after, triangles = _meshlab.apply(vertices, mesh_arrays(spot)[1])
    np.testing.assert_allclose(after, vertices, rtol=0, atol=1e-15)
    assert np.array_equal(triangles, mesh_arrays(spot)[1])


def test_what_others_ask_of_meshlab_is_not_remembered(spot: TriangleMesh) -> None:
    before = mesh_arrays(ATTACKS.make("simplify")(spot))
    other = {"targetfacenum": 1000, "optimalplacement": False, "qualitythr": 1.0, "preservenormal": True}
    _meshlab.apply(*mesh_arrays(spot), ("meshing_decimation_quadric_edge_collapse", other))
    for old, new in zip(before, mesh_arrays(ATTACKS.make("simplify")(spot)), strict=True):
        np.testing.assert_array_equal(old, new)


def test_simplification_keeps_planes() -> None:
    """A box of many triangles is the same box with a fifth of them: not a vertex leaves its side."""
    box = TriangleMesh.create_box(1.0, 0.8, 0.6).subdivide_midpoint(4)
    box.rotate(TriangleMesh.get_rotation_matrix_from_xyz((0.5, 0.6, 0.7)))
    assert surface_distance(box, ATTACKS.make("simplify:ratio=0.8")(box)).hausdorff < 1e-3


def test_meshlab_s_refusals_are_named(spot: TriangleMesh) -> None:
    with pytest.raises(BackendError, match="meshing_surface_subdivision_nix failed: Filter does not exist"):
        _meshlab.apply(*mesh_arrays(spot), ("meshing_surface_subdivision_nix", {}))
    with pytest.raises(BackendError, match="leaves no triangle of the 5856"):
        _meshlab.apply(*mesh_arrays(spot), ("set_selection_all", {}), ("meshing_remove_selected_faces", {}))
