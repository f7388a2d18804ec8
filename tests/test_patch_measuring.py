"""What a patch measures: the compiled loops against sums over every point, and what it does not see."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fixtures.attacked import grid
from fixtures.shapes import icosphere, rotation
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface, mesh_arrays
from o3dmark.methods.local_patches import measuring
from o3dmark.methods.local_patches.disk import DiskFunctions, disk_functions
from o3dmark.methods.local_patches.format import FORMATS, smooth_end
from o3dmark.methods.local_patches.measuring import (
    Grid,
    Patches,
    Sampled,
    answers,
    coefficients,
    first_look,
    grid_of,
    held,
    patches_at,
)

FORM = FORMATS["2026"]
RADIUS = 0.3
SOME = np.arange(0, 10_000, 700)


@pytest.fixture(scope="module")
def functions() -> DiskFunctions:
    return disk_functions(FORM)


@pytest.fixture(scope="module")
def bumpy() -> Surface:
    """A ball of 10 242 vertices with waves of several lengths, some shorter than a patch."""
    vertices, triangles = icosphere(5)
    ways = np.random.default_rng(0).standard_normal((12, 3)) * np.linspace(2.0, 9.0, 12)[:, None]
    return Surface.from_arrays(
        vertices * (1.0 + 0.02 * np.sin(vertices @ ways.T + 1.0).sum(axis=1))[:, None], triangles
    )


@pytest.fixture(scope="module")
def sampled(bumpy: Surface) -> Sampled:
    return Sampled(FORM, bumpy, RADIUS)


@pytest.fixture(scope="module")
def patches(sampled: Sampled) -> Patches:
    return sampled.patches(sampled.surface.vertices[SOME], sampled.surface.normals[SOME])


def one_by_one(points: np.ndarray, vectors: np.ndarray, patches: Patches, functions: DiskFunctions) -> np.ndarray:
    """As `coefficients`, by the formula, of every point for every patch."""
    found = np.zeros((len(patches.centre), len(functions.order)), np.complex128)
    for i, (centre, frame) in enumerate(zip(patches.centre, patches.frames(), strict=True)):
        x, y, z = frame @ (points - centre).T / patches.radius
        flux = vectors @ frame[2] / patches.radius**2
        taper, _ = smooth_end(np.abs(z) / FORM.half_height, FORM.lid)
        nodes = np.linspace(0.0, 1.0, functions.table.shape[1])
        for q, (m, row) in enumerate(zip(functions.order, functions.table, strict=True)):
            wave = np.interp(np.hypot(x, y), nodes, row, right=0.0) * np.exp(-1j * m * np.arctan2(y, x))
            found[i, q] = np.sum(z * taper * wave * flux)
    return found


# The compiled loops


def test_coefficients_are_the_sum_over_every_point(
    sampled: Sampled, patches: Patches, functions: DiskFunctions
) -> None:
    few = patches.among(np.arange(2))
    slow = one_by_one(sampled.samples.points, sampled.samples.area_vectors, few, functions)
    fast = coefficients(sampled.grid, few, functions)
    np.testing.assert_allclose(fast, slow, atol=1e-10)
    assert np.abs(slow).max() > 1e-3


def test_a_lid_brings_what_is_far_up_to_nothing(sampled: Sampled, functions: DiskFunctions) -> None:
    """Of patches that stand so low that the lid cuts the surface."""
    up = sampled.surface.normals[SOME[:3]]
    low = Patches(FORM, sampled.surface.vertices[SOME[:3]] - 0.7 * RADIUS * up, up, RADIUS)
    slow = one_by_one(sampled.samples.points, sampled.samples.area_vectors, low, functions)
    np.testing.assert_allclose(coefficients(sampled.grid, low, functions), slow, atol=1e-10)
    beyond = low._replace(centre=low.centre - 0.6 * RADIUS * up)
    assert np.abs(slow).max() > 1e-3
    assert not coefficients(sampled.grid, beyond, functions).any()


def test_a_first_look_sees_a_wave_to_two_hundredths(functions: DiskFunctions) -> None:
    """Of vertices and centroids, what they hold taken together in rings, where all points measure; on flat ground."""
    for number in (0.4, 0.8, 1.2):
        sampled, middle = field(lambda x, y, number=number: 0.1 * np.cos(number * x + 0.3 * y))
        patch = Patches(FORM, middle, np.array([[0.0, 0.0, 1.0]]), sampled.radius)
        full = coefficients(sampled.grid, patch, functions)
        look = first_look(sampled.coarse, patch, functions)
        assert np.linalg.norm(look - full) < 0.02 * np.linalg.norm(full), number


def test_a_first_look_is_off_by_a_small_part_of_a_step(
    sampled: Sampled, patches: Patches, functions: DiskFunctions
) -> None:
    """On hilly ground, where heights are many times the mark's."""
    off = first_look(sampled.coarse, patches, functions) - coefficients(sampled.grid, patches, functions)
    assert np.sqrt((np.abs(off) ** 2).mean()) < 0.15 * min(FORM.strengths)
    assert np.sqrt((np.abs(off) ** 2).mean()) < 0.05 * max(FORM.strengths)


