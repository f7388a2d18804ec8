"""A solid before it was stretched, sheared, bent or twisted: the surrogate is the spectrum, and the reader finds it."""

import numpy as np
import pytest

from o3dmark.attacks import attack_all
from o3dmark.coding.keys import Key
from o3dmark.coding.scs import coherence
from o3dmark.mesh.surface import Surface, TriangleMesh
from o3dmark.methods.shape_spectrum import deformation
from o3dmark.methods.shape_spectrum.deformation import Surrogate, Values, most_coherent
from o3dmark.methods.shape_spectrum.projections import Projections
from o3dmark.profiles import PROFILES
from o3dmark.solid.frame import FRAME_2026, rules
from o3dmark.solid.solid import Solid
from o3dmark.solid.spectrum import Spectrum

MARK = PROFILES["robust-2026"]
BAND = MARK.method.band


@pytest.fixture(scope="module")
def solid(spot: TriangleMesh) -> Solid:
    return Solid.of(Surface.of(spot))


@pytest.fixture(scope="module")
def surrogate(solid: Solid) -> Surrogate:
    rule = rules(solid, FRAME_2026)[0]
    return Surrogate.of(BAND, solid, rule, rule.frames(solid)[0])


@pytest.fixture(scope="module")
def projections(key: Key) -> Projections:
    return Projections.of(key, BAND, 64)


def measured(solid: Solid, d: np.ndarray, projections: Projections) -> np.ndarray:
    """The values of a solid that is really deformed and put into its frame again."""
    rule = rules(solid, FRAME_2026)[0]
    frame = rule.frames(solid)[0]
    deformed = deformation._deformed(solid, frame, d)
    return projections(Spectrum.of_solid(BAND, rule.near(deformed, frame).solid(deformed)).values)


@pytest.mark.parametrize(
    ("kind", "size", "error"), [("strain", 0.01, 0.02), ("strain", 0.03, 0.06), ("bend", 0.01, 0.1)]
)
def test_the_surrogate_is_the_spectrum_of_the_deformed_solid(
    kind: str, size: float, error: float, solid: Solid, surrogate: Surrogate, projections: Projections
) -> None:
    """But for a small share of what the deformation does to the values."""
    rng = np.random.default_rng(1)
    d = np.zeros(23)
    part = slice(0, 5) if kind == "strain" else slice(5, 23)
    d[part] = rng.standard_normal(d[part].shape)
    d *= size / np.linalg.norm(d)
    values = surrogate.measured(projections)
    whole = np.linalg.norm(values.at(d[None])[0] - values.at(np.zeros((1, 23)))[0])
    assert np.linalg.norm(values.at(d[None])[0] - measured(solid, d, projections)) < error * whole


def test_the_slope_is_that_of_the_values(surrogate: Surrogate, projections: Projections) -> None:
    values, h = surrogate.measured(projections), 1e-6
    d = 0.01 * np.random.default_rng(2).standard_normal(23)
    slope = values.slope(d[None])[0]
    for number in range(23):
        step = h * np.eye(23)[number]
        ahead, back = values.at(np.array([d + step, d - step]))
        np.testing.assert_allclose(slope[:, number], (ahead - back) / (2.0 * h), rtol=1e-5, atol=1e-7)


def test_the_lattice_covers_the_ball_of_strains() -> None:
    """By the metric no strain is further from the nearest start than the covering radius."""
    rng = np.random.default_rng(3)
    J = rng.standard_normal((64, 5)) * 30.0
    G, radius = J.T @ J / 64.0, 0.009
    e = deformation._strains(G, 0.0, radius)
    some = rng.standard_normal((300, 5))
    some *= 0.8 * radius * rng.random((300, 1)) ** 0.2 / np.linalg.norm(some, axis=1, keepdims=True)
    away = e[None] - some[:, None]
    distance = np.sqrt(np.einsum("nhi,ij,nhj->nh", away, G, away).min(axis=1))
    assert distance.max() <= deformation._COVERED * 1.0001
    assert np.linalg.norm(e, axis=1).max() <= radius
    assert len(np.unique(e.round(12), axis=0)) == len(e)


def test_bends_and_twists_are_what_they_are_called() -> None:
    """To first order a twist keeps all volumes, and so has no divergence."""
    some = deformation._bends()
    assert some.shape == (deformation._BENDS, 23)
    assert np.isfinite(some).all()
    twists = some[::2, 5:].reshape(-1, 6, 3)
    i, j = np.triu_indices(3)
    divergence = np.zeros((len(twists), 3))  # of q(x), linear in x
    for pair, (a, b) in enumerate(zip(i, j, strict=True)):
        divergence[:, b] += twists[:, pair, a]
        divergence[:, a] += twists[:, pair, b]
    assert np.abs(divergence).max() < 1e-12
    assert deformation._bends() is some


def test_the_most_coherent_start_is_the_one_that_was_hidden(key: Key) -> None:
    rng = np.random.default_rng(4)
    coefficients = rng.standard_normal((39, 64))
    values, dither = Values(coefficients), rng.random(64)
    starts, steps = 0.1 * rng.standard_normal((5000, 23)), np.array([0.3, 0.25, 0.2])
    codewords = steps[1] * (rng.integers(0, 9, 64) / 2.0 + dither)
    coefficients[0] += codewords - values.at(starts[4321:4322])[0]
    found = most_coherent(values, starts, steps, dither, 64, 10)
    assert np.array_equal(found.d[0], starts[4321])
    assert found.step[0] == 1
    assert len(found.d) == 10


@pytest.mark.parametrize("n_bits", [64, 16])
def test_agreement_is_the_coherence_that_the_decoder_knows(n_bits: int) -> None:
    rng = np.random.default_rng(5)
    values, dither = rng.standard_normal((20, 64)).astype(np.float32), rng.random(64)
    found = deformation._agreement(values, np.array([1.0, 2.0]), dither, n_bits)
    for s, rate in enumerate((1.0, 2.0)):
        vectors = np.exp(2j * np.pi * (values * rate - dither)).reshape(20, -1, n_bits).sum(axis=1)
        np.testing.assert_allclose(found[:, s], (vectors**2).real.sum(axis=1), atol=0.4)
    assert coherence(np.zeros((1, 64)))[0] == 1.0


@pytest.fixture(scope="module")
def marked(spot: TriangleMesh, key: Key) -> TriangleMesh:
    return MARK.embed(spot, "mine", key)


@pytest.mark.parametrize(
    "edit",
    [
        "strain:amount=-0.02",
        "bend:angle=2,axis=random,band=1",
        "twist:angle=3,axis=random,band=1",
    ],
)
def test_a_deformed_mesh_is_read(edit: str, marked: TriangleMesh, key: Key) -> None:
    mesh = attack_all(marked, ["similarity", edit], 2)
    reading = MARK.extract(mesh, key)
    assert reading.message == "mine"
    assert MARK.test(reading.extraction, key, "mine").present
    assert "deformation" in reading.extraction.note or reading.extraction.fitted


def test_a_wrong_key_reads_nothing_in_a_deformed_mesh(marked: TriangleMesh) -> None:
    assert not MARK.extract(attack_all(marked, ["strain:amount=0.02"], 2), Key(bytes(32))).found
