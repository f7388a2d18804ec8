"""The owner's secret, and the portable pseudo-random streams drawn from it.

A mark must be readable in ten years, so the streams rest on SHAKE-256 (FIPS 202) and nothing else: stream(label) is
the output of SHAKE-256 over a domain tag, the secret and the label. Golden values in the tests freeze them.
Nothing here prints or logs the secret.
"""

import hashlib
import os
import re
import secrets
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from o3dmark.errors import KeyFileError

_DOMAIN = b"o3dmark/1"
_HEADER = "o3dmark-key-1"
_SECRET_BYTES = 32


@dataclass(frozen=True)
class Key:
    """A 256-bit secret. ``str`` and ``repr`` do not show it."""

    secret: bytes = field(repr=False)

    def __post_init__(self) -> None:
        if not isinstance(self.secret, bytes) or len(self.secret) != _SECRET_BYTES:
            raise KeyFileError(f"a key is {_SECRET_BYTES} bytes")

    @classmethod
    def generate(cls) -> "Key":
        """A new key from the operating system's randomness."""
        return cls(secrets.token_bytes(_SECRET_BYTES))

    @classmethod
    def from_passphrase(cls, passphrase: str) -> "Key":
        """A key from words, by scrypt (RFC 7914; n = 2^14, r = 8, p = 1). No stronger than the words are."""
        return cls(hashlib.scrypt(passphrase.encode(), salt=_DOMAIN, n=2**14, r=8, p=1, dklen=_SECRET_BYTES))

    @classmethod
    def load(cls, path: str | Path) -> "Key":
        """Read a key file. Errors: KeyFileError when it is missing, unreadable or not a key."""
        try:
            text = Path(path).read_text(encoding="ascii", errors="strict")
        except FileNotFoundError:
            raise KeyFileError(f"no key file at {str(path)!r}; `o3dmark keygen FILE` makes one") from None
        except (OSError, UnicodeDecodeError) as error:
            raise KeyFileError(f"cannot read the key file {str(path)!r}: {type(error).__name__}") from None
        found = re.fullmatch(rf"{_HEADER}:([0-9a-f]{{{2 * _SECRET_BYTES}}})\s*", text)
        if not found:
            raise KeyFileError(f"{str(path)!r} is not a key file: one line, '{_HEADER}:' and 64 hexadecimal digits")
        return cls(bytes.fromhex(found[1]))

    def save(self, path: str | Path) -> None:
        """Write the key file with mode 0600. An existing file is never overwritten: KeyFileError."""
        try:
            handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with os.fdopen(handle, "w", encoding="ascii") as file:
                file.write(f"{_HEADER}:{self.secret.hex()}\n")
        except FileExistsError:
            raise KeyFileError(f"{str(path)!r} exists; a key is never overwritten") from None
        except OSError as error:
            raise KeyFileError(f"cannot write the key file {str(path)!r}: {error.strerror}") from None

    def derived(self, label: str) -> "Key":
        """Another key that follows from this one, which nobody can find from it, nor from others of the kind."""
        return Key(self.stream(f"key/{label}").read(_SECRET_BYTES))

    @property
    def fingerprint(self) -> str:
        """16 hexadecimal digits that tell keys apart and nothing about them."""
        return self.stream("fingerprint").read(8).hex()

    def stream(self, label: str) -> "Stream":
        """The pseudo-random stream that belongs to this key and ``label``; the same ten years on, on any machine."""
        return Stream(self.secret, label)


class Stream:
    """Successive draws from one labelled stream. Every draw consumes whole bytes, so draws can be replayed in order."""

    def __init__(self, secret: bytes, label: str) -> None:
        self._source = hashlib.shake_256(_DOMAIN + b"\0" + secret + label.encode())
        self._position = 0

    def read(self, count: int) -> bytes:
        """``count`` bytes."""
        start, self._position = self._position, self._position + count
        return self._source.digest(self._position)[start:]

    def uniform(self, count: int) -> NDArray[np.float64]:
        """``count`` numbers (count,) in [0, 1), each with 53 random bits."""
        words = np.frombuffer(self.read(8 * count), "<u8")
        return (words >> np.uint64(11)).astype(np.float64) * 2.0**-53

    def bits(self, count: int) -> NDArray[np.uint8]:
        """``count`` fair bits (count,), 0 or 1."""
        return np.unpackbits(np.frombuffer(self.read(-(-count // 8)), np.uint8))[:count]

    def permutation(self, count: int) -> NDArray[np.int64]:
        """A permutation (count,) of 0 .. count - 1: the order that sorts ``count`` random words."""
        return np.argsort(np.frombuffer(self.read(8 * count), "<u8"), kind="stable").astype(np.int64)
