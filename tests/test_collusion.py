"""Mixtures of copies: who took part is named, who did not is not, and p-values are what they say."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from o3dmark.attacks import attack_all
from o3dmark.coding.collusion import Matches, Mixture, Seen, _log10_tail
from o3dmark.coding.keys import Key
from o3dmark.copies import Ledger, Tracer, issue
from o3dmark.copies.words import sentence
from o3dmark.files import open_asset, read_mesh, write_mesh
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays, triangle_mesh
from o3dmark.profiles import PROFILES

NAMES = [f"b{number}" for number in range(12)]
MIXES: dict[str, Callable[[np.ndarray, np.random.Generator], np.ndarray]] = {
    "mean": lambda copies, _: copies.mean(axis=0),
    "median": lambda copies, _: np.median(copies, axis=0),
    "least": lambda copies, _: copies.min(axis=0),
    "greatest": lambda copies, _: copies.max(axis=0),
    "any": lambda copies, rng: copies[rng.integers(len(copies), size=copies.shape[1]), np.arange(copies.shape[1])],
    "halves": lambda copies, _: np.where(copies[0][:, :1] > np.median(copies[0][:, 0]), copies[0], copies[1]),
    "a + b - c": lambda copies, _: copies[0] + copies[1] - copies[2],
}


# ---- vectors ----


def test_the_tail_is_that_of_random_directions() -> None:
    rng = np.random.default_rng(0)
    cosines = rng.standard_normal((200_000, 12))
    cosines = cosines[:, 0] / np.linalg.norm(cosines, axis=1)
    p = np.array([10 ** _log10_tail(float(cosine), False, 12) for cosine in cosines[:20_000]])
    assert stats.kstest(p[p < 0.5], "uniform", (0, 0.5)).pvalue > 0.01
    assert np.mean(cosines > 0.8) == pytest.approx(10 ** _log10_tail(0.8, False, 12), rel=0.15)
    assert 10 ** _log10_tail(-0.8, True, 12) == pytest.approx(2 * 10 ** _log10_tail(0.8, False, 12))
    assert _log10_tail(-0.8, False, 12) == pytest.approx(np.log10(0.5))
    assert _log10_tail(1.0, False, 64) == -np.inf


@pytest.mark.parametrize("size", [2, 3, 5, 8])
@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_of_fifty_vectors_those_of_a_mean_are_named_and_no_other(size: int, noise: float) -> None:
    rng = np.random.default_rng(size)
    for _ in range(5):
        vectors = rng.standard_normal((50, 64))
        some = rng.permutation(50)[:size]
        mixed = vectors[some].mean(axis=0) + noise * rng.standard_normal(64)
        log10_p = Mixture((Seen(mixed, vectors),)).log10_p(50)
        assert log10_p[some].min() < -6
        assert np.delete(log10_p, some).min() > -4


def test_innocents_are_named_as_rarely_as_said() -> None:
    """Mixtures of copies that are not in the ledger, or of some that are, 200 times beside 30 who took no part."""
    rng = np.random.default_rng(7)
    least = []
    for trial in range(200):
        vectors = rng.standard_normal((30, 64))
        strangers = rng.standard_normal((rng.integers(1, 6), 64))
        taken = vectors[: trial % 3]  # these did take part
        mixed = np.concatenate([strangers, taken]).mean(axis=0)
        least.append(Mixture((Seen(mixed, vectors),)).log10_p(30)[trial % 3 :].min())
    counts = [int(np.count_nonzero(np.array(least) <= level)) for level in (-1, -2, -3)]
    assert np.all(np.array(counts) <= [37, 8, 3])  # four standard deviations above 20, 2 and 0.2


def test_the_order_of_candidates_makes_no_difference() -> None:
    rng = np.random.default_rng(1)
    vectors = rng.standard_normal((20, 40))
    mixed, order = vectors[:3].mean(axis=0), rng.permutation(20)
    one = Mixture((Seen(mixed, vectors),)).log10_p(20)
    np.testing.assert_allclose(Mixture((Seen(mixed, vectors[order]),)).log10_p(20), one[order], rtol=1e-6, atol=1e-9)


def test_counts_of_matches_are_bounded_by_those_of_chance() -> None:
    rng = np.random.default_rng(2)
    chance = rng.poisson(20.0, 2000).astype(float)
    log10_p = Mixture((), Matches(np.array([15.0, 30.0, 800.0]), chance)).log10_p(3)
    assert log10_p[:2].tolist() == [0.0, 0.0]
    assert log10_p[2] < -9
    innocents = rng.poisson(20.0, 5000).astype(float)
    assert Mixture((), Matches(innocents, chance)).log10_p(5000).min() == 0.0


def test_of_nothing_nobody_is_named() -> None:
    assert Mixture().log10_p(3).tolist() == [0.0, 0.0, 0.0]
    assert Mixture((Seen(np.zeros(8), np.ones((3, 8))),)).log10_p(3).tolist() == [0.0, 0.0, 0.0]


# ---- meshes ----


@pytest.fixture(scope="module")
def shop(spot: TriangleMesh, key: Key, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("shop")
    write_mesh(folder / "spot.ply", spot)
    with Ledger(folder / "copies.db", writable=True) as ledger:
        list(issue(folder / "spot.ply", NAMES, key, ledger, folder / "out", profile="robust-2026"))
    return folder


@pytest.fixture(scope="module")
def tracer(shop: Path, key: Key) -> Tracer:
    with Ledger(shop / "copies.db") as ledger:
        return Tracer.of(ledger.copies(), [key], reference=open_asset(shop / "spot.ply"))


def mixed(shop: Path, how: str, names: list[str], seed: int = 0) -> TriangleMesh:
    meshes = [mesh_arrays(read_mesh(shop / "out" / "spot.ply" / name / "spot.ply")) for name in names]
    vertices = MIXES[how](np.array([vertices for vertices, _ in meshes]), np.random.default_rng(seed))
    return triangle_mesh(vertices, meshes[0][1])


def unmixed(tracer: Tracer, mesh: TriangleMesh) -> set[str]:
    """The names of those who took part, as the method says of the mesh beside the cover."""
    (batch,), (cover,), method = tracer.batches, tracer._covers, tracer.batches[0].watermark.method
    if id(cover) not in batch.remade:
        batch.remade[id(cover)] = method.remade(cover, batch.words, batch.key)
    log10_p = method.mixture(mesh, batch.remade[id(cover)]).log10_p(len(batch.copies))
    return {copy.name for copy, p in zip(batch.copies, log10_p, strict=True) if p <= -6}


@pytest.mark.parametrize("how", MIXES)
def test_who_mixed_is_named(how: str, shop: Path, tracer: Tracer) -> None:
    colluders = NAMES[3:6]
    found = unmixed(tracer, mixed(shop, how, colluders))
    assert found
    assert found <= set(colluders)


@pytest.mark.parametrize("attack", ["noise:amplitude=0.0005", "quantise:bits=14", "reorder", "similarity"])
def test_who_mixed_is_named_after_what_the_world_did(attack: str, shop: Path, tracer: Tracer) -> None:
    mesh = attack_all(mixed(shop, "mean", NAMES[1:4]), [attack], 1)
    found = unmixed(tracer, mesh)
    assert found
    assert found <= set(NAMES[1:4])


def test_a_trace_says_who_mixed(shop: Path, tracer: Tracer) -> None:
    found = tracer.trace(mixed(shop, "mean", ["b2", "b9"]))
    assert found.found
    assert {named.copy.name for named in found.named} == {"b2", "b9"}
    assert found.runner_up is not None
    assert sentence(found).startswith("Found: a mixture of copies, to which b")


def test_an_unmarked_mesh_and_a_mixture_of_strangers_are_nobody_s(tracer: Tracer, spot: TriangleMesh) -> None:
    assert unmixed(tracer, spot) == set()
    mark = PROFILES["robust-2026"]
    strangers = [mesh_arrays(mark.embed(spot, name, Key(bytes(32))))[0] for name in ("one", "two")]
    assert unmixed(tracer, triangle_mesh(np.mean(strangers, axis=0), mesh_arrays(spot)[1])) == set()


def test_where_the_vertices_are_lost_nothing_is_said(shop: Path, tracer: Tracer) -> None:
    mesh = attack_all(mixed(shop, "mean", ["b2", "b9"]), ["simplify:ratio=0.5"], 1)
    assert unmixed(tracer, mesh) == set()
