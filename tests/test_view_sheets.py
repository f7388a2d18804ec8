"""Sheets: what they draw and what their captions say."""

import itertools

import numpy as np
import open3d as o3d
import pytest

import o3dmark.view.comparison
import o3dmark.view.window
from fixtures.pictures import covered
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays, triangle_mesh
from o3dmark.view import (
    Panel,
    comparison_sheet,
    distance_sheet,
    render_scalars,
    sheet,
)


def panels_of(monkeypatch: pytest.MonkeyPatch) -> list[Panel]:
    """The list that the panels of the next sheet will be put in, instead of being drawn."""
    panels: list[Panel] = []
    monkeypatch.setattr(o3dmark.view.comparison, "sheet", lambda drawn, **_: panels.extend(drawn))
    return panels


def shifted(mesh: TriangleMesh, length: float) -> TriangleMesh:
    """The mesh with every other vertex moved by ``length`` along x."""
    vertices, triangles = mesh_arrays(mesh)
    vertices[::2, 0] += length
    return triangle_mesh(vertices, triangles)


def test_the_comparison_sheet_shows_seven_different_pictures(spot):
    marked = shifted(spot, 0.002)
    attacked = TriangleMesh(marked).scale(3.0, np.zeros(3)).rotate(o3d.geometry.get_rotation_matrix_from_xyz([1, 2, 3]))
    saliency = np.asarray(spot.vertices)[:, 1]
    picture = comparison_sheet(
        spot, marked, attacked, saliency=saliency, title="spot", notes=["method", "消息"], width=480
    )
    assert picture.shape[1:] == (480, 3)
    assert picture.dtype == np.uint8
    rows, columns = (picture.shape[0] - 20) // 3, 480 // 3
    cells = [picture[20 + rows * r :][:rows, columns * c :][:, :columns] for r in (0, 1, 2) for c in (0, 1, 2)]
    for cell in cells[:7]:
        assert 0.1 < covered(cell).mean() < 0.9
    assert 0 < covered(cells[7]).mean() < 0.1  # the notes
    for one, other in itertools.combinations(cells[:7], 2):
        assert (one != other).any(axis=2).mean() > 0.01


def test_the_displacement_panel_says_what_it_draws(spot, monkeypatch):
    panels = panels_of(monkeypatch)
    diagonal = geometry.diagonal(mesh_arrays(spot)[0])
    comparison_sheet(spot, shifted(spot, 1e-4 * diagonal), spot)
    mirrors = ["Original, as a mirror", "Marked, as a mirror"]
    assert [panel.title for panel in panels] == ["Original", "Marked", "Displacement", *mirrors, "Attacked"]
    marked, displacement, attacked = panels[1], panels[2], panels[5]
    assert "0.01 % of the diagonal" in marked.caption
    assert displacement.caption == "drawn 100 times as large as it is"
    np.testing.assert_allclose(displacement.scalars[:2], [0.01, 0.0], rtol=1e-9)
    np.testing.assert_allclose(mesh_arrays(displacement.mesh)[0], mesh_arrays(shifted(spot, 1e-2 * diagonal))[0])
    assert displacement.limits[0] == 0
    assert marked.frame is displacement.frame
    assert attacked.frame is None
    assert [panels[number].look for number in (0, 1, 5)] == 3 * ["worn"]


@pytest.mark.parametrize(
    ("length", "asked", "factor"), [(0, None, 1), (1e-15, None, 1), (0.4, None, 1), (1e-3, 7.5, 7.5)]
)
def test_the_exaggeration_is_the_one_asked_for_or_sensible(spot, monkeypatch, length, asked, factor):
    panels = panels_of(monkeypatch)
    comparison_sheet(spot, shifted(spot, length), spot, exaggeration=asked)
    expected = mesh_arrays(shifted(spot, factor * length))[0]
    np.testing.assert_allclose(mesh_arrays(panels[2].mesh)[0], expected, atol=1e-12)


def test_an_unmarked_mesh_and_constant_saliency_make_a_sheet(ball):
    picture = comparison_sheet(ball, ball, ball, saliency=np.zeros(len(ball.vertices)), width=360)
    assert covered(picture).any()


def test_a_displacement_needs_as_many_vertices(spot, ball):
    with pytest.raises(MeshError, match="distance_sheet"):
        comparison_sheet(spot, ball, ball)


def test_the_distance_sheet_measures_by_the_marked_meshs_diagonal(spot, ball, monkeypatch):
    panels = panels_of(monkeypatch)
    distance_sheet(ball, spot, np.full(len(spot.vertices), 0.5))
    expected = 50 / geometry.diagonal(mesh_arrays(ball)[0])
    np.testing.assert_allclose(panels[2].scalars, expected)
    with pytest.raises(MeshError, match="one number to each"):
        distance_sheet(ball, spot, np.zeros(3))


def test_a_colour_bar_shows_the_colormap(ball):
    picture = render_scalars(ball, np.arange(len(ball.vertices)), "rank, a $ number_of", title="Rank", width=300)
    bar = picture[int(0.84 * len(picture)) : int(0.87 * len(picture)), 60:-60].astype(int)
    coloured_rows = bar[np.ptp(bar, axis=2).min(axis=1) > 20]
    assert len(coloured_rows)
    assert coloured_rows[0, 5, 2] > coloured_rows[0, 5, 0]
    assert coloured_rows[0, -5, 0] > coloured_rows[0, -5, 2]


@pytest.mark.parametrize("width", [101, 333, 480])
def test_a_sheet_is_as_wide_as_asked(ball, width):
    assert sheet([Panel("a", ball), Panel("b", ball)], columns=2, width=width).shape[1] == width
