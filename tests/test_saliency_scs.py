"""The paper's method: its order, its three synchronisations, and the theorems that the blind one rests on."""

from typing import Any

import numpy as np
import pytest

from fixtures.shapes import bits_of
from o3dmark.attacks import attack_all
from o3dmark.coding.keys import Key
from o3dmark.errors import MeshError, SpecError
from o3dmark.mesh.surface import Surface, mesh_arrays
from o3dmark.methods import METHODS
from o3dmark.methods.saliency_scs import FORMATS, Guess, SaliencySCS, Spherical
from o3dmark.metrics.distance import surface_distance
from o3dmark.registry import spec_of

BITS = bits_of(0, 256)


def test_spherical_coordinates_give_the_vertices_back(spot: Any) -> None:
    surface = Surface.of(spot)
    spherical = Spherical.of(surface)
    np.testing.assert_allclose(spherical.vertices(spherical.norms), surface.vertices, atol=1e-12)
    assert np.isclose(spherical.norms.mean(), 1.0)


def test_vertices_move_along_their_radii_by_half_gamma_step_at_most(carrier: Any, key: Key) -> None:
    method = SaliencySCS(step=0.03, gamma=0.6)
    before = Spherical.of(Surface.of(carrier))
    after = mesh_arrays(method.embed(carrier, BITS[:32], key))[0] - before.centre
    norms = np.linalg.norm(after, axis=1) / before.unit
    np.testing.assert_allclose(after / norms[:, None] / before.unit, before.directions, atol=1e-9)
    assert np.abs(norms - before.norms).max() <= 0.6 * 0.03 / 2 + 1e-12


def test_only_the_salient_set_moves(carrier: Any, key: Key) -> None:
    method = SaliencySCS(share=0.4)
    surface = Surface.of(carrier)
    salient = method.salient_set(method.saliency(surface))
    assert np.isclose(salient.mean(), 0.4, atol=1e-3)
    assert method.saliency(surface)[salient].min() >= method.saliency(surface)[~salient].max()
    moved = (mesh_arrays(method.embed(carrier, BITS[:16], key))[0] != mesh_arrays(carrier)[0]).any(axis=1)
    assert not moved[~salient].any()
    assert moved[salient].mean() > 0.99


@pytest.mark.parametrize("target", [2e-4, 6e-4])
def test_the_step_meets_the_distortion_asked_for(carrier: Any, key: Key, target: float) -> None:
    marked = SaliencySCS(mrms=target).embed(carrier, BITS[:64], key)
    assert 0.90 * target < surface_distance(carrier, marked).mrms <= target


def test_moving_along_radii_leaves_the_order_of_the_sphere(carrier: Any, key: Key) -> None:
    """What makes `sphere` blind: the mesh projected on the unit sphere does not know what the norms are."""
    method = SaliencySCS()
    surface = Surface.of(carrier)
    spherical = Spherical.of(surface)
    salient = method.salient_set(method.saliency(surface))
    shifted = surface.moved(spherical.vertices(spherical.norms * np.linspace(0.9, 1.1, len(surface.vertices))))
    again = method._order(Guess("", shifted, 0), salient, 16, key)
    first = method._order(Guess("", surface, 0), salient, 16, key)
    same = np.mean(first.bit == again.bit)  # not exactly: the mean of the vertices moves a little
    assert same > 0.8


def test_rank_cannot_be_read_blindly_and_informed_can(carrier: Any, key: Key) -> None:
    rank, informed = SaliencySCS(sync="rank"), SaliencySCS(sync="informed")
    marked = rank.embed(carrier, BITS[:64], key)
    np.testing.assert_array_equal(mesh_arrays(informed.embed(carrier, BITS[:64], key))[0], mesh_arrays(marked)[0])
    blind = rank.extract(marked, 64, key).bits == BITS[:64]
    assert 16 <= np.count_nonzero(blind) <= 48  # chance: 32, standard deviation 4
    np.testing.assert_array_equal(informed.extract(marked, 64, key, reference=carrier).bits, BITS[:64])


