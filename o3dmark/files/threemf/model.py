"""One model file of a 3MF: the objects in it and where they are placed, and its bytes with other vertices.

The reader hands over everything but the insides of <vertices> and <triangles> to expat; those it reads by the megabyte
where they are written as programs write them, and else by expat too.
"""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

import numpy as np

from o3dmark.arrays import Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.files.text.notation import Notation
from o3dmark.files.threemf import xml_rows
from o3dmark.files.threemf.xml import XmlReader

Place: TypeAlias = tuple[str, str, Floats]
"""An object that is used: the file that it is in or "" for the same file, its id, and its transform (4, 4)."""

Renew: TypeAlias = Callable[[int, int, Floats], tuple[Floats, Notation] | None]
"""Called with the number of an object, that of a first vertex and vertices (n, 3) from it on, as they are: what they
are to be, and how they are written; None for an object that does not move."""

_PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
_BULK = re.compile(rb"<((?:[^\s<>/:\"'=]+:)?)(vertices|triangles)(?:\s[^<>]*)?>")
_NUMBER = re.compile(r"[ \t\r\n]*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)[ \t\r\n]*", re.ASCII)
_INDEX = re.compile(r"[ \t\r\n]*\+?(\d{1,18})[ \t\r\n]*", re.ASCII)
_MOST = 100_000  # objects, components and build items
_LIST_DEPTH = 5  # model, resources, object, mesh, vertices
_AXES, _CORNERS = ("x", "y", "z"), ("v1", "v2", "v3")
_WORDS = {  # what elements of the materials extension, and of the core, are called when they are counted up
    "basematerials": "materials",
    "compositematerials": "materials",
    "multiproperties": "materials",
    "colorgroup": "vertex colours",
    "texture2d": "textures",
    "texture2dgroup": "texture coordinates",
    "metadata": "metadata",
}
_PROPERTIES = {"pid", "p1", "p2", "p3"}


@dataclass
class Object:
    """One <object>: its mesh, if it has one, or the others that it is put together from."""

    id: str
    name: str
    rows: bytearray = field(default_factory=bytearray)  # of vertices, float64: grows without a second copy
    corners: bytearray = field(default_factory=bytearray)  # of triangles, int64
    components: list[Place] = field(default_factory=list)
    has_mesh: bool = False

    @property
    def vertices(self) -> Floats:
        return np.frombuffer(self.rows, np.float64).reshape(-1, 3)

    @property
    def triangles(self) -> Ints:
        return np.frombuffer(self.corners, np.int64).reshape(-1, 3)


