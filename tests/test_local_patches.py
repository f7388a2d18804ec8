"""local-patches: what the reader finds in a part of a mesh, in any pose, is what was embedded in the whole."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from fixtures.attacked import torus
from fixtures.shapes import mapped, rotation
from o3dmark.attacks import attack_all
from o3dmark.coding.detection import together
from o3dmark.coding.keys import Key
from o3dmark.errors import CapacityError, MeshError, SpecError
from o3dmark.mesh import similarity
from o3dmark.mesh.surface import Surface, TriangleMesh, mesh_arrays, triangle_mesh
from o3dmark.methods import METHODS, Depth, Extraction
from o3dmark.methods.local_patches import places, search
from o3dmark.methods.local_patches.codewords import Share
from o3dmark.methods.local_patches.format import FORMATS
from o3dmark.methods.local_patches.measuring import Patches, Sampled
from o3dmark.methods.local_patches.method import LocalPatches, Look, _told
from o3dmark.methods.local_patches.places import Marked
from o3dmark.methods.local_patches.search import Hit, Seen, believed, mean_edge, radii

METHOD, FORM = LocalPatches(), FORMATS["2026"]
BITS = np.random.default_rng(5).integers(0, 2, 34)
POSE = "similarity:smallest=1,largest=1"


@pytest.fixture(scope="module")
def quick() -> Iterator[None]:
    """The writer looks at fewer vertices for places, which takes a third of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(places, "_LOOKED_AT", 250)
        yield


@pytest.fixture(scope="module")
def written(carrier: TriangleMesh, key: Key, quick: None) -> Marked:
    return METHOD.marked(Surface.of(carrier), BITS, key)


@pytest.fixture(scope="module")
def marked(carrier: TriangleMesh, written: Marked) -> TriangleMesh:
    return triangle_mesh(written.vertices, mesh_arrays(carrier)[1])


@pytest.fixture(scope="module")
def small(marked: TriangleMesh) -> Look:
    """What a twentieth of the mesh shows at the radius of its patches, were there but one strength."""
    part = Surface.of(attack_all(marked, ["crop:share=0.94,kind=ball"], rng=4))
    radius = FORM.nearest_rung(METHOD.radius * np.sqrt(Surface.of(marked).area))
    return Look(FORM, part, (Seen(Sampled(replace(FORM, strengths=(0.004,)), part, radius)),))


def stranger(number: int) -> Key:
    return Key(number.to_bytes(32, "big"))


def joined(one: TriangleMesh, other: TriangleMesh) -> TriangleMesh:
    """Both in one mesh, beside each other."""
    (vertices, triangles), (more, corners) = mesh_arrays(one), mesh_arrays(other)
    aside = vertices.max(axis=0) - more.min(axis=0) + 0.1
    return triangle_mesh(np.concatenate([vertices, more + aside]), np.concatenate([triangles, corners + len(vertices)]))


# What a reader finds


def test_two_thirds_of_the_mesh_tell_the_message_in_another_pose(marked: TriangleMesh, key: Key) -> None:
    read = METHOD.extract(attack_all(marked, ["crop:share=0.3", POSE], rng=1), len(BITS), key)
    assert np.array_equal(read.bits, BITS)
    assert read.part.endswith("patches")
    assert read.log10_p is not None
    assert read.log10_p < -10.0
    assert read.detect(BITS).log10_p < read.log10_p


def test_two_fifths_of_it_tell_the_message_pasted_beside_something_else(marked: TriangleMesh, key: Key) -> None:
    part = attack_all(marked, ["crop:share=0.6", POSE], rng=1)
    beside = mapped(torus(), lambda v: 0.4 * v)
    assert np.array_equal(METHOD.extract(joined(part, beside), len(BITS), key).bits, BITS)


def test_the_radii_of_another_size_are_those_of_the_ladder(marked: TriangleMesh, key: Key) -> None:
    """A mesh that has grown by a power of the ratio is read, one in between is not."""
    vertices, triangles = mesh_arrays(attack_all(marked, ["crop:share=0.65", POSE], rng=1))
    method = METHOD.quick
    grown, between = (
        method.extract(triangle_mesh(scale * vertices, triangles), len(BITS), key)
        for scale in (FORM.ratio, FORM.ratio**0.5)
    )
    assert np.array_equal(grown.bits, BITS)
    assert (between.part, grown.part != "") == ("", True)
    assert between.detect(BITS).p_value > 1e-3


