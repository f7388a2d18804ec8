"""Fixtures shared by all tests: the CC0 mesh kept in the repo, and real meshes where they are present."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from fixtures.paths import GOLDEN, ROOT, SHARED
from o3dmark.arrays import Floats
from o3dmark.coding.keys import Key
from o3dmark.mesh.surface import TriangleMesh


@pytest.fixture(scope="session")
def shared() -> Callable[[str], Path]:
    """The path of a file that is not in the repo (real meshes, oracle values); skips the test where it is absent."""

    def find(name: str) -> Path:
        path = SHARED / name
        if not path.exists():
            pytest.skip(f"{name} is not here (set O3DMARK_SHARED to the folder that holds it)")
        return path

    return find


@pytest.fixture(scope="session")
def spot() -> TriangleMesh:
    """Spot (Keenan Crane, CC0): 2 930 vertices, 5 856 triangles, closed, genus 0. Do not change it."""
    from o3dmark.files import read_mesh

    return read_mesh(GOLDEN / "spot.ply")


@pytest.fixture(scope="session")
def points(spot: TriangleMesh) -> Floats:
    """Spot's vertices (n, 3)."""
    from o3dmark.mesh.surface import mesh_arrays

    return mesh_arrays(spot)[0]


@pytest.fixture(scope="session")
def ball() -> TriangleMesh:
    """A unit ball of meridians and parallels, to be drawn. Do not change it."""
    import open3d as o3d

    return o3d.geometry.TriangleMesh.create_sphere(1.0, 16)


@pytest.fixture(scope="session")
def carrier() -> TriangleMesh:
    """The synthetic bust of data_synthetic: 8 857 vertices. Do not change it."""
    from o3dmark.files import read_mesh

    return read_mesh(ROOT / "data_synthetic" / "bimba.ply")


@pytest.fixture(scope="session")
def semi_regular(spot: TriangleMesh) -> TriangleMesh:
    """Spot, once subdivided: 11 714 vertices, 8 784 edges of its base mesh. Do not change it."""
    return spot.subdivide_loop(1)


@pytest.fixture(scope="session")
def cover_for(carrier: TriangleMesh, semi_regular: TriangleMesh) -> Callable[[str], TriangleMesh]:
    """A mesh that a method takes, by the method's name. Do not change it."""
    from o3dmark.methods import METHODS

    return lambda name: semi_regular if METHODS[name].needs_semi_regular else carrier


@pytest.fixture(scope="module")
def own_registries() -> Iterator[None]:
    """What plug-ins register is forgotten again after the tests of a file."""
    import sys

    from o3dmark.attacks import ATTACKS
    from o3dmark.methods import METHODS
    from o3dmark.metrics import METRICS

    before = {registry: set(registry) for registry in (ATTACKS, METHODS, METRICS)}
    yield
    for registry, names in before.items():
        for name in set(registry) - names:
            del registry._classes[name]
    for module in [name for name in sys.modules if name.startswith("o3dmark_plugin_")]:
        del sys.modules[module]


@pytest.fixture(scope="session")
def key() -> Key:
    return Key(bytes(range(32)))


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str, str | bytes], Path]:
    """Writes text or bytes under a name, and says where."""

    def write(name: str, content: str | bytes) -> Path:
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


@pytest.fixture
def noisy_spot(spot: TriangleMesh) -> TriangleMesh:
    """Spot with digits in every place of its doubles; the test's own."""
    from fixtures.shapes import noisy

    return noisy(spot, 1e-3)
