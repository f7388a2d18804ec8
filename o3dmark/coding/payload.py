"""Messages and codewords: frame, keyed permutation, error-correcting code, keyed whitening; and back from soft bits.

    message -> frame (k,) -> keyed permutation -> word (k,) -> codeword (n,) -> XOR keyed stream -> bits (n,)

The permutation makes the bits of any two messages independent (see `permutation`). There are no check bits. Every bit
beyond the frame serves correction, and the p-value of the nearest codeword decides whether a message is there: at most
2^k codewords could have been found, each by chance with the probability that `detection.sign_test` counts, and the
whitening makes a wrong key and an unmarked mesh exactly such a chance. Sixteen check bits in a code of the same length
were measured to do no better at the same false-positive rate, even with a list of candidates to check.
"""

import abc
import itertools
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from o3dmark.arrays import Bits
from o3dmark.coding.detection import Detection, detect, weights
from o3dmark.coding.keys import Key, Stream
from o3dmark.coding.permutation import permuted, restored
from o3dmark.errors import SpecError
from o3dmark.registry import Registry, option

CODES: "Registry[Code]" = Registry("code")

# Part of the format: golden values in the tests hold them.
_SIZES = (1, 2, 4, 8, 16, 32)  # bytes that a frame can hold
_KIND_BITS = 2
_TEXT, _FULL, _SHORT = range(3)  # UTF-8 and zeros; bytes that fill the frame; bytes, 0x80 and zeros
_PROOF_BITS = 19  # that the frame leaves over, so that a reading without errors has a p-value of 2^-19, or 2e-6

# And of the reader alone.
_SEARCH = 32  # of the least trusted basis bits are flipped in pairs: 1 word of 32 bits in 100 is missed, in some 10 ms


@dataclass(frozen=True)
class Decoded:
    """What was read: the message, or None; and the test of the nearest codeword, all possible messages charged."""

    message: str | None
    detection: Detection

    @property
    def found(self) -> bool:
        """Whether a message was read."""
        return self.message is not None

    @property
    def log10_p(self) -> float:
        """log10 of `p_value`, which may be too small for a double."""
        return self.detection.log10_p

    @property
    def p_value(self) -> float:
        """Probability that a wrong key or an unmarked mesh reads as well as this."""
        return self.detection.p_value

    @property
    def matches(self) -> int:
        """Signs that agree with the nearest codeword."""
        return self.detection.matches

    @property
    def corrected_bits(self) -> int | None:
        """Signs that the code turned over; None when no message was found."""
        return self.detection.n_bits - self.matches if self.found else None

    def to_dict(self) -> dict[str, Any]:
        """found, message, corrected_bits and what the test says, ready for JSON."""
        read = {"found": self.found, "message": self.message, "corrected_bits": self.corrected_bits}
        return read | self.detection.to_dict()


