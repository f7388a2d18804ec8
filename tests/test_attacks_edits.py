"""Attacks that tear, add something or edit a part of the shape: each does what it says."""

import numpy as np
import pytest
from open3d.geometry import AxisAlignedBoundingBox
from scipy.spatial import KDTree

from fixtures.attacked import is_closed, moved, sphere, torus, volume
from o3dmark.attacks import ATTACKS
from o3dmark.attacks.geometry import random_direction
from o3dmark.errors import BackendError, SpecError
from o3dmark.mesh import geometry
from o3dmark.mesh.inside import pieces, within
from o3dmark.mesh.surface import Surface, TriangleMesh, mesh_arrays


def attacked(spec: str, mesh: TriangleMesh, seed: int = 0) -> TriangleMesh:
    return ATTACKS.make(spec)(mesh, seed)


def test_a_soup_has_corners_of_its_own_within_the_jitter(spot: TriangleMesh) -> None:
    vertices, triangles = mesh_arrays(spot)
    torn, corners = mesh_arrays(attacked("soup:jitter=1e-5", spot))
    assert np.array_equal(np.sort(corners.ravel()), np.arange(3 * len(triangles)))
    away = np.abs(torn[corners] - vertices[triangles])
    assert 0.9e-5 * geometry.diagonal(vertices) < away.max() <= 1e-5 * geometry.diagonal(vertices) * (1 + 1e-9)


def test_some_triangles_of_a_soup_are_turned_over(spot: TriangleMesh) -> None:
    vertices, triangles = mesh_arrays(spot)
    torn, corners = mesh_arrays(attacked("soup:jitter=0,flipped=0.3", spot))
    same = np.einsum("md,md->m", geometry.area_vectors(torn, corners), geometry.area_vectors(vertices, triangles)) > 0
    assert np.mean(~same) == pytest.approx(0.3, abs=0.05)


def test_pieces_of_a_cracked_mesh_moved_as_wholes(spot: TriangleMesh) -> None:
    before = Surface.of(spot)
    after = Surface.of(attacked("crack:pieces=8,gap=1e-3", spot))
    piece = pieces(after)
    assert 8 <= len(np.unique(piece)) < 40
    assert len(after.triangles) == len(before.triangles)
    shift = after.vertices[after.triangles] - before.vertices[before.triangles]
    assert np.ptp(shift, axis=1).max() < 1e-12
    assert np.linalg.norm(shift[:, 0], axis=1) == pytest.approx(1e-3 * before.diagonal, rel=1e-6)


def test_twice_is_two_at_one_place(spot: TriangleMesh) -> None:
    vertices, triangles = mesh_arrays(spot)
    both, corners = mesh_arrays(attacked("twice:jitter=0", spot))
    assert np.array_equal(both, np.concatenate([vertices, vertices]))
    assert len(corners) == 2 * len(triangles)


@pytest.mark.parametrize("spec", ["inside:size=0.05", "inside:kind=shell,size=0.3"])
def test_what_is_put_inside_is_inside(spec: str, spot: TriangleMesh) -> None:
    surface = Surface.of(attacked(spec, spot))
    piece = pieces(surface)
    np.testing.assert_array_equal(within(surface, piece, 2), [False, True])


def test_a_speck_is_small_and_far(spot: TriangleMesh) -> None:
    before, after = mesh_arrays(spot)[0], mesh_arrays(attacked("speck:size=1e-3,distance=50", spot))[0]
    speck = after[len(before) :]
    diagonal = geometry.diagonal(before)
    assert geometry.diagonal(speck) < 2e-3 * diagonal
    assert np.linalg.norm(speck.mean(axis=0) - before.mean(axis=0)) == pytest.approx(50 * diagonal, rel=0.02)


@pytest.mark.parametrize(("spec", "more"), [("dust:count=7", 7), ("scene:objects=5", 5), ("plate:copies=3", 2)])
def test_so_many_are_added_and_do_not_touch_the_mesh(spec: str, more: int, spot: TriangleMesh) -> None:
    vertices, triangles = mesh_arrays(spot)
    after, corners = mesh_arrays(attacked(spec, spot))
    assert np.array_equal(after[: len(vertices)], vertices)
    assert np.array_equal(corners[: len(triangles)], triangles)
    alone = len(np.unique(pieces(Surface.of(spot))))
    assert len(np.unique(pieces(Surface.of(attacked(spec, spot))))) >= alone + more


