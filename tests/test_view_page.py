"""The page for a browser: what its script is given, and what a browser shows of it."""

import base64
import hashlib
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import open3d as o3d
import pytest

from fixtures.browser import Page, browser
from fixtures.paths import ROOT
from fixtures.shapes import mapped
from o3dmark.errors import MeshError, SpecError
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface, TriangleMesh, mesh_arrays, point_cloud, triangle_mesh
from o3dmark.view import Camera, Shown, render, write_page
from o3dmark.view.page import page
from o3dmark.view.page.buffers import TYPES
from o3dmark.view.page.corners import Corners
from o3dmark.view.texture import Texture

FOLDER = ROOT / "o3dmark" / "view" / "page"
THREE = "7a02597015cdd7e88f57b1ac02045fbb562640b5dea1a1e21f9384321159426d"  # of three.min.js, by scripts/bundle_three
RED, BLUE = [0.9, 0.1, 0.1], [0.1, 0.1, 0.9]
FRONT = Camera.parse("front")


def scene_of(text: str) -> dict[str, Any]:
    """What the script of a page is given."""
    (scene,) = re.findall(r'<script type="application/json" id="scene">(.*?)</script>', text, re.DOTALL)
    return json.loads(scene)


def array(scene: dict[str, Any], told: dict[str, Any], width: int = 3) -> np.ndarray:
    """A buffer of a scene, in rows."""
    return np.frombuffer(base64.b64decode(scene["buffers"][told["data"]]), TYPES[told["type"]]).reshape(-1, width)


def waved(mesh: TriangleMesh, height: float) -> TriangleMesh:
    """A mesh whose vertices move along x by at most ``height``, up and down along y."""
    return mapped(mesh, lambda v: v + [height, 0.0, 0.0] * np.sin(20.0 * v[:, 1:2]))


def test_three_js_is_what_the_script_makes_and_its_licence_is_beside_it() -> None:
    assert hashlib.sha256((FOLDER / "three.min.js").read_bytes()).hexdigest() == THREE
    assert "SPDX-License-Identifier: MIT" in (FOLDER / "three.min.js").read_text(encoding="utf-8")
    assert "Permission is hereby granted" in (FOLDER / "three.LICENSE").read_text(encoding="utf-8")
    parts = (ROOT / "scripts" / "bundle_three").read_text(encoding="utf-8")
    used = {
        name.strip()
        for script in FOLDER.glob("[!t]*.js")
        for names in re.findall(r'import \{([^}]*)\} from "three"', script.read_text(encoding="utf-8"))
        for name in names.split(",")
        if name.strip()
    }
    assert used == set(re.findall(r"\b[A-Z]\w+\b", "".join(re.findall(r"export \{(.*?)\}", parts, re.DOTALL))))


@pytest.mark.parametrize("height", [1e-3, 1e-9])
def test_displacements_keep_their_digits_whatever_their_size_and_the_mesh_s_place(
    spot: TriangleMesh, height: float
) -> None:
    cover = mapped(spot, lambda v: 40.0 * v + 7.0)
    marked = waved(cover, height)
    scene = scene_of(page([Shown("a", cover), Shown("b", marked)]))
    first, second = scene["meshes"]
    before, after = mesh_arrays(cover)[0], mesh_arrays(marked)[0]
    diagonal = geometry.diagonal(before)
    places = array(scene, first["positions"]).astype(float) * diagonal + geometry.box_centre(before)
    assert np.abs(places - before).max() <= 1.0001 * scene["rounding"] * diagonal
    assert 0 < scene["rounding"] < 4e-8
    np.testing.assert_allclose(array(scene, second["positions"]) * diagonal, after - before, rtol=3e-7, atol=1e-20)
    lengths = array(scene, second["quantities"]["displacement"]["values"], 1)[:, 0]
    np.testing.assert_allclose(lengths, 100.0 * np.linalg.norm(after - before, axis=1) / diagonal, rtol=3e-7)


def test_what_two_meshes_share_is_kept_once(spot: TriangleMesh) -> None:
    alone, pair = (
        scene_of(page([Shown("a", each) for each in meshes])) for meshes in ([spot], [spot, waved(spot, 1e-3)])
    )
    assert pair["meshes"][0]["surface"] == pair["meshes"][1]["surface"]
    assert len(pair["buffers"]) == len(alone["buffers"]) + 2  # displacements, and their lengths


