"""What a received surface may be taken for, and what a reader makes of it: welded, as wound, without what is added."""

import numpy as np
import pytest

from fixtures.shapes import icosphere
from o3dmark.attacks import ATTACKS, attack_all
from o3dmark.coding.keys import Key
from o3dmark.mesh.inside import pieces, seen, within
from o3dmark.mesh.surface import Surface, TriangleMesh, mesh_arrays, triangle_mesh, with_vertices
from o3dmark.mesh.welding import ladder, mended, open_edges, welded
from o3dmark.profiles import PROFILES
from o3dmark.received import MOST, views
from o3dmark.solid.solid import Solid

MARK = PROFILES["robust-2026"]


def together(*parts: tuple[np.ndarray, np.ndarray]) -> Surface:
    start = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    triangles = [t + first for (_, t), first in zip(parts, start, strict=False)]
    return Surface.from_arrays(np.concatenate([v for v, _ in parts]), np.concatenate(triangles))


def ball(radius: float = 1.0, centre: float = 0.0, level: int = 3) -> tuple[np.ndarray, np.ndarray]:
    vertices, triangles = icosphere(level)
    return radius * vertices + [centre, 0.0, 0.0], triangles


def names(surface: Surface) -> list[str]:
    return [view.name for view in views(surface)]


class TestWelding:
    def test_a_soup_is_closed_by_the_first_tolerance_that_reaches(self, spot: TriangleMesh) -> None:
        whole = Surface.of(spot)
        soup = Surface.of(ATTACKS.make("soup:jitter=1e-7")(spot, 1))
        assert open_edges(soup) == len(soup.vertices) == 3 * len(whole.triangles)
        again = mended(soup)
        assert open_edges(again) == 0
        assert len(again.vertices) == len(whole.vertices)
        assert len(again.triangles) == len(whole.triangles)

    def test_a_closed_surface_is_left_alone(self, spot: TriangleMesh) -> None:
        surface = Surface.of(spot)
        assert mended(surface) is surface
        assert welded(surface, 1.0) is surface
        assert ladder(surface) == []

    def test_a_fine_mesh_does_not_collapse(self, spot: TriangleMesh) -> None:
        """Only open edges are welded: a hole's rim, however large the tolerance."""
        surface = Surface.of(ATTACKS.make("holes:share=0.01,count=1")(spot, 1))
        coarse = welded(surface, 0.1 * surface.diagonal)
        assert len(surface.vertices) - len(coarse.vertices) < 0.05 * len(surface.vertices)

    def test_every_vertex_of_the_mesh_is_found_again(self, spot: TriangleMesh) -> None:
        soup = ATTACKS.make("soup:jitter=1e-7")(spot, 1)
        vertices, _ = mesh_arrays(soup)
        again = mended(Surface.of(soup))
        away = np.linalg.norm(again.vertices[again.vertex_map] - vertices, axis=1)
        assert away.max() < 1e-6 * again.diagonal

    def test_what_was_merged_moves_alike(self, spot: TriangleMesh) -> None:
        """By as much, not to the same place: what was apart stays apart."""
        soup = ATTACKS.make("soup:jitter=1e-7")(spot, 1)
        surface = mended(Surface.of(soup))
        motion = np.random.default_rng(0).standard_normal(surface.vertices.shape)
        after = mesh_arrays(with_vertices(soup, surface, surface.vertices + motion))[0]
        np.testing.assert_allclose(after - mesh_arrays(soup)[0], motion[surface.vertex_map], atol=1e-12)

    def test_a_cluster_of_vertices_costs_no_more_than_they_are(self) -> None:
        rng = np.random.default_rng(0)
        points = np.concatenate([1e-9 * rng.standard_normal((30_000, 3)), rng.standard_normal((30_000, 3))])
        found = ladder(Surface.from_arrays(points, np.arange(60_000).reshape(-1, 3)))
        assert len(found[0].vertices) <= 30_000


class TestInside:
    def test_pieces_hang_together_by_edges(self) -> None:
        v, t = ball()
        touching = together((v, t), (v[::-1] * 0.5 + v[0] - 0.5 * v[0], len(v) - 1 - t[:, ::-1]))
        piece = pieces(touching)
        assert set(piece) == {0, 1}
        assert np.bincount(piece)[0] == len(t)

    def test_a_ball_in_a_ball_is_within_it_whichever_way_it_is_wound(self) -> None:
        v, t = ball(0.4)
        for triangles in (t, t[:, ::-1]):
            surface = together(ball(), (v, triangles), ball(0.3, 3.0))
            np.testing.assert_array_equal(within(surface, pieces(surface), 3), [False, True, False])

    def test_what_nobody_sees_is_inside(self) -> None:
        surface = together(ball(), ball(0.4))
        visible = seen(surface)
        assert visible[: len(ball()[1])].all()
        assert not visible[len(ball()[1]) :].any()