def test_the_axis_is_the_mean_normal_of_what_faces_its_way(sampled: Sampled) -> None:
    points, vectors = sampled.samples.points, sampled.samples.area_vectors
    here, start = sampled.surface.vertices[SOME[:5]], sampled.surface.normals[SOME[:5]]
    found = patches_at(FORM, sampled.grid, here, start, RADIUS).axis
    for centre, axis, fast in zip(here, start, found, strict=True):
        away = 1.0 - np.sum((points - centre) ** 2, axis=1) / (FORM.normal_radius * RADIUS) ** 2
        for _ in range(FORM.passes):
            counted = (away > 0.0) & (vectors @ axis > 0.0)
            axis = geometry.unit((away[counted] ** 2 @ vectors[counted])[None])[0]
        np.testing.assert_allclose(fast, axis, atol=1e-12)


def test_a_sheet_that_faces_the_other_way_does_not_turn_the_axis() -> None:
    """As the far side of a thin plate, which is not even parallel."""
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (400, 3)) * [1.0, 1.0, 0.0]
    upper, lower = np.array([0.0, 0.6, 0.8]), np.array([0.8, 0.0, -0.6])
    both = np.concatenate([points, points - [0.0, 0.0, 0.1]])
    plate = grid_of(both, np.repeat([upper, lower], 400, axis=0), 1.0)
    middle = np.zeros((1, 3))
    for side in (upper, lower):
        np.testing.assert_allclose(patches_at(FORM, plate, middle, side[None], 1.0).axis[0], side, atol=1e-12)


def test_where_nothing_is_near_the_normal_stays(sampled: Sampled) -> None:
    far, up = np.array([[9.0, 9.0, 9.0]]), np.array([[0.0, 0.6, 0.8]])
    assert np.array_equal(sampled.patches(far, up).axis, up)


def test_frames_are_rotations_with_the_axis_last(patches: Patches) -> None:
    axes = patches._replace(axis=np.concatenate([patches.axis, np.eye(3), -np.eye(3)]))
    for frame, axis in zip(axes.frames(), axes.axis, strict=True):
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(frame) == pytest.approx(1.0)
        np.testing.assert_allclose(frame[2], axis)


# What a patch does not see, and how it turns


def field(height: object, tilt: np.ndarray | None = None) -> tuple[Sampled, np.ndarray]:
    """A height over a square of 40 by 40, turned, as patches of radius 10 see it; and its middle."""
    vertices, triangles = mesh_arrays(grid(40, height))  # type: ignore[arg-type]
    middle = vertices[[20 * 41 + 20]]
    turn = np.eye(3) if tilt is None else tilt
    return Sampled(FORM, Surface.from_arrays(vertices @ turn.T, triangles), 10.0), middle @ turn.T


