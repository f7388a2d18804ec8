"""The header of a PLY file: which elements follow it, and what each of their rows holds."""

import re
from dataclasses import dataclass

from o3dmark.errors import MeshError

_KINDS = {  # numpy's codes
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_HEAD = re.compile(rb"ply[ \t]*(\r\n|\n|\r)(.*?[\r\n])??end_header[ \t]*(\r\n|\n|\r|$)", re.S)


@dataclass(frozen=True)
class Property:
    """A number of each row, or a list of them: ``kind`` of the numbers, and ``counted``, of a list's length, or "".

    Kinds are numpy's codes without a byte order.
    """

    name: str
    kind: str
    counted: str = ""


@dataclass(frozen=True)
class Element:
    name: str
    count: int
    properties: tuple[Property, ...]

    def find(self, *names: str, lists: bool = False) -> Property | None:
        """The first property that is a list, or is none, and has one of these names."""
        return next((p for p in self.properties if p.name in names and bool(p.counted) == lists), None)


@dataclass(frozen=True)
class Header:
    """``order``: of bytes, "<" or ">", or "" for a text. ``comments``: without that word. ``size``: in bytes."""

    order: str
    elements: tuple[Element, ...]
    comments: tuple[str, ...]
    size: int

    @classmethod
    def of(cls, name: str, content: bytes) -> "Header":
        """The header at the start of a file's content. Errors: MeshError, by the name of the file."""
        found = _HEAD.match(content)
        if found is None:
            raise MeshError(f"{name} does not begin like a PLY file")
        size = found.end()
        if found[1] == b"\r" and found[3] == b"\r\n":  # that is the first byte of what follows
            size -= 1
        order, elements, comments = None, list[tuple[str, int, list[Property]]](), list[str]()
        for line in (part.decode("utf-8", "replace") for part in (found[2] or b"").splitlines()):
            match line.split():
                case ["format", form, *_]:
                    order = _ORDERS.get(form)
                case ["element", *words]:
                    elements.append((*_element(name, words), []))
                case ["property", *words] if elements:
                    elements[-1][2].append(_property(name, words))
                case ["property", *_]:
                    raise MeshError(f"{name}: its header has a property before any element")
                case ["comment" | "obj_info", *_]:
                    comments.append(line.partition(" ")[2].strip())
                case _:  # old exporters forget the word "comment"
                    pass
        if order is None:
            raise MeshError(f"{name}: its header has no format that PLY knows: {', '.join(_ORDERS)}")
        made = tuple(Element(label, count, tuple(properties)) for label, count, properties in elements)
        return cls(order, made, tuple(comments), size)


def _element(name: str, words: list[str]) -> tuple[str, int]:
    match words:
        case [element, count] if count.isascii() and count.isdigit() and len(count) < 20:
            return element, int(count)
    raise MeshError(f"{name}: its header has an element {' '.join(words)!r}, which is not a name and a number of rows")


def _property(name: str, words: list[str]) -> Property:
    match words:
        case ["list", counted, kind, *label] if label and _KINDS.get(counted, "f")[0] != "f" and kind in _KINDS:
            return Property(" ".join(label), _KINDS[kind], _KINDS[counted])
        case [kind, *label] if label and kind in _KINDS:
            return Property(" ".join(label), _KINDS[kind])
    raise MeshError(f"{name}: its header has a property {' '.join(words)!r}, which is of no type that PLY knows")
