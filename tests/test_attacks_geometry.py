"""Attacks that move vertices: placement, noise, quantisation, smoothing, deformation."""

import numpy as np
import pytest
from scipy.spatial.distance import pdist
from scipy.spatial.transform import Rotation

from o3dmark.attacks import ATTACKS
from o3dmark.attacks.geometry import random_direction, random_rotation
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface, TriangleMesh, mesh_arrays, triangle_mesh


def moved(spec: str, mesh: TriangleMesh, seed: int = 0) -> np.ndarray:
    return mesh_arrays(ATTACKS.make(spec)(mesh, seed))[0]


def volume(mesh: TriangleMesh) -> float:
    return geometry.volume(*mesh_arrays(mesh))


def fan() -> TriangleMesh:
    """A square pyramid without its base: the apex 0 inside, the border 1 to 4 around it."""
    vertices = np.array([[0.3, 0.1, 1.0], [1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0.0]])
    return triangle_mesh(vertices, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]]))


CENTRE = np.array([10.0, -3.0, 0.5])


def sphere() -> TriangleMesh:
    """642 vertices, evenly on the sphere of radius 2 about CENTRE."""
    mesh = TriangleMesh.create_icosahedron().subdivide_midpoint(3)
    vertices, triangles = mesh_arrays(mesh)
    return triangle_mesh(2.0 * geometry.unit(vertices) + CENTRE, triangles)


# similarity


@pytest.mark.parametrize("seed", range(5))
def test_similarity_keeps_the_ratios_of_distances_and_the_orientation(spot: TriangleMesh, seed: int) -> None:
    after = ATTACKS.make("similarity")(spot, seed)
    some = slice(None, None, 100)
    ratio = pdist(mesh_arrays(after)[0][some]) / pdist(mesh_arrays(spot)[0][some])
    assert np.ptp(ratio) < 1e-9 * ratio.mean()
    assert volume(after) / volume(spot) == pytest.approx(ratio.mean() ** 3)


def test_similarity_stays_within_the_benchmark_s_ranges(spot: TriangleMesh) -> None:
    v = mesh_arrays(spot)[0]
    centre = v.mean(axis=0)
    norm = np.linalg.norm(v - centre, axis=1).mean()
    shifts, scales, angles = [], [], []
    for seed in range(60):
        w = moved("similarity", spot, seed)
        shifts.append((w.mean(axis=0) - centre) / norm)
        scales.append(np.linalg.norm(w - w.mean(axis=0), axis=1).mean() / norm)
        turn = np.linalg.lstsq(v - centre, (w - w.mean(axis=0)) / scales[-1], rcond=None)[0]
        angles.append(np.degrees(np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0))))
    assert 4.0 < np.abs(shifts).max() <= 5.0
    assert 0.1 <= min(scales) < 2.0 < 8.0 < max(scales) <= 10.0
    assert min(angles) < 45.0
    assert max(angles) > 135.0


def test_each_part_of_a_similarity_can_be_switched_off(spot: TriangleMesh) -> None:
    v = mesh_arrays(spot)[0]
    shifted = moved("similarity:rotation=0,smallest=1,largest=1", spot)
    assert np.ptp(shifted - v, axis=0) == pytest.approx(np.zeros(3), abs=1e-12)
    turned = moved("similarity:translation=0,smallest=1,largest=1", spot)
    assert turned.mean(axis=0) == pytest.approx(v.mean(axis=0))
    assert pdist(turned[::100]) == pytest.approx(pdist(v[::100]))
    scaled = moved("similarity:translation=0,rotation=0,smallest=3,largest=3", spot)
    assert scaled == pytest.approx(3.0 * v - 2.0 * v.mean(axis=0))


