"""shape-spectrum: what the reader meets is what was embedded, whatever the mesh went through."""

import hashlib
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from o3dmark.attacks import attack_all
from o3dmark.coding.keys import Key
from o3dmark.coding.scs import ScalarCosta, coherence
from o3dmark.errors import CapacityError, MeshError, SpecError
from o3dmark.files import read_mesh
from o3dmark.mesh import geometry
from o3dmark.mesh.saliency import Saliency
from o3dmark.mesh.surface import Surface, TriangleMesh, mesh_arrays, point_cloud, triangle_mesh
from o3dmark.methods import METHODS, Extraction
from o3dmark.methods.shape_spectrum.codewords import Comb, plans
from o3dmark.methods.shape_spectrum.decoder import Decoder
from o3dmark.methods.shape_spectrum.fit import fit, log10_p
from o3dmark.methods.shape_spectrum.lattice import Lattice
from o3dmark.methods.shape_spectrum.method import ShapeSpectrum
from o3dmark.methods.shape_spectrum.projections import Projections
from o3dmark.methods.shape_spectrum.search import Hypotheses
from o3dmark.metrics import METRICS
from o3dmark.solid.frame import FRAME_2026
from o3dmark.solid.spectrum import Band

METHOD = ShapeSpectrum(mrms=8e-4)
BITS = np.random.default_rng(5).integers(0, 2, 32)


@pytest.fixture(scope="module")
def marked(spot: TriangleMesh, key: Key) -> TriangleMesh:
    return METHOD.embed(spot, BITS, key)


def read(mesh: object, key: Key, method: ShapeSpectrum = METHOD) -> Extraction:
    return method.extract(mesh, len(BITS), key)


def errors(mesh: object, key: Key) -> int:
    return int(np.count_nonzero(read(mesh, key).bits != BITS))


# What embedding promises


def test_the_distortion_is_within_what_was_asked_for(spot: TriangleMesh, marked: TriangleMesh) -> None:
    cover, after = Surface.of(spot), Surface.of(marked)
    motion = (after.vertices - cover.vertices)[cover.triangles]
    size = geometry.normal_rms(geometry.area_vectors(cover.vertices, cover.triangles), motion) / cover.diagonal
    assert 0.7 * METHOD.mrms < size <= 1.01 * METHOD.mrms


@pytest.mark.parametrize("method", [replace(METHOD, jnd=0.3), replace(METHOD, mrms=3e-3)], ids=["below", "cap raised"])
def test_no_more_is_seen_than_may_be(method: ShapeSpectrum, spot: TriangleMesh, key: Key) -> None:
    """Where the eye holds it back the mark stays below both limits, and is read all the same."""
    marked = method.embed(spot, BITS, key)
    seen, size = (METRICS.make(name)(spot, marked) for name in ("jnd", "mrms"))
    assert 0.7 * method.jnd < seen <= 1.001 * method.jnd
    assert size < 0.95 * method.mrms
    assert np.array_equal(read(marked, key, method).bits, BITS)


def test_where_the_cap_holds_it_back_the_eye_changes_nothing(
    spot: TriangleMesh, marked: TriangleMesh, key: Key
) -> None:
    assert METRICS.make("jnd")(spot, marked) < 0.8
    anything = replace(METHOD, jnd=None).embed(spot, BITS, key)
    assert np.array_equal(np.asarray(anything.vertices), np.asarray(marked.vertices))


def test_a_mark_that_cannot_be_hidden_is_refused_with_what_helps(spot: TriangleMesh, key: Key) -> None:
    with pytest.raises(MeshError, match=r"0\.01 just noticeable differences .*; a smaller mrms"):
        replace(METHOD, jnd=0.01).embed(spot, BITS, key)


def test_the_limits_are_named() -> None:
    assert METHOD.limits == {"mrms": 8e-4, "jnd": 1.0}
    assert replace(METHOD, jnd=None).limits == {"mrms": 8e-4}


def test_the_cover_is_not_touched_and_the_triangles_stay(spot: TriangleMesh, key: Key) -> None:
    before = mesh_arrays(spot)
    after = mesh_arrays(METHOD.embed(spot, BITS, key))
    assert all(np.array_equal(a, b) for a, b in zip(before, mesh_arrays(spot), strict=True))
    assert np.array_equal(before[1], after[1])


