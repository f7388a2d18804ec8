"""Patches: what their cylinders hold, and that they go with the surface that they stand on."""

import json

import numpy as np
import pytest

from fixtures.shapes import rotation
from o3dmark.mesh import similarity
from o3dmark.mesh.patch import Patch
from o3dmark.methods.local_patches.format import FORMATS
from o3dmark.methods.local_patches.measuring import Patches, held

AXIS = np.array([2.0, -1.0, 2.0]) / 3.0
PATCH = Patch(np.array([0.2, 0.1, -0.3]), AXIS, 0.5, 0.4)
POINTS = np.random.default_rng(0).uniform(-1.0, 1.0, (5000, 3))
MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])


def moved(scale: float) -> np.ndarray:
    """A similarity (4, 4)."""
    place = np.eye(4)
    place[:3, :3], place[:3, 3] = scale * rotation(1), [3.0, -2.0, 7.0]
    return place


def test_a_patch_holds_what_its_reader_measures() -> None:
    form = FORMATS["2026"]
    seen = Patches(form, PATCH.centre[None], AXIS[None], PATCH.radius)
    same = PATCH._replace(half_height=form.half_height * PATCH.radius)
    inside = np.flatnonzero(same.holds(POINTS))
    assert 100 < len(inside) < 2000
    assert np.array_equal(inside, held(POINTS, seen))


@pytest.mark.parametrize("place", [moved(1.0), moved(0.01), moved(30.0) @ MIRROR])
def test_a_patch_goes_with_its_surface(place: np.ndarray) -> None:
    there = PATCH.placed(place)
    assert np.array_equal(there.holds(similarity.apply(place, POINTS)), PATCH.holds(POINTS))
    outward = similarity.apply(place, (PATCH.centre + AXIS)[None])[0] - there.centre
    assert there.axis == pytest.approx(outward / np.linalg.norm(outward))


def test_where_a_surface_is_stretched_its_normal_stays_one() -> None:
    place = np.diag([1.0, 1.0, 8.0, 1.0])
    across = np.linalg.svd(AXIS[None])[2][1:]
    there = PATCH.placed(place)
    assert np.abs(across @ place[:3, :3] @ there.axis).max() < 1e-12
    assert (np.linalg.norm(there.axis), there.radius) == (pytest.approx(1.0), pytest.approx(2.0 * PATCH.radius))


def test_its_fields_are_ready_for_json() -> None:
    fields = json.loads(json.dumps(PATCH.to_dict()))
    assert list(fields) == ["centre", "axis", "radius", "half_height"]
    assert fields["centre"] == [0.2, 0.1, -0.3]