@pytest.mark.parametrize("attacks", [["reorder"], ["similarity"], ["similarity", "reorder", "noise:amplitude=0.001"]])
def test_informed_matches_vertices_through_pose_and_order(carrier: Any, key: Key, attacks: list[str]) -> None:
    method = SaliencySCS(sync="informed")
    attacked = attack_all(method.embed(carrier, BITS[:64], key), attacks, 5)
    np.testing.assert_array_equal(method.extract(attacked, 64, key, reference=carrier).bits, BITS[:64])


@pytest.mark.parametrize(
    "attacks",
    [
        ["reorder"],
        ["similarity"],
        ["noise:amplitude=0.001"],
        ["quantise:bits=10"],
        ["smooth:iterations=30"],
        ["similarity", "reorder", "noise:amplitude=0.001"],
    ],
)
def test_sphere_reads_64_bits_blindly(carrier: Any, key: Key, attacks: list[str]) -> None:
    method = SaliencySCS()
    attacked = attack_all(method.embed(carrier, BITS[:64], key), attacks, 5)
    np.testing.assert_array_equal(method.extract(attacked, 64, key).bits, BITS[:64])


@pytest.mark.parametrize(
    "attack",
    ["noise:amplitude=0.003", "quantise:bits=9", "subdivide:scheme=midpoint", "smooth:iterations=10"],
)
def test_sphere_reads_16_bits_blindly_after_the_benchmarks_attacks(carrier: Any, key: Key, attack: str) -> None:
    method = SaliencySCS()
    attacked = attack_all(method.embed(carrier, BITS[:16], key), [attack], 5)
    extraction = method.extract(attacked, 16, key)
    np.testing.assert_array_equal(extraction.bits, BITS[:16])
    assert extraction.hypotheses % len(FORMATS["2026"].steps) == 0


def test_a_step_handed_over_is_one_hypothesis(carrier: Any, key: Key) -> None:
    method = SaliencySCS(step=0.03)
    extraction = method.extract(method.embed(carrier, BITS[:64], key), 64, key)
    np.testing.assert_array_equal(extraction.bits, BITS[:64])
    assert extraction.hypotheses == 1


def test_without_saliency_every_vertex_carries(carrier: Any, key: Key) -> None:
    method = SaliencySCS(share=1.0)
    marked = method.embed(carrier, BITS[:64], key)
    assert (mesh_arrays(marked)[0] != mesh_arrays(carrier)[0]).any(axis=1).mean() > 0.99
    np.testing.assert_array_equal(method.extract(marked, 64, key).bits, BITS[:64])


def test_the_recomputed_step_is_proportional_to_the_normals(carrier: Any, key: Key) -> None:
    surface = Surface.of(carrier)
    salient = np.ones(len(surface.vertices), bool)
    one, two = (SaliencySCS(sync="rank", lam=lam)._steps(surface, salient)[0] for lam in (0.1, 0.2))
    assert np.isclose(one, 2 * two)
    double = surface.moved(2 * surface.vertices)
    assert np.isclose(SaliencySCS(sync="rank", lam=0.1)._steps(double, salient)[0], one)  # a share of the mean norm


def test_readings_of_the_salient_share() -> None:
    """70 % of the vertices with the highest saliency, or those with 30 % of the highest saliency and more."""
    saliency = np.array([0.0, 9.0, 2.9, 3.1, 10.0, 1.0, 2.0, 0.5, 1.5, 0.1])
    by_count, by_range = SaliencySCS().salient_set(saliency), SaliencySCS(salient="range").salient_set(saliency)
    assert np.flatnonzero(by_count).tolist() == [1, 2, 3, 4, 5, 6, 8]
    assert np.flatnonzero(by_range).tolist() == [1, 3, 4]
    for salient in ("count", "range"):
        assert SaliencySCS(share=1.0, salient=salient).salient_set(saliency).all()  # type: ignore[arg-type]


@pytest.mark.parametrize("wrong", ["gamma=0", "gamma=1.5", "share=0", "step=-1", "mrms=0", "sync=disk", "passes=-1"])
def test_impossible_options_are_refused(wrong: str) -> None:
    with pytest.raises(SpecError):
        METHODS.make(f"saliency-scs:{wrong}")


def test_informed_needs_its_reference(carrier: Any, key: Key) -> None:
    with pytest.raises(MeshError, match="needs the cover mesh"):
        SaliencySCS(sync="informed").extract(carrier, 16, key)
    assert spec_of(SaliencySCS(sync="informed")) == "saliency-scs:sync=informed"