def test_a_plane_has_no_coefficient_whichever_way_it_lies(functions: DiskFunctions) -> None:
    for tilt in (np.eye(3), rotation(1), rotation(2)):
        sampled, middle = field(lambda x, _: 0.0 * x, tilt)
        patch = sampled.patches(middle, tilt[:, 2][None])
        np.testing.assert_allclose(patch.axis[0], tilt[:, 2], atol=1e-12)
        assert np.abs(coefficients(sampled.grid, patch, functions)).max() < 1e-12


def test_neither_height_tilt_nor_curvature_beside_the_axis_is_seen(functions: DiskFunctions) -> None:
    """Fluxes through a patch that stands upright in fields of up to the third degree, and in one of the fourth.

    What is left is of the quadrature; of a wave as high as these fields coefficients are a tenth.
    """
    up = np.array([[0.0, 0.0, 1.0]])

    def seen(height: object) -> float:
        sampled, middle = field(height)
        patch = Patches(FORM, middle, up, sampled.radius)
        return float(np.abs(coefficients(sampled.grid, patch, functions)).max())

    low = {
        "tilt": lambda x, y: 0.2 * (x - 20) - 0.1 * (y - 20),
        "saddle": lambda x, y: 0.02 * (x - 20) * (y - 20),
        "bowl": lambda x, y: 0.02 * ((x - 20) ** 2 + (y - 20) ** 2),
        "cubic": lambda x, y: 0.002 * ((x - 20) ** 3 - 2.0 * (x - 20) * (y - 20) ** 2),
    }
    wave = seen(lambda x, _: 2.0 * np.cos(0.6 * (x - 20)))
    quartic = seen(lambda x, _: 0.0002 * (x - 20) ** 4)
    found = {name: seen(height) for name, height in low.items()}
    assert max(found.values()) < 0.02 * wave, found
    assert quartic > 2.0 * max(found.values()), found


def test_a_rigid_motion_leaves_the_size_of_every_coefficient(
    sampled: Sampled, patches: Patches, functions: DiskFunctions
) -> None:
    """And so does a change of scale, together with the radius."""
    before = np.abs(coefficients(sampled.grid, patches, functions))
    turn, surface = rotation(3), sampled.surface
    for scale in (1.0, 7.0):
        moved = Sampled(FORM, surface.moved(scale * surface.vertices @ turn.T + [1.0, -2.0, 3.0]), scale * RADIUS)
        there = moved.patches(moved.surface.vertices[SOME], moved.surface.normals[SOME])
        np.testing.assert_allclose(there.axis, patches.axis @ turn.T, atol=1e-9)
        np.testing.assert_allclose(np.abs(coefficients(moved.grid, there, functions)), before, atol=1e-9)


@pytest.mark.parametrize("angle", [0.3, -2.0, np.pi])
def test_what_turns_about_the_axis_turns_each_coefficient_by_its_order(
    angle: float, sampled: Sampled, patches: Patches, functions: DiskFunctions
) -> None:
    """exp(-i m angle) where the surface turns, exp(i m angle) where the frame does."""
    patch = patches.among(np.array([2]))
    turn = Rotation.from_rotvec(angle * patch.axis[0]).as_matrix()
    vectors = sampled.samples.area_vectors @ turn.T
    turned = grid_of((sampled.samples.points - patch.centre) @ turn.T + patch.centre, vectors, RADIUS)
    before, after = (coefficients(each, patch, functions) for each in (sampled.grid, turned))
    np.testing.assert_allclose(after, before * np.exp(-1j * angle * functions.order), atol=1e-10)


def test_what_lies_outside_the_cylinder_does_not_matter(sampled: Sampled, functions: DiskFunctions) -> None:
    """Nor does a patch feel that all the rest is cut away: a fragment is measured as the whole."""
    surface, centre = sampled.surface, int(SOME[5])
    near = np.linalg.norm(surface.vertices - surface.vertices[centre], axis=1) < 1.4 * RADIUS
    part = Sampled(FORM, surface.part(near[surface.triangles].all(axis=1)), RADIUS)
    here, up = surface.vertices[[centre]], surface.normals[[centre]]
    one, other = (coefficients(each.grid, each.patches(here, up), functions) for each in (sampled, part))
    assert len(part.surface.vertices) < 0.2 * len(surface.vertices)
    np.testing.assert_allclose(one, other, atol=1e-10)