def test_a_base_is_under_each_copy(spot: TriangleMesh) -> None:
    before, after = mesh_arrays(spot)[0], mesh_arrays(attacked("plate:copies=1,base=true", spot))[0]
    base = after[len(before) :]
    assert base[:, 2].max() == pytest.approx(before[:, 2].min())
    assert (base.min(axis=0)[:2] < before.min(axis=0)[:2]).all()
    assert (base.max(axis=0)[:2] > before.max(axis=0)[:2]).all()


def test_a_flattened_cap_is_flat_and_the_rest_is_as_it_was() -> None:
    before, after = mesh_arrays(sphere())[0], moved("flatten:share=0.1", sphere())
    changed = (before != after).any(axis=1)
    assert 0.05 * len(before) < changed.sum() <= round(0.1 * len(before))
    _, spread, _ = np.linalg.svd(after[changed] - after[changed].mean(axis=0))
    assert spread[2] < 1e-9 * spread[0]


def test_a_bump_is_so_high_and_far_away_nothing_moves() -> None:
    before, after = mesh_arrays(sphere())[0], moved("bump:height=0.05,radius=0.03", sphere())
    distance = np.linalg.norm(after - before, axis=1)
    assert distance.max() == pytest.approx(0.05 * geometry.diagonal(before), rel=1e-6)
    assert np.median(distance) < 1e-9 * distance.max()
    assert (
        volume(attacked("bump:height=0.05", sphere()))
        > volume(sphere())
        > volume(attacked("bump:height=-0.05", sphere()))
    )


def test_one_half_is_smoothed_and_the_other_untouched(spot: TriangleMesh) -> None:
    before, after = mesh_arrays(spot)[0], moved("half", spot)
    assert np.mean((before == after).all(axis=1)) == pytest.approx(0.5, abs=0.03)


def test_one_half_is_simplified_and_the_other_untouched(spot: TriangleMesh) -> None:
    before, after = mesh_arrays(spot), mesh_arrays(attacked("half:edit=simplify,ratio=0.5", spot))
    assert len(after[1]) == pytest.approx(0.75 * len(before[1]), rel=0.05)
    gone = KDTree(after[0]).query(before[0])[0] > 1e-9
    height = before[0] @ random_direction(np.random.default_rng(0))
    assert 0.3 < gone.mean() < 0.5
    assert height[gone].min() > np.median(height)


@pytest.mark.parametrize("depth", [0.06, 0.3])
def test_a_pedestal_is_one_with_what_stands_on_it(depth: float) -> None:
    before, after = mesh_arrays(sphere())[0], attacked(f"pedestal:depth={depth}", sphere())
    surface = Surface.of(after)
    assert is_closed(after)
    assert len(np.unique(pieces(surface))) == 1
    assert surface.vertices[:, 2].max() == pytest.approx(before[:, 2].max())
    below = before[:, 2].min() - surface.vertices[:, 2].min()
    assert 0 < below < 0.1 * np.ptp(before[:, 2])
    cap = np.pi * (depth * 2.0) ** 2 * (3.0 - depth * 2.0) / 3.0 * (volume(sphere()) / (4.0 / 3.0 * np.pi))
    width, length, _ = np.ptp(surface.vertices, axis=0)
    plate = width * length * (below + depth * np.ptp(before[:, 2]))
    assert volume(after) == pytest.approx(volume(sphere()) - cap + plate, rel=0.02)


def test_a_pedestal_wants_something_closed() -> None:
    with pytest.raises(BackendError, match="boolean"):
        attacked("pedestal", TriangleMesh.create_sphere().crop(AxisAlignedBoundingBox([-2, -2, -2], [2, 2, 0])))


