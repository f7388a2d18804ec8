"""Keys and their streams. The golden values freeze the streams: if one of these tests fails, old marks are lost."""

import hashlib
import stat
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from o3dmark.coding.keys import Key
from o3dmark.errors import KeyFileError

KEY = Key(bytes(range(32)))
# 2026-11-22, OpenSSL 3.0: openssl dgst -shake256 -xoflen 80 over "o3dmark/1", a zero byte, bytes 0..31 and "golden"
SHAKE = bytes.fromhex(
    "69718532a84481a41e2f4236a22d0f211508d8314ce44198481a8d3660b83342ce3bc79c27288fa7"
    "d83971a2c57e8aaec53b52c18ae23abcc98a0d4f298b490693ae0bfed34baedb1725e60477ec9ce9"
)


# ---- streams ----


def test_golden_bits() -> None:
    expected = [int(bit) for byte in SHAKE for bit in f"{byte:08b}"]
    assert KEY.stream("golden").bits(640).tolist() == expected


def test_golden_uniform() -> None:
    expected = [(int.from_bytes(SHAKE[i : i + 8], "little") >> 11) / 2**53 for i in range(0, 80, 8)]
    assert KEY.stream("golden").uniform(10).tolist() == expected
    assert expected[:3] == [0.6425974760664042, 0.1291378518128644, 0.5947554288885329]


def test_golden_permutation() -> None:
    words = [int.from_bytes(SHAKE[i : i + 8], "little") for i in range(0, 80, 8)]
    assert KEY.stream("golden").permutation(10).tolist() == sorted(range(10), key=words.__getitem__)


def test_draws_follow_one_another() -> None:
    stream = KEY.stream("golden")
    stream.uniform(3)
    assert stream.bits(12).tolist() == [0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1]  # byte 24, and half of 25
    assert stream.permutation(6).tolist() == np.argsort(np.frombuffer(SHAKE[26:74], "<u8")).tolist()


def test_golden_derived_key() -> None:
    """Made by this program on 2026-11-26."""
    assert KEY.derived("work").secret.hex()[:16] == "f17bdbf1d6090814"
    assert KEY.fingerprint == "21240151009fe3b2"


def test_derived_keys_tell_nothing_of_each_other() -> None:
    keys = [KEY, KEY.derived("a"), KEY.derived("b"), KEY.derived("a").derived("b"), Key(bytes(32)).derived("a")]
    assert len({key.secret for key in keys}) == len({key.fingerprint for key in keys}) == 5
    assert KEY.derived("a") == keys[1]


def test_golden_passphrase() -> None:
    # 2026-11-22: openssl kdf -keylen 32 -kdfopt salt:o3dmark/1 -kdfopt n:16384 -kdfopt r:8 -kdfopt p:1 SCRYPT
    secret = "a944fab4759b1cd3ec2cc6be60bb6deab9fe51be53d4827bb7c603561cc45497"
    assert Key.from_passphrase("correct horse battery staple").secret.hex() == secret


@given(st.lists(st.integers(0, 40), max_size=6))
def test_byte_aligned_draws_join_into_one_stream(counts: list[int]) -> None:
    stream, whole = KEY.stream("joined"), KEY.stream("joined").bits(8 * sum(counts))
    parts = [stream.bits(8 * count) for count in counts]
    assert np.array_equal(np.concatenate([np.zeros(0, np.uint8), *parts]), whole)


def test_labels_and_secrets_separate_streams() -> None:
    draws = {key.stream(label).bits(128).tobytes() for key in (KEY, Key(bytes(32))) for label in ("a", "b", "")}
    assert len(draws) == 6


def test_streams_are_fair() -> None:
    stream = KEY.stream("fair")
    assert abs(stream.bits(100_000).mean() - 0.5) < 5 * 0.5 / 100_000**0.5
    uniform = stream.uniform(100_000)
    assert uniform.min() >= 0
    assert uniform.max() < 1
    assert abs(uniform.mean() - 0.5) < 5 * 12**-0.5 / 100_000**0.5
    assert sorted(stream.permutation(1000)) == list(range(1000))


def test_no_draw_is_no_draw() -> None:
    stream = KEY.stream("golden")
    assert stream.bits(0).shape == stream.uniform(0).shape == stream.permutation(0).shape == (0,)
    assert np.array_equal(stream.bits(640), KEY.stream("golden").bits(640))


# ---- the secret ----


@pytest.mark.parametrize("show", [repr, str, "{}".format])
def test_a_key_does_not_show_its_secret(show: object) -> None:
    text = show(KEY)  # type: ignore[operator]
    assert KEY.secret.hex() not in text
    assert repr(KEY.secret)[2:-1] not in text


def test_generated_keys_differ() -> None:
    assert Key.generate() != Key.generate()


@pytest.mark.parametrize("secret", [b"", bytes(31), bytes(33), "0" * 32, None])
def test_a_key_is_32_bytes(secret: bytes) -> None:
    with pytest.raises(KeyFileError, match="32 bytes"):
        Key(secret)


# ---- the file ----


def test_a_key_file_reads_back_and_only_its_owner_may(tmp_path: Path) -> None:
    key = Key.generate()
    key.save(tmp_path / "key")
    assert Key.load(tmp_path / "key") == key
    assert stat.S_IMODE((tmp_path / "key").stat().st_mode) == 0o600
    assert [path.name for path in tmp_path.iterdir()] == ["key"]


def test_a_key_is_never_overwritten(tmp_path: Path) -> None:
    KEY.save(tmp_path / "key")
    with pytest.raises(KeyFileError, match="never overwritten"):
        Key.generate().save(tmp_path / "key")
    assert Key.load(tmp_path / "key") == KEY


def test_a_link_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "key").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(KeyFileError, match="never overwritten"):
        KEY.save(tmp_path / "key")
    assert not (tmp_path / "elsewhere").exists()


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(KeyFileError, match="cannot write"):
        KEY.save(tmp_path / "none" / "key")


def test_a_missing_file_says_how_to_make_one(tmp_path: Path) -> None:
    with pytest.raises(KeyFileError, match="o3dmark keygen"):
        Key.load(tmp_path / "none")


def test_a_folder_is_no_key_file(tmp_path: Path) -> None:
    with pytest.raises(KeyFileError, match="IsADirectoryError"):
        Key.load(tmp_path)


GOOD = f"o3dmark-key-1:{hashlib.sha256(b'').hexdigest()}"


@pytest.mark.parametrize("ending", ["", "\n", "\r\n"])
def test_line_endings_do_not_matter(tmp_path: Path, ending: str) -> None:
    (tmp_path / "key").write_bytes((GOOD + ending).encode())
    assert Key.load(tmp_path / "key").secret == hashlib.sha256(b"").digest()


@pytest.mark.parametrize(
    "text",
    ["", GOOD[:-1], GOOD + "0", GOOD.upper(), GOOD[14:], "x" + GOOD, GOOD + "\n" + GOOD, GOOD[:-1] + "g", "\xff"],
)
def test_a_malformed_file_is_refused_without_being_shown(tmp_path: Path, text: str) -> None:
    (tmp_path / "key").write_bytes(text.encode("latin-1"))
    with pytest.raises(KeyFileError) as caught:
        Key.load(tmp_path / "key")
    assert hashlib.sha256(b"").hexdigest()[:16] not in str(caught.value).lower()
