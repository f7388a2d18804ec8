"""Attacks that leave a part: cropping, holes, pasting."""

import numpy as np
import pytest

from fixtures.attacked import grid, is_closed, rows, torus
from o3dmark.attacks import ATTACKS
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays, triangle_mesh


@pytest.mark.parametrize("kind", ["plane", "ball"])
@pytest.mark.parametrize("share", [0.1, 0.3, 0.5, 0.9])
def test_a_crop_removes_its_share_of_vertices(spot: TriangleMesh, share: float, kind: str) -> None:
    after = ATTACKS.make(f"crop:share={share},kind={kind}")(spot, 3)
    gone = 2930 - len(after.vertices)
    assert round(share * 2930) <= gone <= round(share * 2930) + 6  # and those left without a triangle
    assert rows(mesh_arrays(after)[0]) <= rows(mesh_arrays(spot)[0])


@pytest.mark.parametrize("seed", range(5))
def test_a_cropped_plane(seed: int) -> None:
    before, after = grid(20), mesh_arrays(ATTACKS.make("crop:share=0.4")(grid(20), seed))[0]
    gone = np.array(sorted(rows(mesh_arrays(before)[0]) - rows(after)))
    assert 176 <= len(gone) <= 176 + 6  # 0.4 of 441
    difference = gone.mean(axis=0) - after.mean(axis=0)
    assert np.linalg.norm(difference) > 8.0  # a cut, not a sieve
    hull = [np.isclose(after[:, 0], edge).any() + np.isclose(after[:, 1], edge).any() for edge in (0, 20)]
    assert sum(hull) >= 2


@pytest.mark.parametrize("seed", range(4))
def test_a_cropped_ribbon_by_hand(seed: int) -> None:
    """A plane so narrow that every cut is across it: 0.3 of 200 vertices are 30 pairs, at one end."""
    side = np.repeat([0.0, 1e-3], 100)
    along = np.tile(np.arange(100.0), 2)
    first = np.arange(99)
    corners = np.r_[np.c_[first, first + 1, first + 100], np.c_[first + 1, first + 101, first + 100]]
    ribbon = triangle_mesh(np.c_[along, side, 0 * side], corners)
    kept, triangles = mesh_arrays(ATTACKS.make("crop:share=0.3")(ribbon, seed))
    x = np.unique(kept[:, 0])
    assert x.tolist() in (list(range(70)), list(range(30, 100)))
    assert (len(kept), len(triangles)) == (140, 138)
    assert geometry.areas(kept, triangles).sum() == pytest.approx(69e-3)


def test_a_plane_crop_is_a_half_space(spot: TriangleMesh) -> None:
    from scipy.optimize import linprog

    kept = mesh_arrays(ATTACKS.make("crop:share=0.3")(spot, 7))[0]
    gone = np.array(sorted(rows(mesh_arrays(spot)[0]) - rows(kept)))
    sides = np.concatenate([np.c_[-kept, np.ones(len(kept))], np.c_[gone, -np.ones(len(gone))]])
    lonely = 3  # strays that lost all their triangles lie on the kept side
    result = linprog(
        np.r_[np.zeros(4), np.ones(len(sides))],
        np.c_[sides, -np.eye(len(sides))],
        -np.ones(len(sides)),
        bounds=[(None, None)] * 4 + [(0, None)] * len(sides),
        options={"time_limit": 20},
    )
    assert (result.x[4:] > 1.0).sum() <= lonely


def test_a_ball_crop_keeps_a_ball(spot: TriangleMesh) -> None:
    kept = mesh_arrays(ATTACKS.make("crop:share=0.8,kind=ball")(spot, 2))[0]
    all_vertices = mesh_arrays(spot)[0]
    radii = [np.linalg.norm(kept - centre, axis=1).max() for centre in all_vertices]
    centre = all_vertices[np.argmin(radii)]
    inside = np.linalg.norm(all_vertices - centre, axis=1) < min(radii)
    assert inside.sum() < 0.35 * 2930


def test_the_largest_piece_is_connected_and_largest() -> None:
    small = TriangleMesh.create_icosahedron().translate((5.0, 0.0, 0.0))
    both = torus() + small
    assert len(ATTACKS.make("crop:share=0,largest=true")(both).vertices) == 600
    soup = ATTACKS.make("unweld")(both)
    assert len(ATTACKS.make("crop:share=0,largest=true")(soup).triangles) == 1200


def test_cutting_everything_off_is_refused_with_a_reason() -> None:
    with pytest.raises(MeshError, match="leaves no triangle"):
        ATTACKS.make("crop:share=0.99")(TriangleMesh.create_icosahedron(), 0)


def test_holes_open_the_mesh_where_they_say(spot: TriangleMesh) -> None:
    after = ATTACKS.make("holes:share=0.1,count=4")(spot, 1)
    gone = 2930 - len(after.vertices)
    assert 0.03 * 2930 < gone <= 0.1 * 2930 + 10
    boundary = geometry.boundary_vertices(mesh_arrays(after)[1], len(after.vertices))
    assert boundary.any()
    assert not is_closed(after)


def test_holes_in_a_mesh_of_a_few_vertices_keep_to_their_share() -> None:
    box = TriangleMesh.create_box()  # 8 vertices: a twentieth is less than one
    assert len(ATTACKS.make("holes")(box, 0).vertices) == 7
    assert len(ATTACKS.make("holes:share=0.25,count=4")(box, 1).vertices) >= 5


@pytest.mark.parametrize("foreign", ["torus", "sphere", "box", "cone"])
def test_a_pasted_fragment_is_there_in_one_piece_beside_the_foreign_object(spot: TriangleMesh, foreign: str) -> None:
    after = ATTACKS.make(f"paste:share=0.5,foreign={foreign},size=2")(spot, 1)
    fragment = ATTACKS.make("crop:share=0.5")(spot, 1)
    n, m = len(fragment.vertices), len(fragment.triangles)
    vertices, triangles = mesh_arrays(after)
    assert np.array_equal(triangles[:m], mesh_arrays(fragment)[1])
    assert triangles[m:].min() >= n
    ratio = geometry.diagonal(vertices[n:]) / geometry.diagonal(vertices[:n])
    assert ratio == pytest.approx(2.0)
    lengths = [np.linalg.norm(np.diff(v[:n:50], axis=0), axis=1) for v in (vertices, mesh_arrays(fragment)[0])]
    assert np.ptp(lengths[0] / lengths[1]) < 1e-9 * lengths[0].max()
    distances = np.linalg.norm(vertices[:n, None] - vertices[None, n:], axis=2)
    assert distances.min() < 1e-9