def test_a_second_mark_moves_vertices_a_little_and_the_seed_decides(spot: TriangleMesh) -> None:
    vertices, triangles = mesh_arrays(spot)
    again, same = mesh_arrays(attacked("remark:profile=tiny-2026", spot))
    assert np.array_equal(triangles, same)
    motion = np.linalg.norm(again - vertices, axis=1).max() / geometry.diagonal(vertices)
    assert 0 < motion < 0.01
    assert not np.array_equal(again, mesh_arrays(attacked("remark:profile=tiny-2026", spot, seed=1))[0])


def test_sharpening_undoes_what_smoothing_did_at_first_order(spot: TriangleMesh) -> None:
    before = mesh_arrays(spot)[0]
    soft = attacked("smooth:iterations=1", spot)
    crisp = moved("sharpen:strength=1,iterations=1", soft)
    assert np.linalg.norm(crisp - before) < 0.3 * np.linalg.norm(mesh_arrays(soft)[0] - before)


def test_bilateral_denoising_takes_off_noise_and_leaves_edges() -> None:
    box = TriangleMesh.create_box().subdivide_midpoint(4)
    before = mesh_arrays(box)[0]
    noisy = moved("noise:amplitude=0.01,kind=normal", box) - before
    calm = moved("bilateral", attacked("noise:amplitude=0.01,kind=normal", box)) - before
    sides = np.isclose(np.abs(before - 0.5), 0.5).sum(axis=1)
    assert np.linalg.norm(calm[sides == 1]) < 0.85 * np.linalg.norm(noisy[sides == 1])
    filed, smoothed = (
        np.abs(moved(spec, box) - before)[sides == 3].max() for spec in ("bilateral", "smooth:strength=1")
    )
    assert filed < 0.5 * smoothed


def test_a_warp_is_as_strong_as_it_says_and_along_the_normals(spot: TriangleMesh) -> None:
    surface = Surface.of(spot)
    motion = Surface.of(attacked("warp:amplitude=1e-3", spot)).vertices - surface.vertices
    area = surface.vertex_areas
    assert np.sqrt(area @ np.sum(motion**2, axis=1) / area.sum()) == pytest.approx(1e-3 * surface.diagonal, rel=1e-6)
    assert np.abs(np.cross(motion, surface.normals)).max() < 1e-12


@pytest.mark.parametrize(("kind", "singular"), [("stretch", [1.02, 1.0, 1.0]), ("shear", [1.01, 1.0, 0.99])])
def test_a_strain_is_the_linear_map_that_it_says(kind: str, singular: list[float]) -> None:
    before, after = mesh_arrays(torus())[0], moved(f"strain:kind={kind},amount=0.02", torus())
    linear = np.linalg.lstsq(before - before.mean(axis=0), after - after.mean(axis=0), rcond=None)[0]
    np.testing.assert_allclose(np.linalg.svd(linear)[1], singular, atol=1e-3)
    assert is_closed(attacked("strain", torus()))


@pytest.mark.parametrize("name", ["bend", "twist"])
def test_about_a_random_axis_the_seed_decides(name: str) -> None:
    one, other = (moved(f"{name}:axis=random,angle=10", torus(), seed) for seed in (1, 2))
    assert not np.allclose(one, other, atol=1e-3)
    assert volume(attacked(f"{name}:axis=random,angle=5,band=1", torus())) == pytest.approx(volume(torus()), rel=0.02)


def test_a_second_mark_needs_a_profile_that_there_is() -> None:
    with pytest.raises(SpecError, match="robust-2026"):
        ATTACKS.make("remark:profile=none")


@pytest.mark.parametrize(
    "spec",
    [
        *("soup:jitter=-1", "soup:flipped=2", "crack:pieces=0", "crack:gap=-1", "twice:jitter=-1", "inside:size=1"),
        *("speck:size=0", "dust:size=2", "scene:objects=-1", "plate:copies=0", "flatten:share=1", "bump:radius=0"),
        *(
            "half:iterations=-1",
            "half:ratio=1",
            "pedestal:depth=1",
            "sharpen:iterations=0",
            "bilateral:height=0",
            "warp:lowest=0",
            "strain:amount=1",
        ),
    ],
)
def test_options_out_of_range_are_refused(spec: str) -> None:
    with pytest.raises(SpecError, match=r"should be|wants"):
        ATTACKS.make(spec)
