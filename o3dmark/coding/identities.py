"""Whose copy is it? Each copy has a codeword of its own, drawn from the key and its name; a reading is laid on all.

Every bit serves detection, and there is no structure for a mixture of copies to fall into: to who lacks the key, the
codeword of a name is fair coins, independent of all others. So the p-value of `detection` holds for an innocent's
codeword whatever was read, from whichever copies; charged for every candidate it holds for the nearest of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from o3dmark.arrays import Bits, Bools, Floats
from o3dmark.coding.detection import charge, sign_test
from o3dmark.coding.keys import Key

_TESTED = 8  # of the candidates that agree best, whose p-values are worked out: agreement orders nearly as they do
_BLOCK = 1 << 24  # agreements held at a time


@dataclass(frozen=True)
class Candidate:
    """A codeword beside a reading: its place among the candidates, log10 of its p-value, and which bits agree.

    ``agreement`` has a 1 for each bit of the codeword that the reading has too, and a 0 for each other.
    """

    index: int
    log10_p: float
    agreement: str

    @property
    def matches(self) -> int:
        """How many bits agree."""
        return self.agreement.count("1")


def codeword(key: Key, name: str, n_bits: int) -> Bits:
    """The bits (n_bits,) of the copy of that name. Part of the format: golden values in the tests hold it."""
    return key.stream(f"copy/{name}").bits(n_bits)


def codewords(key: Key, names: Sequence[str], n_bits: int) -> Bits:
    """The bits (N, n_bits) of copies."""
    return np.array([codeword(key, name, n_bits) for name in names], np.uint8).reshape(-1, n_bits)


def nearest(readings: Floats, words: Bits, hypotheses: int) -> list[Candidate]:
    """The few of the ``words`` (N, n) that agree best with one of the ``readings`` (h, n), soft bits; surest first.

    Each is charged for ``hypotheses``, which the caller counts: readings tried, times all that could have been named.
    """
    if not len(words):
        return []
    unit = readings / np.maximum(np.linalg.norm(readings, axis=1, keepdims=True), 1e-12)
    agreement, which = _best(unit.astype(np.float32), words)
    found = []
    for index in np.argsort(-agreement, kind="stable")[:_TESTED].tolist():
        soft = readings[which[index]].astype(np.float64)
        agrees = (soft > 0) == words[index]
        found.append(Candidate(index, charge(sign_test(soft, words[index]), hypotheses), _shown(agrees)))
    return sorted(found, key=lambda candidate: candidate.log10_p)


def _shown(bits: Bools) -> str:
    return "".join("01"[int(bit)] for bit in bits)


def _best(unit: Floats, words: Bits) -> tuple[Floats, np.ndarray]:
    """For each word the highest agreement with a reading (N,), and which reading that is (N,)."""
    signs = (2.0 * words.astype(np.float32) - 1.0).T
    size = max(1, _BLOCK // len(unit))
    blocks = [unit @ signs[:, start : start + size] for start in range(0, len(words), size)]
    return np.concatenate([b.max(axis=0) for b in blocks]), np.concatenate([b.argmax(axis=0) for b in blocks])
