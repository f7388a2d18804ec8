"""Evidence: what a trace found, as one HTML page for somebody who does not know this field, and may doubt it.

    evidence = Evidence()
    evidence.add("leak.glb", Path("leak.glb"), trace)
    evidence.write("evidence.html", ["copies.db"], "o3dmark trace leak.glb")

It loads nothing, escapes all names, and holds neither keys nor codewords.
"""

import importlib.metadata
import platform
from base64 import b64encode
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from o3dmark._version import __version__
from o3dmark.arrays import Floats
from o3dmark.coding.words import one_in
from o3dmark.copies.ledger import Ledger
from o3dmark.copies.tracing import Named, Trace
from o3dmark.copies.verification import digest_of
from o3dmark.copies.words import sentence
from o3dmark.errors import MeshError
from o3dmark.files import read_shape, replacing
from o3dmark.mesh import similarity
from o3dmark.mesh.patch import Patch
from o3dmark.mesh.proximity import closest_points
from o3dmark.mesh.registration import align
from o3dmark.mesh.surface import Surface, is_cloud, mesh_arrays, triangle_mesh
from o3dmark.report.content import Cell, Figure, Section, Table
from o3dmark.report.page import page
from o3dmark.view.comparison import distance_sheet
from o3dmark.view.patches import patches_panel
from o3dmark.view.render import jpeg
from o3dmark.view.sheet import sheet

_ALIGNED_BY = 3000  # points of each surface
_COLUMNS = 16  # bits in a row
_CELL = 26  # pixels of a bit
_WIDTH = 900  # of the picture of patches, in pixels
_LIBRARIES = ("numpy", "scipy", "open3d")  # their modules; the packages may have other names

_PROBABILITY = (
    "Each copy has a sequence of bits of its own, drawn from a secret key and the name of its buyer, and written into"
    " the shape of the whole model. For somebody who has nothing to do with this file, each bit agrees with what was"
    " read by chance, like a coin that is tossed. The number above is the probability that so many bits of any copy in"
    " the ledger would agree by chance alone, with all the ways counted in which the file was looked at. It assumes"
    " that the key and the ledger were fixed before the file was looked at; see what was committed. It says that the"
    " file comes from that copy. It does not say who passed it on."
)
_MIXED = (
    "Each copy moves the surface of the original in a way of its own, drawn from a secret key and the name of its"
    " buyer. The file moves it in a way that is made of several of these. What the other copies do not explain points"
    " where the copy of each person named points; for somebody who has nothing to do with the file it would point"
    " anywhere. The number above is the probability that it would point so near to his by chance, with all copies of"
    " the ledger and all the ways counted in which the file was looked at. It does not say who put the copies together."
)
_PATCHES = (
    "The key finds the mark in the coloured patches of the surface. Each of them carries bits of the copy by itself, so"
    " that a piece of the model that holds one is enough to read them."
)
_COMMITTED = (
    "The ledger's rows are tied to each other by a chain of hashes; whoever was given its head, 64 digits, at an"
    " earlier time can tell whether a row was changed, removed or put in since."
)


class Evidence:
    """A page in the making: `add` each suspect while its file is there, then `write`."""

    def __init__(self, files: Path | None = None) -> None:
        """``files``: the folder of the copies, to lay a suspect on the copy that it is."""
        self._files = files
        self._sections: list[Section] = []
        self._traces: dict[str, Trace] = {}

    def add(self, name: str, file: Path, trace: Trace) -> None:
        """What a trace says of a file, which is shown under a name."""
        self._traces[name] = trace
        self._sections += _sections(name, file, trace, self._files)

    def write(self, path: str | Path, ledgers: Sequence[str | Path], command: str) -> None:
        """Write the page; ``command``: what was typed. Errors: LedgerError for a ledger that does not fit, OSError."""
        found = [trace for trace in self._traces.values() if trace.found]
        title = f"Whose copy is {next(iter(self._traces))}?" if len(self._traces) == 1 else "Whose copy is it?"
        tiles = {"files looked at": Cell(str(len(self._traces))), "copies found": Cell(str(len(found)))}
        for name, trace in self._traces.items():
            if trace.best is not None and trace.found:
                tiles[name] = Cell(f"the copy of {trace.best.copy.name}", f"mistaken: {one_in(trace.best.log10_p)}")
        sections = [*self._sections, _chain(ledgers), _made_with(found)]
        text = page(title, {"command": command, "o3dmark": __version__}, tiles, sections)
        with replacing(path) as draft:
            draft.write_text(text, encoding="utf-8")


def _sections(name: str, file: Path, trace: Trace, files: Path | None) -> Iterator[Section]:
    yield Section(f"{name}: the answer", sentence(trace), (_answer(name, file, trace),))
    if trace.best is None or not trace.found:
        return
    if files is not None:
        yield Section(f"{name}: beside the copy", *_beside(file, files / trace.best.copy.file))
    if trace.patches:
        yield Section(f"{name}: where it was read", *_patches(name, file, trace.patches))
    if trace.mixed:
        yield Section(f"{name}: what the probability means", _MIXED)
        return
    bits = Figure(
        f"{trace.best.matches} of {len(trace.best.agreement)} bits agree",
        _drawn(trace.best.agreement),
        "A filled square: the bit that was read is the copy's; a crossed one: it is not.",
    )
    yield Section(f"{name}: the bits", "Read from the shape, without the original.", (bits,))
    yield Section(f"{name}: what the probability means", _PROBABILITY)


