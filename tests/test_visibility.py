"""What an eye sees of a motion: the pyramid against blurs of the whole surface, solved directly."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from fixtures.shapes import icosphere
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface, TriangleMesh, mesh_arrays
from o3dmark.motion import visibility
from o3dmark.motion.visibility import Visibility


@pytest.fixture(scope="module")
def surface(spot: TriangleMesh) -> Surface:
    return Surface.of(spot)


@pytest.fixture(scope="module")
def fine() -> Surface:
    """A ball of 40 962 vertices, whose wide bands have few points."""
    return Surface.from_arrays(*icosphere(6))


def rippled(surface: Surface, height: float, waves: float = 40.0) -> Surface:
    """Moved along its normals by a wave, in units of the diagonal."""
    wave = np.sin(waves * surface.vertices @ [1.0, 2.0, 3.0] / surface.diagonal)
    return surface.moved(surface.vertices + height * surface.diagonal * wave[:, None] * surface.normals)


def directly(surface: Surface, after: Surface) -> np.ndarray:
    """As `Visibility.local`, every band on all vertices."""
    edges, n = geometry.edges(surface.triangles), len(surface.vertices)
    joined = geometry.adjacency(surface.triangles, n)
    degree = joined.sum(axis=1)
    edge2 = np.mean(np.sum((surface.vertices[edges[:, 0]] - surface.vertices[edges[:, 1]]) ** 2, axis=1))
    signals, squares = np.concatenate([after.normals - surface.normals, surface.normals], axis=1), np.zeros(n)
    for band in range(4):
        width = 0.005 * 2**band
        t = (2.0 * width * surface.diagonal) ** 2 / edge2
        form = (sp.diags_array((1.0 + t) * degree) - t * joined).tocsc()
        finer, signals = signals, spsolve(form, degree[:, None] * signals)
        energy = (finer - signals) ** 2 / 0.45**2
        sums = np.stack([energy[:, :3].sum(axis=1), energy[:, 3:].sum(axis=1)], axis=1)
        contrast, mask = 2.0 * spsolve(form, degree[:, None] * sums).T
        threshold = 1.0 / (200.0 * visibility._relative_sensitivity(1.0 / (30.0 * 7.5 * width)))
        squares += contrast / threshold**2 / np.maximum(1.0, mask / threshold**2) ** 0.7
    return np.sqrt(squares)


def test_it_is_what_blurs_of_the_whole_surface_say(surface: Surface) -> None:
    ball = Surface.from_arrays(*icosphere(5))
    for each, tolerance in ((surface, 0.02), (ball, 0.05)):
        after = rippled(each, 1e-3)
        found, wanted = Visibility(each).local(after), directly(each, after)
        assert np.quantile(found, 0.95) == pytest.approx(np.quantile(wanted, 0.95), rel=tolerance)
        assert np.corrcoef(found, wanted)[0, 1] > 0.98


def test_wide_bands_of_fine_meshes_have_few_points(fine: Surface) -> None:
    sizes = [len(level.points) for level in Visibility(fine)._levels]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[0] == len(fine.vertices)
    assert sizes[-1] < 0.2 * sizes[0]


def test_points_of_two_sheets_stay_apart() -> None:
    """A hair between them, narrower than any cell: what one does is not seen on the other."""
    vertices, triangles = mesh_arrays(TriangleMesh.create_box(1.0, 1.0, 1e-4).subdivide_midpoint(6))
    flat = Surface.from_arrays(vertices, triangles)
    top = flat.vertices[:, 2] > 5e-5
    inner = np.abs(flat.vertices[:, :2] - 0.5).max(axis=1) < 0.3
    after = flat.vertices + np.outer(top * inner, [0.0, 0.0, 1e-3]) * np.sin(60.0 * flat.vertices[:, :1])
    assert len(Visibility(flat)._levels[-1].points) < 0.5 * len(flat.vertices)
    seen = Visibility(flat).local(flat.moved(after))
    middle = np.abs(flat.vertices[:, :2] - 0.5).max(axis=1) < 0.2
    assert seen[top & middle].mean() > 20.0 * seen[~top & middle].mean()


def test_it_grows_with_the_motion_in_proportion(surface: Surface) -> None:
    eye = Visibility(surface)
    one, two = eye(rippled(surface, 1e-4)), eye(rippled(surface, 2e-4))
    assert one > 0
    assert two == pytest.approx(2.0 * one, rel=0.02)
    assert eye(surface) == 0.0


def test_neither_size_nor_place_matters(surface: Surface) -> None:
    after = rippled(surface, 1e-3)
    there = [each.moved(7.0 * each.vertices + 3.0) for each in (surface, after)]
    assert Visibility(there[0])(there[1]) == pytest.approx(Visibility(surface)(after), rel=0.01)


def test_nearer_one_sees_another_share_of_more(surface: Surface) -> None:
    after = rippled(surface, 1e-3)
    assert Visibility(surface)(after, share=0.5) < Visibility(surface)(after, share=1.0)
    assert Visibility(surface, angle=60.0)(after) != pytest.approx(Visibility(surface)(after), rel=0.01)