def test_patches_are_found_where_they_were_written(
    marked: TriangleMesh, written: Marked, key: Key, carrier: TriangleMesh
) -> None:
    """To a hundredth of the radius, each once, the surest first, of the strength that it was written with."""
    surface = Surface.of(carrier)
    sampled = Sampled(FORM, Surface.of(marked), FORM.nearest_rung(METHOD.radius * np.sqrt(surface.area)))
    seen, shares = Seen(sampled), Share.all_of(key, FORM, len(BITS))
    candidates = seen.candidates(shares, times=10)
    hits, tried = believed(candidates), len(seen.patches.centre) * 256 * len(FORM.strengths) * len(shares) * 10
    assert len(hits) > 0.6 * len(written.places) > 4
    assert [hit.log10_p for hit in candidates] == sorted(hit.log10_p for hit in candidates)
    centres = np.array([hit.patch.centre[0] for hit in candidates])
    apart = np.linalg.norm(centres[:, None] - centres, axis=2) + 9.0 * sampled.radius * np.eye(len(centres))
    assert apart.min() > 0.5 * sampled.radius
    at = sampled.surface.vertices[[place.vertex for place in written.places]]
    for hit in hits:
        offset = np.linalg.norm(at - hit.patch.centre[0], axis=1)
        place = written.places[int(offset.argmin())]
        assert offset.min() < 0.01 * sampled.radius
        assert hit.strength == place.strength
        assert hit.agreement == pytest.approx(place.agreement, abs=4.0)
        assert hit.agreement == pytest.approx(hit.share.agreement(hit.phase))
        alone = float(hit.share.log10_p(np.array(hit.agreement)))
        charged = [alone + math.log10(tried * len(search._FITS)) + fit.gain for fit in search._FITS]
        assert min(abs(hit.log10_p - each) for each in charged) < 1e-9


def test_a_stretched_fragment_is_fitted(marked: TriangleMesh, key: Key) -> None:
    """By 2 % along a random axis: with the strain at rest far fewer of the coefficients are where they should be."""
    part = attack_all(marked, ["crop:share=0.5", "strain:amount=0.02", POSE], rng=2)
    read = METHOD.extract(part, len(BITS), key)
    assert np.array_equal(read.bits, BITS)
    assert read.log10_p is not None
    assert read.log10_p < -8.0
    strain = [np.abs(hit.patch.strain).max() for hit in _sure(part, key) if hit.patch.strain is not None]
    assert max(strain) > 0.008


def _sure(part: TriangleMesh, key: Key) -> list[Hit]:
    seen, shares = METHOD.observe(part).seen, Share.all_of(key, FORM, len(BITS))
    return [hit for each in seen[:2] for hit in believed(each.candidates(shares, times=1))]


@pytest.mark.parametrize("scale", [1.17, pytest.param(0.3, marks=pytest.mark.slow)])
def test_a_fragment_in_another_unit_is_read_where_that_is_asked_for(
    marked: TriangleMesh, key: Key, scale: float
) -> None:
    vertices, triangles = mesh_arrays(attack_all(marked, ["crop:share=0.3", POSE], rng=2))
    part = triangle_mesh(scale * vertices, triangles)
    assert not METHOD.quick.extract(part, len(BITS), key).part
    look = replace(METHOD.observe(part), seen=())  # so that no time goes into its own unit
    read = METHOD.searching(Depth(any_scale=True)).extract(look, len(BITS), key)
    assert np.array_equal(read.bits, BITS)
    assert read.part


