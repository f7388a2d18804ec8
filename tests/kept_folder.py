"""Results folders made by hand: a small campaign, rows with invented figures, and the files that a campaign keeps."""

import json
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from o3dmark.campaign.plan import Campaign, Case, Gallery, Job, Source
from o3dmark.campaign.row import Row

FIGURES = """table,method,metric,condition,model,value
noise,hamidi,corr,0.05%,Bimba,1
noise,hamidi,corr,0.10%,Bimba,0.92
noise,hamidi,corr,0.50%,Bimba,0.79
noise,hamidi,corr,0.50%,Vase,0.72
noise,hamidi,corr,0.50%,Ant,0.01
subdivision,hamidi,corr,midpoint,Bimba,0.95
imperceptibility,hamidi,mrms_e-3,saliency,Bimba,0.37
imperceptibility,hamidi,hd_e-3,saliency,Bimba,1.62
imperceptibility,hamidi,mrms_e-3,no saliency,Bimba,0.76
noise comparison,cho2007,corr,0.1%,Bunny,0.72
noise comparison,hamidi,corr,0.1%,Bunny,1
noise comparison,cho2007,corr,0.5%,Bunny,0.66
noise comparison,hamidi,corr,0.5%,Bunny,0.86
imperceptibility comparison,cho2007,mrms_e-3,,Bunny,3.17
imperceptibility comparison,hamidi,mrms_e-3,,Bunny,0.51
"""
PLAIN = Campaign(
    title="a small campaign",
    meshes=tuple(Source(name, f"{name.lower()}:vertices=1000") for name in ("Bimba", "Vase", "Bunny")),
    methods={"first": "saliency-scs:sync=rank", "second": "shape-spectrum"},
    cases=(
        Case("noise", "0.05%", ("noise:amplitude=0.0005",)),
        Case("noise", "0.1%", ("noise:amplitude=0.001",)),
        Case("noise", "0.50%", ("noise:amplitude=0.005",)),
        Case("subdivision", "loop", ("subdivide:scheme=loop",)),
        Case("subdivision", "midpoint", ("subdivide:scheme=midpoint",)),
        Case("pipelines", "all at once", ("reorder", "noise:amplitude=0.001")),
    ),
    main="second",
    bits=(64,),
    seeds=(0, 1),
    wrong_keys=2,
    unmarked=1,
    gallery=Gallery(("Bimba", "Vase"), ("noise/0.50%", "subdivision/loop"), "Vase"),
)
COMPARED = replace(
    PLAIN,
    published=FIGURES,
    published_names={"hamidi": "Hamidi 2019", "cho2007": "Cho 2007"},
    imperceptibility={"saliency": "first"},
)
RUN = {
    "command": "o3dmark bench small --out small",
    "started": "2026-11-27 10:00 UTC",
    "version": "0.2.0",
    "commit": "abc1234",
    "machine": "Linux x86_64, 2 cores",
    "python": "3.11.7",
}


def invented_rows(campaign: Campaign, change: Callable[[Row], Row] = lambda row: row) -> list[Row]:
    """A row for every reading of a campaign, with figures from a seeded generator; ``change`` may set them."""
    rng = np.random.default_rng(0)
    return [
        change(_row(job, reading.case, reading.control, rng)) for job in campaign.jobs() for reading in job.readings
    ]


def keep(
    folder: Path, campaign: Campaign, rows: Iterable[Row] | None = None, *, runs: tuple[dict[str, Any], ...] = (RUN,)
) -> Path:
    """Write what a campaign leaves in a folder: its plan, its runs, its methods, its rows; returns the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    methods = {
        label: {"spec": spec, "says": f"What {label} does.", "needs": "key alone (blind)", "options": "none"}
        for label, spec in campaign.methods.items()
    }
    content = {"campaign": campaign.to_dict(), "runs": runs, "methods": methods}
    (folder / "campaign.json").write_text(json.dumps(content))
    lines = invented_rows(campaign) if rows is None else rows
    (folder / "rows.jsonl").write_text("".join(json.dumps(row.to_dict()) + "\n" for row in lines))
    return folder


def _row(job: Job, case: Case, control: str, rng: np.random.Generator) -> Row:
    errors = int(rng.integers(0, job.n_bits // 3))
    p = -float(rng.exponential(1.0))
    return Row(
        job=job.id,
        mesh=job.mesh.name,
        source=job.mesh.public,
        label=job.label,
        method=job.method,
        group=case.group,
        condition=case.condition,
        attack=" ".join(case.attacks) or "identity",
        control=control,
        seed=job.seed,
        n_bits=job.n_bits,
        version="0.2.0",
        vertices=1000,
        bit_errors=errors,
        ber=errors / job.n_bits,
        corr=float(rng.uniform(0.2, 1.0)),
        message_ok=bool(rng.random() < 0.5) and not control,
        message_read=bool(rng.random() < 0.5),
        log10_p=p / 2,
        log10_p_best=p,
        log10_p_uncharged=p,
        hypotheses=10,
        seconds=0.5,
        embed_seconds=1.0,
        metrics={
            "mrms": float(rng.uniform(3e-4, 7e-4)),
            "hausdorff": float(rng.uniform(1e-3, 5e-3)),
            "msdm": float(rng.uniform(0.1, 0.5)),
        },
    )