def test_random_rotations_turn_about_any_axis_by_any_angle_up_to_the_largest() -> None:
    rng = np.random.default_rng(0)
    turns = [Rotation.from_matrix(random_rotation(rng, 2.0)) for _ in range(2000)]
    angles = np.array([turn.magnitude() for turn in turns])
    axes = np.array([turn.as_rotvec() for turn in turns]) / angles[:, None]
    assert angles.max() <= 2.0
    assert angles.mean() == pytest.approx(1.0, abs=0.04)
    assert axes.T @ axes / 2000 == pytest.approx(np.eye(3) / 3.0, abs=0.04)
    assert np.array_equal(random_rotation(rng, 0.0), np.eye(3))


def test_random_directions_are_uniform() -> None:
    rng = np.random.default_rng(0)
    directions = np.array([random_direction(rng) for _ in range(4000)])
    assert np.linalg.norm(directions, axis=1) == pytest.approx(np.ones(4000))
    assert directions.mean(axis=0) == pytest.approx(np.zeros(3), abs=0.05)
    assert directions.T @ directions / 4000 == pytest.approx(np.eye(3) / 3.0, abs=0.03)


# stretch, mirror, axes, units


def test_stretch_scales_each_axis_by_its_own_factor(spot: TriangleMesh) -> None:
    v = mesh_arrays(spot)[0]
    factors = np.ptp(moved("stretch:amount=0.2", spot), axis=0) / np.ptp(v, axis=0)
    assert len(set(factors)) == 3
    assert (np.abs(factors - 1.0) <= 0.2).all()


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_mirror_is_its_own_inverse_and_stays_outward(spot: TriangleMesh, axis: str) -> None:
    once = ATTACKS.make(f"mirror:axis={axis}")(spot)
    twice = ATTACKS.make(f"mirror:axis={axis}")(once)
    v, w = mesh_arrays(spot)[0], mesh_arrays(once)[0]
    column = "xyz".index(axis)
    assert w[:, column] + v[:, column] == pytest.approx(np.full(len(v), 2.0 * v[:, column].mean()))
    assert np.delete(w, column, axis=1) == pytest.approx(np.delete(v, column, axis=1))
    assert volume(once) == pytest.approx(volume(spot))
    assert mesh_arrays(twice)[0] == pytest.approx(v)


@pytest.mark.parametrize("order", ["xzy", "yxz", "zyx", "yzx", "zxy"])
def test_axes_are_exchanged_and_normals_stay_outward(spot: TriangleMesh, order: str) -> None:
    after = ATTACKS.make(f"axes:order={order}")(spot)
    assert np.array_equal(mesh_arrays(after)[0], mesh_arrays(spot)[0][:, ["xyz".index(letter) for letter in order]])
    assert volume(after) == pytest.approx(volume(spot))


def test_units_multiply(spot: TriangleMesh) -> None:
    assert moved("units:factor=25.4", spot) == pytest.approx(25.4 * mesh_arrays(spot)[0])
    assert moved("units", spot) == pytest.approx(mesh_arrays(spot)[0] / 25.4)


# noise


def mean_norm(v: np.ndarray) -> float:
    return np.linalg.norm(v - v.mean(axis=0), axis=1).mean()


def test_uniform_noise_fills_its_interval_evenly(spot: TriangleMesh) -> None:
    v = mesh_arrays(spot)[0]
    step = (moved("noise:amplitude=0.005", spot) - v) / (0.005 * mean_norm(v))
    assert np.abs(step).max() <= 1.0 + 1e-9
    assert np.abs(step).max() > 0.99
    assert step.mean(axis=0) == pytest.approx(np.zeros(3), abs=0.04)
    assert step.std(axis=0) == pytest.approx(np.full(3, 3**-0.5), abs=0.02)


def test_noise_scales_with_the_mesh(spot: TriangleMesh) -> None:
    large = TriangleMesh(spot).scale(1000.0, (0.0, 0.0, 0.0))
    assert moved("noise", large) == pytest.approx(1000.0 * moved("noise", spot))


