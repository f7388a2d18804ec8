"""A keyed permutation of words of bits: to who lacks the key, the images of any two words have nothing in common.

Without it, code and whitening are affine over GF(2): the sum of three messages' bits is that of a fourth, which three
copies of a mesh can be mixed to, and messages that differ in a letter have bits in common.

It is a Feistel network (Luby and Rackoff 1988, who need four rounds of a random function): each round adds to one half
of the word a function of the other, drawn from the key.
"""

import numpy as np

from o3dmark.arrays import Bits
from o3dmark.coding.keys import Key

# Part of the format: golden values in the tests hold it. Halves of the shortest words have 5 bits; ten rounds are what
# NIST takes for words as short (SP 800-38G, FF1).
_ROUNDS = 10


def permuted(word: Bits, key: Key) -> Bits:
    """The image (k,) of a ``word`` (k,) of bits, k even."""
    left, right = np.split(word, 2)
    for number in range(_ROUNDS):
        left, right = right, left ^ _function(right, number, key)
    return np.concatenate([left, right])


def restored(image: Bits, key: Key) -> Bits:
    """The word (k,) whose image is ``image`` (k,)."""
    left, right = np.split(image, 2)
    for number in reversed(range(_ROUNDS)):
        left, right = right ^ _function(left, number, key), left
    return np.concatenate([left, right])


def _function(half: Bits, number: int, key: Key) -> Bits:
    digits = np.packbits(half).tobytes().hex()
    return key.stream(f"payload/permutation/{2 * len(half)}/{number}/{digits}").bits(len(half))
