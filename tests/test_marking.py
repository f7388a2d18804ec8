"""Marks in files: each part that holds one is marked, what is written is read back, any part may speak."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fixtures.npz_asset import Npz, npz
from fixtures.paths import GOLDEN
from fixtures.shapes import UNIT_SQUARE, icosphere, rotation
from o3dmark import marking
from o3dmark.coding.keys import Key
from o3dmark.errors import CapacityError, MeshError, SpecError
from o3dmark.files import ASSETS, Asset, Source, open_asset, read_mesh
from o3dmark.mesh.patch import Patch
from o3dmark.mesh.surface import Surface, TriangleMesh, mesh_arrays, point_cloud, triangle_mesh
from o3dmark.methods import METHODS, Extraction
from o3dmark.profiles import DEFAULT_PROFILE, PROFILES
from o3dmark.watermark import Watermark

MARK = replace(PROFILES["robust-2026"], n_bits=43)
Opened = Callable[..., Asset]


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> Opened:
    """Meshes as an asset of the tests' own format."""
    monkeypatch.setitem(ASSETS, ".npz", Npz)
    return lambda *meshes: open_asset(Source(Path("scene.npz"), {"scene.npz": npz(meshes)}))


@pytest.fixture(scope="module")
def spot_arrays(spot: TriangleMesh) -> tuple[np.ndarray, np.ndarray]:
    return mesh_arrays(spot)


def after(asset: Asset, marked: marking.Marked) -> Asset:
    return open_asset(Source(asset.path, marked.files))


def test_what_was_written_is_read(opened: Opened, spot_arrays, key: Key) -> None:
    asset = opened(spot_arrays)
    marked = marking.embed(asset, MARK, "me", key)
    assert marked.verified
    assert [part.name for part in marked.parts] == ["mesh 0"]
    found = marking.extract(after(asset, marked), MARK, key)
    assert (found.part, found.reading.message) == ("mesh 0", "me")
    assert not marking.extract(asset, MARK, key).reading.found
    np.testing.assert_array_equal(asset.parts[0].vertices, spot_arrays[0])
    ((before, new),) = marked.pairs()
    assert 1e-4 < np.abs(np.asarray(new.vertices) - np.asarray(before.vertices)).max() < 0.01


def test_how_strong_it_came_out_is_told_and_what_held_it_back(opened: Opened, spot_arrays, key: Key) -> None:
    asset = opened(spot_arrays)
    for spec, by, word in (
        ("shape-spectrum", "cap", "the cap holds it back"),
        ("shape-spectrum:mrms=0.002", "jnd", "what eyes see holds it back, at "),
        ("saliency-scs:step=0.02", None, "just noticeable differences"),
    ):
        mark = replace(MARK, method=METHODS.make(spec))
        found = marking.strength(marking.embed(asset, mark, "me", key), mark.method)
        assert found is not None
        assert found.by == found.to_dict()["strength_by"] == by
        assert word in found.words
        assert by is None or 0.7 < max(found.jnd, found.mrms / mark.method.mrms) <= 1.01
    assert marking.strength(marking.Marked(asset, {}, {}), MARK.method) is None


def test_each_part_is_marked_and_what_cannot_be_is_left_and_named(opened: Opened, spot_arrays, key: Key) -> None:
    vertices, triangles = spot_arrays
    asset = opened(UNIT_SQUARE, (vertices, triangles), (3.0 * vertices[:, ::-1] + 100.0, triangles[:, ::-1]))
    marked = marking.embed(asset, MARK, "me", key)
    assert list(marked.moved) == [1, 2]
    assert [each.part for each in marked.left] == ["mesh 0"]
    assert "43 bits asked for" in marked.left[0].why
    written = after(asset, marked)
    np.testing.assert_array_equal(written.parts[0].vertices, UNIT_SQUARE[0])
    for number in (1, 2):
        assert MARK.extract(triangle_mesh(written.parts[number].vertices, triangles), key).message == "me"


def test_when_no_part_holds_the_mark_the_largest_says_why(opened: Opened, key: Key) -> None:
    with pytest.raises(CapacityError, match="43 bits asked for"):
        marking.embed(opened(UNIT_SQUARE), MARK, "me", key)
    with pytest.raises(MeshError, match=r"none of the 2 meshes of scene\.npz.* the largest, mesh 1: .*as symmetric"):
        marking.embed(opened(UNIT_SQUARE, icosphere(4)), MARK, "me", key)
    with pytest.raises(MeshError, match="holds no mesh of triangles"):
        marking.embed(opened(), MARK, "me", key)


