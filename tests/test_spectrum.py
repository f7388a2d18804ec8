"""The Fourier transform of a solid: the divergence theorem, and what it promises."""

import numpy as np
import pytest

from o3dmark.arrays import Floats
from o3dmark.solid.quadrature import samples
from o3dmark.solid.solid import Solid
from o3dmark.solid.spectrum import Band, Spectrum

BAND = Band(2.0, 6.0, 6.0)
ACCURACY = 3e-5  # over the largest value; the transforms are good to 1e-5


def box(size: Floats) -> Solid:
    """An axis-aligned box around the origin, 12 triangles."""
    v = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * size
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    t = np.array([(q[0], q[i], q[i + 1]) for q in quads for i in (1, 2)])
    return Solid(v, t, np.ones(8, bool))


def spectrum(solid: Solid, gradient: bool = False) -> Spectrum:
    q = samples(solid, 0.05 * BAND.shortest)
    return Spectrum.of(BAND, q.points, q.area_vectors, gradient=gradient)


def worst(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.abs(a - b).max() / np.abs(b).max())


SIZE = np.array([1.0, 1.3, 0.8])
SHIFT = np.array([0.3, -0.2, 0.1])


@pytest.fixture(scope="module")
def bent() -> Solid:
    """A solid without symmetry: a box, moved and sheared."""
    solid = box(SIZE)
    shear = np.array([[1.0, 0.2, 0.1], [0.0, 1.0, -0.3], [0.1, 0.0, 1.0]])
    return solid.moved(solid.vertices @ shear.T + SHIFT)


def test_the_band_holds_one_of_each_wave_and_its_negative() -> None:
    n = BAND.integers
    size = np.linalg.norm(n, axis=1)
    assert size.min() >= 2.0
    assert size.max() <= 6.0
    both = {tuple(row) for row in np.concatenate([n, -n]).tolist()}
    assert len(both) == 2 * len(n)
    reach = np.arange(-6, 7)
    every = np.stack(np.meshgrid(reach, reach, reach), axis=-1).reshape(-1, 3)
    wanted = (np.linalg.norm(every, axis=1) >= 2) & (np.linalg.norm(every, axis=1) <= 6)
    assert both == {tuple(row) for row in every[wanted].tolist()}


def test_a_box_is_a_product_of_sincs() -> None:
    k = BAND.waves
    expected = np.prod(SIZE * np.sinc(k * SIZE / (2.0 * np.pi)), axis=1)
    assert worst(spectrum(box(SIZE)).values, expected) < 1e-3


def test_finer_quadrature_converges_to_the_box() -> None:
    k = BAND.waves
    expected = np.prod(SIZE * np.sinc(k * SIZE / (2.0 * np.pi)), axis=1)
    q = samples(box(SIZE), 0.02)
    assert worst(Spectrum.of(BAND, q.points, q.area_vectors).values, expected) < ACCURACY


def test_it_equals_the_sum_written_out(bent: Solid) -> None:
    q = samples(bent, 0.2)
    k = BAND.waves
    wave = np.exp(-1j * k @ q.points.T)
    expected = 1j / np.sum(k * k, axis=1) * np.sum(k @ q.area_vectors.T * wave, axis=1)
    assert worst(Spectrum.of(BAND, q.points, q.area_vectors).values, expected) < ACCURACY


def test_translation_is_a_phase(bent: Solid) -> None:
    moved = spectrum(bent.moved(bent.vertices + SHIFT)).values
    assert worst(moved, spectrum(bent).values * np.exp(-1j * BAND.waves @ SHIFT)) < ACCURACY


def test_solids_add(bent: Solid) -> None:
    other = bent.moved(bent.vertices + 2.0)
    v = np.concatenate([bent.vertices, other.vertices])
    both = Solid(v, np.concatenate([bent.triangles, bent.triangles + len(bent.vertices)]), np.ones(len(v), bool))
    assert worst(spectrum(both).values, spectrum(bent).values + spectrum(other).values) < ACCURACY


def test_the_triangulation_does_not_matter(bent: Solid) -> None:
    v, t = bent.vertices, bent.triangles
    middle = 0.5 * (v[t] + v[np.roll(t, -1, axis=1)])  # of the edges ab, bc, ca
    corners = np.concatenate([v, middle.reshape(-1, 3)])
    ab, bc, ca = (len(v) + 3 * np.arange(len(t)) + i for i in range(3))
    a, b, c = t.T
    finer = np.concatenate([np.stack(x, axis=1) for x in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    other = Solid(corners, finer, np.ones(len(corners), bool))
    assert worst(spectrum(other).values, spectrum(bent).values) < 1e-3


def test_the_gradient_is_that_of_the_values(bent: Solid) -> None:
    """On a lattice with a slightly smaller box the waves are k (1 + h): the radial derivative, by differences."""
    q, h = samples(bent, 0.1), 1e-3
    high, low = (Spectrum.of(Band(2.0, 6.0, 6.0 / (1.0 + s)), q.points, q.area_vectors).values for s in (h, -h))
    gradient = Spectrum.of(BAND, q.points, q.area_vectors, gradient=True).gradient
    assert gradient is not None
    assert worst(np.sum(BAND.waves.T * gradient, axis=0), (high - low) / (2 * h)) < 0.02


@pytest.mark.parametrize("motion", range(7))
def test_moving_the_frame_changes_the_spectrum_as_its_derivative_says(bent: Solid, motion: int) -> None:
    from o3dmark.solid.frame import Frame

    h = 1e-2
    step = np.zeros(7)
    step[motion] = h
    still = Frame(np.zeros(3), 1.0, np.eye(3))
    high, low = (spectrum(still.shifted(s * step).solid(bent)).values for s in (1.0, -1.0))
    derivative = spectrum(bent, gradient=True).frame_derivative()[motion]
    assert worst(derivative, (high - low) / (2 * h)) < 0.02


@pytest.mark.parametrize("order", [(0, 1, 2), (1, 2, 0), (0, 2, 1)])
@pytest.mark.parametrize("signs", [(1, 1, 1), (1, -1, -1), (-1, 1, 1), (-1, -1, -1)])
def test_signed_permutations_need_no_transform(bent: Solid, order: tuple[int, ...], signs: tuple[int, ...]) -> None:
    P = np.diag(np.array(signs, float))[list(order)]
    q = samples(bent, 0.2)
    expected = Spectrum.of(BAND, q.points @ P.T, q.area_vectors @ P.T, gradient=True)
    found = Spectrum.of(BAND, q.points, q.area_vectors, gradient=True).turned(P)
    assert worst(found.values, expected.values) < ACCURACY
    assert found.gradient is not None
    assert expected.gradient is not None
    assert worst(found.gradient, expected.gradient) < ACCURACY


def test_functions_are_the_transpose_of_the_transform() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(-1.0, 1.0, (50, 3))
    c = rng.standard_normal((3, len(BAND.waves))) + 1j * rng.standard_normal((3, len(BAND.waves)))
    expected = (c @ np.exp(-1j * BAND.waves @ points.T)).real
    assert worst(BAND.functions(points, c), expected) < 1e-3
    strengths = rng.standard_normal((1, 50))
    inner = np.sum((c * BAND.transform(points, strengths)).real, axis=1)
    assert inner == pytest.approx(expected @ strengths[0], rel=1e-3)


def test_without_a_gradient_there_is_no_derivative(bent: Solid) -> None:
    with pytest.raises(ValueError, match="without its gradient"):
        spectrum(bent).frame_derivative()