@dataclass(frozen=True)
class Code(abc.ABC):
    """A binary linear code of any length n, with ordered-statistics decoding. k = 2 + 8 message_bytes."""

    name: ClassVar[str] = ""

    message_bytes: int | None = option(
        None, "bytes in the frame: 1, 2, 4, 8, 16 or 32; none: as many as the bits carry"
    )

    def __post_init__(self) -> None:
        if self.message_bytes not in (None, *_SIZES):
            raise ValueError(f"message_bytes should be one of {_SIZES}, not {self.message_bytes}")

    @abc.abstractmethod
    def generator(self, k: int, n: int) -> Bits:
        """The generator matrix (k, n), of rank k."""

    def frame_bytes(self, n_bits: int) -> int:
        """The message bytes that ``n_bits`` carry. Errors: SpecError when it is none; says what would be enough."""
        sizes = _SIZES if self.message_bytes is None else (self.message_bytes,)
        fitting = [size for size in sizes if least_bits(size) <= n_bits]
        if not fitting:
            raise SpecError(f"{n_bits} bits carry no message of {sizes[0]} bytes; {_needs()}")
        return fitting[-1]

    def encode(self, message: str, n_bits: int, key: Key) -> Bits:
        """The bits (n_bits,) that stand for a text, or for the bytes of ``"hex:..."``.

        Errors: SpecError when the message is empty, malformed or too long; says how many bits it needs.
        """
        size = self.frame_bytes(n_bits)
        word = permuted(_frame(message, size), key)
        return gf2_matmul(word, self.generator(_k(size), n_bits)) ^ _whitening(key, n_bits)

    def decode(
        self,
        soft: ArrayLike,
        key: Key,
        *,
        hypotheses: int = 1,
        false_positive_rate: float = 1e-4,
        shown: float | None = None,
    ) -> Decoded:
        """The message in soft bits (n,): sign is the bit, magnitude the trust in it.

        Found means that the nearest codeword is a message and its p-value is ``false_positive_rate`` at most, so a
        wrong key yields a message no more often than that. ``hypotheses``: readings among which this one was chosen;
        ``shown``: what else speaks for them (see `detect`).
        """
        values = np.asarray(soft, np.float64)
        n_bits = len(values)
        size = self.frame_bytes(n_bits)
        G, white = self.generator(_k(size), n_bits), _whitening(key, n_bits)
        word = decode_osd(G, (values > 0) ^ white, weights(values))
        bits = gf2_matmul(word, G) ^ white
        charged = int(hypotheses) << len(word)
        rate = false_positive_rate
        detection = detect(values, bits, false_positive_rate=rate, hypotheses=charged, shown=shown)
        return Decoded(_unframe(restored(word, key)) if detection.present else None, detection)


@CODES.register("random")
@dataclass(frozen=True)
class RandomLinear(Code):
    """[I | P] with P drawn once and for all from a public stream: exists for every n, and as good as BCH when short."""

    def generator(self, k: int, n: int) -> Bits:
        """Identity (k, k) beside pseudo-random parities (k, n - k)."""
        return _random_generator(k, n)