def test_every_value_lands_within_the_slack(marked: TriangleMesh, key: Key) -> None:
    strict = 2.0 * np.pi * (METHOD.slack + 0.012)
    soft = read(marked, key).soft
    assert np.all((soft > 0) == BITS)
    assert np.abs(soft).min() > np.cos(strict)


def test_embedding_is_repeatable(spot: TriangleMesh, marked: TriangleMesh, key: Key) -> None:
    again = METHOD.embed(spot, BITS, key)
    assert np.array_equal(np.asarray(again.vertices), np.asarray(marked.vertices))


# What reading promises


@pytest.mark.parametrize(
    "attack",
    [
        "reorder",
        "similarity:smallest=0.01,largest=100",
        "noise:amplitude=0.003",
        "quantise:bits=9",
        "smooth:iterations=30",
        "taubin:iterations=10",
        "subdivide:scheme=loop",
        "simplify:ratio=0.8",
        "remesh:edge=0.02",
    ],
)
def test_it_survives(marked: TriangleMesh, key: Key, attack: str) -> None:
    assert errors(attack_all(marked, [attack], rng=1), key) == 0


def test_a_mirror_image_is_read_and_said_to_be_one(marked: TriangleMesh, key: Key) -> None:
    reading = read(attack_all(marked, ["mirror"]), key)
    assert np.array_equal(reading.bits, BITS)
    assert reading.view == "as received, mirrored"


def test_the_winding_does_not_matter(marked: TriangleMesh, key: Key) -> None:
    vertices, triangles = mesh_arrays(marked)
    triangles[::3] = triangles[::3, ::-1]
    assert errors(triangle_mesh(vertices, triangles), key) == 0


def test_the_step_of_another_strength_is_found(spot: TriangleMesh, key: Key) -> None:
    """The reader keeps its own options: the ladder is wide enough for half the distortion."""
    weaker = ShapeSpectrum(mrms=5e-4).embed(spot, BITS, key)
    assert errors(weaker, key) == 0


def test_few_bits_are_carried_several_times(spot: TriangleMesh, key: Key) -> None:
    bits = np.array([1, 0, 1, 1, 0, 0, 1, 0])
    marked = attack_all(METHOD.embed(spot, bits, key), ["noise:amplitude=0.005"], rng=1)
    assert np.array_equal(METHOD.extract(marked, 8, key).bits, bits)


def test_a_point_cloud_is_read(marked: TriangleMesh, key: Key) -> None:
    cloud = _sampled(marked, 20_000)
    assert errors(cloud, key) == 0


def _sampled(mesh: TriangleMesh, count: int) -> object:
    surface = Surface.of(mesh)
    rng = np.random.default_rng(0)
    corners = surface.vertices[surface.triangles]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1)
    chosen = rng.choice(len(area), count, p=area / area.sum())
    weights = rng.dirichlet(np.ones(3), count)
    return point_cloud(np.einsum("qc,qcd->qd", weights, corners[chosen]), (cross / area[:, None])[chosen])


# What it refuses


def test_a_wrong_key_and_an_unmarked_mesh_are_at_chance(spot: TriangleMesh, marked: TriangleMesh, key: Key) -> None:
    quick = ShapeSpectrum(mrms=8e-4, search=False)
    readings = [read(marked, Key(bytes([i + 50] * 32)), quick) for i in range(8)]
    readings += [read(spot, Key(bytes([i + 50] * 32)), quick) for i in range(8)]
    wrong = [np.count_nonzero(reading.bits != BITS) for reading in readings]
    assert 14 < np.mean(wrong) < 18
    assert min(wrong) > 2


def test_more_tries_are_charged(marked: TriangleMesh, key: Key) -> None:
    plain = read(marked, key)
    fitted = read(attack_all(marked, ["smooth:iterations=10"]), key)
    assert plain.readings is not None
    assert fitted.readings is not None
    assert len(plain.readings) == len(METHOD.steps(32))
    for reading in (plain, fitted):  # a fifth of the chance of a mistake is kept for deformations, not looked for here
        assert reading.hypotheses == math.ceil(len(reading.readings) / 0.8)
    assert fitted.hypotheses > 10 * plain.hypotheses