def test_numbers_too_coarse_are_told_before_anything_is_computed(
    opened: Opened, spot_arrays, key: Key, monkeypatch: pytest.MonkeyPatch
) -> None:
    vertices, triangles = spot_arrays
    monkeypatch.setattr(Watermark, "prepare", lambda *_: pytest.fail("it was computed"))
    with pytest.raises(MeshError, match=r"lie 0\.5 apart, the mesh measures"):
        marking.embed(opened(((vertices + 5e6).astype(np.float32), triangles)), MARK, "me", key)


def test_a_part_that_does_not_tell_the_mark_from_its_numbers_is_left(
    opened: Opened, spot_arrays, key: Key, monkeypatch: pytest.MonkeyPatch
) -> None:
    asset = opened(spot_arrays, spot_arrays)
    with_positions = Npz.with_positions

    def rounded(self: Npz, moved, names=None):  # the second part's numbers are too coarse after all
        return with_positions(self, {number: np.round(v, 1 if number else 9) for number, v in moved.items()}, names)

    monkeypatch.setattr(Npz, "with_positions", rounded)
    marked = marking.embed(asset, MARK, "me", key)
    assert list(marked.moved) == [0]
    assert [(each.part, "cannot be read back" in each.why) for each in marked.left] == [("mesh 1", True)]
    np.testing.assert_array_equal(after(asset, marked).parts[1].vertices, asset.parts[1].vertices)
    alone = marking.embed(opened(UNIT_SQUARE, spot_arrays), MARK, "me", key)
    assert (alone.verified, dict(alone.files), len(alone.left)) == (False, {}, 2)


def test_raw_bits(opened: Opened, spot_arrays, key: Key) -> None:
    bits = np.array([0, 1] * 8)
    asset = opened(spot_arrays)
    marked = marking.embed(asset, Watermark(n_bits=16), bits, key)
    written = triangle_mesh(after(asset, marked).parts[0].vertices, spot_arrays[1])
    np.testing.assert_array_equal(Watermark(n_bits=16).extract_bits(written, key).bits, bits)


def test_the_views_of_a_file_are_its_parts_and_all_of_it(opened: Opened, spot_arrays) -> None:
    vertices, triangles = spot_arrays
    assert [view.part for view in marking.views(opened(spot_arrays), MARK.method)] == ["mesh 0"]
    scene = opened(icosphere(2), UNIT_SQUARE, (vertices + 9.0, triangles))
    assert [view.part for view in marking.views(scene, MARK.method)] == ["mesh 2", "mesh 0", "all of it"]
    cloud = point_cloud(vertices)
    assert [view.shape for view in marking.views(cloud, MARK.method)] == [cloud]
    with pytest.raises(MeshError, match="holds no mesh of triangles"):
        marking.views(opened(), MARK.method)


def test_patches_are_told_where_the_file_has_them(opened: Opened, spot_arrays) -> None:
    """A part's own frame is not the file's: each place that the file gives it has the patch."""
    mirrored, moved, flat = np.diag([-2.0, 2.0, 2.0, 1.0]), np.eye(4), np.diag([1.0, 1.0, 0.0, 1.0])
    moved[:3, :3], moved[:3, 3] = 0.1 * rotation(2), [5.0, 6.0, 7.0]
    scene = opened(spot_arrays)
    scene.parts = (replace(scene.parts[0], placements=np.stack([moved, mirrored, flat])),)
    own, file = Surface.from_arrays(*spot_arrays), Surface.of(scene.mesh())
    patch = Patch(own.vertices[7], own.normals[7], 0.1, 0.08)
    told = Extraction(np.ones(8), patches=(patch,))
    for method in (MARK.method, PROFILES["tiny-2026"].method):
        for view in marking.views(scene, method):
            found = view.patches(told)
            assert [each.radius for each in found] == pytest.approx([0.01, 0.2])
            for number, each in enumerate(found):
                vertex = 7 + number * len(own.vertices)
                assert each.centre == pytest.approx(file.vertices[vertex])
                assert each.axis == pytest.approx(file.normals[vertex])
    (stays,) = marking.views(triangle_mesh(*spot_arrays), MARK.method)[0].patches(told)
    assert stays.centre == pytest.approx(patch.centre)