def test_other_meshes_are_compared_where_they_lie_beside_the_first(spot: TriangleMesh) -> None:
    fewer = spot.simplify_quadric_decimation(2000)
    away = mapped(fewer, lambda v: 5.0 * v + 100.0)
    scene = scene_of(page([Shown("spot", spot), Shown("fewer", fewer), Shown("away", away)]))
    _, beside, apart = scene["meshes"]
    assert beside["quantities"]["displacement"]["label"] == "distance from spot, % of the bounding-box diagonal"
    assert "place and size of its own" not in beside["caption"]
    assert apart["quantities"] == {}
    assert "place and size of its own" in apart["caption"]
    assert scene["factors"] == []
    places = array(scene, apart["positions"])
    assert geometry.diagonal(places) == pytest.approx(1.0, abs=1e-6)


def test_corners_are_split_at_creases_and_share_normals_across_seams(ball: TriangleMesh) -> None:
    box = TriangleMesh.create_box(1.0, 1.0, 1.0)
    made = Corners.of(box, Surface.of(box), None)
    assert (len(made.point), len(np.unique(made.group))) == (24, 24)
    np.testing.assert_array_equal(made.point[made.triangles], mesh_arrays(box)[1])
    smooth = Corners.of(ball, Surface.of(ball), None)
    assert len(smooth.point) == len(np.unique(smooth.group)) == len(ball.vertices)
    seamed = TriangleMesh(ball)
    where = np.random.default_rng(3).random((3 * len(ball.triangles), 2))
    seamed.triangle_uvs = o3d.utility.Vector2dVector(where)
    seamed.textures = [o3d.geometry.Image(np.zeros((2, 2, 3), np.uint8))]
    seamed.triangle_material_ids = o3d.utility.IntVector([0] * len(ball.triangles))
    surface = Surface.of(seamed)
    split = Corners.of(seamed, surface, Texture.of(seamed, surface))
    assert split.uv is not None
    np.testing.assert_array_equal(split.uv[split.triangles.ravel()], where)
    assert (len(split.point), len(np.unique(split.group))) == (len(where), len(ball.vertices))


def test_a_name_is_a_name_and_nothing_is_loaded(ball: TriangleMesh) -> None:
    name = "</script><b>&amp;'\""
    text = page([Shown(name, ball)], title=name)
    assert scene_of(text)["meshes"][0]["name"] == name
    assert "<title>&lt;/script&gt;" in text
    head = re.sub(r"<script.*?</script>|<!--.*?-->", "", text, flags=re.DOTALL)
    assert re.findall(r"https?:|\bsrc=|url\(|@import", head) == []


def test_what_no_page_can_show_is_refused(ball: TriangleMesh) -> None:
    with pytest.raises(ValueError, match="needs a mesh"):
        page([])
    with pytest.raises(SpecError, match=r"clay, gloss, zebra$"):
        page([Shown("ball", ball)], look="saliency")
    with pytest.raises(MeshError, match="one number to each"):
        page([Shown("ball", ball, np.zeros(3))])
    with pytest.raises(MeshError, match="no triangle"):
        page([Shown("nothing", TriangleMesh())])


# What a browser shows


@pytest.fixture(scope="module")
def chromium() -> Iterator[Page]:
    with browser() as opened:
        yield opened
        assert opened.complaints == []


@pytest.fixture
def shown(chromium: Page, tmp_path: Path) -> Any:
    """Opens a page of meshes in the browser."""

    def show(*meshes: Shown, **options: Any) -> Page:
        write_page(tmp_path / "page.html", meshes, **options)
        chromium.open(tmp_path / "page.html")
        assert chromium.state == "drawn"
        return chromium

    return show


def cell(at: Page, number: int) -> np.ndarray:
    """The middle of the picture of a mesh, without its texts."""
    box = at.run(f"JSON.parse(JSON.stringify(document.querySelectorAll('figure')[{number}].getBoundingClientRect()))")
    top, left = round(box["top"]) + 60, round(box["left"]) + 4
    return at.picture()[top : round(box["bottom"]) - 90, left : round(box["right"]) - 4]


