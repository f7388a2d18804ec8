"""The informed reader of shape-spectrum: what a fragment says, and that it says nothing where there is nothing."""

import itertools

import numpy as np
import pytest

from o3dmark.attacks import attack_all
from o3dmark.coding.detection import detect
from o3dmark.coding.keys import Key
from o3dmark.mesh.surface import Surface, TriangleMesh
from o3dmark.methods import Extraction
from o3dmark.methods.shape_spectrum.fragment import _correspondences, _CoverModel, _fitted, _Points, read_fragment
from o3dmark.methods.shape_spectrum.lattice import Lattice
from o3dmark.methods.shape_spectrum.method import ShapeSpectrum

METHOD = ShapeSpectrum(mrms=8e-4)
BITS = np.random.default_rng(5).integers(0, 2, 16)
CUT = "crop:share=0.5"


@pytest.fixture(scope="module")
def marked(spot: TriangleMesh, key: Key) -> TriangleMesh:
    return METHOD.embed(spot, BITS, key)


@pytest.fixture(scope="module")
def host(spot: TriangleMesh, key: Key) -> _CoverModel:
    steps = METHOD.steps(len(BITS))
    return _CoverModel(METHOD.cover(Surface.of(spot), key, len(BITS)), steps)


def read(mesh: TriangleMesh, cover: TriangleMesh, key: Key) -> Extraction:
    n = len(BITS)
    return read_fragment(Surface.of(mesh), METHOD.cover(Surface.of(cover), key, n), METHOD.steps(n), n)


# What a fragment says


def test_a_fragment_tells_all_bits(spot: TriangleMesh, marked: TriangleMesh, key: Key) -> None:
    extraction = read(attack_all(marked, [CUT, "noise:amplitude=0.002", "similarity"], rng=1), spot, key)
    assert np.array_equal(extraction.bits, BITS)
    assert extraction.hypotheses >= len(METHOD.steps(len(BITS)))


@pytest.fixture
def placed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fragments are taken to lie where they lie: finding that out has its own tests, and takes its time."""
    monkeypatch.setattr("o3dmark.mesh.fragments.poses", lambda *_: [np.eye(4)])


@pytest.mark.usefixtures("placed")
@pytest.mark.parametrize(
    "attacks", [["crop:share=0.8"], ["simplify:ratio=0.5", CUT], [CUT, "quantise:bits=10"], ["smooth", CUT]]
)
def test_it_does_not_take_much(spot: TriangleMesh, marked: TriangleMesh, key: Key, attacks: list[str]) -> None:
    assert np.array_equal(read(attack_all(marked, attacks, rng=2), spot, key).bits, BITS)


@pytest.mark.usefixtures("placed")
@pytest.mark.parametrize("other", range(1, 6))
def test_a_wrong_key_reads_nothing(spot: TriangleMesh, marked: TriangleMesh, other: int) -> None:
    extraction = read(attack_all(marked, [CUT], rng=1), spot, Key(bytes(range(other, other + 32))))
    assert detect(extraction.soft, BITS, hypotheses=extraction.hypotheses).p_value > 0.01


@pytest.mark.usefixtures("placed")
def test_an_unmarked_fragment_reads_nothing(spot: TriangleMesh, key: Key) -> None:
    extraction = read(attack_all(spot, [CUT], rng=1), spot, key)
    assert detect(extraction.soft, BITS, hypotheses=extraction.hypotheses).p_value > 0.01


def test_of_two_places_the_one_is_taken_where_the_mark_explains_more(
    spot: TriangleMesh, marked: TriangleMesh, key: Key, monkeypatch: pytest.MonkeyPatch
) -> None:
    wrong = np.eye(4)
    wrong[:3, 3] = 0.004
    monkeypatch.setattr("o3dmark.mesh.fragments.poses", lambda *_: [wrong @ wrong, np.eye(4)])
    extraction = read(attack_all(marked, [CUT], rng=1), spot, key)
    assert np.array_equal(extraction.bits, BITS)
    assert extraction.hypotheses == 4 * len(METHOD.steps(len(BITS)))


@pytest.mark.parametrize("somewhere", [[], [np.eye(4) + 9.0 * np.eye(4, k=3)]])
def test_a_mesh_that_lies_nowhere_gives_no_bits(
    spot: TriangleMesh, key: Key, monkeypatch: pytest.MonkeyPatch, somewhere: list[np.ndarray]
) -> None:
    """Whether no place is found or too little of the cover is there."""
    monkeypatch.setattr("o3dmark.mesh.fragments.poses", lambda *_: somewhere)
    extraction = read(TriangleMesh.create_torus(1.0, 0.4, 40, 20), spot, key)
    assert not extraction.soft.any()
    assert "nowhere" in extraction.view


# The model


def test_motions_change_the_projections_as_they_say(host: _CoverModel) -> None:
    """To first order, each by one: the derivative of the values, in the moved solid's own frame, is the identity."""
    change = np.random.default_rng(0).normal(size=len(host.cover.values))
    change *= 0.2 * host.step / np.abs(change).max()
    slope = host.cover.project(host.cover.moved(change)) - host.cover.project(host.cover.moved(-change))
    assert np.abs(slope / 2.0 - change).max() < 0.05 * np.abs(change).max()


