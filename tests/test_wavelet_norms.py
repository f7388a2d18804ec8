"""Marks in wavelet coefficients: the base mesh rests, norms stand on codewords, and the reader finds the step."""

from typing import Any

import numpy as np
import pytest
from open3d.geometry import TriangleMesh

from fixtures.shapes import bits_of
from o3dmark.attacks import attack_all
from o3dmark.coding.keys import Key
from o3dmark.coding.scs import ScalarCosta
from o3dmark.errors import MeshError, SpecError
from o3dmark.mesh.surface import Surface
from o3dmark.methods import METHODS
from o3dmark.methods._wavelet_norms import Multiresolution
from o3dmark.metrics.distance import surface_distance

BITS = bits_of(1, 32)
NAMES = pytest.mark.parametrize("name", ["wang2008", "hamidi2017", "hamidi2019"])


def seen(mesh: Any) -> Multiresolution:
    return Multiresolution.of(Surface.of(mesh))


def test_an_edge_normal_is_the_sum_of_its_two_triangles(semi_regular: TriangleMesh) -> None:
    mesh = seen(semi_regular)
    for number in (0, 17, 4000):
        ends = set(mesh.edges[number])
        two = [k for k, corners in enumerate(mesh.levels[0].triangles) if ends <= set(corners)]
        assert len(two) == 2
        np.testing.assert_allclose(mesh.edge_area_vectors[number], mesh.base.area_vectors[two].sum(axis=0), atol=1e-15)


@NAMES
def test_the_base_rests_and_norms_stand_on_codewords(name: str, semi_regular: TriangleMesh, key: Key) -> None:
    method = METHODS.make(f"{name}:gamma=1")
    before, after = seen(semi_regular), seen(method.embed(semi_regular, BITS, key))
    np.testing.assert_allclose(after.wavelets.base, before.wavelets.base, atol=1e-12)
    np.testing.assert_array_equal(method.order(after), method.order(before))  # type: ignore[attr-defined]
    edge = method.order(before)  # type: ignore[attr-defined]
    bit, dither = method._carried(len(edge), len(BITS), key)  # type: ignore[attr-defined]
    soft = ScalarCosta(method.strength).soft(after.norms[edge], dither)  # type: ignore[attr-defined]
    np.testing.assert_allclose(soft, 2.0 * BITS[bit] - 1.0, atol=1e-6)
    others = np.setdiff1d(np.arange(len(before.edges)), edge)
    np.testing.assert_allclose(after.norms[others], before.norms[others], atol=1e-12)


@NAMES
def test_the_reader_finds_the_step_of_a_distortion(name: str, semi_regular: TriangleMesh, key: Key) -> None:
    method = METHODS.make(f"{name}:mrms=0.0003")
    marked = method.embed(semi_regular, BITS, key)
    assert 0.88 * 3e-4 < surface_distance(semi_regular, marked, samples=50_000).mrms <= 3e-4
    read = method.extract(attack_all(marked, ["noise:amplitude=0.0001", "similarity"], 3), 32, key)
    np.testing.assert_array_equal(read.bits, BITS)
    assert read.hypotheses == 120
    with pytest.raises(MeshError, match="ask for a larger one"):
        METHODS.make(f"{name}:mrms=1e-9").embed(semi_regular, BITS, key)


@NAMES
def test_flat_subdivisions_can_be_marked(name: str, spot: TriangleMesh, key: Key) -> None:
    """All coefficients are zero there, and have no direction of their own."""
    flat, method = spot.subdivide_midpoint(1), METHODS.make(name)
    np.testing.assert_array_equal(method.extract(method.embed(flat, BITS, key), 32, key).bits, BITS)


def test_misuse_is_an_error() -> None:
    for spec in ("wang2008:gamma=0", "wang2008:epsilon=0", "hamidi2019:share=0", "hamidi2019:reach=-1"):
        with pytest.raises(SpecError):
            METHODS.make(spec)