def test_gaussian_noise_has_its_standard_deviation(spot: TriangleMesh) -> None:
    v = mesh_arrays(spot)[0]
    step = (moved("noise:amplitude=0.002,kind=gaussian", spot) - v) / (0.002 * mean_norm(v))
    assert step.std(axis=0) == pytest.approx(np.ones(3), abs=0.04)
    assert np.abs(step).max() > 2.5


def test_noise_along_normals_stays_along_them(spot: TriangleMesh) -> None:
    v = mesh_arrays(spot)[0]
    step = (moved("noise:amplitude=0.002,kind=normal", spot) - v) / (0.002 * mean_norm(v))
    normals = Surface.of(spot).normals
    height = np.einsum("ij,ij->i", step, normals)
    assert step == pytest.approx(height[:, None] * normals, abs=1e-9)
    assert height.std() == pytest.approx(1.0, abs=0.04)


def test_noise_opens_seams_only_when_told_to() -> None:
    soup = ATTACKS.make("unweld")(sphere())
    positions = len(geometry.weld(mesh_arrays(soup)[0])[0])
    assert len(geometry.weld(moved("noise", soup))[0]) == positions
    assert len(geometry.weld(moved("noise:seams=false", soup))[0]) == len(soup.vertices)


# quantisation


def test_quantisation_by_hand() -> None:
    vertices = np.array([[0, 0, 0], [8, 0, 0], [0, 4, 0], [3.9, 1.1, 2], [4.1, 0.4, 0.2]], np.float64)
    mesh = triangle_mesh(vertices, np.array([[0, 1, 2], [1, 2, 3], [2, 3, 4], [0, 1, 4]]))
    by_axis = np.array([[0, 0, 0], [8, 0, 0], [0, 4, 0], [4, 1, 2], [4, 0, 0]], np.float64)  # steps 2, 1, 0.5
    by_axis[4, 2] = 0.0
    assert np.array_equal(moved("quantise:bits=2", mesh), by_axis)
    cube = np.array([[0, 0, 0], [8, 0, 0], [0, 4, 0], [4, 2, 2], [4, 0, 0]], np.float64)  # one step, 2
    assert np.array_equal(moved("quantise:bits=2,grid=cube", mesh), cube)


def test_a_quantised_cube_by_hand() -> None:
    thirds = TriangleMesh.create_box(3.0, 3.0, 3.0)
    thirds = triangle_mesh(np.r_[mesh_arrays(thirds)[0], [[1, 2, 0], [2, 1, 3]]], [*mesh_arrays(thirds)[1], [0, 8, 9]])
    before, after = mesh_arrays(thirds)[0], moved("quantise:bits=2", thirds)  # levels 0, 0.75, 1.5, 2.25, 3
    assert np.array_equal(after[:8], before[:8])
    assert np.array_equal(after[8:], [[0.75, 2.25, 0], [2.25, 0.75, 3]])
    assert moved("quantise:bits=1", thirds)[8:].tolist() == [[1.5, 1.5, 0], [1.5, 1.5, 3]]  # levels 0, 1.5, 3


@pytest.mark.parametrize("bits", [7, 9, 11])
def test_quantisation_moves_by_half_a_step_at_most_and_once(spot: TriangleMesh, bits: int) -> None:
    v, spec = mesh_arrays(spot)[0], f"quantise:bits={bits}"
    once = ATTACKS.make(spec)(spot)
    w = mesh_arrays(once)[0]
    steps = np.ptp(v, axis=0) / 2**bits
    assert (np.abs(w - v) <= 0.5 * steps * (1 + 1e-9)).all()
    levels = (w - w.min(axis=0)) / steps
    assert levels == pytest.approx(np.round(levels), abs=1e-9)
    assert levels.max() == pytest.approx(2**bits)
    assert moved(spec, once) == pytest.approx(w, abs=1e-12)


def test_a_flat_mesh_stays_in_its_plane() -> None:
    flat = triangle_mesh(np.array([[0, 0, 5.5], [1, 0, 5.5], [0.3, 1, 5.5]]), np.array([[0, 1, 2]]))
    assert (moved("quantise:bits=4", flat)[:, 2] == 5.5).all()