def test_too_many_bits_are_refused_with_the_number_that_fits(spot: TriangleMesh, key: Key) -> None:
    with pytest.raises(CapacityError) as caught:
        METHOD.embed(spot, np.zeros(METHOD.capacity(spot) + 1, int), key)
    assert caught.value.fits == METHOD.capacity(spot) == 128


def test_half_a_mesh_is_read_with_the_cover_as_reference(spot: TriangleMesh, marked: TriangleMesh, key: Key) -> None:
    half = attack_all(marked, ["crop:share=0.5", "similarity"], 1)
    assert np.array_equal(METHOD.extract(half, 32, key, reference=spot).bits, BITS)
    assert not np.array_equal(METHOD.extract(half, 32, key).bits, BITS)


def test_a_solid_without_a_frame_is_refused_by_the_writer_only(shared: Callable[[str], Path], key: Key) -> None:
    ball = read_mesh(shared("meshes/extra/sphere_16070.ply"))
    with pytest.raises(MeshError, match="symmetric"):
        METHOD.embed(ball, BITS, key)
    assert np.abs(read(ball, key).soft).max() < 1e-9


@pytest.mark.parametrize("spec", ["mrms=0", "lowest=12", "slack=0.3", "highest=100", "box=-1", "jnd=0"])
def test_options_are_checked(spec: str) -> None:
    with pytest.raises(SpecError):
        METHODS.make(f"shape-spectrum:{spec}")


# Its parts


def test_projections_deal_every_mode_once(key: Key) -> None:
    band = Band(2.0, 4.0, 6.0)
    projections = Projections.of(key, band, 7)
    sizes = np.bincount(projections.owner)
    assert sizes.sum() == 2 * len(band.integers)
    assert np.ptp(sizes) <= 1
    points = np.random.default_rng(0).uniform(-3.0, 3.0, (4000, 3))
    assert np.mean(projections.functions(points) ** 2, axis=1) == pytest.approx(np.ones(7), rel=0.15)


def test_projections_of_point_masses_are_their_functions(key: Key) -> None:
    """p_j of the transform of unit strengths is the sum of s_j over the points."""
    projections = Projections.of(key, Band(2.0, 4.0, 6.0), 7)
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (9, 3))
    spectrum = projections.band.transform(points, np.ones((1, 9)))[0]
    assert projections(spectrum) == pytest.approx(projections.functions(points).sum(axis=1), abs=1e-2)


def test_plans_lead_to_codewords_keep_within_their_limit_and_come_widest_margin_first() -> None:
    rng = np.random.default_rng(1)
    values, dither, bits = rng.standard_normal(24), rng.random(24), rng.integers(0, 2, 24)
    root = rng.standard_normal((24, 30))
    cost, steps = root @ root.T, np.geomspace(0.4, 0.1, 9)
    comb = Comb(values, bits, dither, cost, Lattice(cost))
    limit = 0.98 * next(plans(comb, steps[:1], 0.0, np.inf)).size
    found = list(plans(comb, steps, 0.04, limit))
    assert [plan.margin for plan in found] == sorted((plan.margin for plan in found), reverse=True)
    assert any(plan.margin < 0.249 * plan.step for plan in found)  # some stop short of their codewords
    for plan in found:
        away = (values + plan.change) / plan.step - dither - bits / 2.0
        missed = np.abs(away - np.rint(away)).max()
        assert missed <= 0.25 - plan.margin / plan.step + 1e-9
        assert plan.size == pytest.approx(np.sqrt(plan.change @ cost @ plan.change))
        assert plan.size <= limit
        nearest = ScalarCosta(plan.step).codeword(values, bits, dither) - values
        assert plan.size**2 < nearest @ cost @ nearest