@CODES.register("repetition")
@dataclass(frozen=True)
class Repetition(Code):
    """The frame over and over until n bits are full: the baseline that a code must beat."""

    def generator(self, k: int, n: int) -> Bits:
        """Identities (k, k) side by side, cut at n columns."""
        return np.resize(np.eye(k, dtype=np.uint8), (-(-n // k) * k, k)).T[:, :n]


def least_bits(message_bytes: int) -> int:
    """The least n that carries so many bytes: the frame, a third of it for correction, and the bits that prove it."""
    k = _k(message_bytes)
    return k + k // 3 + _PROOF_BITS


def decode_osd(G: Bits, bits: ArrayLike, weight: ArrayLike) -> Bits:
    """The information word (k,) whose codeword differs from ``bits`` (n,) in the least total ``weight`` (n,).

    Ordered-statistics decoding (Fossorier and Lin 1995): the k most trusted independent bits, the basis, determine a
    codeword; every way to flip up to four of them, as two patterns of one or two, is weighed. Nearly, not always, the
    optimum: pairs are taken among the 32 least trusted of the k.
    """
    y, w = np.asarray(bits, np.uint8), np.asarray(weight, np.float32)
    k, n = G.shape
    A, basis = row_reduce(np.hstack([G, np.eye(k, dtype=np.uint8)]), np.argsort(-w, kind="stable"))
    others = np.setdiff1d(np.arange(n), basis)
    P, back = A[:, others], A[:, n:]  # basis bits -> the other bits; basis bits -> information word
    wrong, w_others = gf2_matmul(y[basis], P) ^ y[others], w[others]

    flips = _flips(k)
    price = np.append(w[basis], np.float32(0))[flips].sum(axis=1)
    parity = np.vstack([P, np.zeros_like(P[:1])])[flips]
    turned = parity[:, 0] ^ parity[:, 1]
    # of two patterns that beat the best single one, neither costs more in the basis, and one costs half at most
    best = (price + np.einsum("ij,j->i", turned ^ wrong, w_others)).min()
    cheap = price <= best
    flips, price, turned = flips[cheap], price[cheap], turned[cheap]
    half = price <= best / 2

    signs = 1 - 2 * turned.astype(np.float32)
    gain = 0.5 * np.where(wrong, w_others, -w_others)
    # where two parts flip the same bit the sum is too high, but that codeword stands elsewhere at its true cost
    # einsum, not @: BLAS would start threads, which on a busy machine wait for each other longer than this takes
    total = price[half, None] + price + np.einsum("ik,kj->ij", signs[half] * gain, signs.T.copy())
    first, second = np.unravel_index(np.argmin(total), total.shape)
    flipped = np.bincount(np.concatenate([flips[half][first], flips[second]]), minlength=k + 1)[:k] & 1
    return gf2_matmul(y[basis] ^ flipped.astype(np.uint8), back)


def gf2_matmul(X: Bits, Y: Bits) -> Bits:
    """The matrix product over GF(2). Sums of uint8 wrap at 256, which leaves their parity alone."""
    return np.asarray(X @ Y & 1, np.uint8)


def row_reduce(A: Bits, order: NDArray[np.intp]) -> tuple[Bits, list[int]]:
    """Reduce A over GF(2) so that its first k independent columns in ``order`` are the identity; returns both."""
    basis: list[int] = []
    for column in order.tolist():
        row = len(basis)
        pivots = np.flatnonzero(A[row:, column])
        if not len(pivots):
            continue
        A[[row, row + pivots[0]]] = A[[row + pivots[0], row]]
        others = A[:, column].astype(bool)
        others[row] = False
        A[others] ^= A[row]
        basis.append(column)
        if len(basis) == len(A):
            break
    return A, basis


@cache
def _flips(k: int) -> NDArray[np.int64]:
    """What to flip (p, 2): nothing, each one of k, each pair of the last 32. The position k stands for no bit."""
    pairs = itertools.combinations(range(max(0, k - _SEARCH), k), 2)
    return np.array([(k, k), *((i, k) for i in range(k)), *pairs])


@cache
def _random_generator(k: int, n: int) -> Bits:
    parities = Stream(b"public", f"payload/random/{k}/{n}").bits(k * (n - k))
    G = np.hstack([np.eye(k, dtype=np.uint8), parities.reshape(k, n - k)])
    G.setflags(write=False)
    return G


def _k(message_bytes: int) -> int:
    return _KIND_BITS + 8 * message_bytes


def _whitening(key: Key, n_bits: int) -> Bits:
    return key.stream("payload/whitening").bits(n_bits)


def _needs() -> str:
    """Which bits carry which messages, for error texts."""
    return "it takes " + ", ".join(f"{least_bits(size)} bits for {size}" for size in _SIZES)


def _frame(message: str, size: int) -> Bits:
    """The frame (2 + 8 size,): kind, then the bytes."""
    if message.startswith("hex:"):
        try:
            content = bytes.fromhex(message[4:])
        except ValueError:
            raise SpecError("after 'hex:' a message is pairs of hexadecimal digits") from None
        kind, end = (_FULL, b"") if len(content) == size else (_SHORT, b"\x80")
    else:
        try:
            content, kind, end = message.encode(), _TEXT, b""
        except UnicodeEncodeError:
            raise SpecError("the message is not a text that UTF-8 can write; give its bytes as 'hex:...'") from None
        if b"\0" in content:
            raise SpecError("a text holds no zero character; give its bytes as 'hex:...'")
    if not content:
        raise SpecError("the message is empty")
    if len(content) > size:
        raise SpecError(f"the message is {len(content)} bytes long, {size} fit; {_needs()}")
    padded = (content + end).ljust(size, b"\0")
    return np.unpackbits(np.frombuffer(bytes([kind]) + padded, np.uint8))[8 - _KIND_BITS :]


def _unframe(frame: Bits) -> str | None:
    """The message of a frame, or None when no message has that frame."""
    kind, content = int(frame[:_KIND_BITS] @ [2, 1]), np.packbits(frame[_KIND_BITS:]).tobytes()
    try:
        if kind == _TEXT:
            message = content.rstrip(b"\0").decode()
        else:
            message = "hex:" + (content if kind == _FULL else content.rstrip(b"\0")[:-1]).hex()
        return message if np.array_equal(_frame(message, len(content)), frame) else None
    except (UnicodeDecodeError, SpecError):
        return None