# smoothing


def test_the_umbrella_by_hand() -> None:
    v = mesh_arrays(fan())[0]
    w = moved("smooth:iterations=1,strength=0.1", fan())
    assert w[0] == pytest.approx([0.27, 0.09, 0.9])  # nine tenths of the apex, a tenth of the square's centre, 0
    assert np.array_equal(w[1:], v[1:])
    assert moved("smooth:iterations=2,strength=0.1", fan())[0] == pytest.approx(0.81 * v[0])


def valley(n: int = 6) -> tuple[TriangleMesh, np.ndarray]:
    """A plane folded up on both sides of x = 3, inner vertices with six neighbours; and its vertices (49, 3)."""
    x, y = (side.ravel().astype(np.float64) for side in np.meshgrid(np.arange(n + 1), np.arange(n + 1)))
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    triangles = np.r_[np.c_[first, first + 1, first + n + 2], np.c_[first, first + n + 2, first + n + 1]]
    vertices = np.c_[x, y, np.abs(x - n / 2)]
    return triangle_mesh(vertices, triangles), vertices


def test_a_smoothed_edge_by_hand() -> None:
    mesh, v = valley()
    once, many = (moved(f"smooth:iterations={k},strength=0.3", mesh) for k in (1, 4))
    inner = ((v[:, :2] > 0) & (v[:, :2] < 6)).all(axis=1)
    edge = inner & (v[:, 0] == 3)
    assert once[edge, 2] == pytest.approx(np.full(5, 0.3 * 4 / 6))  # four of six neighbours stand one higher
    assert once[inner & ~edge] == pytest.approx(v[inner & ~edge])  # planes stay planes
    assert np.array_equal(once[~inner], v[~inner])
    deep = edge & (v[:, 1] == 3)  # out of the border's reach
    second = 0.2 + 0.3 * ((2 * 0.2 + 4 * 1.0) / 6 - 0.2)
    assert moved("smooth:iterations=2,strength=0.3", mesh)[deep, 2] == pytest.approx(second)
    assert many[deep, 2] > second


def test_cotangents_by_hand() -> None:
    v = mesh_arrays(fan())[0]
    weights = []
    for j, before, after in ((1, 4, 2), (2, 1, 3), (3, 2, 4), (4, 3, 1)):
        corners = [(v[0] - v[k], v[j] - v[k]) for k in (before, after)]
        weights.append(max(sum(a @ b / np.linalg.norm(np.cross(a, b)) for a, b in corners), 0.0))
    mean = np.average(v[1:], axis=0, weights=weights)
    w = moved("smooth:iterations=1,strength=0.5,weights=cotangent", fan())
    assert w[0] == pytest.approx(0.5 * (v[0] + mean))


def test_smoothing_a_sphere_shrinks_it_and_taubin_does_not() -> None:
    before = volume(sphere())
    laplace = volume(ATTACKS.make("smooth:iterations=20,strength=0.5")(sphere()))
    taubin = volume(ATTACKS.make("taubin:iterations=10")(sphere()))
    hc = volume(ATTACKS.make("hc:iterations=10")(sphere()))
    assert laplace < 0.93 * before
    assert abs(taubin / before - 1.0) < 0.3 * (1.0 - laplace / before)
    assert abs(hc / before - 1.0) < 0.3 * (1.0 - laplace / before)


@pytest.mark.parametrize("spec", ["smooth:strength=0.5", "smooth:weights=cotangent,strength=0.5", "taubin", "hc"])
def test_smoothing_takes_noise_away(spec: str) -> None:
    rough = ATTACKS.make("noise:amplitude=0.02")(sphere(), 0)
    smooth = ATTACKS.make(spec)(rough)
    radii = [np.linalg.norm(Surface.of(mesh).vertices - CENTRE, axis=1) for mesh in (rough, smooth)]
    assert radii[1].std() < 0.8 * radii[0].std()