def test_the_fit_undoes_a_motion_it_expects() -> None:
    rng = np.random.default_rng(2)
    u = rng.integers(0, 9, (1, 64)) / 2.0
    jacobian = rng.standard_normal((1, 64, 7)) * 50.0
    prior = np.diag(np.full(7, 2e-3**2))[None]
    moved = u - np.einsum("hkp,p->hk", jacobian, rng.standard_normal(7) * 1e-3)
    assert coherence(moved)[0] < 0.6
    fitted, log10_trials, _ = fit(moved, jacobian, prior)
    assert coherence(fitted)[0] > 0.99
    assert log10_trials[0] > 0


def test_the_significance_of_random_values_is_a_p_value() -> None:
    """With and without a fit: the share of random dithers that reach p is p at most."""
    rng = np.random.default_rng(3)
    jacobian = np.broadcast_to(rng.standard_normal((64, 7)) * 50.0, (40, 64, 7))
    prior = np.broadcast_to(np.diag(np.full(7, 1e-3**2)), (40, 7, 7))
    plain, fitted = [], []
    for u in rng.random((25, 40, 64)):
        moved, log10_trials, _ = fit(u, jacobian, prior)
        plain.append(log10_p(u, 64))
        fitted.append(log10_p(moved, 64, log10_trials))
    for found in (np.concatenate(plain), np.concatenate(fitted)):
        for level in (-1.0, -1.5, -2.0, -2.5):
            assert np.mean(found < level) <= 10.0**level * 1.3 + 2e-3


def test_the_choice_among_readings_says_nothing_about_the_bits(marked: TriangleMesh, key: Key) -> None:
    """Half a period more of dither flips its bit and nothing else: so under a wrong key each bit is a fair coin."""
    smooth = Surface.of(attack_all(marked, ["smooth:iterations=10"]))
    for secret, search in ((key, True), (Key(bytes(32)), False)):
        projections = METHOD.projections(secret, 32)
        flipped = replace(projections, dither=projections.dither + 0.5 * (np.arange(32) % 3 == 0))
        hypotheses = Hypotheses(smooth, METHOD.band, FRAME_2026, search=search)
        one, other = (Decoder(each, METHOD.steps(32), 32, 5e-4).read(hypotheses) for each in (projections, flipped))
        assert one.note == other.note
        assert one.hypotheses == other.hypotheses
        assert other.soft == pytest.approx(np.where(np.arange(32) % 3 == 0, -one.soft, one.soft), abs=1e-6)


def test_hypotheses_serve_one_key_after_the_other(marked: TriangleMesh, key: Key) -> None:
    """What a first key made them work out changes nothing for the next."""
    rough = attack_all(marked, ["noise:amplitude=0.003"], 1)
    seen = METHOD.observe(rough)
    wrong = METHOD.decoder(32, Key(bytes(32))).read(seen)
    shared, alone = METHOD.extract(seen, 32, key), METHOD.extract(rough, 32, key)
    assert wrong.hypotheses > shared.hypotheses  # it had to look further
    assert np.array_equal(shared.soft, alone.soft)


def test_what_old_marks_depend_on_never_changes() -> None:
    """The deal of the modes, their signs, the dither and the ladder: golden values, of a key of zeros."""
    projections = Projections.of(Key(bytes(32)), METHOD.band, 32)
    deal = hashlib.sha256(np.where(projections.weight > 0, 1, -1) * (projections.owner + 1)).hexdigest()
    assert deal[:16] == "a4cfb5a6d771a34a"
    assert projections.dither[:3] == pytest.approx([0.5673779384, 0.2078907593, 0.6869307735], abs=1e-9)
    steps = ShapeSpectrum().steps(64)
    assert (len(steps), steps[0], steps[-1]) == pytest.approx((45, 0.0495400874, 0.00252389074))


def test_a_mask_moves_the_motion_to_salient_places(spot: TriangleMesh, marked: TriangleMesh, key: Key) -> None:
    surface = Surface.of(spot)
    salient = Saliency().of_surface(surface)
    high = salient > np.median(salient)

    def share(mesh: TriangleMesh) -> float:
        motion = np.sum((Surface.of(mesh).vertices - surface.vertices) ** 2, axis=1)
        return float(motion[high].sum() / motion.sum())

    masked = replace(METHOD, mask="saliency").embed(spot, BITS, key)
    assert np.array_equal(read(masked, key).bits, BITS)  # the reader need not know
    assert share(masked) > share(marked) + 0.1
