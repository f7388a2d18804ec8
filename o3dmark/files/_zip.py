"""Zip archives of which a few files change, and everything else keeps its very bytes.

`zipfile` finds the entries; the archive is then written again from the old bytes, so that order, names, times, extra
fields, comments, and the compressed bytes of what did not change stay. Only sizes, checksums and offsets are made anew.
"""

import io
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterable, Mapping
from typing import IO

from o3dmark.errors import MeshError

_LOCAL, _CENTRAL = 30, 46  # bytes of a header before the name of its file
_MOST_ENTRIES = 65_535  # of an archive without the extensions for huge ones; each costs memory
_ALLOWANCE = 256 << 20  # bytes beside ten times the archive that all its files together may unfold to
_FULL = b"\xff\xff\xff\xff"  # "the number stands in the extra field"
_ZIP64, _PADDING = 0x0001, 0x1986  # kinds of extra fields; the second is what USD fills gaps with
_END = b"PK\x05\x06"  # of the directory
_STREAMED = 0x0008  # flag: sizes follow the data instead of standing before them
_ENCRYPTED = 0x0001
_BROKEN = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    EOFError,
    NotImplementedError,
    OSError,
    RuntimeError,
    ValueError,
)


class Archive:
    """The entries of a zip archive, none of them read yet.

    Errors: MeshError for what is no archive, is damaged, encrypted, or unfolds to more than ten times its size and
    256 MiB.
    """

    def __init__(self, name: str, content: bytes) -> None:
        self.name, self.content = name, content
        if content.count(b"PK\x01\x02") > _MOST_ENTRIES:
            raise MeshError(f"{name} holds more than {_MOST_ENTRIES} files, which is more than a mesh is kept in")
        try:
            self._zip = zipfile.ZipFile(io.BytesIO(content))
            infos = self._zip.infolist()
            starts = [self._data_start(info) for info in infos]
        except _BROKEN:
            raise MeshError(f"{name} is damaged, or no zip archive") from None
        self._starts = dict(zip(map(id, infos), starts, strict=True))
        if any(info.flag_bits & _ENCRYPTED for info in infos):
            raise MeshError(f"{name} is encrypted; take the password off first")
        if sum(info.file_size for info in infos) > 10 * len(content) + _ALLOWANCE:
            raise MeshError(f"{name} would unfold to more than ten times its size and 256 MiB, as no mesh does")

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self._zip.NameToInfo)

    def stored(self, name: str) -> memoryview:
        """The bytes of an entry that is not compressed, where they stand. Errors: MeshError for a compressed one."""
        info = self._zip.NameToInfo[name]
        if info.compress_type != zipfile.ZIP_STORED:
            raise MeshError(f"{self.name}: {name} is compressed, which this format does not allow")
        start = self._starts[id(info)]
        return memoryview(self.content)[start : start + info.file_size]

    def pieces(self, name: str, size: int) -> Iterable[bytes]:
        """What an entry unfolds to, in pieces of some bytes. Errors: MeshError, possibly after the first pieces."""
        info = self._zip.NameToInfo[name]
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise MeshError(f"{self.name}: {name} is compressed in an unusual way; save it with deflate")
        try:
            with self._zip.open(info) as stream:
                yield from _chunks(stream, size)
        except _BROKEN:
            raise MeshError(f"{self.name} is damaged: {name} cannot be unfolded") from None

    def replaced(self, new: Mapping[str, Callable[[], Iterable[bytes]]], align: int = 1) -> bytes:
        """The archive with other contents for some names, compressed as the old ones were.

        ``align``: data begin at multiples of so many bytes, by padding in the extra field of their headers.
        Errors: MeshError for entries that overlap, or that become larger than 4 GiB where 64 bits are not set up.
        """
        try:
            return self._replaced(new, align)
        except struct.error:
            raise MeshError(f"{self.name} is damaged: its headers are too short") from None

    def _replaced(self, new: Mapping[str, Callable[[], Iterable[bytes]]], align: int) -> bytes:
        infos = self._zip.infolist()
        fresh = {id(self._zip.NameToInfo[name]): make for name, make in new.items()}
        records = self._central_records()
        written: list[bytes | bytearray | memoryview] = []
        content, at, length = memoryview(self.content), 0, 0

        def put(part: bytes | bytearray | memoryview) -> None:
            nonlocal length
            written.append(part)
            length += len(part)

        for i in sorted(range(len(infos)), key=lambda i: infos[i].header_offset):
            info = infos[i]
            local, start = info.header_offset, self._starts[id(info)]
            if local < at or start + info.compress_size > self._zip.start_dir:
                raise MeshError(f"{self.name} is damaged: its entries overlap")
            put(content[at:local])
            _put_offset(self.name, records[i], length - local)
            at = start + info.compress_size
            header, data = bytearray(content[local:start]), content[start:at]
            if id(info) in fresh:
                at += self._descriptor(info, at)
                data = self._renewed(info, fresh[id(info)](), header, records[i])
            put(_aligned(header, length, align))
            put(data)
        put(content[at : self._zip.start_dir])
        tail = bytearray(content[self._zip.start_dir + sum(map(len, records)) :])
        if _END not in tail:
            raise MeshError(f"{self.name} is damaged: its directory is longer than it says")
        _move_directory(tail, length - self._zip.start_dir)
        return b"".join([*written, *records, tail])

    def _data_start(self, info: zipfile.ZipInfo) -> int:
        at = info.header_offset
        signature, name, extra = struct.unpack_from("<4s22xHH", self.content, at)
        if signature != b"PK\x03\x04" or at + _LOCAL + name + extra + info.compress_size > len(self.content):
            raise ValueError("no entry where the directory says")
        return at + _LOCAL + name + extra

    def _central_records(self) -> list[bytearray]:
        at, records = self._zip.start_dir, []
        for _ in self._zip.infolist():
            size = _CENTRAL + sum(struct.unpack_from("<HHH", self.content, at + 28))
            records.append(bytearray(self.content[at : at + size]))
            at += size
        return records

    def _descriptor(self, info: zipfile.ZipInfo, at: int) -> int:
        """How many bytes after the data repeat their sizes."""
        if info.flag_bits & _STREAMED:
            for form in ("<4sLLL", "<4sLQQ", "<LLL", "<LQQ"):
                size = struct.calcsize(form)
                found = struct.unpack(form, self.content[at : at + size].ljust(size, b"\0"))
                if found[-3:] == (info.CRC, info.compress_size, info.file_size):
                    return size
        return 0

    def _renewed(
        self, info: zipfile.ZipInfo, pieces: Iterable[bytes], header: bytearray, record: bytearray
    ) -> memoryview:
        """The new data of an entry as they are kept; its two headers are set right for them."""
        packer = zlib.compressobj(wbits=-15) if info.compress_type == zipfile.ZIP_DEFLATED else None
        check, size, kept = 0, 0, io.BytesIO()
        for piece in pieces:
            check, size = zlib.crc32(piece, check), size + len(piece)
            kept.write(packer.compress(piece) if packer else piece)
        kept.write(packer.flush() if packer else b"")
        data = kept.getbuffer()
        for place, part, fixed in ((6, header, _LOCAL), (8, record, _CENTRAL)):
            flags = struct.unpack_from("<H", part, place)[0] & ~_STREAMED
            struct.pack_into("<H", part, place, flags)
            checks = place + 8
            struct.pack_into("<L", part, checks, check)
            extra = _field(part, _extra(part, fixed), _ZIP64)
            for at, value in ((checks + 8, size), (checks + 4, len(data))):
                extra = _put_number(self.name, part, at, value, extra)
        return data


