"""Makes the golden marks: marked meshes that every later version must still read.

    python scripts/make_golden_marks.py             those that are not there yet
    python scripts/make_golden_marks.py sheet cad   only these
    python scripts/make_golden_marks.py sheet --again

tests/golden/marks holds one mesh for each profile, each kind of frame and surface, and each way in which the reader
looks again; manifest.json there says what each is and who made it. The key is public: Key(bytes(range(32))).

A golden stands for the marks that owners have already given away. One that cannot be read any more means that theirs
cannot either, so it is never made again to please a test. --again changes the mark's format on purpose, and belongs in
a commit that says why. Another case is another name.
"""

import argparse
import datetime
import json
import math
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import o3dmark
from o3dmark import PROFILES, SHAPES, Key, Surface, Watermark, attack_all, read_mesh
from o3dmark.files import replacing
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays, triangle_mesh
from o3dmark.solid.frame import FRAME_2026, rules
from o3dmark.solid.solid import Solid
from o3dmark.synthetic.products import cells, skin_of_cells
from o3dmark.watermark import parse_bits

ROOT = Path(__file__).parent.parent
FOLDER = ROOT / "tests" / "golden" / "marks"
KEY = Key(bytes(range(32)))
SEED = 1  # of the attacks
BOXES = (((0, 0, 0), (30, 18, 3)), ((0, 0, 0), (3, 18, 21)), ((18, 3, 3), (27, 9, 9)))  # low and high corners, in cells
RECEIVED = "as received, step"  # the reader's note on a mesh that it read at first sight
MARGIN = 0.5  # log10: how much worse a p-value may become, by more tries or by the last digits of another machine


@dataclass(frozen=True)
class Golden:
    """What one file is. It carries a ``message`` or raw ``bits``; ``note`` is part of what the reader says of it."""

    what: str
    cover: str  # "spot", one of CONSTRUCTIONS, or a spec of SHAPES
    before: tuple[str, ...] = ()  # attacks that make the cover
    profile: str = "robust-2026"
    message: str = ""
    bits: str = ""
    attacks: tuple[str, ...] = ()  # on the marked mesh
    measure: str = "volume"
    turned: bool = False
    note: str = RECEIVED

    @property
    def watermark(self) -> Watermark:
        """The profile, with as many bits as there are where they are raw."""
        profile = PROFILES[self.profile]
        return replace(profile, n_bits=len(self.bits)) if self.bits else profile

    @property
    def has_frame(self) -> bool:
        """Whether the profile's method reads in a frame at all."""
        return self.watermark.method.name == "shape-spectrum"

    def build(self) -> TriangleMesh:
        """The mesh to keep: the cover, marked and attacked."""
        cover = attack_all(base(self.cover), self.before, SEED)
        if self.bits:
            marked = self.watermark.embed_bits(cover, parse_bits(self.bits), KEY)
        else:
            marked = self.watermark.embed(cover, self.message, KEY)
        return attack_all(marked, self.attacks, SEED)

    def checked(self, mesh: TriangleMesh) -> tuple[float, str]:
        """log10 of the p-value with which ``mesh`` is read, and the reader's note. Errors: AssertionError."""
        if self.bits:
            extraction = self.watermark.extract_bits(mesh, KEY)
            assert np.array_equal(extraction.bits, parse_bits(self.bits)), extraction.bits
            log10_p = math.log10(extraction.hypotheses) - len(self.bits) * math.log10(2.0)
        else:
            reading = self.watermark.extract(mesh, KEY)
            assert reading.message == self.message, f"read {reading.message}"
            extraction, log10_p = reading.extraction, reading.decoded.log10_p
        assert self.note in extraction.note or not self.has_frame, extraction.note
        if self.has_frame:
            kinds = [(rule.measure, rule.moment is not None) for rule in rules(Solid.of(Surface.of(mesh)), FRAME_2026)]
            assert kinds == [(self.measure, self.turned)], f"its frames are {kinds}"
        return log10_p, extraction.note

    def entry(self, log10_p: float, note: str) -> dict[str, Any]:
        """What the manifest says of the file, read so surely and with this note."""
        return {
            "what": self.what,
            "profile": self.profile,
            **({"bits": self.bits} if self.bits else {"message": self.message}),
            "cover": [self.cover, *self.before],
            "attacks": list(self.attacks),
            "frame": self.measure if self.has_frame else None,
            "turned": self.turned if self.has_frame else None,
            "read": note,
            "log10_p_at_most": round(min(log10_p + MARGIN, 0.0), 2),
            "version": o3dmark.__version__,
            "date": datetime.date.today().isoformat(),
            "commit": git("rev-parse", "--short", "HEAD"),
        }


