"""The contract of every registered method: tested by existing."""

import hashlib
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from fixtures.shapes import bits_of
from o3dmark.attacks import attack_all
from o3dmark.coding.keys import Key
from o3dmark.errors import CapacityError, MeshError
from o3dmark.mesh.surface import MeshArrays, TriangleMesh, mesh_arrays, triangle_mesh
from o3dmark.methods import METHODS, Method
from o3dmark.registry import describe, spec_of

pytestmark = pytest.mark.parametrize("name", list(METHODS))


BITS = bits_of(1)


def first_sight(name: str) -> Method:
    """The method without the search that its reader may be told to leave."""
    searches = any(option == "search" for option, *_ in describe(METHODS[name]))
    return METHODS.make(f"{name}:search=false" if searches else name)


@pytest.fixture(scope="module")
def marks(cover_for: Callable[[str], Any], key: Key) -> dict[str, Any]:
    """A cover with BITS by the name of the method, marked when first asked for."""

    class Marks(dict[str, Any]):
        def __missing__(self, name: str) -> Any:
            self[name] = METHODS.make(name).embed(cover_for(name), BITS, key)
            return self[name]

    return Marks()


def test_reads_what_it_wrote(name: str, marks: dict[str, Any], key: Key) -> None:
    extraction = METHODS.make(name).extract(marks[name], len(BITS), key)
    np.testing.assert_array_equal(extraction.bits, BITS)
    assert extraction.hypotheses >= 1


def test_leaves_the_cover_alone_and_marks_it_alike_each_time(
    name: str, cover_for: Callable[[str], Any], marks: dict[str, Any], key: Key
) -> None:
    """Also where it comes as arrays, and goes back as such."""
    cover = cover_for(name)
    before, first = mesh_arrays(cover), mesh_arrays(marks[name])
    arrays = mesh_arrays(cover)
    again = METHODS.make(name).embed(arrays, BITS, key)
    assert isinstance(again, MeshArrays)
    for kept, given in zip(before, arrays, strict=True):
        np.testing.assert_array_equal(kept, given)
    for kept, given in zip(before, mesh_arrays(cover), strict=True):
        np.testing.assert_array_equal(kept, given)
    np.testing.assert_array_equal(first[1], before[1])
    assert not np.array_equal(first[0], before[0])
    np.testing.assert_array_equal(first[0], again.vertices)
    np.testing.assert_array_equal(first[1], again.triangles)


def test_every_claim_holds(name: str, marks: dict[str, Any], key: Key) -> None:
    method = METHODS.make(name)
    assert {"identity", "reorder"} <= set(method.claims)
    assert any(claim.startswith("similarity") for claim in method.claims)
    for claim in method.claims:
        attacked = attack_all(marks[name], [claim], 7)
        np.testing.assert_array_equal(method.extract(attacked, len(BITS), key).bits, BITS, err_msg=claim)


def test_a_wrong_key_reads_noise(name: str, marks: dict[str, Any], key: Key) -> None:
    """Half of the bits, and no p-values that chance would not bring: below 0.1 in a tenth of the cases."""
    method = first_sight(name)
    seen = method.observe(marks[name])
    strangers = [Key(hashlib.sha256(bytes([9, i])).digest()) for i in range(20)]
    found = [method.extract(seen, 16, stranger) for stranger in strangers]
    assert abs(np.mean([np.count_nonzero(each.bits == BITS) for each in found]) - 8) < 2  # standard error 0.45
    p = np.array([each.detect(BITS).p_value for each in found])
    assert np.mean(p < 0.1) < 0.3
    assert p.min() > 2e-3
    assert method.extract(seen, 16, key).detect(BITS).p_value < 2e-3


def test_observing_a_mesh_once_serves_every_key(name: str, marks: dict[str, Any], key: Key) -> None:
    method = first_sight(name)
    seen = method.observe(marks[name])
    for secret in (Key(bytes(32)), key, Key(bytes(32))):
        once, anew = method.extract(seen, 16, secret), method.extract(marks[name], 16, secret)
        np.testing.assert_array_equal(once.soft, anew.soft)
        assert once.hypotheses == anew.hypotheses


def test_too_many_bits_say_how_many_fit(name: str, key: Key) -> None:
    method = METHODS.make(name)
    semi_regular = TriangleMesh.create_octahedron().subdivide_midpoint(2)
    small = semi_regular if method.needs_semi_regular else TriangleMesh.create_sphere(resolution=8)
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


def test_what_is_not_semi_regular_is_refused_where_it_must_be(name: str, carrier: Any, key: Key) -> None:
    method = METHODS.make(name)
    if not method.needs_semi_regular:
        pytest.skip("takes any mesh")
    for act in (lambda: method.embed(carrier, BITS, key), lambda: method.capacity(carrier)):
        with pytest.raises(MeshError, match="not semi-regular"):
            act()
    assert not method.extract(carrier, 16, key).soft.any()


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
