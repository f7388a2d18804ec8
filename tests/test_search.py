"""Which hypotheses a reader is given: what the mesh was before it was smoothed is among them, in the frame it had."""

from collections.abc import Iterator

import numpy as np
import pytest

from fixtures.shapes import column
from o3dmark.attacks import attack_all
from o3dmark.coding.keys import Key
from o3dmark.mesh.surface import Surface, TriangleMesh, triangle_mesh
from o3dmark.methods.shape_spectrum.hypotheses import FrameHypothesis, Measurement
from o3dmark.methods.shape_spectrum.method import ShapeSpectrum
from o3dmark.methods.shape_spectrum.projections import Projections
from o3dmark.solid.frame import FRAME_2026, Frame, rules
from o3dmark.solid.solid import Solid

METHOD = ShapeSpectrum(lowest=3.0, highest=5.0)


def pillar(stretch: float) -> TriangleMesh:
    """A bent column with four edges, stretched along x, with long triangles that smoothing moves far."""

    def cross(angle: np.ndarray, z: np.ndarray) -> np.ndarray:
        return np.exp(1j * angle) * (1.0 + 0.2 * np.cos(4.0 * (angle - 0.3))) * (1.0 + 0.025 * z) + 0.03 * z**2

    solid = column(cross, rings=16, around=24)
    return triangle_mesh(solid.vertices * [stretch, 1.0, 1.0], solid.triangles)


def first_frame(mesh: TriangleMesh) -> Frame:
    """The frame that a writer uses."""
    solid = Solid.of(Surface.of(mesh))
    return rules(solid, FRAME_2026)[0].frames(solid)[0]


def measurements(mesh: TriangleMesh, projections: Projections) -> Iterator[Measurement]:
    for round_ in METHOD.observe(mesh):
        for hypothesis in round_.hypotheses:
            yield from hypothesis.measurements(projections)


@pytest.mark.parametrize(
    ("attack", "smoothing"),
    [("smooth:iterations=30", "umbrella"), ("taubin:iterations=15", "Taubin"), ("hc:iterations=10", "HC")],
)
def test_smoothing_is_undone_by_its_own_inverse(key: Key, attack: str, smoothing: str) -> None:
    """A sixth of the damage to the projections is left, or less; marks under a filter that is not tried stay unread."""
    mesh, projections = pillar(1.2), METHOD.projections(key, 32)
    truth = next(measurements(mesh, projections)).values
    found = list(measurements(attack_all(mesh, [attack]), projections))
    damage = np.linalg.norm(found[0].values - truth)
    left = [np.linalg.norm(each.values - truth) for each in found if each.smoothing == smoothing]
    assert min(left) < damage / 6.0


def test_what_was_marked_in_another_frame_is_seen_in_that() -> None:
    """Smoothing has worn down the edges that turned the frame; the received mesh lies in its principal axes."""
    mesh = pillar(1.038)
    smooth = attack_all(mesh, ["smooth:iterations=22"])
    frame, received = first_frame(mesh), first_frame(smooth)
    assert np.abs(np.abs(received.axes @ frame.axes.T) - np.eye(3)).max() > 0.5
    rounds = ([each for each in round_.hypotheses if own(each, 22)] for round_ in METHOD.observe(smooth))
    seen = next(filter(None, rounds), [])
    assert seen
    assert min(np.abs(each.symmetry @ each.frame.axes - frame.axes).max() for each in seen) < 0.01


def own(hypothesis: object, passes: int) -> bool:
    """Whether a surface before so many passes of smoothing is seen in a frame of its own."""
    return isinstance(hypothesis, FrameHypothesis) and hypothesis.passes == passes