class ModelReader(XmlReader):
    """Reads one model file; with ``renew``, the pieces that it gives back have other vertices.

    ``fraction``: the most digits behind the point in a coordinate. Errors: MeshError, as `XmlReader`, and where the
    file breaks the rules of 3MF that meshes depend on.
    """

    def __init__(self, title: str, renew: Renew | None = None) -> None:
        super().__init__(title)
        self.objects: list[Object] = []
        self.items: list[Place] = []
        self.contents: set[str] = set()
        self.fraction = 0
        self._renew = renew
        self._core = ""
        self._path: list[str] = []  # local names of the core elements around, others in full
        self._list = ""  # "vertices" or "triangles", inside of one
        self._tag = b""  # the prefix that it has in the bytes, with its colon
        self._plain = True  # nothing in it yet that could hide elements, such as a comment
        self._row = 0
        self._count = 0
        self._slow: list[tuple[float | int, ...]] = []
        self._slow_places: list[tuple[tuple[int, int], ...]] = []
        self._edits: list[tuple[int, int, bytes]] = []

    def renewed(self, pieces: Iterable[bytes]) -> Iterator[bytes]:
        """The document with the vertices that ``renew`` says."""
        for piece in self.read(pieces):
            parts, at = [], 0
            for start, stop, text in sorted(self._edits):
                parts += [piece[at:start], text]
                at = stop
            self._edits.clear()
            yield b"".join([*parts, piece[at:]])

    def take(self, piece: bytes) -> None:
        at = 0
        while at < len(piece):
            if self._list and len(self._path) == _LIST_DEPTH:
                stop = piece.find(b"</", at)
                at = self._take_list(at, stop if stop >= 0 else len(piece))
            found = _BULK.search(piece, at)
            stop = found.end() if found else len(piece)
            self._tag = found[1] if found else self._tag
            self.feed(at, stop)
            at = stop
        self._flush()

    def _take_list(self, at: int, stop: int) -> int:
        """Read vertices or triangles, at once if they are written alike; where they end."""
        self._flush()
        text = self.piece[at:stop]
        if self._plain and self._take_rows(text, at):
            self.skip(len(text))
        else:
            self._plain = self._plain and b"<!" not in text and b"<?" not in text
            self.feed(at, stop)
        return stop

    def _take_rows(self, text: bytes, at: int) -> bool:
        prefixes = self.prefixes.keys()
        if self._list == "triangles":
            found = xml_rows.rows(text, self._tag + b"triangle", _CORNERS, np.int64, prefixes)
            if found is not None:
                self._object.corners += found.values.tobytes()
                self._note_triangle(found.attributes)
            return found is not None
        found = xml_rows.rows(text, self._tag + b"vertex", _AXES, np.float64, prefixes)
        if found is not None:
            self._vertices(found.values, found.start + at, found.stop + at)
            if self._renew is None:
                self.fraction = max(self.fraction, xml_rows.longest_fraction(text, found))
        return found is not None

    def start(self, name: str, attributes: dict[str, str]) -> None:
        if not self._path:
            self._begin_model(name, attributes)
        elif not name.startswith(self._core):
            self._note_foreign(name)
        self._path.append(name.removeprefix(self._core))
        match self._path[1:]:
            case ["resources", "object", "mesh", "vertices", "vertex"]:
                self._slow_vertex(attributes)
            case ["resources", "object", "mesh", "triangles", "triangle"]:
                self._slow.append(tuple(self._index(attributes, corner) for corner in _CORNERS))
                self._note_triangle(attributes)
            case ["resources", "object", "mesh", "vertices" | "triangles" as word]:
                self._begin_list(word)
            case ["resources", "object", "mesh"]:
                self._begin_mesh()
            case ["resources", "object"]:
                self._begin_object(attributes)
            case ["resources", "object", "components", "component"]:
                self._object.components.append(self._place(attributes))
            case ["build", "item"]:
                self.items.append(self._place(attributes))
            case [*_, word] if word in _WORDS:
                self.contents.add(_WORDS[word])

    def end(self, name: str) -> None:  # noqa: ARG002
        if self._list and len(self._path) == _LIST_DEPTH:
            self._flush()
            self._list = ""
        self._path.pop()

    def _begin_model(self, name: str, attributes: dict[str, str]) -> None:
        if name.rpartition(" ")[2] != "model":
            raise self.wrong("is no 3MF model")
        self._core = name.removesuffix("model")
        self.contents.update({"metadata"} if attributes.get("unit", "millimeter") != "millimeter" else ())
        for prefix in attributes.get("requiredextensions", "").split():
            self.contents.add(_extension(self.prefixes.get(prefix, prefix)))

    def _begin_object(self, attributes: dict[str, str]) -> None:
        self._counted()
        number, name = attributes.get("id", ""), attributes.get("name", "")
        if not number:
            raise self.wrong("has an object without an id")
        self.objects.append(Object(number, name))
        self.contents.update({"names"} if name else (), {"materials"} if "pid" in attributes else ())

    def _begin_mesh(self) -> None:
        if self._object.has_mesh:
            raise self.wrong(f"has two meshes in object {self._object.id}")
        self._object.has_mesh, self._row = True, 0

    def _begin_list(self, word: str) -> None:
        if word == "vertices" and self._row:
            raise self.wrong(f"has two lists of vertices in object {self._object.id}")
        self._list, self._plain = word, True

    def _place(self, attributes: dict[str, str]) -> Place:
        self._counted()
        if "objectid" not in attributes:
            raise self.wrong("places an object without saying which")
        numbers = attributes.get("transform", "1 0 0 0 1 0 0 0 1 0 0 0").split()
        if len(numbers) != 12:
            raise self.wrong("has a transform of other than twelve numbers")
        transform = np.eye(4)
        # Rows of the file are what x, y, z and 1 contribute: it multiplies from the left.
        transform[:3] = np.array([self._number(number) for number in numbers]).reshape(4, 3).T
        return attributes.get(f"{_PRODUCTION} path", ""), attributes["objectid"], transform

    def _slow_vertex(self, attributes: dict[str, str]) -> None:
        texts = [attributes.get(axis, "") for axis in _AXES]
        self._slow.append(tuple(map(self._number, texts)))
        if self._renew is None:
            for text in texts:
                exponent = "e" in text.lower()
                self.fraction = max(self.fraction, 16 if exponent else len(text.strip().partition(".")[2]))
        else:
            places = xml_rows.attribute_places(self.piece, self.tag_start())
            self._slow_places.append(tuple(places[axis] for axis in _AXES))

    def _flush(self) -> None:
        """Pass on what came through the parser."""
        if not self._slow:
            return
        if self._list == "vertices":
            places = np.array(self._slow_places, np.int64).reshape(-1, 3, 2)
            self._vertices(np.array(self._slow, np.float64), places[:, :, 0], places[:, :, 1])
        else:
            self._object.corners += np.array(self._slow, np.int64).tobytes()
        self._slow, self._slow_places = [], []

    def _vertices(self, values: Floats, start: Ints, stop: Ints) -> None:
        if self._renew is None:
            self._object.rows += values.tobytes()
        elif (renewal := self._renew(len(self.objects) - 1, self._row, values)) is not None:
            new, notation = renewal
            changed = new != values
            texts = notation.rows(new[changed][:, None])
            self._edits += zip(start[changed].tolist(), stop[changed].tolist(), texts, strict=True)
        self._row += len(values)

    @property
    def _object(self) -> Object:
        return self.objects[-1]

    def _number(self, text: str) -> float:
        match = _NUMBER.fullmatch(text)
        number = float(match[1]) if match else np.inf
        if not np.isfinite(number):
            raise self.wrong(f"has {text[:40]!r} where a number should be")
        return number

    def _index(self, attributes: dict[str, str], name: str) -> int:
        match = _INDEX.fullmatch(attributes.get(name, ""))
        if match is None:
            raise self.wrong(f"has a triangle whose {name} is no number of a vertex")
        return int(match[1])

    def _counted(self) -> None:
        self._count += 1
        if self._count > _MOST:
            raise self.wrong(f"has more than {_MOST} objects and places for them")

    def _note_triangle(self, attributes: Iterable[str]) -> None:
        """What triangles have beside their corners: properties, or what a slicer painted on them."""
        for name in {*attributes}.difference(_CORNERS):
            self.contents.add("materials" if name in _PROPERTIES else f"property {re.split('[ :]', name)[-1]}")

    def _note_foreign(self, name: str) -> None:
        uri, _, word = name.rpartition(" ")
        material = "/material/" in uri  # whose words say more than its name
        self.contents.update({_WORDS[word]} if material and word in _WORDS else () if material else {_extension(uri)})


def _extension(uri: str) -> str:
    """What an extension is called: by the last word of its name space that is no date."""
    words = [word for word in re.split("[/:]", uri) if word and not word.isdigit()]
    return f"extension {words[-1]}" if words else "extension"


def read_model(path: Path, entry: str, pieces: Iterable[bytes]) -> ModelReader:
    """A model file of a 3MF, read through."""
    reader = ModelReader(f"{path.name}, {entry}")
    for _ in reader.read(pieces):
        pass
    for item in reader.objects:
        triangles, count = item.triangles, len(item.vertices)
        if len(triangles) and (triangles.min() < 0 or triangles.max() >= count):
            raise MeshError(f"{path.name}: a triangle of object {item.id} names a vertex beyond its {count}")
    if len({item.id for item in reader.objects}) < len(reader.objects):
        raise MeshError(f"{path.name}: two objects of {entry} have one id")
    return reader