class TestViews:
    def test_a_closed_surface_has_one(self, spot: TriangleMesh) -> None:
        assert names(Surface.of(spot)) == [""]

    def test_an_open_one_also_as_it_is_wound(self, spot: TriangleMesh) -> None:
        found = list(views(Surface.of(ATTACKS.make("crop:share=0.3")(spot, 1))))
        assert [view.name for view in found[:2]] == ["", "as wound"]
        assert found[1].surface.as_wound

    def test_pieces_largest_first_and_the_outermost(self) -> None:
        surface = together(ball(0.5), ball(1.0, 4.0), ball(0.4, 4.0))
        assert names(surface) == ["", "outermost", "piece 1, by area", "piece 2, by area", "piece 3, by area"]
        sizes = [view.surface.area for view in views(surface)]
        assert sizes[2] > sizes[3] > sizes[4]
        assert sizes[1] == pytest.approx(sizes[2] + sizes[3])

    def test_specks_are_left_out(self) -> None:
        surface = together(ball(), ball(1e-3, 100.0, 1))
        assert names(surface) == ["", "outermost and large"]

    def test_there_are_never_more_than_so_many(self) -> None:
        surface = together(*(ball(1.0, 3.0 * number, 2) for number in range(40)))
        assert 1 < len(names(surface)) <= MOST

    def test_as_wound_the_solid_is_the_sum_of_its_triangles(self, spot: TriangleMesh) -> None:
        surface = Surface.of(spot)
        soup = Surface(*(np.array(each) for each in (surface.vertices, surface.triangles, surface.vertex_map)), True)
        for triangles in (soup.triangles, soup.triangles[:, ::-1].copy()):
            solid = Solid.of(Surface(np.array(soup.vertices), triangles, np.array(soup.vertex_map), as_wound=True))
            np.testing.assert_allclose(solid.area_vectors, Solid.of(surface).area_vectors)


@pytest.fixture(scope="module")
def marked(spot: TriangleMesh, key: Key) -> TriangleMesh:
    return MARK.embed(spot, "mine", key)


EDITS = {
    "soup:jitter=1e-9": "",
    "soup:jitter=1e-4": "as wound",
    "soup:jitter=1e-6,flipped=0.5": "",
    "crack:pieces=600,gap=1e-4": "",
    "twice": None,
    "inside:size=0.05": None,
    "inside:kind=shell,size=0.5": None,
    "speck:distance=1000": "outermost and large",
    "dust": "outermost and large",
    "scene": None,
    "plate:copies=1,base=true": None,
}


@pytest.mark.parametrize("edit", EDITS)
def test_what_leaves_the_visible_surface_alone_leaves_the_mark(edit: str, marked: TriangleMesh, key: Key) -> None:
    reading = MARK.extract(attack_all(marked, [edit], 3), key)
    assert reading.message == "mine"
    if (part := EDITS[edit]) is not None and not edit.startswith("soup:jitter=1e-4"):
        assert reading.extraction.part == part


def test_a_wrong_key_reads_nothing_in_any_view(marked: TriangleMesh) -> None:
    reading = MARK.extract(attack_all(marked, ["plate:copies=2,base=true"], 3), Key(bytes(32)))
    assert reading.message is None
    assert reading.p_value > 1e-2


@pytest.mark.parametrize("torn", ["soup:jitter=1e-7", "crack:gap=1e-6"])
def test_the_writer_sees_a_torn_surface_as_the_reader_does(torn: str, spot: TriangleMesh, key: Key) -> None:
    """A mark on a torn surface is read from that, and from the surface that a repair tool makes of it."""
    mesh = ATTACKS.make(torn)(spot, 1)
    after = MARK.embed(mesh, "mine", key)
    assert np.asarray(after.triangles).tolist() == np.asarray(mesh.triangles).tolist()
    assert MARK.extract(after, key).message == "mine"
    repaired = mended(Surface.of(after))
    assert MARK.extract(triangle_mesh(repaired.vertices, repaired.triangles), key).message == "mine"
