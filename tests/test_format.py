"""What old marks depend on: the ladders of steps, and what is drawn from the key, as values that never change.

If one of these tests fails, marks made before can no longer be read; a new format needs a new date. The values are of a
key of zeros, 2026-11-24. What is drawn from a key at all is held by test_keys, the codewords by test_payload, the
choice of the frame by test_frame_format.
"""

import hashlib
from typing import Any

import numpy as np
import pytest

from o3dmark.coding.keys import Key
from o3dmark.mesh.surface import mesh_arrays
from o3dmark.methods.saliency_scs import FORMATS, SaliencySCS
from o3dmark.methods.shape_spectrum.method import ShapeSpectrum
from o3dmark.profiles import PROFILES

ZEROS = Key(bytes(32))
LADDERS = {  # steps of a profile: their number, the first two, the last
    "robust-2026": (45, 0.0495400874, 0.0462991471, 0.00252389074),
    "invisible-2026": (45, 0.0316031592, 0.0295356628, 0.00161006823),
    "slender-2026": (60, 0.0495400874, 0.0462991471, 0.000914774152),
    "contested-2026": (60, 0.0341655775, 0.0319304463, 0.000630878726),
    "layered-2026": (45, 0.0495400874, 0.0462991471, 0.00252389074),
    "paper-2026": (80, 0.2, 0.19047619, 0.00423716493),
    "tiny-2026": (80, 0.2, 0.19047619, 0.00423716493),
}
DEALS = {  # of the real modes to projections: projections, modes, SHA-256 of the signed owners, the first dither values
    "robust-2026": (64, 6902, "f248846b1a62c3b0", [0.5673779384, 0.2078907593]),
    "invisible-2026": (64, 6902, "f248846b1a62c3b0", [0.5673779384, 0.2078907593]),
    "contested-2026": (64, 55674, "ee60a7fa054e9f8c", [0.5673779384, 0.2078907593]),
    "slender-2026": (64, 55674, "ee60a7fa054e9f8c", [0.5673779384, 0.2078907593]),
}
DITHERS = {
    "sphere": [0.029009592, 0.7748379264, 0.1811065203, 0.0192265373],
    "rank": [0.2306252597, 0.3111784558, 0.0447921439, 0.0746226969],
}


@pytest.mark.parametrize("name", PROFILES)
def test_the_ladder_of_every_profile(name: str) -> None:
    method, n_bits = PROFILES[name].method, PROFILES[name].n_bits
    method = method.layers.get("solid", method)
    steps = method.steps(n_bits) if isinstance(method, ShapeSpectrum) else FORMATS[method.format].steps  # type: ignore[attr-defined]
    assert (len(steps), steps[0], steps[1], steps[-1]) == pytest.approx(LADDERS[name], rel=1e-8)
    np.testing.assert_allclose(steps[1:] / steps[:-1], steps[1] / steps[0])


@pytest.mark.parametrize("name", DEALS)
def test_the_deal_of_modes_to_projections(name: str) -> None:
    method, n_bits = PROFILES[name].method, PROFILES[name].n_bits
    assert isinstance(method, ShapeSpectrum)
    dealt = method.projections(ZEROS, n_bits)
    signed = (np.where(dealt.weight > 0, 1, -1) * (dealt.owner + 1)).astype("<i8")
    count, modes, digest, dither = DEALS[name]
    assert (len(dealt), len(signed)) == (count, modes)
    assert hashlib.sha256(signed.tobytes()).hexdigest()[:16] == digest
    assert dealt.dither[:2] == pytest.approx(dither, abs=1e-9)


@pytest.mark.parametrize(("n_bits", "projections"), [(8, 32), (16, 32), (32, 32), (40, 40), (64, 64), (128, 128)])
def test_few_bits_share_32_projections(n_bits: int, projections: int) -> None:
    assert len(ShapeSpectrum().projections(ZEROS, n_bits)) == projections


@pytest.mark.parametrize("sync", DITHERS)
def test_the_dither_of_vertex_norms(spot: Any, sync: str) -> None:
    """Moved all the way, every norm stands on a codeword: a whole number of steps beyond its dither value."""
    step, cover = 0.01, mesh_arrays(spot)[0]
    method = SaliencySCS(sync=sync, step=step, gamma=1.0, share=1.0)  # type: ignore[arg-type]
    after = mesh_arrays(method.embed(spot, np.zeros(4, int), ZEROS))[0]
    centre = cover.mean(axis=0)
    norms = np.linalg.norm(after - centre, axis=1) / np.linalg.norm(cover - centre, axis=1).mean()
    offset = (norms / step)[:, None] - DITHERS[sync]
    on = np.abs(offset - np.rint(offset)) < 1e-6
    assert on.any(axis=0).all()
    if sync == "sphere":  # one value a bit: a quarter of the vertices each
        assert on.sum(axis=0) == pytest.approx(np.full(4, len(cover) / 4), abs=1)
