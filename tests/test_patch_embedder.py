"""Writing patches: motions against differences, targets against their agreement; patches do not feel each other."""

from collections.abc import Iterator

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from fixtures.shapes import icosphere
from o3dmark.coding.keys import Key
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface, TriangleMesh
from o3dmark.methods.local_patches import places
from o3dmark.methods.local_patches.codewords import Share
from o3dmark.methods.local_patches.disk import disk_functions
from o3dmark.methods.local_patches.embedder import Piece, Plan
from o3dmark.methods.local_patches.format import FORMATS
from o3dmark.methods.local_patches.measuring import Sampled, coefficients, grid_of, held
from o3dmark.methods.local_patches.places import Limits, Marked, spread, written
from o3dmark.methods.local_patches.scoring import best_angles
from o3dmark.motion.visibility import Visibility

FORM = FORMATS["2026"]
FUNCTIONS = disk_functions(FORM)
CENTRE, STRENGTH, AGREEMENT = 1234, 0.004, 33.0
BITS = np.random.default_rng(5).integers(0, 2, 34)


@pytest.fixture(scope="module")
def share(key: Key) -> Share:
    return Share.all_of(key, FORM, len(BITS))[0]


@pytest.fixture(scope="module")
def sampled() -> Sampled:
    """A ball of 10 242 vertices with waves, as patches of 230 vertices see it."""
    vertices, triangles = icosphere(5)
    ways = np.random.default_rng(0).standard_normal((12, 3)) * np.linspace(2.0, 9.0, 12)[:, None]
    high = 1.0 + 0.02 * np.sin(vertices @ ways.T + 1.0).sum(axis=1)
    return Sampled(FORM, Surface.from_arrays(vertices * high[:, None], triangles), 0.3)


@pytest.fixture(scope="module")
def piece(sampled: Sampled) -> Piece:
    return Piece.about(sampled, CENTRE, 1.0)


@pytest.fixture(scope="module")
def plan(piece: Piece, share: Share) -> Plan:
    return piece.plans(share, BITS, [STRENGTH])[0]


def price(gram: np.ndarray, change: np.ndarray) -> float:
    """Of the cheapest motion (see `Motions.least`) that changes the coefficients so."""
    return float(change @ np.linalg.solve(gram, change))


# A piece


def test_a_piece_holds_what_the_cylinder_holds_and_the_triangles_around(sampled: Sampled, piece: Piece) -> None:
    surface = sampled.surface
    patch = sampled.patches(surface.vertices[[CENTRE]], surface.normals[[CENTRE]])
    assert np.array_equal(piece.surface.vertices, surface.vertices[piece.number])
    assert piece.number[piece.centre] == CENTRE
    inside = set(held(surface.vertices, patch).tolist())
    assert inside <= set(piece.number[piece.held].tolist())
    edge = geometry.edges(surface.triangles)
    beside = {int(v) for pair in edge.tolist() if inside & set(pair) for v in pair}
    assert set(piece.number[piece.held].tolist()) <= beside
    around = piece.held[piece.surface.triangles].any(axis=1)
    assert around.all()  # no triangle is there for nothing
    whole = np.isin(surface.triangles, piece.number[piece.held]).any(axis=1)
    assert whole.sum() == len(piece.surface.triangles)  # and none is missing


def test_a_piece_is_measured_as_the_whole_is(sampled: Sampled, piece: Piece) -> None:
    surface = sampled.surface
    patch = sampled.patches(surface.vertices[[CENTRE]], surface.normals[[CENTRE]])
    alone, found = piece.measured(piece.surface.vertices)
    np.testing.assert_allclose(alone.axis, patch.axis, atol=1e-12)
    np.testing.assert_allclose(found, coefficients(sampled.grid, patch, FUNCTIONS)[0], atol=1e-12)


def test_nothing_moves_that_is_not_held(piece: Piece) -> None:
    along = np.random.default_rng(0).standard_normal(piece.motions.directions.shape[1])
    moved = (piece.moved(piece.surface.vertices, along) != piece.surface.vertices).any(axis=1)
    assert np.array_equal(moved, piece.held)


def test_the_jacobian_is_the_slope_of_the_coefficients(piece: Piece) -> None:
    """Of the patch where it is: along each motion that the plan would make, by differences."""
    vertices, patch = piece.surface.vertices, piece.measured(piece.surface.vertices)[0]
    jacobian, step = piece.jacobian(vertices, patch), 1e-5
    motions = piece.motions.least(jacobian.real)[::5]
    for motion in motions / np.abs(motions).max(axis=1, keepdims=True):
        found = []
        for each in (step, -step):
            there = piece.rule.samples(piece.surface.moved(piece.moved(vertices, each * motion)))
            found.append(coefficients(grid_of(there.points, there.area_vectors, piece.radius), patch, FUNCTIONS)[0])
        slope = (found[0] - found[1]) / (2.0 * step)
        assert np.linalg.norm(jacobian @ motion - slope) < 0.03 * np.linalg.norm(slope)