@pytest.mark.parametrize(
    ("mirror", "turned"),
    [
        (True, False),
        pytest.param(True, True, marks=pytest.mark.slow),
        pytest.param(False, True, marks=pytest.mark.slow),
    ],
)
def test_a_fragment_mirrored_or_inside_out_is_read_where_that_is_asked_for(
    marked: TriangleMesh, key: Key, mirror: bool, turned: bool
) -> None:
    """``turned``: its triangles face inward afterwards."""
    vertices, triangles = mesh_arrays(attack_all(marked, ["crop:share=0.7", POSE], rng=2))
    if mirror:
        vertices = vertices * [-1.0, 1.0, 1.0]
    part = triangle_mesh(vertices, triangles[:, ::-1] if mirror != turned else triangles)
    read = METHOD.searching(Depth(mirrored=True)).extract(part, len(BITS), key)
    assert np.array_equal(read.bits, BITS)
    assert read.part


def test_a_fragment_tells_where_its_patches_are(
    carrier: TriangleMesh, marked: TriangleMesh, written: Marked, key: Key
) -> None:
    """Where the writer wrote, moved as the fragment was, of its radius and upright; others' looks change nothing."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation(3), [5.0, -2.0, 1.0]
    part = mapped(attack_all(marked, ["crop:share=0.5"], rng=1), lambda v: similarity.apply(pose, v))
    read = METHOD.quick.extract(part, len(BITS), key)
    assert read.part == f"{len(read.patches)} patches"
    radius = METHOD.radius_on(Surface.of(carrier))
    vertices = [place.vertex for place in written.places]
    at = similarity.apply(pose, written.vertices[vertices])
    normals = Surface.of(marked).normals[vertices] @ pose[:3, :3].T
    found = []
    for patch in read.patches:
        offset = np.linalg.norm(at - patch.centre, axis=1)
        found.append(int(offset.argmin()))
        assert offset.min() < 0.05 * radius
        assert patch.axis @ normals[found[-1]] > 0.8
        assert (patch.radius, patch.half_height) == pytest.approx((radius, FORM.half_height * radius))
        assert np.linalg.norm(patch.axis) == pytest.approx(1.0)
    assert len(set(found)) == len(found) > 2
    assert read.times(7).patches == read.beside(Extraction(read.soft)).patches == read.patches
    assert Extraction(read.soft).beside(read).patches == ()


def test_more_bits_than_a_patch_holds_are_told_by_patches_of_two_kinds(
    carrier: TriangleMesh, key: Key, quick: None
) -> None:
    bits = np.random.default_rng(6).integers(0, 2, 64)
    marked = METHOD.embed(carrier, bits, key)
    read = METHOD.quick.extract(attack_all(marked, ["crop:share=0.4", POSE], rng=1), 64, key)
    assert np.array_equal(read.bits, bits)
    assert read.log10_p is not None
    assert read.log10_p < -25.0  # of two kinds, which are independent


# What it does not find


def test_neither_a_wrong_key_nor_an_unmarked_mesh_tells_anything(
    marked: TriangleMesh, carrier: TriangleMesh, key: Key
) -> None:
    for mesh, other in ((marked, stranger(7)), (carrier, key)):
        part = attack_all(mesh, ["crop:share=0.7", POSE], rng=1)
        read = METHOD.quick.extract(part, len(BITS), other)
        assert (read.part, read.patches) == ("", ())
        assert read.detect(BITS).p_value > 1e-3
        assert read.log10_p is not None
        assert read.log10_p > -3.0
        assert 5 < np.count_nonzero(read.bits != BITS) < 29


def test_p_values_of_wrong_keys_are_no_lower_than_chance_has_it(small: Look, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of what a key finds at its best of all places, angles and strengths, everything charged."""
    monkeypatch.setattr(search, "_REFINED", 1)
    monkeypatch.setattr(search, "_STEPS", 1)
    reads = [METHOD.extract(small, len(BITS), stranger(number)) for number in range(200)]
    alone = np.array([read.log10_p for read in reads])
    known = np.array([read.detect(BITS).log10_p for read in reads])
    for p in (alone, known):
        assert np.mean(p < math.log10(0.1)) <= 0.2
        assert np.mean(p < math.log10(0.01)) <= 0.04
        assert p.min() > -4.0
    wrong = np.array([np.count_nonzero(read.bits != BITS) for read in reads])
    assert abs(wrong.mean() - 17.0) < 1.0  # a standard error is 0.2
    assert len({read.soft.tobytes() for read in reads}) == len(reads)


