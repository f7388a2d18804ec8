"""Undoing smoothing by its inverse."""

import numpy as np
import pytest

from o3dmark.attacks import attack_all
from o3dmark.mesh.geometry import boundary_vertices
from o3dmark.mesh.smoothing import InverseSmoothing, Transfer, hc, taubin, umbrella
from o3dmark.mesh.surface import Surface, TriangleMesh

CASES = [
    ("smooth:iterations=10", umbrella(10, 0.1), 1000.0, 0.01),
    ("smooth:iterations=50", umbrella(50, 0.1), 1000.0, 0.25),
    ("smooth:iterations=4,strength=0.3", umbrella(4, 0.3), 1000.0, 0.2),
    ("taubin:iterations=10", taubin(10, 0.5, -0.53), 30.0, 0.55),
    ("hc:iterations=4", hc(4), 8.0, 0.75),
]


def rms(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum((a - b) ** 2, axis=1))))


@pytest.mark.parametrize(("attack", "transfer", "gain", "left"), CASES, ids=[c[0] for c in CASES])
def test_it_undoes_the_attack_of_that_name(
    spot: TriangleMesh, attack: str, transfer: Transfer, gain: float, left: float
) -> None:
    """What is left of the damage; details that the smoothing wiped out do not come back."""
    cover, smooth = Surface.of(spot), Surface.of(attack_all(spot, [attack]))
    damage = rms(smooth.vertices, cover.vertices)
    assert rms(InverseSmoothing(smooth).undo(transfer, gain), cover.vertices) < left * damage


@pytest.mark.parametrize("gain", [4.0, 30.0])
def test_no_detail_grows_by_more_than_the_gain(spot: TriangleMesh, gain: float) -> None:
    surface = Surface.of(spot)
    noise = 1e-4 * np.random.default_rng(0).standard_normal(surface.vertices.shape)
    both = surface, surface.moved(surface.vertices + noise)
    one, other = (InverseSmoothing(s).undo(umbrella(60, 0.1), gain) for s in both)
    assert rms(one, other) < gain * rms(noise, np.zeros_like(noise))


def test_no_smoothing_is_the_identity(spot: TriangleMesh) -> None:
    surface = Surface.of(spot)
    assert InverseSmoothing(surface).undo(umbrella(0, 0.1), 10.0) == pytest.approx(surface.vertices, abs=1e-12)


def test_the_boundary_stays(spot: TriangleMesh) -> None:
    cover = Surface.of(spot)
    cut = Surface.from_arrays(cover.vertices, cover.triangles[200:])
    boundary = boundary_vertices(cut.triangles, len(cut.vertices))
    assert boundary.any()
    undone = InverseSmoothing(cut).undo(umbrella(20, 0.1), 100.0)
    assert undone[boundary] == pytest.approx(cut.vertices[boundary], abs=1e-9)
