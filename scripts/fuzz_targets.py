"""What `fuzz` gives to the parsers: for each format its seeds, and what an input must go through."""

import base64
import sys
import zipfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

ROOT = Path(__file__).parent.parent
SHIFT = 1e-3  # of the diagonal: as large as a strong mark
sys.path.append(str(ROOT / "tests"))
FAR = 1e30  # coordinates beyond are left alone: what a motion of them is, is anybody's guess


class WrongError(Exception):
    """A file does not hold what was written into it."""


@dataclass(frozen=True)
class Target:
    """Inputs of one format; ``wrap`` makes a file of an input."""

    suffix: str
    seeds: Callable[[], Iterable[bytes]]
    wrap: Callable[[bytes], bytes] = bytes

    def journey(self, data: bytes) -> None:
        """Parse, look at everything, move, write, parse again. Errors: O3dmarkError, as it should; WrongError."""
        from o3dmark.files import Source, open_asset

        path, content = Path(f"x{self.suffix}"), self.wrap(data)
        asset = open_asset(Source(path, {path.name: content}))
        _ = asset.contents, asset.mesh()
        if asset.with_positions({}) != {path.name: content}:
            raise WrongError("not the bytes that were read")
        moved = {number: waved(part) for number, part in enumerate(asset.parts) if not part.fixed}
        files = asset.with_positions(moved)
        try:
            written = open_asset(Source(path, files))
        except Exception as error:
            raise WrongError(f"its own output is refused: {error}") from error
        compare(asset.parts, written.parts, moved)


def waved(part: Any) -> Any:
    """The vertices (n, 3) of a part, its corners smoothly moved within their box; unless they are too far, or none."""
    corners = np.unique(part.triangles)
    if not len(corners) or not (np.abs(part.vertices) < FAR).all():
        return part.vertices
    moved, here = part.vertices.copy(), part.vertices[corners]
    sides = np.ptp(here, axis=0)
    centre, extent = here.min(axis=0) + sides / 2, float(np.linalg.norm(sides)) or 1.0
    inward = SHIFT * (1.0 + np.sin(5.0 * (here[:, [1, 2, 0]] - centre) / extent))
    moved[corners] -= inward * (here - centre)
    return moved


def compare(before: Any, after: Any, moved: Any) -> None:
    """Errors: WrongError where parts, triangles or the positions of their corners are not those that were written."""
    if len(before) != len(after):
        raise WrongError(f"{len(before)} parts became {len(after)}")
    for number, (was, now) in enumerate(zip(before, after, strict=True)):
        wanted = moved.get(number, was.vertices)
        if now.vertices.shape != wanted.shape or not np.array_equal(now.triangles, was.triangles):
            raise WrongError("other triangles")
        corners = np.unique(was.triangles)
        if not len(corners) or not (np.abs(wanted) < FAR).all():
            continue
        extent = np.linalg.norm(np.ptp(wanted[corners], axis=0)) + 1e-9 * np.abs(wanted).max()
        allowed = np.broadcast_to(was.steps, wanted.shape)[corners] + 1e-6 * extent  # digits, or float32
        if not (np.abs(now.vertices - wanted)[corners] <= allowed).all():
            raise WrongError("other positions")


def kept(*suffixes: str) -> list[bytes]:
    """What lies in ../shared/cases with one of these endings; nothing where that is not there."""
    from fixtures.paths import SHARED

    return [path.read_bytes() for path in sorted((SHARED / "cases").glob("**/*")) if path.suffix in suffixes]


def zipped(model: bytes) -> bytes:
    """A 3MF file whose model is an input; the zip itself is sound, for no damage would leave its checksums right."""
    from fixtures.threemf_files import archive

    return archive(model, compression=zipfile.ZIP_STORED)


def obj() -> list[bytes]:
    return [_OBJ, _OBJ.replace(b"\n", b"\r\n"), *kept(".obj")]


def off() -> list[bytes]:
    square = b"0 0 0\n1 0 0.5\n1 1 0\n0 1e-1 0\n"
    return [
        b"OFF\n# a comment\n4 2 0\n" + square + b"3 0 1 2\n3 0 2 3 255 0 0\n",
        b"COFF 4 1 0\n" + square.replace(b"\n", b" 1 0 0 1\n") + b"4 0 1 2 3 0.5 0.5 0.5\n",
        b"NOFF\n4 1 0\n" + square.replace(b"\n", b" 0 0 1\n") + b"4 0 1 2 3\n",
        b"STOFF\n4 1 0\n" + square.replace(b"\n", b" 0.5 0.5\n") + b"4 0 1 2 3\n",
    ]


