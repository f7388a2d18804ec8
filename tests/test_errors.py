"""The exception tree is the one that errors.py draws, and its members say what to do."""

import inspect

import pytest

from o3dmark import errors
from o3dmark.errors import BackendError, CapacityError, KeyFileError, LedgerError, MeshError, O3dmarkError, SpecError

CLASSES = [cls for _, cls in inspect.getmembers(errors, inspect.isclass)]


@pytest.mark.parametrize("cls", CLASSES)
def test_every_error_is_an_o3dmark_error_and_is_drawn(cls: type[O3dmarkError]) -> None:
    assert issubclass(cls, O3dmarkError)
    assert cls.__name__ in str(errors.__doc__)


def test_exit_codes_tell_the_callers_typing_from_bad_input() -> None:
    assert SpecError.exit_code == 2
    assert {cls.exit_code for cls in (MeshError, CapacityError, KeyFileError, LedgerError, BackendError)} == {3}


def test_capacity_error_says_how_many_bits_fit() -> None:
    error = CapacityError(64, 12, "300 salient vertices")
    assert (error.wanted, error.fits) == (64, 12)
    assert isinstance(error, MeshError)
    assert "64" in str(error)
    assert "12" in str(error)
    assert "300 salient vertices" in str(error)
