"""Subdivision: exact on what each scheme reproduces, and no mesh is refused."""

import numpy as np
import pytest

from fixtures.attacked import grid, is_closed, rows, torus
from o3dmark.attacks import ATTACKS, _meshlab
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface, TriangleMesh, mesh_arrays, triangle_mesh

SCHEMES = ["midpoint", "loop", "butterfly", "sqrt3"]


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("iterations", [1, 2])
def test_subdivision_counts_and_stays_closed(spot: TriangleMesh, scheme: str, iterations: int) -> None:
    before, after = spot, ATTACKS.make(f"subdivide:scheme={scheme},iterations={iterations}")(spot)
    v, f = len(before.vertices), len(before.triangles)
    for _ in range(iterations):
        v, f = (v + f, 3 * f) if scheme == "sqrt3" else (v + 3 * f // 2, 4 * f)
    assert (len(after.vertices), len(after.triangles)) == (v, f)
    assert is_closed(after)
    assert geometry.volume(*mesh_arrays(after)) == pytest.approx(geometry.volume(*mesh_arrays(spot)), rel=0.02)


@pytest.mark.parametrize("iterations", [1, 2])
def test_subdivision_agrees_with_open3d(iterations: int) -> None:
    midpoint = ATTACKS.make(f"subdivide:scheme=midpoint,iterations={iterations}")
    loop = ATTACKS.make(f"subdivide:scheme=loop,iterations={iterations}")
    for mesh in (torus(), TriangleMesh.create_icosahedron(), TriangleMesh.create_box()):
        assert rows(mesh_arrays(midpoint(mesh))[0]) == rows(np.asarray(mesh.subdivide_midpoint(iterations).vertices))
    # Open3D has Warren's weights, which are Loop's at six neighbours only
    assert rows(mesh_arrays(loop(torus()))[0]) == rows(np.asarray(torus().subdivide_loop(iterations).vertices))


def test_loop_and_butterfly_agree_with_meshlab() -> None:
    once = {"iterations": 1, "threshold": _meshlab.length(0.0)}
    for mesh in (TriangleMesh.create_icosahedron(), torus(), grid(4, lambda x, y: x * y - x**2)):
        ours = ATTACKS.make("subdivide:scheme=loop")(mesh)
        theirs = _meshlab.apply(*mesh_arrays(mesh), ("meshing_surface_subdivision_loop", once))
        assert rows(mesh_arrays(ours)[0]) == rows(theirs[0])
    ours = ATTACKS.make("subdivide:scheme=butterfly")(torus())
    theirs = _meshlab.apply(*mesh_arrays(torus()), ("meshing_surface_subdivision_butterfly", once))
    assert rows(mesh_arrays(ours)[0]) == rows(theirs[0])


def test_midpoint_keeps_the_shape() -> None:
    after = ATTACKS.make("subdivide:scheme=midpoint")(torus())
    assert np.array_equal(mesh_arrays(after)[0][:600], mesh_arrays(torus())[0])
    assert Surface.of(after).area == pytest.approx(Surface.of(torus()).area)
    assert geometry.volume(*mesh_arrays(after)) == pytest.approx(geometry.volume(*mesh_arrays(torus())))


@pytest.mark.parametrize("scheme", SCHEMES)
def test_subdivision_reproduces_planes(scheme: str) -> None:
    plane = grid(6, lambda x, y: 2.0 * x - 3.0 * y + 1.0)
    x, y, z = mesh_arrays(ATTACKS.make(f"subdivide:scheme={scheme},iterations=2")(plane))[0].T
    assert z == pytest.approx(2.0 * x - 3.0 * y + 1.0)


def test_butterfly_reproduces_cubics_and_keeps_old_vertices() -> None:
    def cubic(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x**3 - 2.0 * x * y * y + 5.0 * x * y - y**2

    after = mesh_arrays(ATTACKS.make("subdivide:scheme=butterfly")(grid(12, cubic)))[0]
    assert np.array_equal(after[: 13 * 13], mesh_arrays(grid(12, cubic))[0])
    x, y, z = after[13 * 13 :].T
    inner = (np.minimum(x, y) > 2) & (np.maximum(x, y) < 10)
    assert inner.sum() > 100
    assert z[inner] == pytest.approx(cubic(x, y)[inner])


def test_loop_and_sqrt3_by_hand() -> None:
    bump = grid(4)
    np.asarray(bump.vertices)[12, 2] = 1.0  # the middle one of 25
    heights = {}
    for scheme in ("loop", "sqrt3"):
        after = mesh_arrays(ATTACKS.make(f"subdivide:scheme={scheme}")(bump))[0]
        heights[scheme] = after[12, 2], sorted(np.unique(np.round(after[25:, 2], 9)))
    assert heights["loop"][0] == pytest.approx(10 / 16)
    assert heights["loop"][1] == pytest.approx([0, 1 / 8, 3 / 8])
    assert heights["sqrt3"][0] == pytest.approx(2 / 3)  # alpha_6 = 1/3
    assert heights["sqrt3"][1] == pytest.approx([0, 1 / 3])


def test_sqrt3_flips_every_inner_edge_and_no_boundary_edge() -> None:
    two = triangle_mesh(np.array([[0, 0, 0], [3, 0, 0], [3, 3, 0], [0, 3, 0.0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    after = ATTACKS.make("subdivide:scheme=sqrt3")(two)
    edges = set(map(tuple, geometry.edges(mesh_arrays(after)[1])))
    assert (0, 2) not in edges
    assert (4, 5) in edges
    assert {(0, 1), (1, 2), (2, 3), (0, 3)} <= edges
    assert Surface.of(after).area == pytest.approx(9.0)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_non_manifold_edges_are_creases_not_errors(scheme: str) -> None:
    vertices = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [-1, -1, 0.0]])
    book = triangle_mesh(vertices, np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]]))
    after = mesh_arrays(ATTACKS.make(f"subdivide:scheme={scheme}")(book))
    assert len(after[1]) == (9 if scheme == "sqrt3" else 12)
    if scheme != "sqrt3":
        assert (0.0, 0.0, 0.5) in rows(after[0])
