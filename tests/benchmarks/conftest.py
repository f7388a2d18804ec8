"""What several benchmarks measure on."""

import numpy as np
import pytest

from o3dmark.methods.shape_spectrum.method import ShapeSpectrum


@pytest.fixture(scope="session")
def large(spot):
    """Spot, subdivided to 46 850 vertices. Do not change it."""
    return spot.subdivide_loop(2)


@pytest.fixture(scope="session")
def message():
    """64 bits."""
    return np.random.default_rng(0).integers(0, 2, 64)


@pytest.fixture(scope="session")
def marked(large, message, key):
    """The large mesh with that message. Do not change it."""
    return ShapeSpectrum().embed(large, message, key)