def test_hc_like_its_slow_definition(spot: TriangleMesh) -> None:
    surface = Surface.of(spot)
    neighbours = [[] for _ in surface.vertices]
    for a, b in geometry.edges(surface.triangles):
        neighbours[a].append(b)
        neighbours[b].append(a)
    o = q = surface.vertices
    alpha, beta = 0.2, 0.6
    for _ in range(2):
        p = np.array([q[near].mean(axis=0) for near in neighbours])
        b = p - (alpha * o + (1 - alpha) * q)
        q = np.array([p[i] - (beta * b[i] + (1 - beta) * b[near].mean(axis=0)) for i, near in enumerate(neighbours)])
    assert moved("hc:iterations=2,alpha=0.2,beta=0.6", spot) == pytest.approx(q, abs=1e-12)


@pytest.mark.parametrize("spec", ["smooth:iterations=30", "smooth:weights=cotangent", "taubin", "hc"])
def test_smoothing_commutes_with_similarities(spot: TriangleMesh, spec: str) -> None:
    after = moved(spec, ATTACKS.make("similarity")(spot, 3))
    before = mesh_arrays(ATTACKS.make("similarity:translation=0,rotation=0,smallest=1,largest=1")(spot, 3))[0]
    linear, _, _, _ = np.linalg.lstsq(np.c_[before, np.ones(len(before))], moved("similarity", spot, 3), rcond=None)
    assert after == pytest.approx(np.c_[moved(spec, spot), np.ones(len(before))] @ linear, abs=1e-9)


# deformation


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_twist_keeps_distances_to_its_axis(spot: TriangleMesh, axis: str) -> None:
    v, w = mesh_arrays(spot)[0], moved(f"twist:angle=40,axis={axis}", spot, 1)
    column = "xyz".index(axis)
    across = np.delete(v, column, axis=1), np.delete(w, column, axis=1)
    centre = (across[0].min(axis=0) + across[0].max(axis=0)) / 2.0
    assert np.array_equal(v[:, column], w[:, column])
    radii = [np.linalg.norm(points - centre, axis=1) for points in across]
    assert radii[0] == pytest.approx(radii[1])


@pytest.mark.parametrize("name", ["twist", "bend"])
@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_both_ends_of_a_deformation_move_rigidly(spot: TriangleMesh, name: str, axis: str) -> None:
    v = mesh_arrays(spot)[0]
    w = moved(f"{name}:angle=60,axis={axis},band=0.3", spot, 1)
    along = v[:, "xyz".index(axis)]
    order = np.argsort(along)
    low, high = order[:10], order[-10:]
    assert w[low] == pytest.approx(v[low], abs=1e-12)
    assert pdist(w[high]) == pytest.approx(pdist(v[high]))
    turn = np.linalg.lstsq(v[high] - v[high].mean(axis=0), w[high] - w[high].mean(axis=0), rcond=None)[0]
    assert np.degrees(np.arccos((np.trace(turn) - 1.0) / 2.0)) == pytest.approx(60.0, abs=1e-4)


def test_a_bend_is_continuous_and_keeps_the_length_of_the_axis() -> None:
    height = np.linspace(0.0, 1.0, 400)
    strip = np.concatenate([np.c_[np.full(400, side), np.zeros(400), height] for side in (-0.1, 0.1)])
    triangles = np.array([[i, i + 1, i + 400] for i in range(399)] + [[i + 1, i + 401, i + 400] for i in range(399)])
    w = moved("bend:angle=90,axis=z,band=0.5", triangle_mesh(strip, triangles), 0)
    middle = (w[:400] + w[400:]) / 2.0
    steps = np.linalg.norm(np.diff(middle, axis=0), axis=1)
    assert steps == pytest.approx(np.full(399, 1 / 399), rel=1e-3)
    first, last = np.diff(middle[:2], axis=0)[0], np.diff(middle[-2:], axis=0)[0]
    assert first @ last == pytest.approx(0.0, abs=1e-9)
    assert last[0] > 0  # towards the next axis
