"""What marks and attacks look like: the campaign's meshes marked anew, attacked, and drawn.

Meshes are taken one after the other and let go: each has its saliency drawn; if the campaign's gallery names it, it is
marked, once, and put through the gallery's attacks. One mesh alone gets pictures of those.
"""

import io
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from matplotlib.image import imsave

from o3dmark.arrays import Floats
from o3dmark.campaign import Case, Job, Source, Specimen
from o3dmark.campaign.plan import UNTOUCHED
from o3dmark.campaign.saliency_rank import rank_correlation
from o3dmark.campaign.specimen import cover_of
from o3dmark.errors import O3dmarkError
from o3dmark.mesh.saliency import Saliency
from o3dmark.report.content import Cell, Picture, Section, Table, number
from o3dmark.report.data import Results, Row, corr, mean
from o3dmark.view import render

SIZE = (360, 330)  # pixels
MARKED = Case(UNTOUCHED, "-", ())  # what the mark alone does to saliency
SUBJECT = "Bimba"  # the mesh that the paper shows after attacks


@dataclass(frozen=True)
class After:
    """A mesh after one case: how its saliency kept its order (or why that is unknown), and the pictures, if wanted."""

    case: str
    rank: float | None
    reason: str = ""
    mesh: Picture | None = None
    saliency: Picture | None = None


@dataclass(frozen=True)
class Model:
    """What there is to show of a mesh; ``marked`` and ``after`` are empty for those that the gallery does not name."""

    name: str
    saliency: Picture
    marked: tuple[Picture, ...] = ()
    after: tuple[After, ...] = ()


def gallery_sections(results: Results) -> Iterator[Section]:
    """Saliency of every mesh; those marked; one mesh after every attack; its saliency before and after them."""
    wish = (
        {} if results.campaign.gallery is None else {"method": results.campaign.main} | asdict(results.campaign.gallery)
    )
    jobs = _jobs(results, wish)
    subject = SUBJECT if SUBJECT in jobs else next(iter(jobs), "")
    attacks = {*wish.get("attacks", ())}
    cases = [MARKED, *(case for case in results.campaign.cases if f"{case.group}/{case.condition}" in attacks)]
    models = [_model(results, mesh, jobs.get(mesh.name), cases, subject) for mesh in results.campaign.meshes]
    shown = next((model for model in models if model.name == subject), None)
    intro = "Mesh saliency after Lee et al., five scales, from the 2nd to the 98th percentile: yellow draws the eye."
    yield Section("Saliency of the models", intro, tuple(model.saliency for model in models))
    intro = (
        f"Each model and its copy marked with {wish.get('method', '')} (seed {results.campaign.seeds[0]}), from the"
        " same point of view. Corr is that of the bits read from the copy."
    )
    yield Section("Marked models", intro, tuple(picture for model in models for picture in model.marked))
    intro = "The marked mesh after each attack, and how well its bits were read."
    after = shown.after if shown else ()
    yield Section(f"{subject} after attacks", intro, tuple(each.mesh for each in after if each.mesh))
    yield _stability([model for model in models if model.after], shown)


def _stability(models: list[Model], shown: Model | None) -> Section:
    """Saliency after attacks beside that of the cover, in pictures and in numbers."""
    intro = (
        "A blind method that chooses vertices by saliency needs an attacked mesh to order them as its cover did."
        " Spearman's rank correlation ρ says how well it does: 1 for the same order, 0 for none. Where the"
        " triangulation changed, nearest vertices are compared, after any change of pose and size is undone."
    )
    pictures, tables = [], []
    if shown and shown.after:
        pictures = [Picture(shown.name, shown.saliency.jpeg, "cover")]
        pictures += [each.saliency for each in shown.after if each.saliency]
    if models:
        head = ("Spearman's ρ of saliency", *(model.name for model in models), "mean")
        rows = tuple(_rank_row([model.after[k] for model in models]) for k in range(len(models[0].after)))
        tables = [Table("Rank correlation of saliency with the cover's", head, rows)]
    return Section("Saliency before and after attacks", intro, (*pictures, *tables))


def _rank_row(models: list[After]) -> tuple[Cell, ...]:
    """One case, in all models, and the mean."""
    cells = (Cell(number(after.rank), after.reason) for after in models)
    return (Cell(models[0].case), *cells, Cell(number(mean(after.rank for after in models))))


def _jobs(results: Results, wish: Mapping[str, Any]) -> dict[str, Job]:
    """The jobs to draw, by the names of their meshes: each wanted mesh, first seed, first number of bits."""
    campaign = results.campaign
    wanted = {(name, wish["method"], campaign.seeds[0], campaign.bits[0]) for name in wish.get("meshes", ())}
    return {job.mesh.name: job for job in campaign.jobs() if (job.mesh.name, job.label, job.seed, job.n_bits) in wanted}


def _model(results: Results, mesh: Source, job: Job | None, cases: list[Case], subject: str) -> Model:
    try:
        cover = cover_of(mesh)
        saliency = Saliency()(cover)
        picture = _picture(mesh.name, cover, f"{len(cover.vertices):,} vertices", saliency)
    except O3dmarkError as error:  # the files of real meshes may be gone by now
        return Model(mesh.name, Picture(f"{mesh.name}: not drawn", b"", str(error)))
    if job is None:
        return Model(mesh.name, picture)
    rows = [row for row in results.rows if row["job"] == job.id]
    try:
        marked = Specimen.of(job)
    except Exception as error:  # ours or a library's: the report goes on, as the campaign did
        return Model(mesh.name, picture, (Picture(f"{mesh.name}: not marked", b"", str(error)),))
    pair = (
        _picture(mesh.name, cover, "original"),
        _picture(f"{mesh.name}, marked", marked.marked, _marked_caption(rows), frame=cover),
    )
    drawn = mesh.name == subject
    return Model(mesh.name, picture, pair, tuple(_after(marked, saliency, rows, case, drawn) for case in cases))


def _after(marked: Specimen, before: Floats, rows: list[Row], case: Case, drawn: bool) -> After:
    title = "marked" if case is MARKED else f"{case.group} {case.condition}"
    try:
        mesh = marked.attacked(case)
        saliency = Saliency()(mesh)
        rank = rank_correlation(marked.cover, before, mesh, saliency)
        if not drawn:
            return After(title, rank)
        coloured = _picture(title, mesh, f"ρ = {number(rank)}", saliency)
        plain = None if case is MARKED else _picture(title, mesh, _read(rows, case))
        return After(title, rank, "", plain, coloured)
    except Exception as error:  # likewise
        return After(title, None, str(error))


def _marked_caption(rows: list[Row]) -> str:
    row = next((row for row in rows if row["mrms"] is not None), None)
    return "" if row is None else f"MRMS {1e3 * row['mrms']:.2f} · 10⁻³, Corr {number(row['corr'])}"


def _read(rows: list[Row], case: Case) -> str:
    found = [row for row in rows if (row["group"], row["condition"]) == (case.group, case.condition)]
    message = ", message read" if any(row["message_ok"] for row in found) else ""
    return f"Corr {number(corr(found))}{message}"


def _picture(title: str, mesh: Any, caption: str, scalars: Floats | None = None, frame: Any = None) -> Picture:
    image, file = render(mesh, scalars, size=SIZE, frame=frame), io.BytesIO()
    imsave(file, np.ascontiguousarray(image), format="jpeg", pil_kwargs={"quality": 86})
    return Picture(title, file.getvalue(), caption)