# How it answers to motion


@pytest.mark.parametrize(("way", "tolerance"), [("axis", 1e-8), ("normals", 0.02), ("across", 0.15)])
def test_answers_are_the_slope_of_the_coefficients(
    way: str, tolerance: float, sampled: Sampled, patches: Patches, functions: DiskFunctions
) -> None:
    """Moving the surface by dx changes them by the integral of the answer times dx . dA, the patch where it was.

    By the divergence theorem, so exactly where no sample goes aside; else as exactly as sums are integrals.
    """
    patch, surface = patches.among(np.array([1])), sampled.surface
    inside = held(sampled.samples.points, patch)
    corners, weights = sampled.samples.corners[inside], sampled.samples.weights[inside]
    ways = {"axis": patch.axis, "normals": surface.normals, "across": patch.frames()[:, 0]}[way]
    motion = np.cos(25.0 * surface.vertices[:, [0]] + 1.0) * ways
    at_samples = np.einsum("qc,qcd->qd", weights, motion[corners])
    speed = np.einsum("qd,qd->q", at_samples, sampled.samples.area_vectors[inside])
    step, found = 1e-5, []
    for each in (step, -step):
        there = sampled.rule.samples(surface.moved(surface.vertices + each * motion))
        found.append(coefficients(grid_of(there.points, there.area_vectors, RADIUS), patch, functions)[0])
    slope = (found[0] - found[1]) / (2.0 * step)
    expected = speed @ answers(sampled.samples.points[inside], patch, functions)
    assert np.linalg.norm(slope - expected) < tolerance * np.linalg.norm(slope)


def test_answers_are_the_slope_under_the_lids_too(sampled: Sampled, functions: DiskFunctions) -> None:
    """Of a patch that stands so low that its lid's taper lies on the surface."""
    surface, up = sampled.surface, sampled.surface.normals[SOME[:1]]
    low = Patches(FORM, surface.vertices[SOME[:1]] - 0.65 * RADIUS * up, up, RADIUS)
    inside = held(sampled.samples.points, low)
    flux = sampled.samples.area_vectors[inside] @ up[0]
    step, found = 1e-6, []
    for each in (step, -step):
        there = sampled.rule.samples(surface.moved(surface.vertices + each * up))
        found.append(coefficients(grid_of(there.points, there.area_vectors, RADIUS), low, functions)[0])
    slope = (found[0] - found[1]) / (2.0 * step)
    expected = flux @ answers(sampled.samples.points[inside], low, functions)
    assert np.linalg.norm(slope - expected) < 1e-4 * np.linalg.norm(slope)


def test_held_are_the_points_in_the_cylinder(sampled: Sampled, patches: Patches) -> None:
    points = np.random.default_rng(0).uniform(-1.5, 1.5, (20_000, 3))
    for i in range(3):
        patch = patches.among(np.array([i]))
        x, y, z = patch.frames()[0] @ (points - patch.centre[0]).T / RADIUS
        slow = np.flatnonzero((x**2 + y**2 < 1.0) & (np.abs(z) < FORM.half_height))
        assert len(slow)
        assert np.array_equal(held(points, patch), slow)


# Boundaries


def test_a_closed_surface_has_whole_patches_alone(sampled: Sampled, patches: Patches) -> None:
    assert sampled.boundary is None
    assert sampled.whole(patches).all()