def test_the_marked_mesh_lies_on_the_cover_once_that_is_moved_alike(host: _CoverModel) -> None:
    change = np.random.default_rng(1).normal(size=len(host.cover.values)) * 0.3 * host.step
    there = host.surface.moved(host.cover.moved(change))
    gaps = _correspondences(host, change, _Points.of(there), host.modes)
    assert np.abs(gaps.d).max() < 1e-12 * host.surface.diagonal
    assert len(gaps.d) > 0.99 * len(there.vertices)


def test_distances_answer_to_the_change_as_functions_say(host: _CoverModel) -> None:
    change = np.random.default_rng(2).normal(size=len(host.cover.values)) * 0.05 * host.step
    gaps = _correspondences(
        host, np.zeros_like(change), _Points.of(host.surface.moved(host.cover.moved(change))), host.modes
    )
    error = gaps.d - gaps.functions @ change
    assert np.sqrt(np.mean(error**2)) < 0.05 * np.sqrt(np.mean(gaps.d**2))


def test_a_half_seen_change_is_found(host: _CoverModel, spot: TriangleMesh) -> None:
    """Without noise, half of the surface tells the change of all projections."""
    change = np.random.default_rng(3).normal(size=len(host.cover.values)) * 0.2 * host.step
    there = host.surface.moved(host.cover.moved(change))
    points = _Points.of(there)
    half = _Points(*(column[points.positions[:, 2] > 0.0] for column in points))
    fit = _fitted(host, half, np.eye(4), host.modes)
    assert fit is not None
    assert np.abs(fit.change - change).max() < 0.01 * host.step


# The closest-vector search


def quadratic(seed: int, k: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(k, k))
    return root @ root.T + 0.1 * np.eye(k), 3.0 * rng.normal(size=k)


@pytest.mark.parametrize("seed", range(5))
def test_the_best_candidate_is_the_closest_vector(seed: int) -> None:
    M, t = quadratic(seed, 4)
    around = np.rint(t) + np.array(list(itertools.product(range(-5, 6), repeat=4)))
    cost = np.einsum("ci,ij,cj->c", around - t, M, around - t)
    found = Lattice(M).closest(t)
    np.testing.assert_array_equal(found.z[0], around[cost.argmin()])
    np.testing.assert_allclose(found.cost[0], cost.min())


def test_the_cost_is_the_form_and_ascends() -> None:
    M, t = quadratic(7, 20)
    found = Lattice(M).closest(t)
    np.testing.assert_allclose(found.cost, np.einsum("ci,ij,cj->c", found.z - t, M, found.z - t))
    assert (np.diff(found.cost) >= 0.0).all()
    assert len(np.unique(found.z, axis=0)) == len(found.z)


def test_moving_the_target_by_integers_moves_the_answer() -> None:
    M, t = quadratic(8, 12)
    shift = np.arange(12) - 5
    np.testing.assert_array_equal(Lattice(M).closest(t + shift).z[0], Lattice(M).closest(t).z[0] + shift)
