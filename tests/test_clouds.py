"""Point clouds carry a mark: points move as the surface through them, and nothing else of the cloud changes."""

import numpy as np
import open3d as o3d
import pytest

from o3dmark.coding.keys import Key
from o3dmark.errors import MeshError, O3dmarkError
from o3dmark.mesh import geometry
from o3dmark.mesh.reconstruction import oriented
from o3dmark.mesh.surface import PointCloud, TriangleMesh, point_cloud
from o3dmark.methods.layered import Layered
from o3dmark.profiles import PROFILES

MARK = PROFILES["layered-2026"]
POINTS = 30_000


@pytest.fixture(scope="module")
def cloud(spot: TriangleMesh) -> PointCloud:
    """Points of spot with normals and colours."""
    o3d.utility.random.seed(1)
    sampled = TriangleMesh(spot).sample_points_uniformly(POINTS, use_triangle_normal=True)  # gives a mesh normals
    sampled.colors = o3d.utility.Vector3dVector(np.random.default_rng(0).random((POINTS, 3)))
    return sampled


@pytest.fixture(scope="module")
def marked(cloud: PointCloud, key: Key) -> PointCloud:
    return MARK.embed(cloud, "mine", key)


def points_of(cloud: PointCloud) -> np.ndarray:
    return np.asarray(cloud.points)


def test_only_points_move_along_their_normals(cloud: PointCloud, marked: PointCloud) -> None:
    motion, normals = points_of(marked) - points_of(cloud), np.asarray(cloud.normals)
    along = np.einsum("pd,pd->p", motion, normals)
    assert np.allclose(motion, along[:, None] * normals, rtol=0.0, atol=1e-12)
    assert 1e-4 < np.sqrt(np.mean(along**2)) / geometry.diagonal(points_of(cloud)) < 6e-4
    assert np.array_equal(marked.colors, cloud.colors)
    assert np.array_equal(marked.normals, cloud.normals)
    assert type(marked) is type(cloud)


@pytest.mark.slow
def test_the_cloud_that_was_given_stays_and_the_mark_is_always_the_same(
    cloud: PointCloud, marked: PointCloud, key: Key
) -> None:
    before = points_of(cloud).copy()
    again = MARK.embed(cloud, "mine", key)
    assert np.array_equal(points_of(cloud), before)
    assert np.array_equal(points_of(again), points_of(marked))


@pytest.mark.slow
def test_it_is_read_from_all_points_from_half_of_them_with_noise_and_through_a_surface(
    marked: PointCloud, key: Key
) -> None:
    rng, points = np.random.default_rng(2), points_of(marked)
    half = marked.select_by_index(rng.permutation(POINTS)[: POINTS // 2].tolist())
    noise = rng.normal(0.0, 1e-3 * geometry.diagonal(points) / np.sqrt(3.0), points.shape)
    surface, _ = TriangleMesh.create_from_point_cloud_poisson(marked, depth=8, n_threads=1)
    for received in (marked, half, point_cloud(points + noise, np.asarray(marked.normals)), surface):
        assert MARK.extract(received, key).message == "mine"
    assert not PROFILES["robust-2026"].method.quick.extract(marked, 64, Key(bytes(31) + b"\7")).certainty > 0.9


def test_a_tensor_cloud_keeps_its_kind_precision_and_attributes(
    cloud: PointCloud, marked: PointCloud, key: Key
) -> None:
    tensor = o3d.t.geometry.PointCloud.from_legacy(cloud, o3d.core.float64)
    tensor.point.weight = o3d.core.Tensor(np.arange(float(POINTS))[:, None])
    done = MARK.embed(tensor, "mine", key)
    assert type(done) is type(tensor)
    assert done.point.positions.dtype == o3d.core.float64
    assert np.allclose(done.point.positions.numpy(), points_of(marked), rtol=0.0, atol=1e-9)
    assert np.array_equal(done.point.weight.numpy(), tensor.point.weight.numpy())


@pytest.mark.slow
def test_without_normals_a_cloud_is_marked_and_gets_none(cloud: PointCloud, key: Key) -> None:
    bare = point_cloud(points_of(cloud))
    done = MARK.embed(bare, "mine", key)
    assert not done.has_normals()
    assert MARK.extract(done, key).message == "mine"


def test_what_tells_no_solid_is_refused(cloud: PointCloud, key: Key) -> None:
    few = cloud.select_by_index(list(range(500)))
    plane = point_cloud(
        np.c_[np.random.default_rng(0).random((5000, 2)), np.zeros(5000)], np.tile([0.0, 0, 1], (5000, 1))
    )
    with pytest.raises(MeshError, match="500 points are too few"):
        MARK.embed(few, "mine", key)
    with pytest.raises(O3dmarkError):
        MARK.embed(plane, "mine", key)


def test_methods_of_vertices_say_that_they_want_a_mesh(cloud: PointCloud, key: Key) -> None:
    with pytest.raises(MeshError, match="an Open3D TriangleMesh is wanted, not PointCloud"):
        PROFILES["paper-2026"].embed(cloud, "mine", key)


@pytest.mark.slow
def test_a_layered_cloud_is_that_of_its_solid_s_layer(cloud: PointCloud, marked: PointCloud, key: Key) -> None:
    alone = PROFILES["robust-2026"].embed(cloud, "mine", key)
    assert isinstance(MARK.method, Layered)
    assert np.array_equal(points_of(alone), points_of(marked))


# Normals of points that have none


def test_points_that_are_not_in_the_tree_follow_their_neighbours(
    spot: TriangleMesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("o3dmark.mesh.reconstruction._ORIENTED", 4000)
    sampled = TriangleMesh(spot).sample_points_uniformly(20_000, use_triangle_normal=True)
    found = oriented(point_cloud(points_of(sampled)))
    agree = np.einsum("pd,pd->p", np.asarray(found.normals), np.asarray(sampled.normals)) > 0.0
    assert max(agree.mean(), 1.0 - agree.mean()) > 0.995
    assert np.array_equal(points_of(found), points_of(sampled))
    assert oriented(sampled) is sampled
