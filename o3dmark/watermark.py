"""A watermark: the method that hides bits and the code that makes bits of a message; one object for owner and reader.

    mark = Watermark()                            # or a profile, or Watermark(method=..., code=...)
    marked = mark.embed(mesh, "(c) 26", key)
    mark.extract(attacked, key).message           # -> "(c) 26", or None
    mark.detect(attacked, key, "(c) 26").present  # -> True

The reader needs the key and the same watermark, nothing of the embedding (see `profiles`).
"""

from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from o3dmark.coding.detection import Detection
from o3dmark.coding.keys import Key
from o3dmark.coding.payload import CODES, Code, Decoded
from o3dmark.coding.words import one_in, table
from o3dmark.errors import KeyFileError, SpecError
from o3dmark.methods import METHODS, Extraction, Method
from o3dmark.registry import spec_of

Mesh = TypeVar("Mesh")
"""A mesh of any kind: the marked one is of the kind that was given."""


@dataclass(frozen=True, repr=False)
class Reading:
    """What was read from a mesh: the raw bits and, through the code, the message."""

    extraction: Extraction
    decoded: Decoded

    def __repr__(self) -> str:
        return f"Reading({'none' if self.message is None else repr(self.message)}, p={self.p_value:.2g})"

    def _repr_html_(self) -> str:
        corrected = self.decoded.corrected_bits
        rows = {
            "message": "none" if self.message is None else self.message,
            "mistaken": one_in(self.decoded.log10_p),
            "corrected bits": "-" if corrected is None else f"{corrected} of {len(self.extraction.soft)}",
            "how it was read": self.extraction.note,
        }
        return table(rows)

    @property
    def found(self) -> bool:
        return self.decoded.found

    @property
    def message(self) -> str | None:
        return self.decoded.message

    @property
    def p_value(self) -> float:
        """Probability that a wrong key, or an unmarked mesh, reads as well: all messages and hypotheses charged."""
        return self.decoded.p_value

    def to_dict(self) -> dict[str, Any]:
        return self.decoded.to_dict() | raw_dict(self.extraction)