def test_a_fragment_too_small_for_any_patch_tells_nothing(marked: TriangleMesh, key: Key) -> None:
    part = attack_all(marked, ["crop:share=0.99,kind=ball"], rng=1)
    read = METHOD.extract(part, len(BITS), key)
    assert not read.soft.any()
    assert (read.log10_p, read.part, read.step) == (0.0, "", None)
    assert read.detect(BITS).p_value == 1.0


# What it refuses


def test_the_cover_is_not_touched_and_the_triangles_stay(
    carrier: TriangleMesh, written: Marked, key: Key, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(LocalPatches, "marked", lambda *_: written)  # as it was written a moment ago
    before = mesh_arrays(carrier)
    after = mesh_arrays(METHOD.embed(carrier, BITS, key))
    assert all(np.array_equal(a, b) for a, b in zip(before, mesh_arrays(carrier), strict=True))
    assert np.array_equal(before[1], after[1])
    assert 0 < np.count_nonzero((before[0] != after[0]).any(axis=1)) < 0.7 * len(before[0])


def test_a_mesh_without_room_is_refused_with_the_reason(key: Key) -> None:
    with pytest.raises(MeshError, match="no patch of the surface holds the bits unseen"):
        METHOD.embed(TriangleMesh.create_box().subdivide_midpoint(2), BITS, key)


def test_too_many_bits_are_refused_with_the_number_that_fits(carrier: TriangleMesh, key: Key) -> None:
    with pytest.raises(CapacityError) as caught:
        METHOD.embed(carrier, np.zeros(129, int), key)
    assert caught.value.fits == METHOD.capacity(carrier) == 128


def test_a_reference_is_refused(carrier: TriangleMesh, key: Key) -> None:
    assert not METHOD.takes_reference
    with pytest.raises(MeshError, match="without a reference"):
        METHOD.extract(carrier, 34, key, reference=carrier)


@pytest.mark.parametrize("spec", ["mrms=0", "jnd=0", "radius=0", "radius=0.6", "format=2025", "size=1"])
def test_options_are_checked(spec: str) -> None:
    with pytest.raises(SpecError):
        METHODS.make(f"local-patches:{spec}")


def test_what_a_writer_may_choose_is_nothing_to_the_reader() -> None:
    other = LocalPatches(mrms=1e-4, jnd=0.5, radius=0.1, search=False)
    assert other.sight == METHOD.sight
    assert METHOD.quick == LocalPatches(search=False)
    assert METHOD.quick.quick == METHOD.quick


# Radii, and which candidates are patches


def test_radii_are_the_rungs_that_suit_the_surface_the_likeliest_first(carrier: TriangleMesh) -> None:
    surface = Surface.of(carrier)
    found, unit = radii(FORM, surface), math.sqrt(surface.area)
    assert set(found) <= set(FORM.rungs(0.03 * unit, 0.3 * unit))
    assert FORM.nearest_rung(METHOD.radius * unit) in found[:2]
    off = [abs(math.log(radius / (0.08 * unit))) for radius in found]
    assert off == sorted(off)
    assert mean_edge(surface) < 0.4 * min(found)
    coarse = Surface.of(TriangleMesh.create_icosahedron().subdivide_midpoint(2))
    fewer = radii(FORM, coarse)
    assert len(fewer) < len(found)
    assert all(mean_edge(coarse) < 0.4 * radius for radius in fewer)


def test_the_mean_edge_is_that_of_every_edge_once() -> None:
    assert mean_edge(Surface.of(TriangleMesh.create_tetrahedron())) == pytest.approx(math.sqrt(8.0 / 3.0))


def hit(share: Share, log10_p: float, phase: np.ndarray) -> Hit:
    patch = Patches(FORM, np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), 1.0)
    return Hit(patch, share, 0.004, float(share.agreement(phase)), log10_p, phase)


