"""What marks and attacks look like: the campaign's meshes marked anew, attacked, and drawn."""

import io
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.image import imsave
from scipy.stats import spearmanr

from o3dmark.campaign import Case, Job, Trial, trial
from o3dmark.campaign.job import attacked
from o3dmark.errors import O3dmarkError
from o3dmark.geometry import Floats
from o3dmark.report.content import Picture, Section, number
from o3dmark.report.data import Results, corr
from o3dmark.saliency import Saliency
from o3dmark.view import render

SIZE = (360, 330)  # pixels


def gallery_sections(results: Results) -> Iterator[Section]:
    """Every mesh before and after; one mesh after every attack; its saliency before and after them."""
    wish = results.campaign.gallery or {}
    cases = [case for case in results.campaign.cases if f"{case.group}/{case.condition}" in wish.get("attacks", ())]
    jobs = _jobs(results, wish)
    pictures: list[Picture] = []
    after: list[Picture] = []
    changed: list[Picture] = []
    for job in jobs:
        try:
            marked = trial(job)
            pictures += _mesh_pictures(results, job, marked, cases)
            if job is _subject(jobs):
                after, changed = _attack_pictures(results, job, marked, cases)
        except O3dmarkError as error:  # the files of real meshes may be gone by now
            pictures.append(Picture(f"{job.mesh.name}: not drawn", b"", str(error)))
    yield Section(
        "Gallery", f"Marked with {wish.get('method', '')}, seed {results.campaign.seeds[0]}.", tuple(pictures)
    )
    name = _subject(jobs).mesh.name if jobs else ""
    yield Section(f"{name} after attacks", "The marked mesh, and how well its bits were read.", tuple(after))
    intro = (
        "Spearman's rank correlation with the saliency of the cover says how well an attacked mesh still tells where"
        " the salient vertices are."
    )
    yield Section("Saliency before and after attacks", intro, tuple(changed))


def _jobs(results: Results, wish: Any) -> list[Job]:
    """The jobs to draw: each wanted mesh, first seed, first number of bits."""
    campaign = results.campaign
    wanted = {(name, wish["method"], campaign.seeds[0], campaign.bits[0]) for name in wish.get("meshes", ())}
    return [job for job in campaign.jobs() if (job.mesh.name, job.label, job.seed, job.n_bits) in wanted]


def _subject(jobs: list[Job]) -> Job:
    """The mesh to attack in pictures: the paper's, or the first."""
    return next((job for job in jobs if job.mesh.name == "Bimba"), jobs[0])


def _mesh_pictures(results: Results, job: Job, marked: Trial, cases: list[Case]) -> Iterator[Picture]:
    name, rows = job.mesh.name, [row for row in results.rows if row["job"] == job.id]
    yield _picture(name, marked.cover, f"{len(marked.cover.vertices):,} vertices")
    yield _picture("saliency", marked.cover, "bright where the eye is drawn to", Saliency()(marked.cover))
    cost = next((f"MRMS {1e3 * row['mrms']:.2f} · 10⁻³" for row in rows if row["mrms"] is not None), "")
    yield _picture("marked", marked.marked, cost, frame=marked.cover)
    if cases:
        case = cases[0]
        yield _picture(f"{case.group} {case.condition}", attacked(marked, case, job.seed), _read(rows, case))


def _attack_pictures(
    results: Results, job: Job, marked: Trial, cases: list[Case]
) -> tuple[list[Picture], list[Picture]]:
    rows = [row for row in results.rows if row["job"] == job.id]
    before = Saliency()(marked.cover)
    after, changed = [], [_picture("cover", marked.cover, "", before)]
    for case in cases:
        mesh, title = attacked(marked, case, job.seed), f"{case.group} {case.condition}"
        after.append(_picture(title, mesh, _read(rows, case)))
        values = Saliency()(mesh)
        text = "other vertices than the cover's"
        if len(values) == len(before):
            text = f"rank correlation {number(float(spearmanr(before, values).statistic))}"
        changed.append(_picture(title, mesh, text, values))
    return after, changed


def _read(rows: list[dict[str, Any]], case: Case) -> str:
    found = [row for row in rows if (row["group"], row["condition"]) == (case.group, case.condition)]
    message = ", message read" if any(row["message_ok"] for row in found) else ""
    return f"Corr {number(corr(found))}{message}"


def _picture(title: str, mesh: Any, caption: str, scalars: Floats | None = None, frame: Any = None) -> Picture:
    image, file = render(mesh, scalars, size=SIZE, frame=frame), io.BytesIO()
    imsave(file, np.ascontiguousarray(image), format="jpeg", pil_kwargs={"quality": 86})
    return Picture(title, file.getvalue(), caption)