@dataclass(frozen=True)
class Watermark:
    """Method, code, and the number of bits between them."""

    method: Method = field(default_factory=lambda: METHODS.make("layered"))
    code: Code = field(default_factory=lambda: CODES.make("random"))
    n_bits: int = 64

    def __post_init__(self) -> None:
        for name, kind, makes in (("method", Method, "METHODS"), ("code", Code, "CODES")):
            if not isinstance(given := getattr(self, name), kind):
                raise SpecError(f"{name} is {given!r}: an object is wanted, as {makes}.make({str(given)!r}) makes one")
        if self.n_bits < 1:
            raise SpecError(f"a watermark has 1 bit or more, not {self.n_bits}")

    def prepare(self, mesh: Any, key: Key) -> Any:
        """What marking finds out of ``mesh`` whatever the bits: see `Method.prepare`. The others take it for a mesh."""
        _check_key(key)
        return self.method.prepare(mesh, self.n_bits, key)

    def embed(self, mesh: Mesh, message: str, key: Key) -> Mesh:
        """A copy of ``mesh`` that carries ``message``, a text or ``"hex:..."``.

        Errors: SpecError when the message does not fit the code, MeshError and CapacityError as in `Method.embed`;
        KeyFileError for what is no key.
        """
        _check_message(message)
        _check_key(key)
        marked: Mesh = self.method.embed(mesh, self.code.encode(message, self.n_bits, key), key)
        return marked

    def extract(self, mesh: Any, key: Key, *, reference: Any = None, false_positive_rate: float = 1e-4) -> Reading:
        """Read the message, blindly unless the method takes a ``reference``.

        A wrong key yields a message no more often than ``false_positive_rate``.
        """
        extraction = self.extract_bits(mesh, key, reference=reference)
        return self.decode(extraction, key, false_positive_rate=false_positive_rate)

    def decode(self, extraction: Extraction, key: Key, *, false_positive_rate: float = 1e-4) -> Reading:
        """The message in what `extract_bits` returned."""
        decoded = self.code.decode(
            extraction.soft,
            key,
            hypotheses=extraction.hypotheses,
            false_positive_rate=false_positive_rate,
            shown=extraction.log10_p,
        )
        return Reading(extraction, decoded)

    def detect(
        self,
        mesh: Any,
        key: Key,
        message: str | None = None,
        *,
        reference: Any = None,
        false_positive_rate: float = 1e-6,
    ) -> Detection:
        """Is our mark there? With the ``message`` known the test is far sharper than without.

        It then asks of all the readings that the method tried, not only of the one that it believed in; where another
        message of the same key reads better, the answer is no and names it.
        """
        if message is not None:
            _check_message(message)
        extraction = self.extract_bits(mesh, key, reference=reference)
        return self.test(extraction, key, message, false_positive_rate=false_positive_rate)

    def test(
        self, extraction: Extraction, key: Key, message: str | None = None, *, false_positive_rate: float = 1e-6
    ) -> Detection:
        """The answer of `detect` for what `extract_bits` returned."""
        if message is None:
            return self.decode(extraction, key, false_positive_rate=false_positive_rate).decoded.detection
        bits = self.code.encode(message, self.n_bits, key)
        detection = extraction.detect(bits, false_positive_rate=false_positive_rate)
        read = self.decode(extraction, key).decoded
        if read.message is None or read.log10_p >= detection.log10_p:
            return detection
        if np.array_equal(self.code.encode(read.message, self.n_bits, key), bits):
            return detection
        return replace(detection, other=read.message)

    def embed_bits(self, mesh: Mesh, bits: ArrayLike, key: Key) -> Mesh:
        """Raw bits past the code: what the paper and the benchmark measure."""
        _check_key(key)
        marked: Mesh = self.method.embed(mesh, bits, key)
        return marked

    def extract_bits(self, mesh: Any, key: Key, *, reference: Any = None) -> Extraction:
        """Raw soft bits (n_bits,) past the code; all zero when the mesh is too small to carry so many."""
        _check_key(key)
        return self.method.extract(mesh, self.n_bits, key, reference=reference)

    def to_dict(self) -> dict[str, Any]:
        return {"method": spec_of(self.method), "code": spec_of(self.code), "n_bits": self.n_bits}


def _check_message(message: object) -> None:
    """Errors: SpecError, which does not repeat what may be a secret."""
    if isinstance(message, Key):
        order = "embed(mesh, message, key), detect(mesh, key, message)"
        raise SpecError(f"the key stands where the message should: {order}")
    if not isinstance(message, str):
        kind = type(message).__name__
        raise SpecError(f"a message is a text, or 'hex:' and digits of bytes, not of type {kind}: write it as a text")


def _check_key(key: object) -> None:
    """Errors: KeyFileError, which does not repeat what may be a secret."""
    if not isinstance(key, Key):
        ways = "Key.load(path) reads a key file, Key.from_passphrase(text) makes one of words"
        raise KeyFileError(f"a Key is wanted, not {type(key).__name__}: {ways}")


def raw_dict(extraction: Extraction) -> dict[str, Any]:
    """An extraction, but for the readings not taken, ready for JSON."""
    return {
        "bits": bit_text(extraction.bits),
        "soft": [round(float(value), 4) for value in extraction.soft],
        "hypotheses": extraction.hypotheses,
        **extraction.which(),
        "note": extraction.note,
        "patches": [patch.to_dict() for patch in extraction.patches],
    }


def bit_text(bits: ArrayLike) -> str:
    """Bits (n,) as a text of 0 and 1."""
    return "".join(map(str, np.asarray(bits, int).tolist()))


def parse_bits(text: str) -> NDArray[np.uint8]:
    """A text of 0 and 1 as bits (n,). Errors: SpecError for any other sign, or none."""
    if not text or set(text) - set("01"):
        raise SpecError("bits are written with 0 and 1, like 01101001")
    return np.array([int(sign) for sign in text], np.uint8)