def test_patches_are_whole_where_no_edge_of_one_triangle_is_in_them(sampled: Sampled) -> None:
    """Against every point of the boundary, densely; those whose distance is between the two densities may be either."""
    surface = sampled.surface
    cut = Sampled(FORM, surface.part((surface.vertices[surface.triangles][:, :, 2] < 0.2).all(axis=1)), RADIUS)
    patches = cut.patches(cut.surface.vertices[::11], cut.surface.normals[::11])
    start, end = geometry.boundary_edges(cut.surface.vertices, cut.surface.triangles)
    share = np.linspace(0.0, 1.0, 8)[:, None, None]
    points = ((1.0 - share) * start + share * end).reshape(-1, 3)
    nearest = np.empty(len(patches.centre))
    for i, (centre, frame) in enumerate(zip(patches.centre, patches.frames(), strict=True)):
        x, y, z = frame @ (points - centre).T / RADIUS
        nearest[i] = np.maximum(np.hypot(x, y), np.abs(z) / FORM.half_height).min()
    whole = cut.whole(patches)
    assert whole[nearest > 0.96].all()
    assert not whole[nearest < 0.94].any()
    assert 0.1 < whole.mean() < 0.9


def test_boundary_edges_are_those_of_one_triangle(sampled: Sampled) -> None:
    assert len(geometry.boundary_edges(sampled.surface.vertices, sampled.surface.triangles)[0]) == 0
    vertices, triangles = mesh_arrays(grid(5))
    start, end = geometry.boundary_edges(vertices, triangles)
    assert len(start) == 4 * 5
    assert np.linalg.norm(end - start, axis=1) == pytest.approx(np.ones(20))
    middle = 0.5 * (start + end)[:, :2]
    assert (np.isclose(middle, 0.0) | np.isclose(middle, 5.0)).any(axis=1).all()


def test_areas_are_half_the_cross_products_of_sides(sampled: Sampled) -> None:
    surface = sampled.surface
    a, b, c = surface.vertices[surface.triangles].transpose(1, 0, 2)
    np.testing.assert_allclose(surface.area_vectors, 0.5 * np.cross(b - a, c - a), atol=1e-15)
    np.testing.assert_allclose(surface.areas, 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))
    assert surface.area == pytest.approx(surface.vertex_areas.sum())
    assert np.abs(surface.area_vectors.sum(axis=0)).max() < 1e-12  # closed


# Grids, and loops in parts


def test_a_grid_holds_every_point_once_in_its_cell() -> None:
    points = np.random.default_rng(1).standard_normal((500, 3))
    found = Grid.of(points, 2.0 * points, 0.4)
    assert np.array_equal(np.sort(found.place), np.arange(500))
    assert np.array_equal(found.points, points[found.place])
    assert np.array_equal(found.vectors, 2.0 * points[found.place])
    assert found.first[0] == 0
    assert found.first[-1] == 500
    for cell in range(len(found.first) - 1):
        corner = np.array(np.unravel_index(cell, found.shape))
        inside = found.points[found.first[cell] : found.first[cell + 1]]
        assert np.all(inside >= found.low + corner * found.cell - 1e-12)
        assert np.all(inside <= found.low + (corner + 1) * found.cell + 1e-12)


def test_a_grid_of_far_points_does_not_fill_the_memory(sampled: Sampled, functions: DiskFunctions) -> None:
    """Its cells grow, and what is measured stays."""
    far = np.array([[1e4, -1e4, 1e4]])
    points, vectors = sampled.samples.points, sampled.samples.area_vectors
    wide = grid_of(np.concatenate([points, far]), np.concatenate([vectors, 0.0 * far]), RADIUS)
    assert np.prod(wide.shape) <= measuring._MOST_CELLS
    patch = sampled.patches(sampled.surface.vertices[SOME[:1]], sampled.surface.normals[SOME[:1]])
    one, other = (coefficients(each, patch, functions) for each in (sampled.grid, wide))
    np.testing.assert_allclose(one, other, atol=1e-10)


def test_a_first_look_at_a_surface_whose_triangles_are_all_cut(functions: DiskFunctions) -> None:
    vertices, triangles = mesh_arrays(grid(24))
    sampled = Sampled(FORM, Surface.from_arrays(vertices, triangles), 5.0)
    patch = sampled.patches(vertices[[12 * 25 + 12]], np.array([[0.0, 0.0, 1.0]]))
    assert np.abs(first_look(sampled.coarse, patch, functions)).max() < 1e-6