def _answer(name: str, file: Path, trace: Trace) -> Table:
    rows = [("file", name), ("SHA-256 of the file", digest_of(file))]
    rows += [("copies that could have been named", str(trace.candidates))]
    if trace.best is not None and trace.found:
        copy = trace.best.copy
        rows += [
            ("the copy of", ", ".join(named.copy.name for named in trace.named)),
            ("probability of a mistake", one_in(trace.best.log10_p)),
            ("the next candidate", _next(trace.runner_up)),
            ("part of the file that was read", trace.part),
            ("copy made from", f"{copy.source}, SHA-256 {copy.asset}"),
            ("row of the ledger", f"number {copy.number}, entered {copy.made}"),
            ("SHA-256 of the copy", copy.digest),
        ]
    cells = tuple((Cell(name), Cell(value)) for name, value in rows)
    return Table("In short", ("", ""), cells, prose=True)


def _next(runner_up: Named | None) -> str:
    if runner_up is None:
        return "none"
    return f"{runner_up.copy.name}: as much agrees by chance, {one_in(runner_up.log10_p)}"


def _beside(suspect: Path, copy: Path) -> tuple[str, tuple[Figure, ...]]:
    """What a section says and shows of a suspect that is laid on the copy."""
    try:
        here, there = read_shape(suspect), read_shape(copy)
        if is_cloud(here) or is_cloud(there):
            return "A point cloud is not drawn.", ()
        laid, distances = _laid_on(here, there)
        picture = jpeg(distance_sheet(there, laid, distances, names=("The copy", "The suspect, laid on it")))
    except (MeshError, OSError) as error:
        return f"The two cannot be drawn beside each other: {error}", ()
    said = "The suspect was moved, turned and scaled to lie on the copy; the colours show how far they are apart."
    shown = _image(picture, "the two, and the distance between them")
    return said, (Figure("The copy, the suspect, and the distance between them", shown),)


def _patches(name: str, suspect: Path, patches: Sequence[Patch]) -> tuple[str, tuple[Figure, ...]]:
    """What a section says and shows of the patches of a suspect that spoke."""
    try:
        picture = jpeg(sheet([patches_panel(name, read_shape(suspect), patches)], columns=1, width=_WIDTH))
    except (MeshError, OSError) as error:
        return f"{_PATCHES} They cannot be drawn: {error}", ()
    return _PATCHES, (Figure("The patches that were found", _image(picture, "the suspect with its patches")),)


def _image(picture: bytes, alt: str) -> str:
    """A JPEG in the page."""
    return f'<img alt="{alt}" src="data:image/jpeg;base64,{b64encode(picture).decode()}">'


def _laid_on(here: Any, there: Any) -> tuple[Any, Floats]:
    """A mesh moved onto another, and the distances of its vertices (n,) to that."""
    vertices, triangles = mesh_arrays(here)
    target = Surface.of(there)
    rng = np.random.default_rng(0)
    some = vertices[rng.permutation(len(vertices))[:_ALIGNED_BY]]
    pose = align(some, target.vertices[rng.permutation(len(target.vertices))[:_ALIGNED_BY]])
    moved = similarity.apply(pose, vertices)
    return triangle_mesh(moved, triangles), closest_points(moved, target).distance


def _drawn(agreement: str) -> str:
    """The bits as SVG squares, filled where they agree and crossed where not."""
    height = -(-len(agreement) // _COLUMNS) * _CELL
    size, squares = _CELL - 6, []
    for place, agrees in enumerate(agreement):
        x, y = 3 + place % _COLUMNS * _CELL, 3 + place // _COLUMNS * _CELL
        fill = "currentColor" if agrees == "1" else "none"
        squares.append(f'<rect x="{x}" y="{y}" width="{size}" height="{size}" fill="{fill}" stroke="currentColor"/>')
        if agrees == "0":
            squares.append(f'<path d="M{x} {y}l{size} {size}m0 -{size}l-{size} {size}" stroke="currentColor"/>')
    label = f"{agreement.count('1')} of {len(agreement)} bits agree"
    box = f"0 0 {_COLUMNS * _CELL} {height}"
    return f'<svg role="img" aria-label="{label}" viewBox="{box}" style="max-width: 30rem">{"".join(squares)}</svg>'


def _chain(ledgers: Sequence[str | Path]) -> Section:
    rows = []
    for path in ledgers:
        with Ledger(path) as ledger:
            stored = ledger.sound()
        rows.append((Cell(Path(path).name), Cell(str(len(stored.rows))), Cell(stored.latest)))
    return Section(
        "What was committed", _COMMITTED, (Table("Ledgers", ("ledger", "copies", "head"), tuple(rows), prose=True),)
    )


def _made_with(found: Sequence[Trace]) -> Section:
    profiles = sorted({trace.best.copy.profile for trace in found if trace.best is not None})
    rows = [("o3dmark", __version__), ("parameters of the marks", ", ".join(profiles) or "-")]
    rows += [("Python", platform.python_version()), ("system", f"{platform.system()} {platform.machine()}")]
    packages = importlib.metadata.packages_distributions()
    rows += [(module, importlib.metadata.version(packages[module][0])) for module in _LIBRARIES]
    cells = tuple((Cell(name), Cell(value)) for name, value in rows)
    intro = "With these, the files, the ledger and the key, anybody can repeat the trace."
    return Section("How to repeat it", intro, (Table("Versions", ("", ""), cells, prose=True),))
