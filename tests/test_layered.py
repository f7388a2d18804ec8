"""layered: a whole mesh is read from its solid, a fragment from its patches; what either says is charged for both."""

import json
import math
from dataclasses import replace
from typing import Any, NoReturn

import numpy as np
import pytest

from fixtures.paths import GOLDEN
from o3dmark import marking
from o3dmark.attacks import attack_all
from o3dmark.coding.keys import Key
from o3dmark.errors import SpecError
from o3dmark.files import read_mesh
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface, TriangleMesh, mesh_arrays
from o3dmark.methods import METHODS, NO_DEEPER, Depth, Extraction
from o3dmark.methods.layered import Layered, Seen
from o3dmark.methods.local_patches import LocalPatches, places
from o3dmark.methods.local_patches.places import Marked, Place
from o3dmark.methods.shape_spectrum.method import ShapeSpectrum
from o3dmark.motion.visibility import Visibility
from o3dmark.profiles import PROFILES

METHOD = Layered()
BITS = np.random.default_rng(5).integers(0, 2, 32)
POSE = "similarity:smallest=1,largest=1"
OLD = json.loads((GOLDEN / "marks" / "manifest.json").read_text())


@pytest.fixture(scope="module")
def layers(spot: TriangleMesh, key: Key) -> tuple[Any, Any]:
    """Spot with the solid's layer alone, and with both; the writer looks at fewer vertices for places."""
    solid, embed = [], ShapeSpectrum.embed
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(places, "_LOOKED_AT", 250)
        patch.setattr(ShapeSpectrum, "embed", lambda *data: solid.append(embed(*data)) or solid[0])
        both = METHOD.embed(spot, BITS, key)
    return solid[0], both


@pytest.fixture(scope="module")
def marked(layers: tuple[Any, Any]) -> Any:
    return layers[1]


@pytest.fixture(scope="module")
def coarse(spot: TriangleMesh) -> TriangleMesh:
    """Spot of 400 vertices: none of its places has room for a patch."""
    return spot.simplify_quadric_decimation(800)


def asked(*_: Any, **__: Any) -> NoReturn:
    raise AssertionError("patches were asked")


# What embedding promises


def test_patches_are_written_last_and_move_nothing_else(spot: TriangleMesh, layers: tuple[Any, Any]) -> None:
    cover, solid, both = (mesh_arrays(each)[0] for each in (spot, *layers))
    first, second = ((a != b).any(axis=1) for a, b in ((cover, solid), (solid, both)))
    assert first.mean() > 0.9
    assert 0.0 < second.mean() < 0.5
    assert np.array_equal(mesh_arrays(spot)[1], mesh_arrays(layers[1])[1])


def test_both_layers_together_stay_within_the_limits(spot: TriangleMesh, marked: Any) -> None:
    assert METHOD.limits == {"mrms": METHOD.total, "jnd": METHOD.jnd}
    before, after = Surface.of(spot), Surface.of(marked)
    motion = (after.vertices - before.vertices)[before.triangles]
    assert 0.9 * METHOD.mrms < geometry.normal_rms(before.area_vectors, motion) / before.diagonal <= METHOD.total
    assert 0.0 < Visibility(before)(after) <= METHOD.jnd


def test_each_layer_carries_all_the_bits_by_itself(marked: Any, key: Key) -> None:
    kinds = {name: type(layer) for name, layer in METHOD.layers.items()}
    assert kinds == {"solid": ShapeSpectrum, "patches": LocalPatches}
    for layer in METHOD.layers.values():
        assert np.array_equal(layer.quick.extract(marked, len(BITS), key).bits, BITS)


def test_without_room_for_patches_the_solid_is_marked_alone(coarse: TriangleMesh, key: Key) -> None:
    marked = METHOD.embed(coarse, BITS, key)
    alone = METHOD.layers["solid"].embed(coarse, BITS, key)
    assert np.array_equal(mesh_arrays(marked)[0], mesh_arrays(alone)[0])
    assert np.array_equal(METHOD.extract(marked, len(BITS), key).bits, BITS)
    assert not METHOD.layers["patches"].quick.extract(marked, len(BITS), key).part