def leaf() -> TriangleMesh:
    """A closed, bent and lopsided sheet, some hundredths as thick as it is long."""
    x, y, z, faces = _ball()
    return triangle_mesh(np.stack([1.6 * x + 0.3 * y**2, y + 0.3 * x * y, 0.02 * z + 0.3 * x**2 - 0.2 * y], 1), faces)


def clover(height: float, lobes: float, hook: float) -> TriangleMesh:
    """A body of three unlike lobes around z, about as wide along x as along y, with a bent top and bottom."""
    x, y, z, faces = _ball()
    w = x + 1j * y
    w = w * (1.0 + lobes * (w**3).real) + hook * w.conj() ** 2
    return triangle_mesh(np.stack([w.real, w.imag, height * z * (1.0 + 0.15 * x) + 0.1 * x * y + 0.1 * x**2], 1), faces)


def bracket() -> TriangleMesh:
    """A machine part: a plate, a wall and an off-centre block, with flat faces of small squares and sharp edges."""
    vertices, triangles = skin_of_cells(cells(BOXES))
    return triangle_mesh(vertices + 1.0, triangles)


CONSTRUCTIONS: dict[str, Callable[[], TriangleMesh]] = {
    "leaf": leaf,
    "clover": lambda: clover(1.6, 0.5, 0.05),
    "flat clover": lambda: clover(0.02, 0.15, 0.15),
    "bracket": bracket,
}
GOLDENS = {
    "robust": Golden("a plain solid", "spot", message="mine"),
    "invisible": Golden("the weaker mark", "cat:vertices=2000", profile="invisible-2026", message="hex:c0ffee"),
    "slender": Golden("a thin-limbed solid", "ant:vertices=2000", profile="slender-2026", message="ant"),
    "contested": Golden("short waves, two marks deep", "bimba:vertices=2500", profile="contested-2026", message="mine"),
    "paper": Golden("a mark on salient vertices", "spot", profile="paper-2026", message="hex:00ff00ff"),
    "tiny": Golden("the same, of one byte", "cat:vertices=1500", profile="tiny-2026", message="1"),
    "sheet": Golden("a thin sheet, in the frame of its area", "leaf", message="leaf", measure="area"),
    "turned": Golden("two principal moments nearly equal: a turned frame", "clover", message="turn", turned=True),
    "turned_sheet": Golden(
        "a thin sheet in a turned frame", "flat clover", message="slab", measure="area", turned=True
    ),
    "open": Golden("a mesh with a boundary", "bimba:vertices=2200", ("crop:share=0.15,largest=true",), message="open"),
    "soup": Golden("a triangle soup: every triangle by itself", "cup:vertices=1000", ("unweld",), message="soup"),
    "cad": Golden("a machine part: flat faces, sharp edges", "bracket", message="part"),
    "bits8": Golden("8 raw bits, on four projections each", "cat:vertices=1000", bits="01101001"),
    "bits16": Golden("16 raw bits, on two projections each", "cat:vertices=1000", bits="1110001011010010"),
    "rounded": Golden(
        "rounded to 9 bits a coordinate", "cat:vertices=2000", message="9bit", attacks=("quantise:bits=9",)
    ),
    "halved": Golden(
        "half the vertices gone: the frame is fitted",
        "cat:vertices=2000",
        message="half",
        attacks=("simplify:ratio=0.5",),
        note="as received, frame fitted",
    ),
    "bulging": Golden(
        "so few vertices left that the surface bulged between them",
        "cat:vertices=2000",
        message="few",
        attacks=("simplify:ratio=0.7",),
        note="bulging by",
    ),
    "mirrored": Golden(
        "its mirror image, moved",
        "cat:vertices=1000",
        message="flip",
        attacks=("mirror", "similarity"),
        note="mirrored",
    ),
    "fragment": Golden(
        "half of a bust, which patches tell",
        "venus:vertices=5000",
        profile="layered-2026",
        message="part",
        attacks=("crop:share=0.5",),
    ),
    "smoothed": Golden(
        "smoothed 20 times",
        "cat:vertices=1000",
        message="soft",
        attacks=("smooth:iterations=20",),
        note="umbrella smoothing undone",
    ),
}


