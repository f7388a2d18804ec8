"""XML read in pieces by expat, under limits: nothing in it can expand, nest without end, or fill the memory.

The pieces end before a "<", so that no tag is cut in two, and a reader may take over the bytes of what it knows to be
plain (a million vertices) from the parser.
"""

from collections.abc import Iterable, Iterator
from xml.parsers import expat

from o3dmark.errors import MeshError

PIECE = 1 << 20  # bytes
_LONGEST = 4 << 20  # bytes of a tag or a comment, which expat keeps whole
_DEEPEST = 64
_MOST_NAMES = 10_000  # of elements, attributes and prefixes together; expat remembers all of them


class XmlReader:
    """Feeds a document to `start` and `end`; a format overrides them.

    ``title`` names the document in errors; names of elements and attributes come as "namespace name", or "name".
    Errors: MeshError for what is not well-formed, not UTF-8, has a document type, or exceeds the limits above.
    """

    def __init__(self, title: str) -> None:
        self.title = title
        self.prefixes: dict[str, str] = {}
        self.has_comments = False
        self.piece = b""
        self.depth = 0
        self._names: set[str] = set()
        self._before, self._passed = 0, 0  # bytes before the piece, and bytes that the parser never saw
        # Without a dictionary of names, which would keep each for ever.
        self._parser = expat.ParserCreate("utf-8", " ", None)
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.StartNamespaceDeclHandler = self._prefix
        self._parser.StartDoctypeDeclHandler = self._doctype
        self._parser.XmlDeclHandler = self._declaration
        self._parser.CommentHandler = self._comment

    def start(self, name: str, attributes: dict[str, str]) -> None:
        """An element begins."""

    def end(self, name: str) -> None:
        """An element ends."""

    def take(self, piece: bytes) -> None:
        """Read a piece; overridden where not all of it goes through the parser."""
        self.feed(0, len(piece))

    def read(self, pieces: Iterable[bytes]) -> Iterator[bytes]:
        """Read a document from its bytes in any portions, and give it back in the pieces that were read."""
        for piece in _whole_tags(pieces):
            if not self._before and piece[:2] in (b"\xff\xfe", b"\xfe\xff", b"<\0", b"\0<"):
                raise self.wrong("is UTF-16; save it as UTF-8")
            self.piece = piece
            self.take(piece)
            yield piece
            self._before += len(piece)
        try:
            self._parser.Parse(b"", True)
        except expat.ExpatError as error:
            raise self._not_xml(error) from None

    def feed(self, start: int, stop: int) -> None:
        """Let the parser have this part of the piece."""
        try:
            self._parser.Parse(self.piece[start:stop], False)
        except expat.ExpatError as error:
            raise self._not_xml(error) from None
        unfinished = self._before + stop - self._passed - max(self._parser.CurrentByteIndex, 0)
        if unfinished > _LONGEST:
            raise self.wrong(f"has a tag or a comment of more than {_LONGEST >> 20} MiB")

    def skip(self, count: int) -> None:
        """So many bytes of the piece are not fed to the parser."""
        self._passed += count

    def tag_start(self) -> int:
        """Where in the piece the tag of the element that begins stands. Errors: MeshError for one that began before."""
        at = self._parser.CurrentByteIndex + self._passed - self._before
        if at < 0:
            raise self.wrong(f"has a tag of more than {PIECE >> 20} MiB")
        return at

    def wrong(self, what: str) -> MeshError:
        return MeshError(f"{self.title} {what}")

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._names.add(name)
        self._names.update(attributes)
        self.depth += 1
        if self.depth > _DEEPEST or len(self._names) > _MOST_NAMES:
            raise self.wrong(f"nests elements more than {_DEEPEST} deep, or has more than {_MOST_NAMES} names of them")
        self.start(name, attributes)

    def _end(self, name: str) -> None:
        self.depth -= 1
        self.end(name)

    def _prefix(self, prefix: str | None, uri: str | None) -> None:
        self.prefixes[prefix or ""] = uri or ""
        if len(self.prefixes) > _MOST_NAMES:
            raise self.wrong("declares too many name spaces")

    def _doctype(self, *_: object) -> None:
        raise self.wrong("has a document type, which may hide entities that expand; remove <!DOCTYPE ...>")

    def _declaration(self, _version: str, encoding: str | None, _standalone: int) -> None:
        if encoding is not None and encoding.lower() not in ("utf-8", "us-ascii"):
            raise self.wrong(f"is written in {encoding}; save it as UTF-8")

    def _comment(self, _text: str) -> None:
        self.has_comments = True

    def _not_xml(self, error: expat.ExpatError) -> MeshError:
        return self.wrong(f"is damaged: {expat.ErrorString(error.code)}")


def _whole_tags(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """The same bytes in pieces that end before a "<", wherever a portion has one."""
    rest = b""
    for piece in pieces:
        cut = piece.rfind(b"<")
        if cut < 0 and len(rest) < PIECE:
            rest += piece
            continue
        cut = max(cut, 0)
        yield rest + piece[:cut]
        rest = piece[cut:]
    yield rest