def test_patches_are_found_in_the_first_part_that_has_any(opened: Opened, key: Key, spot_arrays) -> None:
    """All looks charged, in any pose that the scene gives the part; a method without patches is refused."""
    half = mesh_arrays(read_mesh(GOLDEN / "marks" / "fragment.ply"))
    alone, scene = opened(half), opened(icosphere(2), half)
    far = np.eye(4)
    far[:3, :3], far[:3, 3] = 0.1 * rotation(2), [5.0, 6.0, 7.0]
    scene.parts = (scene.parts[0], replace(scene.parts[1], placements=far[None]))
    one, other = (marking.patches_found(each, None, key) for each in (alone, scene))
    assert (one.part, len(one.patches)) == ("mesh 0", 2)
    assert other.part == "mesh 1"
    for here, there in zip(one.patches, other.patches, strict=True):
        assert np.allclose(here.placed(far).centre, there.centre)
    assert other.log10_p == pytest.approx(one.log10_p + np.log10(2 + 1), abs=0.01)
    assert one.log10_p < -15.0
    with pytest.raises(SpecError, match="no patches; profiles that have: layered-2026"):
        marking.patches_found(alone, MARK, key)


def test_for_a_method_that_does_not_look_for_pieces_they_are_views(spot_arrays) -> None:
    vertices, triangles = spot_arrays
    plate = triangle_mesh(np.vstack([vertices, vertices + 9.0]), np.vstack([triangles, triangles + len(vertices)]))
    views = marking.views(plate, PROFILES["tiny-2026"].method)
    assert [view.part for view in views] == ["all of it", "piece 1, by area", "piece 2, by area"]
    assert [len(view.shape.triangles) for view in views[1:]] == [len(triangles)] * 2
    assert len(marking.views(plate, MARK.method)) == 1


def test_a_print_plate_is_read_by_its_pieces_and_they_are_charged(spot_arrays, key: Key) -> None:
    vertices, triangles = spot_arrays
    marked = MARK.embed(triangle_mesh(vertices, triangles), "me", key)
    alone = marking.extract(marked, MARK, key)
    moved = np.asarray(marked.vertices) + np.array([9.0, 0, 0])
    both = np.vstack([np.asarray(marked.vertices), moved])
    plate = triangle_mesh(both, np.vstack([triangles, triangles + len(vertices)]))
    found = marking.extract(plate, MARK, key)
    assert (found.reading.message, found.part) == ("me", "all of it: piece 1, by area")
    assert found.reading.extraction.hypotheses > alone.reading.extraction.hypotheses
    assert found.reading.decoded.log10_p > alone.reading.decoded.log10_p
    known = marking.detect(plate, MARK, key, "me")
    assert known.detection.present
    assert not marking.detect(plate, MARK, Key(bytes(32)), "me").detection.present
    other = marking.detect(plate, MARK, key, "us")
    assert (other.detection.present, other.detection.other) == (False, "me")
    assert other.part == "all of it: piece 1, by area"


class TestProfiles:
    def test_where_nobody_says_which_profile_all_are_tried(self, spot_arrays, key: Key) -> None:
        mesh = triangle_mesh(*spot_arrays)
        marked = PROFILES["slender-2026"].embed(mesh, "me", key)
        found, known = marking.extract(marked, None, key), marking.detect(marked, None, key, "me")
        assert found.reading.message == "me"
        assert known.detection.present
        assert found.profile == known.profile == "slender-2026"

    def test_the_default_pays_half_and_the_others_share_the_rest(self, spot_arrays, key: Key) -> None:
        marked = PROFILES["robust-2026"].embed(triangle_mesh(*spot_arrays), "me", key)  # a layer of the default's
        one, all_ = (marking.extract(marked, mark, key).reading for mark in (PROFILES[DEFAULT_PROFILE], None))
        assert all_.decoded.log10_p == pytest.approx(one.decoded.log10_p + np.log10(2), abs=1e-3)

    def test_the_first_profile_that_holds_the_message_is_taken(self, opened: Opened, spot_arrays, key: Key) -> None:
        vertices, triangles = spot_arrays
        asset = opened((vertices * [1.0, 12.0, 1.0], triangles))
        chosen = marking.embed_by_any(asset, "mine", key)
        assert chosen.profile == "slender-2026"
        assert "too slender" in chosen.refused["layered-2026"]
        assert marking.extract(after(asset, chosen.marked), None, key).reading.message == "mine"

    def test_a_refusal_says_what_each_profile_said(self, opened: Opened, key: Key) -> None:
        with pytest.raises(MeshError, match=r"no profile does: layered-2026: .*; tiny-2026: "):
            marking.embed_by_any(opened(UNIT_SQUARE), "m", key)

    def test_a_message_that_no_profile_can_hold_is_one(self, opened: Opened, spot_arrays, key: Key) -> None:
        with pytest.raises((SpecError, MeshError), match=r"too long|bytes"):
            marking.embed_by_any(opened(spot_arrays), "x" * 99, key)


