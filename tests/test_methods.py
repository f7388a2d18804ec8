"""The contract of every registered method: tested by existing."""

import hashlib
from typing import Any

import numpy as np
import pytest

from fixtures.shapes import bits_of
from o3dmark.attacks import attack_all
from o3dmark.coding.keys import Key
from o3dmark.errors import CapacityError, MeshError
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays, triangle_mesh
from o3dmark.methods import METHODS, Method
from o3dmark.registry import spec_of

pytestmark = pytest.mark.parametrize("name", list(METHODS))


def test_reads_what_it_wrote_and_leaves_the_cover_alone(name: str, carrier: Any, key: Key) -> None:
    method, bits, before = METHODS.make(name), bits_of(1), mesh_arrays(carrier)
    marked = method.embed(carrier, bits, key)
    for kept, given in zip(before, mesh_arrays(carrier), strict=True):
        np.testing.assert_array_equal(kept, given)
    np.testing.assert_array_equal(mesh_arrays(marked)[1], before[1])
    assert not np.array_equal(mesh_arrays(marked)[0], before[0])
    extraction = method.extract(marked, len(bits), key)
    np.testing.assert_array_equal(extraction.bits, bits)
    assert extraction.hypotheses >= 1


def test_same_input_same_mark(name: str, carrier: Any, key: Key) -> None:
    method = METHODS.make(name)
    first, second = (mesh_arrays(method.embed(carrier, bits_of(2), key))[0] for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_every_claim_holds(name: str, carrier: Any, key: Key) -> None:
    method, bits = METHODS.make(name), bits_of(3)
    marked = method.embed(carrier, bits, key)
    for claim in method.claims:
        attacked = attack_all(marked, [claim], 7)
        np.testing.assert_array_equal(method.extract(attacked, len(bits), key).bits, bits, err_msg=claim)


def test_a_wrong_key_reads_noise(name: str, carrier: Any, key: Key) -> None:
    method, bits = METHODS.make(f"{name}:search=false"), bits_of(4)
    marked = method.embed(carrier, bits, key)
    matches = [
        np.count_nonzero(method.extract(marked, 16, Key(hashlib.sha256(bytes([9, i])).digest())).bits == bits)
        for i in range(20)
    ]
    assert abs(np.mean(matches) - 8) < 2  # 8 expected, standard error 0.45


def test_too_many_bits_say_how_many_fit(name: str, key: Key) -> None:
    small = TriangleMesh.create_sphere(resolution=8)
    method = METHODS.make(name)
    fits = method.capacity(small)
    with pytest.raises(CapacityError, match=str(fits)) as caught:
        method.embed(small, np.zeros(fits + 1, int), key)
    assert caught.value.fits == fits


def test_a_blind_method_refuses_a_reference(name: str, carrier: Any, key: Key) -> None:
    method = METHODS.make(name)
    if method.takes_reference:
        pytest.skip("takes a reference")
    with pytest.raises(MeshError, match="reference"):
        method.extract(carrier, 16, key, reference=carrier)


def test_no_area_is_refused(name: str, key: Key) -> None:
    flat = triangle_mesh(np.zeros((30, 3)), np.arange(30).reshape(10, 3))
    method = METHODS.make(name)
    for act in (lambda: method.embed(flat, [0, 1], key), lambda: method.extract(flat, 2, key)):
        with pytest.raises(MeshError):
            act()


def test_spec_round_trip(name: str) -> None:
    method = METHODS.make(name)
    assert isinstance(method, Method)
    assert METHODS.make(spec_of(method)) == method
