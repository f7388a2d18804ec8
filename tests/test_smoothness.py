"""What a shiny surface shows: values that follow from the shape of a wave, and motions that count nothing."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fixtures.attacked import grid
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays, triangle_mesh
from o3dmark.metrics import METRICS

SIDE, HEIGHT, WAVE = 60, 0.05, 2.0 * np.pi / 30  # of a sheet of equilateral triangles, and of a wave on it


def equilateral() -> TriangleMesh:
    vertices, triangles = mesh_arrays(grid(SIDE))
    x, y, z = vertices.T
    return triangle_mesh(np.stack([x - 0.5 * y, np.sqrt(0.75) * y, z], axis=1), triangles)


def waved(mesh: TriangleMesh, turn: float = 0.0) -> TriangleMesh:
    vertices, triangles = mesh_arrays(mesh)
    along = vertices[:, 0] * np.cos(turn) + vertices[:, 1] * np.sin(turn)
    return triangle_mesh(vertices + np.outer(HEIGHT * np.cos(WAVE * along), [0.0, 0.0, 1.0]), triangles)


def moved(mesh: TriangleMesh, motion: Callable[[np.ndarray], np.ndarray]) -> TriangleMesh:
    vertices, triangles = mesh_arrays(mesh)
    return triangle_mesh(motion(vertices), triangles)


@pytest.mark.parametrize("turn", [0.0, 0.5, 1.3])
def test_a_wave_on_a_plane(turn: float) -> None:
    flat = equilateral()
    wave = waved(flat, turn)
    slope = np.degrees(HEIGHT * WAVE)
    diagonal = geometry.diagonal(mesh_arrays(flat)[0])
    assert METRICS.make("planes")(flat, wave) == pytest.approx(slope * 2.0 / np.pi, rel=0.05)
    assert METRICS.make("reflection")(flat, wave) == pytest.approx(2.0 * slope / np.sqrt(2.0), rel=0.03)
    bent = HEIGHT * WAVE**2 / np.sqrt(2.0) * diagonal
    assert METRICS.make("bending")(flat, wave) == pytest.approx(bent, rel=0.05)


def test_planes_that_move_and_tilt_as_wholes_count_nothing() -> None:
    box = TriangleMesh.create_box().subdivide_midpoint(4)
    sheared = moved(box, lambda x: x @ (np.eye(3) + 0.02 * np.array([[0, 1, 0], [0, 0, 2], [1, 0, 0]])))
    assert METRICS.make("planes")(box, sheared) < 1e-9
    assert METRICS.make("bending")(box, sheared) < 1e-9
    assert METRICS.make("reflection")(box, sheared) > 1.0


def test_one_plane_of_six_that_waves_counts_by_its_area() -> None:
    box = TriangleMesh.create_box().subdivide_midpoint(4)

    def top(x: np.ndarray) -> np.ndarray:
        wave = 0.01 * np.sin(np.pi * x[:, 0]) * np.sin(np.pi * x[:, 1]) * (x[:, 2] == 1.0)
        return x + np.outer(wave, [0.0, 0.0, 1.0])

    alone = METRICS.make("planes")(box, moved(box, top))
    both = METRICS.make("planes")(box, moved(box, lambda x: top(top(x) - np.array([0.0, 0.0, 0.0]))))
    assert alone > 0.1
    assert both == pytest.approx(alone, rel=0.02)  # the top stands at one no more


def test_without_planes_there_is_nothing_to_disturb(spot: TriangleMesh) -> None:
    assert METRICS.make("planes")(spot, moved(spot, lambda x: x + 0.01 * np.sin(40 * x))) == 0.0


def test_creases_do_not_count_as_bent() -> None:
    box = TriangleMesh.create_box().subdivide_midpoint(3)
    wedge = moved(box, lambda x: x * np.stack([1.0 + 0.2 * x[:, 2], np.ones(len(x)), np.ones(len(x))], axis=1))
    assert METRICS.make("bending")(box, wedge) < 1e-6
    assert METRICS.make("bending:crease=100")(box, wedge) > 0.1


@pytest.mark.parametrize("name", ["planes", "bending", "reflection"])
def test_neither_size_nor_place_nor_a_quarter_turn_matters(name: str, spot: TriangleMesh) -> None:
    metric = METRICS.make("planes:tolerance=8,share=0" if name == "planes" else name)
    turn = Rotation.from_euler("xyz", [90, 180, 0], degrees=True).as_matrix()  # or the box's diagonal would change
    other = moved(spot, lambda x: x + 0.002 * np.sin(30 * x))
    pair = [moved(each, lambda x: 7.0 * x @ turn.T + 3.0) for each in (spot, other)]
    assert metric(*pair) == pytest.approx(metric(spot, other), rel=1e-6)


def test_a_wave_is_seen_by_its_slope_and_wide_ones_less() -> None:
    """Of 30 degrees a fifth is 0.17 cycles a degree, where the eye is a tenth as sensitive: 5 % are seen."""
    flat = equilateral()
    seen = {wave: METRICS.make("jnd")(flat, rippled(flat, wave, slope=0.01)) for wave in (0.05, 0.2, 0.8)}
    assert seen[0.2] == pytest.approx(0.01 / 0.051, rel=0.4)
    assert seen[0.05] > 1.5 * seen[0.2] > 3.0 * seen[0.8] > 0.0
    twice = METRICS.make("jnd")(flat, rippled(flat, 0.2, slope=0.02))
    assert twice == pytest.approx(2.0 * seen[0.2], rel=0.02)


def test_a_wave_hides_among_others() -> None:
    flat = equilateral()
    rough = rippled(flat, 0.2, slope=0.3, turn=1.0)
    ripple = mesh_arrays(rippled(flat, 0.2, slope=0.01))[0] - mesh_arrays(flat)[0]
    masked = METRICS.make("jnd")(rough, moved(rough, lambda x: x + ripple))
    assert masked < 0.6 * METRICS.make("jnd")(flat, moved(flat, lambda x: x + ripple))


def rippled(mesh: TriangleMesh, wave: float, slope: float, turn: float = 0.3) -> TriangleMesh:
    """A wave of that length, over the diagonal, and of that greatest slope."""
    vertices, triangles = mesh_arrays(mesh)
    k = 2.0 * np.pi / (wave * geometry.diagonal(vertices))
    along = vertices[:, 0] * np.cos(turn) + vertices[:, 1] * np.sin(turn)
    return triangle_mesh(vertices + np.outer(slope / k * np.cos(k * along), [0.0, 0.0, 1.0]), triangles)
