"""USD in text (.usda): where the arrays of numbers of its prims stand, so that a few can change and nothing else.

Only as much of the grammar is read as that takes: prims and variants, and over everything else in its brackets.
"""

import re

import numpy as np

from o3dmark.arrays import AnyArray, Ints
from o3dmark.errors import MeshError

Span = tuple[int, int]

_TOKEN = re.compile(
    rb'\s*("""(?:\\.|[^\\])*?"""|' + rb"'''(?:\\.|[^\\])*?'''" + rb'|"(?:\\.|[^"\\\n])*"' + rb"|'(?:\\.|[^'\\\n])*'"
    rb"|#[^\r\n]*|@@@.*?@@@|@[^@\n]*@|<[^>\n]*>|[][(){}=;,]|[^]\s[(){}=;,\"'#@<]+|.)",
    re.DOTALL,
)
_NUMBERS = re.compile(rb"[\s\d+\-.eE,()naifNAIF]*\]")
_BLANK = bytes.maketrans(b"(),\t\r\n", b"      ")
_CLOSED_BY = {b"(": b")", b"[": b"]", b"{": b"}"}
_DEEPEST = 200  # prims within prims: the library's own parser calls itself for each


def is_text(content: bytes) -> bool:
    return not content.startswith(b"PXR-USDC")


def arrays(name: str, text: bytes) -> dict[str, Span | None]:
    """Where, between their brackets, the arrays of numbers stand that attributes are: by the paths of those.

    None for one that is there twice. Errors: MeshError for prims nested without measure.
    """
    found: dict[str, Span | None] = {}
    around, opening = [""], ""  # the paths of the prims around; that of one whose bracket is about to open
    words: list[bytes] = []  # the last three
    at = 0
    while match := _TOKEN.match(text, at):
        token, at = match[1], match.end()
        if token.startswith(b"#"):
            continue
        if token == b"{" and (opening or _opens_variants(words)):
            around.append(opening or f"{around[-1]}{{{_name(words[-2])}=")
            opening, words = "", []
            if len(around) > _DEEPEST:
                raise MeshError(f"{name} nests prims more than {_DEEPEST} deep")
        elif token == b"}" and len(around) > 1:
            around.pop()
        elif token in _CLOSED_BY:
            whole = _NUMBERS.match(text, at) if token == b"[" else None
            if whole and len(words) >= 2 and words[-1] == b"=":
                path = f"{around[-1]}.{words[-2].decode('utf-8', 'replace')}"
                found[path] = None if path in found else (at, whole.end() - 1)
            at = whole.end() if whole else _behind(name, text, at)
        elif token[:1] in (b'"', b"'") and (
            around[-1].endswith("=") or words[-1:] == [b"def"] or words[-2:-1] == [b"def"]
        ):
            opening, words = _child(around[-1], _name(token)), []
        else:
            words = [*words[-2:], b"def" if token in (b"over", b"class") else token]
    return found


def numbers(text: bytes, span: Span) -> AnyArray:
    """The numbers in an array of the text (n,), as float64 next to what is written; none if there are other words."""
    try:
        found = np.fromstring(text[slice(*span)].translate(_BLANK), np.float64, sep=" ")
    except ValueError:
        return np.empty(0)
    return found if len(found) == len(_places(text, span)[0]) else np.empty(0)


def with_numbers(text: bytes, edits: dict[Span, tuple[AnyArray, AnyArray]]) -> bytes:
    """The text where arrays of float32 numbers (n,) have gone from a first to a second; those that stay keep their
    characters, others are written with as many as tell them from all other float32 numbers."""
    parts, at = [], 0
    for span, (before, after) in sorted(edits.items(), key=lambda edit: edit[0]):
        changed = before != after
        start, stop = (places[changed].tolist() for places in _places(text, span))
        for begin, end, new in zip(start, stop, after[changed].astype("S32").tolist(), strict=True):
            parts += [text[at:begin], new]
            at = end
    return b"".join([*parts, text[at:]])


def _places(text: bytes, span: Span) -> tuple[Ints, Ints]:
    """Where each number of an array begins and ends (n,)."""
    inside = np.frombuffer(text[slice(*span)].translate(_BLANK), np.uint8) > ord(" ")
    change = np.diff(np.concatenate([[False], inside, [False]]).astype(np.int8))
    return np.flatnonzero(change == 1) + span[0], np.flatnonzero(change == -1) + span[0]


def _opens_variants(words: list[bytes]) -> bool:
    return len(words) == 3 and words[0] == b"variantSet" and words[2] == b"="


def _child(around: str, name: str) -> str:
    """The path of what is called ``name``, in a prim, a variant, or a set of variants."""
    if around.endswith("="):
        return f"{around}{name}}}"
    return f"{around}{name}" if around.endswith("}") else f"{around}/{name}"


def _name(token: bytes) -> str:
    return token.strip(b"\"'").decode("utf-8", "replace")


def _behind(name: str, text: bytes, at: int) -> int:
    """Where what a bracket opened before ``at`` is closed again."""
    depth = 1
    while depth:
        match = _TOKEN.match(text, at)
        if match is None:
            raise MeshError(f"{name} is damaged: a bracket is never closed")
        at = match.end()
        if match[1] == b"[" and (whole := _NUMBERS.match(text, at)):
            at = whole.end()
        else:
            depth += (match[1] in _CLOSED_BY) - (match[1] in _CLOSED_BY.values())
    return at
