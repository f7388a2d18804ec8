"""The pictures that a campaign keeps, and how saliency fares: captions and numbers are from the rows."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from o3dmark.campaign.plan import UNTOUCHED
from o3dmark.campaign.row import Row
from o3dmark.errors import SpecError
from o3dmark.report.content import Cell, Picture, Section, Table, corr_number, fitting, number
from o3dmark.report.data import Entry, Results
from o3dmark.report.summary import corr, mean

LIST = "pictures.json"


@dataclass(frozen=True)
class Kept:
    """A line of the list of pictures: the JPEG, and what it shows."""

    jpeg: bytes
    mesh: str
    kind: str
    group: str
    condition: str
    caption: str


def gallery_sections(results: Results) -> Iterator[Section]:
    """Saliency of every mesh; those marked; one mesh after every attack; its saliency before and after them."""
    kept = _kept(results.directory)
    subject = results.campaign.gallery.subject if results.campaign.gallery else ""
    if not kept:
        yield Section("Pictures", "This folder keeps no pictures.")
    yield from _section(
        "Saliency of the meshes",
        "Mesh saliency after Lee et al., five scales, from the 2nd to the 98th percentile: yellow draws the eye.",
        [Picture(each.mesh, each.jpeg, each.caption) for each in kept if each.kind == "saliency"],
    )
    yield from _section(
        "Marked meshes",
        f"Each mesh and its copy marked with {results.campaign.main} (seed {results.campaign.seeds[0]}), from the same"
        " point of view. Corr is that of the bits read from the copy.",
        [_marked(results, each) for each in kept if each.kind in ("original", "marked")],
    )
    yield from _section(
        f"{subject} after attacks",
        "The marked mesh after each attack, and how well its bits were read.",
        [_attacked(results, each) for each in kept if each.kind == "attacked" and each.mesh == subject],
    )
    yield from _saliency(results, [each for each in kept if each.mesh == subject])


def _section(title: str, intro: str, pictures: list[Picture]) -> Iterator[Section]:
    if pictures:
        yield Section(title, intro, tuple(pictures))


def _saliency(results: Results, kept: list[Kept]) -> Iterator[Section]:
    """Saliency after attacks beside that of the cover, in pictures and in numbers."""
    tables = [table for who in results.entries for table in _ranks(results, who)]
    pictures = [_saliency_picture(results, each) for each in kept if each.kind == "attacked saliency"]
    if pictures:
        pictures = [Picture(each.mesh, each.jpeg, "cover") for each in kept if each.kind == "saliency"] + pictures
    intro = (
        "A blind method that chooses vertices by saliency needs an attacked mesh to order them as its cover did."
        " Spearman's rank correlation ρ says how well it does: 1 for the same order, 0 for none. Where the"
        " triangulation changed, nearest vertices are compared, after any change of pose and size is undone."
    )
    if pictures or tables:
        yield Section("Saliency before and after attacks", intro, (*pictures, *tables))


def _ranks(results: Results, who: Entry) -> Iterator[Table]:
    """The rank correlations of a entry's readings, where the campaign asked for them."""
    rows = [_rank_row(results, who, *each) for each in [(UNTOUCHED, "-"), *results.conditions]]
    if rows := [row for row in rows if row]:
        head = ("Spearman's ρ of saliency", *results.meshes, "mean")
        title = f"Rank correlation of saliency with the cover's: {who.name}"
        yield fitting(Table(title, head, tuple(rows), "Mean over the seeds.", folded=who != results.main))


def _rank_row(results: Results, who: Entry, group: str, condition: str) -> tuple[Cell, ...]:
    """One condition on all meshes, and the mean; empty where it was not asked for."""
    rows = [row for row in results.of(who, group, condition) if row.saliency_rank is not None or row.saliency_failure]
    if not rows:
        return ()
    cells = (_rank_cell([row for row in rows if row.mesh == mesh]) for mesh in results.meshes)
    name = "marked" if group == UNTOUCHED else f"{group} {condition}"
    return (Cell(name), *cells, Cell(number(mean(row.saliency_rank for row in rows))))


def _rank_cell(rows: list[Row]) -> Cell:
    reason = next((row.saliency_failure for row in rows if row.saliency_failure), "")
    return Cell(number(mean(row.saliency_rank for row in rows)), reason)


def _marked(results: Results, kept: Kept) -> Picture:
    if kept.kind == "original":
        return Picture(kept.mesh, kept.jpeg, _joined("original", kept.caption))
    rows = _drawn(results, kept.mesh, UNTOUCHED, "-")
    mrms = mean(row.metrics.get("mrms") for row in rows)
    cost = "" if mrms is None else f"MRMS {1e3 * mrms:.2f} · 10⁻³"
    return Picture(f"{kept.mesh}, marked", kept.jpeg, _joined(cost, f"Corr {corr_number(corr(rows))}", kept.caption))


def _attacked(results: Results, kept: Kept) -> Picture:
    rows = _drawn(results, kept.mesh, kept.group, kept.condition)
    message = "message read" if any(row.message_ok for row in rows) else ""
    return Picture(
        f"{kept.group} {kept.condition}",
        kept.jpeg,
        _joined(f"Corr {corr_number(corr(rows))}", message, kept.caption),
    )


def _saliency_picture(results: Results, kept: Kept) -> Picture:
    rows = _drawn(results, kept.mesh, kept.group, kept.condition)
    title = "marked" if kept.group == UNTOUCHED else f"{kept.group} {kept.condition}"
    return Picture(title, kept.jpeg, _joined(f"ρ = {number(mean(row.saliency_rank for row in rows))}", kept.caption))


def _drawn(results: Results, mesh: str, group: str, condition: str) -> list[Row]:
    """The readings of the mesh that was drawn: the campaign's own method, its first seed and number of bits."""
    rows = results.of(results.main, group, condition, mesh) if results.main else []
    return [row for row in rows if row.seed == results.campaign.seeds[0]]


def _joined(*texts: str) -> str:
    return ", ".join(filter(None, texts))


def _kept(directory: Path) -> list[Kept]:
    """The pictures of a folder; none where it has no list. Errors: SpecError for a list that is damaged."""
    path = directory / LIST
    if not path.exists():
        return []
    try:
        return [_read(directory, each) for each in json.loads(path.read_text(encoding="utf-8"))]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SpecError(f"{path} is damaged: {error}") from None


def _read(directory: Path, entry: dict[str, Any]) -> Kept:
    """One picture; it must lie in the folder, so that no report shows another file of whoever makes it."""
    file = (directory / entry["file"]).resolve()
    if not file.is_relative_to(directory.resolve()):
        raise ValueError(f"{entry['file']} is not in the folder")
    texts = (str(entry.get(name) or "") for name in ("mesh", "kind", "group", "condition", "caption"))
    return Kept(file.read_bytes(), *texts)