def test_of_two_messages_in_a_file_each_is_there(opened: Opened, spot_arrays, key: Key) -> None:
    triangles = spot_arrays[1]
    marked = [np.asarray(MARK.embed(triangle_mesh(*spot_arrays), who, key).vertices) for who in ("me", "us")]
    both = opened((marked[0], triangles), (marked[1], triangles))
    found = {who: marking.detect(both, MARK, key, who) for who in ("me", "us", "it")}
    assert [(who, each.part, each.detection.present) for who, each in found.items()] == [
        ("me", "mesh 0", True),
        ("us", "mesh 1", True),
        ("it", "mesh 0", False),
    ]
    assert found["it"].detection.other == "me"


def test_what_cannot_be_looked_at_is_passed_over_unless_it_is_everything(opened: Opened, spot_arrays, key: Key) -> None:
    flat = (np.zeros((3, 3)), np.array([[0, 1, 2]]))
    marked = MARK.embed(triangle_mesh(*spot_arrays), "me", key)
    found = marking.extract(opened(mesh_arrays(marked), flat), MARK, key)
    assert (found.part, found.reading.message) == ("mesh 0", "me")
    with pytest.raises(MeshError, match="no triangle with three different corners"):
        marking.extract(opened(flat), MARK, key)


class TestAdvice:
    def test_a_profile_that_holds_the_message_is_named(self, opened: Opened, spot_arrays, key: Key) -> None:
        vertices, triangles = spot_arrays
        slender = opened((vertices * [1.0, 12.0, 1.0], triangles))
        advice = marking.advice(slender, PROFILES["robust-2026"], "mine", key)
        name = advice.split()[1]
        assert name != "robust-2026"
        assert marking.embed(slender, PROFILES[name], "mine", key).verified

    def test_or_how_many_bytes_one_holds(self, opened: Opened, spot_arrays, key: Key) -> None:
        small = triangle_mesh(*spot_arrays).simplify_quadric_decimation(800)
        asset = opened(mesh_arrays(small))
        advice = marking.advice(asset, PROFILES["robust-2026"], "mine", key)
        assert "holds a message of 1 byte in this mesh" in advice or "holds a message of 2 bytes" in advice

    def test_or_that_none_does(self, opened: Opened, key: Key) -> None:
        assert "none of the profiles" in marking.advice(opened(UNIT_SQUARE), PROFILES["robust-2026"], "mine", key)

    @pytest.mark.slow
    def test_what_the_file_s_numbers_cannot_hold_is_not_advised(self, opened: Opened, spot_arrays, key: Key) -> None:
        """At 1e5 float32 numbers lie 0.008 apart, a hundredth of what spot measures in width: no profile is read."""
        vertices, triangles = spot_arrays
        asset = opened(((vertices + 1.2e5).astype(np.float32), triangles))
        marked = marking.embed(asset, PROFILES["robust-2026"], "mine", key)
        if not marked.verified:
            assert "lie 0.00781 apart" in marked.left[0].why
            name = marking.advice(asset, PROFILES["robust-2026"], "mine", key).split()[1]
            assert name not in PROFILES or marking.embed(asset, PROFILES[name], "mine", key).verified

    def test_nothing_is_advised_where_the_file_is_to_blame(self, opened: Opened, spot_arrays, key: Key) -> None:
        vertices, triangles = spot_arrays
        damaged = vertices.copy()
        damaged[0] = np.nan
        assert marking.advice(opened((damaged, triangles)), PROFILES["robust-2026"], "mine", key) == ""
        far = opened(((vertices + 5e6).astype(np.float32), triangles))
        assert marking.advice(far, PROFILES["robust-2026"], "mine", key) == ""
