"""Smoothing, by hand and against slow definitions."""

import numpy as np
import pytest

from fixtures.attacked import CENTRE, moved, sphere, volume
from o3dmark.attacks import ATTACKS
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface, TriangleMesh, mesh_arrays, triangle_mesh


def fan() -> TriangleMesh:
    """A square pyramid without its base: the apex 0 inside, the boundary 1 to 4 around it."""
    vertices = np.array([[0.3, 0.1, 1.0], [1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0.0]])
    return triangle_mesh(vertices, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]]))


def test_the_umbrella_by_hand() -> None:
    v = mesh_arrays(fan())[0]
    w = moved("smooth:iterations=1,strength=0.1", fan())
    assert w[0] == pytest.approx([0.27, 0.09, 0.9])  # nine tenths of the apex, a tenth of the square's centre, 0
    assert np.array_equal(w[1:], v[1:])
    assert moved("smooth:iterations=2,strength=0.1", fan())[0] == pytest.approx(0.81 * v[0])


def valley(n: int = 6) -> tuple[TriangleMesh, np.ndarray]:
    """A plane folded up on both sides of x = 3, inner vertices with six neighbours; and its vertices (49, 3)."""
    x, y = (side.ravel().astype(np.float64) for side in np.meshgrid(np.arange(n + 1), np.arange(n + 1)))
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    triangles = np.r_[np.c_[first, first + 1, first + n + 2], np.c_[first, first + n + 2, first + n + 1]]
    vertices = np.c_[x, y, np.abs(x - n / 2)]
    return triangle_mesh(vertices, triangles), vertices


def test_a_smoothed_edge_by_hand() -> None:
    mesh, v = valley()
    once, many = (moved(f"smooth:iterations={k},strength=0.3", mesh) for k in (1, 4))
    inner = ((v[:, :2] > 0) & (v[:, :2] < 6)).all(axis=1)
    edge = inner & (v[:, 0] == 3)
    assert once[edge, 2] == pytest.approx(np.full(5, 0.3 * 4 / 6))  # four of six neighbours stand one higher
    assert once[inner & ~edge] == pytest.approx(v[inner & ~edge])  # planes stay planes
    assert np.array_equal(once[~inner], v[~inner])
    deep = edge & (v[:, 1] == 3)  # out of the boundary's reach
    second = 0.2 + 0.3 * ((2 * 0.2 + 4 * 1.0) / 6 - 0.2)
    assert moved("smooth:iterations=2,strength=0.3", mesh)[deep, 2] == pytest.approx(second)
    assert many[deep, 2] > second


def test_cotangents_by_hand() -> None:
    v = mesh_arrays(fan())[0]
    weights = []
    for j, before, after in ((1, 4, 2), (2, 1, 3), (3, 2, 4), (4, 3, 1)):
        corners = [(v[0] - v[k], v[j] - v[k]) for k in (before, after)]
        weights.append(max(sum(a @ b / np.linalg.norm(np.cross(a, b)) for a, b in corners), 0.0))
    mean = np.average(v[1:], axis=0, weights=weights)
    w = moved("smooth:iterations=1,strength=0.5,weights=cotangent", fan())
    assert w[0] == pytest.approx(0.5 * (v[0] + mean))


def test_smoothing_a_sphere_shrinks_it_and_taubin_does_not() -> None:
    before = volume(sphere())
    laplace = volume(ATTACKS.make("smooth:iterations=20,strength=0.5")(sphere()))
    taubin = volume(ATTACKS.make("taubin:iterations=10")(sphere()))
    hc = volume(ATTACKS.make("hc:iterations=10")(sphere()))
    assert laplace < 0.93 * before
    assert abs(taubin / before - 1.0) < 0.3 * (1.0 - laplace / before)
    assert abs(hc / before - 1.0) < 0.3 * (1.0 - laplace / before)


@pytest.mark.parametrize("spec", ["smooth:strength=0.5", "smooth:weights=cotangent,strength=0.5", "taubin", "hc"])
def test_smoothing_takes_noise_away(spec: str) -> None:
    rough = ATTACKS.make("noise:amplitude=0.02")(sphere(), 0)
    smooth = ATTACKS.make(spec)(rough)
    radii = [np.linalg.norm(Surface.of(mesh).vertices - CENTRE, axis=1) for mesh in (rough, smooth)]
    assert radii[1].std() < 0.8 * radii[0].std()


def test_hc_like_its_slow_definition(spot: TriangleMesh) -> None:
    surface = Surface.of(spot)
    neighbours = [[] for _ in surface.vertices]
    for a, b in geometry.edges(surface.triangles):
        neighbours[a].append(b)
        neighbours[b].append(a)
    o = q = surface.vertices
    alpha, beta = 0.2, 0.6
    for _ in range(2):
        p = np.array([q[near].mean(axis=0) for near in neighbours])
        b = p - (alpha * o + (1 - alpha) * q)
        q = np.array([p[i] - (beta * b[i] + (1 - beta) * b[near].mean(axis=0)) for i, near in enumerate(neighbours)])
    assert moved("hc:iterations=2,alpha=0.2,beta=0.6", spot) == pytest.approx(q, abs=1e-12)


@pytest.mark.parametrize("spec", ["smooth:iterations=30", "smooth:weights=cotangent", "taubin", "hc"])
def test_smoothing_commutes_with_similarities(spot: TriangleMesh, spec: str) -> None:
    after = moved(spec, ATTACKS.make("similarity")(spot, 3))
    before = mesh_arrays(ATTACKS.make("similarity:translation=0,rotation=0,smallest=1,largest=1")(spot, 3))[0]
    linear, _, _, _ = np.linalg.lstsq(np.c_[before, np.ones(len(before))], moved("similarity", spot, 3), rcond=None)
    assert after == pytest.approx(np.c_[moved(spec, spot), np.ones(len(before))] @ linear, abs=1e-9)