def choose(at: Page, group: str, value: str) -> None:
    at.run(f"document.querySelector('[name={group}][value=\"{value}\"]').click()")


def unlike(one: np.ndarray, other: np.ndarray) -> float:
    """The share of pixels that differ to the eye."""
    return float((np.abs(one.astype(int) - other).max(axis=2) > 12).mean())


def test_every_look_is_another_picture_and_the_legend_names_its_unit(shown: Any, spot: TriangleMesh) -> None:
    at = shown(Shown("cover", spot, np.asarray(spot.vertices)[:, 1]), Shown("marked", waved(spot, 2e-3)))
    looks = at.run("[...document.querySelectorAll('[name=look]')].map((input) => input.value)")
    assert looks == ["clay", "gloss", "zebra", "displacement", "saliency"]
    pictures = {}
    for look in looks:
        choose(at, "look", look)
        pictures[look] = [cell(at, 0), cell(at, 1)]
    assert unlike(pictures["clay"][0], pictures["gloss"][0]) > 0.003
    for look in ("zebra", "saliency"):
        assert unlike(pictures["clay"][0], pictures[look][0]) > 0.1
    assert unlike(pictures["clay"][1], pictures["displacement"][1]) > 0.1
    assert unlike(pictures["clay"][0], pictures["displacement"][0]) == 0  # the cover has none
    assert unlike(*pictures["clay"]) < 0.1 * unlike(*pictures["zebra"])  # what the stripes are for
    choose(at, "look", "displacement")
    texts = at.run("[...document.querySelectorAll('figure')].map((figure) => figure.innerText)")
    assert "% of the bounding-box diagonal" in texts[1]
    assert re.search(r"^≥ 0\.07\d+$", texts[1], re.MULTILINE)
    assert "bounding-box" not in texts[0]


def test_keys_and_mouse_turn_all_meshes_alike_and_home_brings_them_back(shown: Any, spot: TriangleMesh) -> None:
    at = shown(Shown("one", spot), Shown("other", spot), camera=FRONT)
    before = cell(at, 0)
    assert unlike(before, cell(at, 1)) == 0
    at.run("document.getElementById('stage').focus()")
    for keys in (("ArrowLeft", 6), ("ArrowUp", 4), ("+", 5)):
        at.press(*keys)
        now = cell(at, 0)
        assert unlike(before, now) > 0.02
        assert unlike(now, cell(at, 1)) == 0
    at.press("Home")
    assert unlike(before, cell(at, 0)) == 0
    at.drag((300.0, 400.0), (420.0, 430.0))
    assert unlike(before, cell(at, 0)) > 0.02
    assert unlike(cell(at, 0), cell(at, 1)) == 0


def test_a_displacement_is_exaggerated_and_nothing_else_moves(shown: Any, spot: TriangleMesh) -> None:
    at = shown(Shown("cover", spot), Shown("marked", waved(spot, 1e-4)))
    cover, marked = cell(at, 0), cell(at, 1)
    assert unlike(cover, marked) < 0.01
    at.run("document.getElementById('factor').focus()")
    at.press("ArrowRight", 6)
    assert at.run("document.getElementById('times').textContent") == "× 100"
    assert "100 times as large" in at.run("document.querySelectorAll('figure')[1].innerText")
    assert unlike(cover, cell(at, 0)) == 0
    hundred = cell(at, 1)
    assert unlike(marked, hundred) > 0.015
    at = shown(Shown("cover", spot), Shown("marked", waved(spot, 1e-2)))
    assert unlike(hundred, cell(at, 1)) < 1e-3  # the same surface, and the same normals
    at = shown(Shown("cover", spot), Shown("marked", waved(spot, 1e-4)), exaggeration=100.0)
    assert unlike(hundred, cell(at, 1)) == 0


def test_digits_show_one_mesh_and_wires_lie_on_it(shown: Any, spot: TriangleMesh) -> None:
    at = shown(Shown("one", spot), Shown("other", spot))
    at.press("2")
    assert at.run("[...document.querySelectorAll('figure')].map((figure) => figure.hidden)") == [True, False]
    before = cell(at, 1)
    assert before.shape[1] > 1000
    at.run("document.getElementById('wires').click()")
    wired = cell(at, 1)
    assert unlike(before, wired) > 0.02
    assert wired.mean() < before.mean()
    at.press("0")
    assert at.run("[...document.querySelectorAll('figure')].some((figure) => figure.hidden)") is False