def ply() -> list[bytes]:
    from fixtures.ply import any_ply

    corners = [(0, 0, 0, 0, 0, 1, 9), (1, 0, 0.5, 0, 0, 1, 8), (1, 1, 0, 0, 1, 0, 7), (0, 1, 0, 1, 0, 0, 6)]
    names = [*(f"float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")), "uchar quality"]
    faces = [([0, 1, 2], 5), ([0, 1, 2, 3], 6)]
    elements = [("vertex", names, corners), ("face", ["list uchar int vertex_indices", "int label"], faces)]
    doubles = [("vertex", ["double x", "double y", "double z"], [corner[:3] for corner in corners]), elements[1]]
    forms = ("ascii", "binary_little_endian", "binary_big_endian")
    lines = ["comment here", "obj_info there"]
    return [any_ply(each, form=form, lines=lines) for form in forms for each in (elements, doubles)]


def stl() -> list[bytes]:
    from fixtures.stl_files import binary_stl, text_stl

    corners = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0.5], [0, 1, 0]]])
    normals = np.array([[0.0, 0, 1]] * 2)
    texts = [text_stl([("part", normals, corners)]), text_stl([("a b", normals, corners)] * 2, newline="\r\n")]
    return [*texts, binary_stl(corners, normals=normals, attributes=[1, 2]), binary_stl(corners, header=b"solid x")]


def glb() -> list[bytes]:
    return [case.files[case.name] for case in _gltf_cases() if case.name.endswith(".glb")] + kept(".glb")


def gltf() -> list[bytes]:
    """Documents whose buffers are in them; what lies beside an input cannot be read."""
    return [_inlined(case.name, case.files) for case in _gltf_cases() if case.name.endswith(".gltf")]


def _gltf_cases() -> list[Any]:
    from fixtures.gltf_files import CASES
    from fixtures.gltf_packed import draco, meshopt, quantised

    packed = [draco(), meshopt(), quantised("u2", normalized=True, stride=8), quantised("i1")]
    return [*(make() for make in CASES.values()), *packed]


def _inlined(name: str, files: dict[str, bytes]) -> bytes:
    text = files[name]
    for other, content in files.items():
        uri = b"data:application/octet-stream;base64," + base64.b64encode(content)
        for spelt in (other, quote(other)):
            text = text.replace(f'"{spelt}"'.encode(), b'"' + uri + b'"')
    return text


def three_mf() -> list[bytes]:
    from fixtures.threemf_files import archive

    return [archive(), archive(compression=zipfile.ZIP_STORED), archive(streamed=True), *kept(".3mf")]


def usda() -> list[bytes]:
    from fixtures.usd_files import CUBE, tetra

    return [text.encode() for text in (CUBE, tetra())]


def usdc() -> list[bytes]:
    from fixtures.usd_files import CUBE, crate, tetra

    return [crate(text) for text in (CUBE, tetra())]


def usdz() -> list[bytes]:
    from fixtures.usd_files import crate, package, tetra

    return [package({"a.usda": tetra().encode()}), package({"a.usdc": crate(tetra()), "b.txt": b"more"})]


def three_mf_model() -> list[bytes]:
    from fixtures.threemf_files import mesh, model

    part = '<components><component objectid="1" transform="1 0 0 0 1 0 0 0 1 5 0 0"/></components>'
    scene = mesh() + f'<object id="2">{part}</object>'
    return [text.encode() for text in (model(), model(scene, '<item objectid="2"/>'), model(attributes=' a="b"'))]


_OBJ = b"""# a comment
mtllib a.mtl
o thing
v 0 0 0
v 1 0 0.5 1 0 0
v 1.0 1.25 0
v 0 1e0 -0
vt 0 0
vn 0 0 1
vn 0 1 0
g some
usemtl red
f 1/1/1 2/1/1 3//2
f -4 -3 -2 -1
f 1//1 2//1 \\
  3//1
l 1 2
p 4
s off
"""
TARGETS = {
    "obj": Target(".obj", obj),
    "off": Target(".off", off),
    "ply": Target(".ply", ply),
    "stl": Target(".stl", stl),
    "glb": Target(".glb", glb),
    "gltf": Target(".gltf", gltf),
    "3mf": Target(".3mf", three_mf),
    "3mf-model": Target(".3mf", three_mf_model, zipped),
    "usda": Target(".usda", usda),
    "usdc": Target(".usdc", usdc),
    "usdz": Target(".usdz", usdz),
}
