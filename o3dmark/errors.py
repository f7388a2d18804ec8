"""Everything that o3dmark raises on purpose.

    O3dmarkError
     +-- SpecError       a name or an option that is not known       (the caller's typing: exit code 2)
     +-- MeshError       a mesh or a file that cannot be used; says why and what to do
     |    +-- CapacityError   a mesh too small for the payload; says how many bits fit
     |    +-- ConversionError a file that cannot be written in another format
     +-- KeyFileError    a key that is missing or malformed
     +-- LedgerError     a ledger of copies that cannot be read or written, or an entry that it cannot take
     +-- BackendError    a library underneath (Open3D, MeshLab, ...) failed

A watermark that is not there is a result, never an error.
"""


class O3dmarkError(Exception):
    """Base of every error that o3dmark raises on purpose."""

    exit_code = 3


class SpecError(O3dmarkError):
    """A name or an option that no method, attack, metric, code or shape has."""

    exit_code = 2


class MeshError(O3dmarkError):
    """A mesh, or the file that should hold one, cannot be used."""


class CapacityError(MeshError):
    """A mesh too small for the payload asked for; ``fits`` is the number of bits that it can carry."""

    def __init__(self, wanted: int, fits: int, why: str = "") -> None:
        self.wanted, self.fits = wanted, fits
        reason = f" ({why})" if why else ""
        super().__init__(f"{wanted} bits asked for, but this mesh carries {fits} at most{reason}")


class ConversionError(MeshError):
    """A file that cannot be written in another format than its own."""


class KeyFileError(O3dmarkError):
    """A key file that is missing, unreadable or malformed."""


class LedgerError(O3dmarkError):
    """A ledger of copies that cannot be read or written, or an entry that it cannot take."""


class BackendError(O3dmarkError):
    """A library underneath failed in a way that the input does not explain."""