def quadrants(picture: np.ndarray) -> np.ndarray:
    """The colours (2, 2, 3) in the middle of the four quarters of a picture that a square fills."""
    height, width = picture.shape[:2]
    step = min(height, width) // 6
    rows, columns = [height // 2 - step, height // 2 + step], [width // 2 - step, width // 2 + step]
    return picture[np.ix_(rows, columns)].astype(int)


def test_textures_lie_as_in_pictures_and_colours_of_vertices_and_points_are_shown(shown: Any) -> None:
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    square = triangle_mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))
    square.triangle_uvs = o3d.utility.Vector2dVector((corners[[0, 1, 2, 0, 2, 3], :2] + 1.0) / 2.0)
    four = np.array([[[220, 30, 30], [30, 200, 30]], [[30, 30, 220], [210, 200, 40]]], np.uint8)
    square.textures = [o3d.geometry.Image(four.repeat(32, axis=0).repeat(32, axis=1))]
    square.triangle_material_ids = o3d.utility.IntVector([0, 0])
    grid = np.stack(np.meshgrid(*2 * [np.linspace(-1.0, 1.0, 80)], [0.0]), axis=-1).reshape(-1, 3)
    cloud = point_cloud(grid, np.tile([0.0, 0.0, 1.0], (len(grid), 1)))
    cloud.colors = o3d.utility.Vector3dVector(np.where(grid[:, :1] < 0.0, RED, BLUE))
    tinted = triangle_mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))
    tinted.vertex_colors = o3d.utility.Vector3dVector(np.where(corners[:, :1] < 0.0, RED, BLUE))
    meshes = square, cloud, tinted
    at = shown(*(Shown("x", each) for each in meshes), camera=FRONT)
    for number, mesh in enumerate(meshes):
        expected = quadrants(render(mesh, look="worn", camera=FRONT, size=(300, 300)))
        assert np.abs(quadrants(cell(at, number)) - expected).max() < 30, number


def test_what_is_up_is_up(shown: Any, ball: TriangleMesh) -> None:
    mesh = TriangleMesh(ball)
    mesh.vertex_colors = o3d.utility.Vector3dVector(np.where(np.asarray(ball.vertices)[:, 2:] < 0.0, RED, BLUE))
    (above, _), (below, _) = quadrants(cell(shown(Shown("ball", mesh), camera=Camera(0, 0, up="z")), 0))
    assert above[2] > above[0]
    assert below[0] > below[2]


def test_light_and_dark_follow_the_reader(chromium: Page, ball: TriangleMesh, tmp_path: Path) -> None:
    write_page(tmp_path / "page.html", [Shown("ball", ball)])
    corners = {}
    for scheme in ("light", "dark"):
        chromium.open(tmp_path / "page.html", scheme=scheme)
        corners[scheme] = chromium.picture()[2, 2].mean()
    chromium.run("document.getElementById('dark').click()")
    assert corners["dark"] < 40 < 220 < corners["light"] == chromium.picture()[2, 2].mean()


def test_without_graphics_the_page_says_so(ball: TriangleMesh, tmp_path: Path) -> None:
    write_page(tmp_path / "page.html", [Shown("ball", ball)])
    with browser("--disable-3d-apis") as at:
        at.open(tmp_path / "page.html")
        assert at.state == "failed"
        assert "cannot be drawn" in at.run("document.getElementById('failure').innerText")


@pytest.mark.slow
def test_a_hundred_thousand_vertices_are_turned(shown: Any) -> None:
    ball = TriangleMesh.create_sphere(1.0, 225)
    assert len(ball.vertices) > 100_000
    at = shown(Shown("cover", ball), Shown("marked", waved(ball, 1e-3)), Shown("attacked", waved(ball, 2e-3)))
    choose(at, "look", "zebra")
    before = cell(at, 1)
    at.run("document.getElementById('factor').focus()")
    at.press("ArrowRight", 4)
    assert unlike(before, cell(at, 1)) > 0.1