def test_what_is_likely_is_believed_beside_what_is_sure(key: Key) -> None:
    share = Share.all_of(key, FORM, 34)[0]
    of = {p: hit(share, p, np.zeros(len(share.source))) for p in (-9.0, -4.0, -2.0, -0.5)}
    assert believed([]) == []
    assert believed([of[-4.0], of[-2.0], of[-0.5]]) == []
    assert [each.log10_p for each in believed([of[-9.0], of[-4.0], of[-2.0], of[-0.5]])] == [-9.0, -4.0]


def test_patches_weigh_as_they_are_clean_and_each_kind_speaks_for_its_bits(key: Key) -> None:
    shares, bits = Share.all_of(key, FORM, 64), np.random.default_rng(0).integers(0, 2, 64)
    clean = [share.codewords(np.zeros(len(share.source)), bits) - share.dither for share in shares]
    noise = np.random.default_rng(1).uniform(-0.5, 0.5, (9, len(clean[0])))
    hits = [hit(shares[0], -19.0, clean[0]), *(hit(shares[0], -6.0, each) for each in noise)]
    one = _told(hits, hits, 64)
    carried = np.isin(np.arange(64), shares[0].bit)
    assert np.array_equal(one.bits[carried], bits[carried])  # one that is clean outweighs nine that are not
    assert not one.soft[~carried].any()
    assert np.abs(one.soft).max() <= 1.0
    assert (one.log10_p, one.part) == (-19.0, "10 patches")  # those of a kind are no surer than the surest
    hits.append(hit(shares[1], -12.0, clean[1]))
    both = _told(hits, hits, 64)
    assert np.array_equal(both.bits, bits)
    assert both.log10_p == pytest.approx(together([-19.0, -12.0]))


def test_all_that_may_be_asked_is_charged(key: Key) -> None:
    """The sum of the inverses of the charges is 1."""
    share = Share.all_of(key, FORM, 34)[0]
    candidates = [hit(share, -0.5, np.full(len(share.source), x)) for x in (0.0, 0.2, 0.3)]
    told = _told(candidates[:1], candidates, 34)
    assert told.readings is not None
    assert told.charges is not None
    assert len(told.readings) == len(told.charges) == 4
    assert (1.0 / told.charges).sum() == pytest.approx(1.0)
    assert np.array_equal(told.readings[0], told.soft)
    assert told.hypotheses == told.charges[0]
    assert _told([], [], 34).detect(np.zeros(34)).p_value == 1.0


# Detection with what values show whatever their bits


def test_what_is_shown_is_no_evidence_by_chance() -> None:
    """Uniform p-values beside fair coins: no test is rejected more often than its rate."""
    rng = np.random.default_rng(7)
    found = np.array(
        [
            Extraction(rng.standard_normal(16), log10_p=math.log10(1.0 - rng.random())).detect(np.ones(16)).log10_p
            for _ in range(2000)
        ]
    )
    for rate in (0.5, 0.1, 0.01):
        assert np.mean(found <= math.log10(rate)) < rate + 4.0 * math.sqrt(rate / 2000)
    assert np.mean(found <= math.log10(0.1)) > 0.02  # and not for want of power


def test_what_is_shown_adds_to_what_the_bits_say() -> None:
    soft = np.where(np.arange(24) < 20, 1.0, -1.0)
    plain, shown = (Extraction(soft, log10_p=p).detect(np.ones(24)) for p in (None, -8.0))
    assert plain.log10_p > -4.0
    assert shown.log10_p == pytest.approx(together([plain.log10_p, -8.0]) + math.log10(2.0))
    assert shown.matches == plain.matches == 20
    useless = Extraction(soft, log10_p=0.0).detect(np.ones(24))
    assert useless.log10_p == pytest.approx(plain.log10_p + math.log10(2.0))  # the price of asking either way


def test_the_best_of_several_looks_is_charged_for_all_of_them() -> None:
    found = Extraction(np.ones(8), hypotheses=3, log10_p=-5.0).times(10)
    assert (found.hypotheses, found.log10_p) == (30, -4.0)
    assert Extraction(np.ones(8), log10_p=-0.5).times(10).log10_p == 0.0
    assert Extraction(np.ones(8)).times(10).log10_p is None
