"""Attacks that forget the mesh: marching cubes, Poisson, simulated scans; and the points that they sample."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from fixtures.references import meshlab_resampled
from o3dmark.attacks import ATTACKS, _marching, sampling
from o3dmark.attacks._marching import resampled
from o3dmark.attacks.sampling import sampled_points, scanned_points
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.box_tree import tree_of
from o3dmark.mesh.proximity import closest_points
from o3dmark.mesh.surface import PointCloud, Surface, TriangleMesh, mesh_arrays, triangle_mesh
from o3dmark.metrics.distance import surface_distance

PLACE = np.array([40.0, -7.0, 3.0])


def sphere(radius: float = 1.0) -> TriangleMesh:
    vertices, triangles = mesh_arrays(TriangleMesh.create_icosahedron().subdivide_midpoint(4))
    return triangle_mesh(radius * geometry.unit(vertices) + PLACE, triangles)


def hemisphere() -> TriangleMesh:
    vertices, triangles = mesh_arrays(sphere())
    return triangle_mesh(vertices, triangles[vertices[triangles].mean(axis=1)[:, 2] > PLACE[2]])


def box(size: float) -> TriangleMesh:
    return TriangleMesh.create_box(size, size, size).translate(PLACE - size / 2.0)


def closed(mesh: TriangleMesh) -> bool:
    return not geometry.boundary_vertices(mesh_arrays(mesh)[1], len(mesh.vertices)).any()


def arrays(cloud: PointCloud) -> tuple[np.ndarray, np.ndarray]:
    """Points about the origin (n, 3) and normals (n, 3)."""
    return np.asarray(cloud.points) - PLACE, np.asarray(cloud.normals)


# points


def test_samples_are_uniform_on_the_surface_and_face_outward() -> None:
    points, normals = arrays(sampled_points(box(2.0), np.random.default_rng(0), 6000))
    assert np.abs(points).max(axis=1) == pytest.approx(np.ones(6000))
    assert np.linalg.norm(normals, axis=1) == pytest.approx(np.ones(6000))
    assert np.einsum("ij,ij->i", points, normals) == pytest.approx(np.ones(6000))
    for face in np.concatenate([np.eye(3), -np.eye(3)]):
        assert (normals @ face > 0.9).mean() == pytest.approx(1 / 6, abs=0.02)
        inside = points[normals @ face > 0.9] @ np.roll(face, 1)
        assert inside.std() == pytest.approx(3**-0.5, abs=0.03)


def test_a_scan_without_noise_lies_on_the_surface() -> None:
    points, normals = arrays(scanned_points(sphere(), np.random.default_rng(0), 3000, noise=0.0))
    assert len(points) == 3000
    radii = np.linalg.norm(points, axis=1)
    assert 0.995 < radii.min() <= radii.max() <= 1.0 + 1e-9
    assert (np.einsum("ij,ij->i", points, normals) > 0.99).all()


def test_scan_noise_has_its_standard_deviation() -> None:
    points, normals = arrays(scanned_points(box(2.0), np.random.default_rng(0), 4000, noise=0.002, views=200))
    off = np.einsum("ij,ij->i", points, normals) - 1.0  # along the line of sight, which slants by the angle a
    sigma = 0.002 * 2.0 * 3**0.5
    assert off.std() == pytest.approx(sigma * 0.5**0.5, rel=0.1)  # mean of cos^2 a, weighted by cos a, is 1/2


def test_scanners_do_not_see_what_is_hidden() -> None:
    vertices, triangles = mesh_arrays(sphere(0.5))
    outer, outer_triangles = mesh_arrays(box(2.0))
    nested = triangle_mesh(np.r_[vertices, outer], np.r_[triangles, outer_triangles + len(vertices)])
    points, _ = arrays(scanned_points(nested, np.random.default_rng(0), 2000, noise=0.0))
    assert np.linalg.norm(points, axis=1).min() > 0.9


def test_one_scanner_sees_one_side() -> None:
    _, normals = arrays(scanned_points(sphere(), np.random.default_rng(0), 2000, noise=0.0, views=1))
    towards = normals.mean(axis=0)
    assert np.linalg.norm(towards) == pytest.approx(2 / 3, abs=0.03)  # mean cosine, seen in proportion to the cosine
    assert (normals @ towards).min() > -0.05


def test_a_mesh_that_is_inside_out_is_seen_from_outside() -> None:
    vertices, triangles = mesh_arrays(sphere())
    inside_out = triangle_mesh(vertices, triangles[:, ::-1])
    points, normals = arrays(scanned_points(inside_out, np.random.default_rng(0), 2000, noise=0.0))
    assert len(points) == 2000
    assert np.einsum("ij,ij->i", points, normals).min() > 0.99


def test_a_surface_that_nobody_sees_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sampling, "_unhidden", lambda scene, origins, sight: np.zeros(len(sight), bool))  # noqa: ARG005
    with pytest.raises(MeshError, match="sees anything"):
        scanned_points(box(1.0), np.random.default_rng(0), 200)


# surfaces


@pytest.mark.parametrize(
    ("spec", "bound"),
    [
        ("resample:cells=24", 0.02),
        ("poisson:points=4000,depth=5", 0.02),
        ("rescan:points=4000,depth=5,noise=0.001", 0.03),
        ("rescan:points=4000,surface=pivot,noise=0.0005", 0.015),
    ],
)
def test_a_sphere_comes_back_as_a_sphere(spec: str, bound: float) -> None:
    mesh = ATTACKS.make(spec)(sphere(), 0)
    vertices, triangles = mesh_arrays(mesh)
    radii = np.linalg.norm(vertices - PLACE, axis=1)
    assert np.abs(radii - 1.0).max() < bound
    assert geometry.areas(vertices, triangles).sum() == pytest.approx(4.0 * np.pi, rel=0.05)
    outward = np.einsum("ij,ij->i", geometry.area_vectors(vertices, triangles), vertices[triangles[:, 0]] - PLACE)
    assert (outward > 0).mean() > 0.99


@pytest.mark.parametrize("spec", ["resample:cells=24", "poisson:points=4000,depth=5", "rescan:points=4000,depth=5"])
def test_resampled_surfaces_are_closed_where_the_input_is(spec: str) -> None:
    assert closed(ATTACKS.make(spec)(sphere(), 0))


def test_what_no_sample_supports_is_trimmed() -> None:
    trimmed = ATTACKS.make("poisson:points=4000,depth=5,trim=0.03")(hemisphere(), 0)
    closed = ATTACKS.make("poisson:points=4000,depth=5,trim=0")(hemisphere(), 0)
    areas = [geometry.areas(*mesh_arrays(mesh)).sum() for mesh in (trimmed, closed)]
    assert areas[0] == pytest.approx(2.0 * np.pi, rel=0.12)
    assert areas[1] > 1.3 * areas[0]


# the grid


def rod(sides: int) -> TriangleMesh:
    """A slanted cylinder of length 40 and radius 1."""
    upright = TriangleMesh.create_cylinder(1.0, 40.0, sides, 1)
    return upright.rotate(TriangleMesh.get_rotation_matrix_from_xyz((0.5, 0.6, 0.7)))


def test_resampling_has_the_cells_it_is_told() -> None:
    vertices, triangles = mesh_arrays(ATTACKS.make("resample:cells=10")(sphere()))
    edges = vertices[geometry.edges(triangles)]
    assert 0.19 < np.abs(np.diff(edges, axis=1)).max() < 0.2 + 1e-6


def test_resampling_gives_what_meshlab_gives(spot: TriangleMesh) -> None:
    cell = (spot.get_max_bound() - spot.get_min_bound()).max() / 60
    theirs = meshlab_resampled(spot, 60)
    ours = ATTACKS.make("resample:cells=60")(spot)
    distance = surface_distance(spot, ours), surface_distance(spot, theirs), surface_distance(ours, theirs)
    assert distance[2].mrms * distance[2].diagonal < 0.1 * cell
    assert distance[0].mrms < 1.1 * distance[1].mrms
    assert len(ours.vertices) == pytest.approx(len(theirs.vertices), rel=0.03)
    assert closed(ours)


def test_what_takes_all_memory_of_meshlab_is_resampled() -> None:
    mesh = ATTACKS.make("resample:cells=80")(rod(400))
    assert closed(mesh)
    assert mesh.get_volume() == pytest.approx(40.0 * np.pi, rel=0.05)


def test_where_the_slabs_meet_makes_no_difference(spot: TriangleMesh, monkeypatch: pytest.MonkeyPatch) -> None:
    surface = Surface.of(spot)
    whole = resampled(surface, 40)
    monkeypatch.setattr(_marching, "_SLAB", 5)
    sliced = resampled(surface, 40)
    assert len(sliced.triangles) == len(whole.triangles)
    assert not geometry.boundary_vertices(sliced.triangles, len(sliced.vertices)).any()
    assert KDTree(whole.vertices).query(sliced.vertices)[0].max() < 1e-6


def test_the_sign_of_the_distance_is_right_at_edges_and_corners() -> None:
    """Of a spike, whose faces meet at angles where the normal of any one of them misleads."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.9, 0.9, 3]])
    triangles = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    points = np.random.default_rng(0).uniform(-1.0, 3.5, (40_000, 3))
    share = np.linalg.solve(np.r_[vertices.T, np.ones((1, 4))], np.c_[points, np.ones(len(points))].T)
    surface = Surface.from_arrays(vertices, triangles)
    signed = _marching._signed_distance(points, surface, tree_of(surface), _marching._pseudonormals(surface))
    assert (signed < 0).sum() > 100
    np.testing.assert_array_equal(signed < 0, (share > 0).all(axis=0))
    np.testing.assert_array_equal(np.abs(signed), closest_points(points, surface).distance)


def test_resampling_keeps_a_mesh_inside_out() -> None:
    vertices, triangles = mesh_arrays(sphere())
    after = ATTACKS.make("resample:cells=20")(triangle_mesh(vertices, triangles[:, ::-1]))
    assert geometry.volume(*mesh_arrays(after)) == pytest.approx(-4.0 / 3.0 * np.pi, rel=0.03)


def test_an_open_boundary_grows_a_collar_of_three_cells_and_a_half() -> None:
    after, _ = mesh_arrays(ATTACKS.make("resample:cells=40")(hemisphere()))
    boundary = mesh_arrays(hemisphere())[0][np.unique(mesh_arrays(hemisphere())[1])][:, 2].min()
    cell = 2.0 / 40
    assert -3.5 * cell - 1e-6 < after[:, 2].min() - boundary < -2.0 * cell


def test_a_plate_that_no_node_sees_is_refused() -> None:
    with pytest.raises(MeshError, match="wide enough"):
        ATTACKS.make("resample:cells=20")(TriangleMesh.create_box(1.0, 1.0, 1e-3))