def base(name: str) -> TriangleMesh:
    """The mesh that a cover begins with."""
    if name == "spot":
        return read_mesh(FOLDER.parent / "spot.ply")
    return CONSTRUCTIONS[name]() if name in CONSTRUCTIONS else SHAPES.make(name).build()


def write_small(path: Path, mesh: TriangleMesh) -> None:
    """Binary PLY with float32 coordinates and 16-bit indices, a third of what Open3D writes."""
    vertices, triangles = mesh_arrays(mesh)
    assert len(vertices) < 1 << 16
    faces = np.empty(len(triangles), [("count", "u1"), ("corners", "<u2", 3)])
    faces["count"], faces["corners"] = 3, triangles
    head = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(vertices)}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar ushort vertex_indices\nend_header\n"
    )
    path.write_bytes(head.encode() + vertices.astype("<f4").tobytes() + faces.tobytes())


def git(*words: str) -> str:
    """What git says about the tree that this script is in."""
    return subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


def _ball() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """x, y and z (n,) of the vertices of a unit ball, and its triangles (m, 3)."""
    vertices, triangles = mesh_arrays(SHAPES.make("sphere:vertices=2000").build())
    return *vertices.T, triangles


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(GOLDENS)}; the missing by default")
    parser.add_argument("--again", action="store_true", help="overwrite the named ones: the format has changed")
    options = parser.parse_args()
    if unknown := set(options.names) - set(GOLDENS):
        parser.error(f"no golden is called {', '.join(sorted(unknown))}")
    if options.again and not options.names:
        parser.error("--again wants the names of those to be made again")
    there = {name for name in GOLDENS if (FOLDER / f"{name}.ply").exists()}
    if not options.again and (kept := there & set(options.names)):
        parser.error(
            f"{', '.join(sorted(kept))}: a golden is not made twice, for it stands for marks that are out in the world."
            " To change the format on purpose, say --again, and say why in the commit"
        )
    if git("status", "--porcelain", "--", "o3dmark"):
        parser.error("o3dmark differs from its last commit, which the manifest is to name; commit it first")
    FOLDER.mkdir(exist_ok=True)
    manifest_path = FOLDER / "manifest.json"
    manifest = json.loads(manifest_path.read_text()) if manifest_path.exists() else {}
    for name in options.names or [name for name in GOLDENS if name not in there]:
        golden, path = GOLDENS[name], FOLDER / f"{name}.ply"
        with replacing(path) as draft:
            write_small(draft, golden.build())
            log10_p, note = golden.checked(read_mesh(draft))
        manifest[path.name] = golden.entry(log10_p, note)
        manifest_path.write_text(json.dumps(manifest, indent=2, sort_keys=True) + "\n")
        print(f"{path.name}: {path.stat().st_size} bytes, log10 p {log10_p:.2f}, {note}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