def test_the_unit_of_motions_does_not_matter(sampled: Sampled, piece: Piece, share: Share, plan: Plan) -> None:
    """Nor does that of the mesh: only how a motion's length and its bending compare hangs on the scale."""
    larger = Sampled(FORM, sampled.surface.moved(10.0 * sampled.surface.vertices), 10.0 * sampled.radius)
    there = Piece.about(larger, CENTRE, 10.0).plans(share, BITS, [STRENGTH])[0].first_order(AGREEMENT)
    here = plan.first_order(AGREEMENT)
    size = np.abs(here - piece.surface.vertices).max()
    np.testing.assert_allclose(there, 10.0 * here, atol=1e-5 * size)


# A plan


def test_a_plan_leads_to_codewords_of_the_bits(plan: Plan, share: Share) -> None:
    assert np.abs(plan.codeword - plan.phase).max() <= 0.5
    assert share.agreement(plan.codeword - share.dither) == pytest.approx(share.most)
    assert np.array_equal(share.soft(plan.codeword - share.dither, len(BITS)) > 0, BITS)


def test_the_gram_matrix_is_that_of_a_price(plan: Plan) -> None:
    np.testing.assert_allclose(plan.gram, plan.gram.T, atol=1e-9 * np.abs(plan.gram).max())
    assert np.linalg.eigvalsh(plan.gram).min() > 0


def test_from_no_other_angle_are_codewords_nearer(piece: Piece, share: Share, plan: Plan) -> None:
    """As motion goes: brute force over as many angles, each with its own Gram matrix."""
    found = piece.measured(piece.surface.vertices)[1] / STRENGTH
    jacobian = piece.jacobian(piece.surface.vertices, piece.measured(piece.surface.vertices)[0]) / STRENGTH
    prices = []
    for angle in 2.0 * np.pi / 128 * np.arange(128):
        seen = np.full(1, angle)
        answer = share.values(jacobian.T, np.broadcast_to(seen, jacobian.shape[1])).T
        gram = answer @ piece.motions.least(answer).T
        gram += 1e-3 * np.trace(gram) / len(gram) * np.eye(len(gram))
        phase = share.values(found[None], seen)[0]
        prices.append(price(gram, share.codewords(phase, BITS) - phase))
    assert plan.angle[0] == pytest.approx(2.0 * np.pi / 128 * np.argmin(prices))
    assert min(prices) < 0.9 * np.mean(prices)  # the choice is worth while


@pytest.mark.parametrize("agreement", [10.0, 20.0, 33.0])
def test_a_target_agrees_as_well_as_it_is_asked_to_and_costs_the_least(
    agreement: float, plan: Plan, share: Share
) -> None:
    target = plan.target(agreement)
    assert share.agreement(target - share.dither) == pytest.approx(agreement, abs=0.05)
    change = target - plan.phase
    full = plan.codeword - plan.phase
    assert price(plan.gram, change) < price(plan.gram, full)
    # all coefficients as far: the same agreement at a higher price
    shares = np.linspace(0.0, 1.0, 2001)
    reached = share.agreement(plan.phase + shares[:, None] * full - share.dither)
    alike = shares[np.argmax(reached >= agreement)]
    assert price(plan.gram, change) < price(plan.gram, alike * full)


def test_what_was_written_is_read(piece: Piece, plan: Plan, share: Share) -> None:
    """By a reader that finds the axis from the marked surface; only the held vertices move, by a part of a step."""
    done = plan.write(AGREEMENT)
    found = piece.measured(done.vertices)[1]
    phase = share.values(found[None] / STRENGTH, plan.angle)[0]
    assert done.missed == pytest.approx(np.sqrt(np.mean((plan.target(AGREEMENT) - phase) ** 2)))
    assert done.missed < 0.03
    assert share.agreement(phase - share.dither) == pytest.approx(AGREEMENT, abs=0.5)
    assert np.array_equal(share.soft(phase - share.dither, len(BITS)) > 0, BITS)
    moved = np.linalg.norm(done.vertices - piece.surface.vertices, axis=1)
    assert not moved[~piece.held].any()
    assert 0.0 < moved.max() < 3.0 * STRENGTH * piece.radius


def test_the_first_order_costs_about_what_the_motion_costs(piece: Piece, plan: Plan) -> None:
    first, done = (there - piece.surface.vertices for there in (plan.first_order(AGREEMENT), plan.write(AGREEMENT)[0]))
    assert np.linalg.norm(first) == pytest.approx(np.linalg.norm(done), rel=0.1)
    assert np.corrcoef(first.ravel(), done.ravel())[0, 1] > 0.95


def test_a_weaker_patch_moves_less(piece: Piece, share: Share) -> None:
    sizes = [
        np.linalg.norm(piece.plans(share, BITS, [strength])[0].first_order(AGREEMENT) - piece.surface.vertices)
        for strength in FORM.strengths
    ]
    assert sizes == sorted(sizes, reverse=True)


