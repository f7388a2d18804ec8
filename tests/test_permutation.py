"""The keyed permutation of words: a bijection, whose images show nothing of how words are alike."""

import itertools

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from o3dmark.coding.keys import Key
from o3dmark.coding.payload import RandomLinear
from o3dmark.coding.permutation import permuted, restored

KEY, OTHER = Key(bytes(range(32))), Key(bytes(range(1, 33)))
WORDS = st.integers(1, 130).flatmap(lambda half: st.lists(st.integers(0, 1), min_size=2 * half, max_size=2 * half))


@given(word=WORDS, secret=st.binary(min_size=32, max_size=32))
def test_a_word_comes_back(word: list[int], secret: bytes) -> None:
    bits = np.array(word, np.uint8)
    image = permuted(bits, Key(secret))
    assert image.dtype == np.uint8
    assert image.shape == bits.shape
    assert np.array_equal(restored(image, Key(secret)), bits)
    assert np.array_equal(permuted(restored(bits, Key(secret)), Key(secret)), bits)


def test_all_words_have_different_images() -> None:
    images = {permuted(np.array(word, np.uint8), KEY).tobytes() for word in itertools.product([0, 1], repeat=10)}
    assert len(images) == 1024


def test_golden_images() -> None:
    """Made by this program on 2026-11-26. If this fails, marks made before can no longer be read."""

    def packed(size: int) -> str:
        return np.packbits(permuted(np.arange(size, dtype=np.uint8) % 3 % 2, KEY)).tobytes().hex()

    assert [packed(size) for size in (10, 34, 130)] == [
        "2000",
        "bb2e2a4800",
        "c210b7cf1089489ee6bcba1df5f1702840",
    ]


def test_words_that_differ_in_a_bit_have_independent_images() -> None:
    """Half of the bits differ, whichever bit it was, and no bit of the images always does or never does."""
    rng = np.random.default_rng(1)
    words = rng.integers(0, 2, (300, 34), dtype=np.uint8)
    images = np.array([permuted(word, KEY) for word in words])
    for bit in (0, 16, 17, 33):
        flipped = words.copy()
        flipped[:, bit] ^= 1
        changed = np.array([permuted(word, KEY) for word in flipped]) ^ images
        assert abs(changed.mean() - 0.5) < 0.02  # four standard deviations
        assert (abs(changed.mean(axis=0) - 0.5) < 0.13).all()  # four and a half


def test_keys_permute_differently() -> None:
    word = np.zeros(34, np.uint8)
    assert not np.array_equal(permuted(word, KEY), permuted(word, OTHER))


def test_messages_in_a_row_have_nothing_in_common() -> None:
    """Serial numbers differ in half of their bits, like any two messages: 28 to 36 of 64 on average is chance."""
    bits = np.array([RandomLinear().encode(f"c{number:03}", 64, KEY) for number in range(300)])
    differing = (bits[:, None] != bits[None]).sum(axis=2)[np.triu_indices(300, 1)]
    assert abs(differing.mean() - 32) < 0.2
    assert abs(differing.std() - 4) < 0.3


def test_the_sum_of_three_messages_is_nobodys() -> None:
    """A + B - C, vertex by vertex, has the bits of A xor B xor C: without the permutation those of "c03"."""
    a, b, c, d = (RandomLinear().encode(f"c{number:02}", 64, KEY) for number in range(4))
    mixed = a ^ b ^ c
    assert 16 < (mixed != d).sum() < 48
    assert RandomLinear().decode(2.0 * mixed - 1, KEY).message is None
