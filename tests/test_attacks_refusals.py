"""What attacks refuse, and that they refuse or attack any real mesh."""

import contextlib

import numpy as np
import pytest

from fixtures.attacked import QUICK, SPECS
from fixtures.paths import SHARED
from o3dmark.attacks import ATTACKS
from o3dmark.errors import MeshError, O3dmarkError, SpecError
from o3dmark.mesh.surface import mesh_arrays, triangle_mesh


@pytest.mark.parametrize("spec", [QUICK.get(name, name) for name in ATTACKS if name != "identity"])
def test_meshes_without_a_surface_are_refused(spec: str) -> None:
    triangle = np.array([[0, 1, 2]])
    flawed = {
        "no triangle": triangle_mesh(np.eye(3), np.empty((0, 3), np.int64)),
        "a point": triangle_mesh(np.ones((3, 3)), triangle),
        "not finite": triangle_mesh(np.array([[0, 0, 0], [1, 0, 0], [0, np.nan, 0.0]]), triangle),
        "out of range": triangle_mesh(np.eye(3), np.array([[0, 1, 7]])),
    }
    for mesh in flawed.values():
        with pytest.raises(MeshError):
            ATTACKS.make(spec)(mesh, 1)


@pytest.mark.parametrize(
    "spec",
    [
        "noise:amplitude=-1",
        "noise:kind=pink",
        "simplify:ratio=1",
        "crop:share=1",
        "holes:count=0",
        "quantise:bits=0",
        "similarity:smallest=0",
        "subdivide:iterations=-1",
        "smooth:strength=2",
        "remesh:edge=0",
        "stretch:amount=1",
        "bend:angle=270",
        "twist:band=0",
        "units:factor=0",
        "resample:cells=1",
        "poisson:depth=20",
        "rescan:views=0",
        "draco:bits=0",
        "meshopt:bits=17",
        "meshopt-simplify:ratio=1",
        "print-scan:layer=-1",
    ],
)
def test_nonsense_is_refused_before_any_mesh_is_seen(spec: str) -> None:
    with pytest.raises(SpecError):
        ATTACKS.make(spec)


@pytest.mark.slow
@pytest.mark.parametrize("spec", [*SPECS, "simplify:ratio=0.975"])
def test_real_meshes_are_attacked_or_refused(spec: str) -> None:
    """Every attack on every shared mesh under 6 000 vertices: a sound mesh, or an error of ours that says why."""
    from o3dmark.files import read_mesh

    meshes = sorted(path for folder in ("paper", "extra") for path in (SHARED / "meshes" / folder).glob("*.ply"))
    if not meshes:
        pytest.skip("the shared meshes are not here")
    for path in meshes:
        mesh = read_mesh(path)
        if len(mesh.vertices) < 6000:
            with contextlib.suppress(O3dmarkError):
                vertices, triangles = mesh_arrays(ATTACKS.make(spec)(mesh, 1))
                assert len(triangles), path.name
                assert np.isfinite(vertices).all(), path.name