# Places on a surface


@pytest.fixture(scope="module")
def whole(carrier: TriangleMesh) -> Sampled:
    surface = Surface.of(carrier)
    return Sampled(FORM, surface, FORM.nearest_rung(0.068 * np.sqrt(surface.area)))


@pytest.fixture(scope="module")
def limits(whole: Sampled) -> Limits:
    return Limits(4e-4 * whole.surface.diagonal, 1.0)


@pytest.fixture(scope="module")
def quick() -> Iterator[None]:
    """Fewer vertices are looked at for places: half of the patches in a quarter of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(places, "_LOOKED_AT", 100)
        yield


@pytest.fixture(scope="module")
def marked(whole: Sampled, share: Share, limits: Limits, quick: None) -> Marked:
    return written(whole, [share], BITS, limits, spread(whole.surface))


@pytest.fixture(scope="module")
def pieces(whole: Sampled, marked: Marked) -> list[Piece]:
    return [Piece.about(whole, place.vertex, 1.0) for place in marked.places]


def rms(before: Surface, vertices: np.ndarray) -> float:
    square = ((vertices - before.vertices) ** 2).sum(axis=1)
    return float(np.sqrt(square @ before.vertex_areas / before.area))


def test_patches_share_no_vertex_that_moves(marked: Marked, pieces: list[Piece], whole: Sampled) -> None:
    assert len(pieces) > 5
    moves = np.concatenate([piece.number[piece.held] for piece in pieces])
    assert len(np.unique(moves)) == len(moves)
    centres = whole.surface.vertices[[place.vertex for place in marked.places]]
    assert pdist(centres).min() > 0.95 * whole.radius


def test_beyond_the_patches_nothing_moves_at_all(marked: Marked, pieces: list[Piece], whole: Sampled) -> None:
    inside = np.zeros(len(whole.surface.vertices), bool)
    inside[np.concatenate([piece.number[piece.held] for piece in pieces])] = True
    assert np.array_equal(marked.vertices[~inside], whole.surface.vertices[~inside])
    for piece in pieces:
        moved = marked.vertices[piece.number] != piece.surface.vertices
        assert moved[piece.held].any()


def test_the_limits_hold(marked: Marked, whole: Sampled, limits: Limits) -> None:
    assert 0.0 < rms(whole.surface, marked.vertices) <= limits.rms
    assert all(0.0 < place.jnd <= limits.jnd for place in marked.places)
    assert all(place.strength in FORM.strengths and place.agreement in places._AGREEMENTS for place in marked.places)


def test_what_is_said_to_be_seen_of_a_patch_is_about_what_is_seen(
    marked: Marked, pieces: list[Piece], whole: Sampled, limits: Limits
) -> None:
    """By the measure of the metric jnd, of the finished surface; said of the first order of the strongest, scaled."""
    visibility, after = Visibility(whole.surface), whole.surface.moved(marked.vertices)
    seen, said = visibility.local(after), np.array([place.jnd for place in marked.places])
    ratio = [np.quantile(seen[piece.number[piece.held]], 0.95) for piece in pieces] / said
    assert 0.8 < np.median(ratio) < 1.2
    assert np.all((ratio > 0.5) & (ratio < 2.0))
    assert visibility(after) < limits.jnd


def test_each_patch_is_read_as_if_it_were_alone(marked: Marked, whole: Sampled, share: Share) -> None:
    after = Sampled(FORM, whole.surface.moved(marked.vertices), whole.radius)
    at = [place.vertex for place in marked.places]
    patches = after.patches(after.surface.vertices[at], after.surface.normals[at])
    found = coefficients(after.grid, patches, FUNCTIONS)
    for place, each in zip(marked.places, found, strict=True):
        scores = best_angles(share, each[None], place.strength, 1024)
        assert scores.agreement[0] > place.agreement - 2.0
        phase = share.values(each[None] / place.strength, scores.angle)[0] - share.dither
        assert np.mean((share.soft(phase, len(BITS)) > 0) == BITS) > 0.97


def test_a_lower_limit_takes_fewer_patches_the_cheapest_first(
    whole: Sampled,
    share: Share,
    limits: Limits,
    marked: Marked,
    quick: None,
) -> None:
    low = Limits(0.3 * limits.rms, limits.jnd)
    fewer = written(whole, [share], BITS, low, spread(whole.surface))
    assert 0 < len(fewer.places) < len(marked.places)
    assert 0.5 * low.rms < rms(whole.surface, fewer.vertices) <= low.rms
    assert {place.vertex for place in fewer.places} <= {place.vertex for place in marked.places}


def test_within_next_to_nothing_there_is_no_patch(whole: Sampled, share: Share, quick: None) -> None:
    done = written(whole, [share], BITS, Limits(1.0, 1e-3), spread(whole.surface))
    assert done.places == []
    assert np.array_equal(done.vertices, whole.surface.vertices)