def _chunks(stream: IO[bytes], size: int) -> Iterable[bytes]:
    while piece := stream.read(size):
        yield piece


def _extra(part: bytearray, fixed: int) -> tuple[int, int]:
    """Where the extra fields of a header begin and end; its part of ``fixed`` length ends with their lengths."""
    name, extra = struct.unpack_from("<HH", part, 26 if fixed == _LOCAL else 28)
    return fixed + name, fixed + name + extra


def _field(part: bytearray, extra: tuple[int, int], kind: int) -> int:
    """Where the content of an extra field begins, or 0."""
    at, end = extra
    while at + 4 <= end:
        found, size = struct.unpack_from("<HH", part, at)
        if found == kind:
            return at + 4
        at += 4 + size
    return 0


def _put_number(name: str, part: bytearray, at: int, value: int, extra: int) -> int:
    """Write a number of a header in its place, or in the extra field if it stands there; where the next one would."""
    if part[at : at + 4] == _FULL and extra:
        struct.pack_into("<Q", part, extra, value)
        return extra + 8
    if value >= 0xFFFFFFFF:
        raise MeshError(f"{name} would hold a file of more than 4 GiB, which it is not set up for")
    struct.pack_into("<L", part, at, value)
    return extra


def _put_offset(name: str, record: bytearray, shift: int) -> None:
    """Move the place of an entry that the directory tells."""
    extra = _field(record, _extra(record, _CENTRAL), _ZIP64)
    extra += 8 * sum(record[at : at + 4] == _FULL for at in (20, 24)) if extra else 0
    wide = record[42:46] == _FULL and extra
    old = struct.unpack_from("<Q", record, extra)[0] if wide else struct.unpack_from("<L", record, 42)[0]
    _put_number(name, record, 42, old + shift, extra)


def _aligned(header: bytearray, at: int, align: int) -> bytearray:
    """A local header that stands at ``at``, padded so that the data after it are aligned."""
    if not (at + len(header)) % align:
        return header
    begin, end = _extra(header, _LOCAL)
    old = _field(header, (begin, end), _PADDING)
    if old:
        del header[old - 4 : old + struct.unpack_from("<H", header, old - 2)[0]]
    size = -(at + len(header) + 4) % align
    header += struct.pack("<HH", _PADDING, size) + bytes(size)
    struct.pack_into("<H", header, 28, len(header) - begin)
    return header


def _move_directory(tail: bytearray, shift: int) -> None:
    """Move the place of the directory, as what stands behind it tells."""
    if tail.startswith(b"PK\x06\x06"):
        struct.pack_into("<Q", tail, 48, struct.unpack_from("<Q", tail, 48)[0] + shift)
        locator = 12 + struct.unpack_from("<Q", tail, 4)[0]
        struct.pack_into("<Q", tail, locator + 8, struct.unpack_from("<Q", tail, locator + 8)[0] + shift)
    end = tail.find(_END)
    if tail[end + 16 : end + 20] != _FULL:
        struct.pack_into("<L", tail, end + 16, struct.unpack_from("<L", tail, end + 16)[0] + shift)