def test_patches_that_disturb_the_solid_are_not_written(
    spot: TriangleMesh, layers: tuple[Any, Any], key: Key, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Were there any: here they take the solid's mark away, so that nothing is read of it."""
    done = Marked(np.array(Surface.of(spot).vertices), [Place(0, 0, 0.004, 33.0, 0.5)])
    monkeypatch.setattr(LocalPatches, "marked", lambda *_: done)
    marked = METHOD.embed(spot, BITS, key)
    assert np.array_equal(mesh_arrays(marked)[0], mesh_arrays(layers[0])[0])


def test_copies_of_what_was_prepared_have_both_layers_and_places_are_not_looked_for_again(
    spot: TriangleMesh, key: Key, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(places, "_LOOKED_AT", 250)
    prepared = METHOD.prepare(spot, len(BITS), key)
    monkeypatch.setattr(places, "spread", asked)
    for bits in (BITS, 1 - BITS):
        copy = METHOD.embed(prepared, bits, key)
        for layer in METHOD.layers.values():
            assert np.array_equal(layer.quick.extract(copy, len(bits), key).bits, bits)
        assert METHOD.limits["mrms"] >= geometry.motion_mrms(
            *(mesh_arrays(each)[0] for each in (spot, copy)), mesh_arrays(spot)[1]
        )


# What reading promises


def test_a_whole_mesh_is_read_without_asking_patches(marked: Any, key: Key, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(LocalPatches, "extract", asked)
    monkeypatch.setattr(LocalPatches, "observe", asked)
    for attack in ("identity", POSE):
        read = METHOD.extract(attack_all(marked, [attack], rng=1), len(BITS), key)
        assert np.array_equal(read.bits, BITS)
        assert "patch" not in read.note
        assert read.patches == ()


def test_nor_does_a_quick_look_ask_them(coarse: TriangleMesh, key: Key, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(LocalPatches, "extract", asked)
    assert METHOD.quick.extract(coarse, len(BITS), key).detect(BITS).p_value > 1e-3
    with pytest.raises(AssertionError, match="patches were asked"):
        METHOD.extract(coarse, len(BITS), key)


def test_a_fragment_is_read_from_its_patches(marked: Any, key: Key, monkeypatch: pytest.MonkeyPatch) -> None:
    """Which the solid does not tell at first sight; its search, which takes longest, is not begun."""

    def at_first_sight(solid: ShapeSpectrum, *data: Any, **options: Any) -> Extraction:
        assert not solid.search
        return extract(solid, *data, **options)

    extract = ShapeSpectrum.extract
    monkeypatch.setattr(ShapeSpectrum, "extract", at_first_sight)
    seen = METHOD.observe(attack_all(marked, ["crop:share=0.3", POSE], rng=1))
    read = METHOD.extract(seen, len(BITS), key)
    assert np.array_equal(read.bits, BITS)
    assert "patch" in read.part
    assert len(read.patches) == int(read.part.split()[0])
    surface = Surface.of(seen.whole.received)
    for patch in read.patches:
        assert np.linalg.norm(surface.vertices - patch.centre, axis=1).min() < 0.1 * patch.radius
    assert read.detect(BITS).log10_p < -15.0
    first = METHOD.layers["solid"].quick.extract(seen.whole, len(BITS), key)
    assert not np.array_equal(first.bits, BITS)
    assert read.charges is not None
    assert (1.0 / read.charges).sum() <= 1.0 + 1e-12


def test_where_neither_tells_anything_both_may_be_asked(coarse: TriangleMesh, key: Key) -> None:
    """Of an unmarked mesh: all that was tried is charged, and nothing is found."""
    read = METHOD.extract(coarse, len(BITS), key)
    assert read.part == ""
    assert read.detect(BITS).p_value > 1e-3
    assert read.charges is not None
    assert (1.0 / read.charges).sum() <= 1.0 + 1e-12


WHOLE = [name for name, each in OLD.items() if each["profile"] == "robust-2026" and not each["attacks"]]


@pytest.mark.parametrize("name", WHOLE)
def test_marks_of_the_solid_alone_are_read(name: str, key: Key, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of earlier versions, by the method as it is asked for by name."""
    monkeypatch.setattr(LocalPatches, "extract", asked)
    mesh, method, old = read_mesh(GOLDEN / "marks" / name), METHODS.make("layered"), OLD[name]
    if "bits" in old:
        read = method.extract(mesh, len(old["bits"]), key)
        assert "".join(map(str, read.bits)) == old["bits"]
    else:
        assert replace(PROFILES["robust-2026"], method=method).extract(mesh, key).message == old["message"]


def test_what_patches_show_is_worked_out_once_and_when_it_is_asked_for() -> None:
    class Whole:
        received = "the surface"

    looks = []
    seen = Seen(Whole(), lambda surface: looks.append(surface) or f"look {len(looks)}")  # type: ignore[arg-type, return-value]
    assert looks == []
    assert seen.patches == seen.patches == "look 1"
    assert looks == ["the surface"]
    assert METHOD.observe(seen) is seen


@pytest.mark.parametrize("spec", ["mrms=0", "mrms=0.0006,total=0.0006", "jnd=0", "radius=1"])
def test_options_are_checked(spec: str) -> None:
    with pytest.raises(SpecError):
        METHODS.make(f"layered:{spec}")


def test_what_a_writer_may_choose_is_nothing_to_the_reader() -> None:
    other = Layered(mrms=1e-4, total=2e-4, jnd=0.5, search=False)
    assert other.sight == METHOD.sight == METHOD.layers["solid"].sight
    assert METHOD.quick == Layered(search=False)
    assert METHOD.quick.quick == METHOD.quick


# Extractions beside each other


def some_reading(rng: np.random.Generator, kind: int) -> Extraction:
    """Of noise: with one reading, with several, and with several that are charged each in its own way."""
    if kind == 0:
        return Extraction(rng.standard_normal(16))
    readings = rng.standard_normal((3, 16))
    if kind == 1:
        return Extraction(readings[0], hypotheses=3, readings=readings)
    return Extraction(readings[0], hypotheses=2, readings=readings, charges=np.array([2, 4, 4]), log10_p=0.0)


@pytest.mark.parametrize("kinds", [(0, 0), (0, 2), (1, 2), (2, 1)])
def test_two_extractions_share_the_evidence(kinds: tuple[int, int]) -> None:
    """Each charged for half: the sum of the inverses is 1 at most, and every reading of either is among them."""
    one, other = (some_reading(np.random.default_rng(kind), kind).times(2) for kind in kinds)
    both = one.beside(other)
    assert both.readings is not None
    assert both.charges is not None
    assert (1.0 / both.charges).sum() <= 1.0 + 1e-12
    assert np.array_equal(both.soft, one.soft)
    asked_for = [each.soft[None] if each.readings is None else each.readings for each in (one, other)]
    assert sorted(map(tuple, both.readings)) == sorted(map(tuple, np.concatenate(asked_for)))
    assert (both.hypotheses, both.log10_p, both.part) == (one.hypotheses, one.log10_p, one.part)


def test_the_better_of_two_is_found_whichever_is_preferred() -> None:
    rng = np.random.default_rng(1)
    good, bad = Extraction(np.ones(24)), Extraction(rng.standard_normal(24))
    alone = good.detect(np.ones(24)).log10_p
    for both in (good.times(2).beside(bad.times(2)), bad.times(2).beside(good.times(2))):
        assert both.detect(np.ones(24)).log10_p == pytest.approx(alone + math.log10(2.0))


def test_no_test_is_rejected_more_often_than_its_rate() -> None:
    """Of noise beside noise, with uniform p-values of what is shown."""
    rng, found = np.random.default_rng(2), []
    for i in range(1000):
        shown = replace(some_reading(rng, 2), log10_p=math.log10(1.0 - rng.random()))
        both = shown.times(2).beside(some_reading(rng, i % 3).times(2))
        found.append(both.detect(np.ones(16)).log10_p)
    for rate in (0.5, 0.1, 0.01):
        assert np.mean(np.array(found) <= math.log10(rate)) < rate + 4.0 * math.sqrt(rate / 1000)
    assert np.mean(np.array(found) < 0.0) > 0.1  # and not for want of power


# Deeper searches


def test_what_else_is_looked_for_reaches_the_patches(
    coarse: TriangleMesh, key: Key, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And neither the first sight nor the solid, which needs no telling."""
    told: list[Depth] = []

    def extract(method: Any, *_: Any, **__: Any) -> Extraction:
        if isinstance(method, LocalPatches):
            told.append(Depth(method.mirrored, method.any_scale))
        return Extraction(np.zeros(64), log10_p=0.0, coherence=0.0)

    for method in (LocalPatches, ShapeSpectrum):
        monkeypatch.setattr(method, "extract", extract)
    depths = [NO_DEEPER, Depth(any_scale=True), Depth(mirrored=True)]
    for depth in depths:
        marking.extract(coarse, PROFILES["layered-2026"], key, depth=depth)
    assert told == depths
    assert Layered(any_scale=True, mirrored=True).quick == Layered(search=False)
    assert ShapeSpectrum().searching(Depth(any_scale=True)) == ShapeSpectrum()


# How well eyes see, by which places are chosen


def test_acuity_is_highest_where_nothing_masks(spot: TriangleMesh) -> None:
    """A plane has the acuity of bare thresholds, all over; the rougher a surface, the lower."""
    plane = Surface.of(TriangleMesh.create_box(1.0, 1.0, 1e-9).subdivide_midpoint(4))
    surface = Surface.of(spot)
    smooth = Visibility(surface).acuity
    bumps = np.random.default_rng(0).standard_normal((len(surface.vertices), 1))
    rough = Visibility(surface.moved(surface.vertices + 2e-3 * surface.diagonal * bumps * surface.normals)).acuity
    inside = np.all(np.abs(plane.vertices[:, :2] - 0.5) < 0.1, axis=1)
    bare = Visibility(plane)
    thresholds = np.sqrt(sum(bare._threshold(0.005 * 2.0**band) ** -2.0 for band in range(4)))
    assert np.all(smooth <= thresholds * (1.0 + 1e-9))
    assert inside.any()
    np.testing.assert_allclose(bare.acuity[inside], thresholds, rtol=0.05)
    assert np.median(rough) < 0.7 * np.median(smooth)


def test_acuity_tells_how_much_of_a_small_motion_is_seen(spot: TriangleMesh) -> None:
    """The same contrast all over is seen best where the acuity is highest."""
    surface = Surface.of(spot)
    visibility = Visibility(surface)
    wave = np.sin(40.0 * surface.vertices @ [1.0, 2.0, 3.0] / surface.diagonal)
    after = surface.moved(surface.vertices + 1e-4 * surface.diagonal * wave[:, None] * surface.normals)
    seen, acuity = visibility.local(after), visibility.acuity
    assert acuity.shape == seen.shape
    assert np.corrcoef(np.log(seen), np.log(acuity))[0, 1] > 0.3
