"""One job: a mesh marked once, put through everything, read each time. A failure is a row like any other."""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o3dmark._version import __version__
from o3dmark.campaign.pictures import Picture, pictures_of
from o3dmark.campaign.plan import UNTOUCHED, Case, Job, Reading
from o3dmark.campaign.plugins import load_plugins
from o3dmark.campaign.row import UNMARKED, Row
from o3dmark.campaign.saliency_rank import rank_correlation
from o3dmark.campaign.specimen import Specimen, key_of
from o3dmark.coding.detection import detect
from o3dmark.coding.keys import Key
from o3dmark.mesh.saliency import Saliency
from o3dmark.methods import Extraction
from o3dmark.metrics import METRICS
from o3dmark.metrics.correlation import bit_errors, correlation


@dataclass(frozen=True)
class Outcome:
    """What a job gives: the rows of its readings, in their order, and the pictures that the campaign wants of it."""

    rows: tuple[Row, ...]
    pictures: tuple[Picture, ...] = ()


def run_job(job: Job) -> Outcome:
    """Do a job. It has a row for each of its readings, whatever fails."""
    try:
        load_plugins(job.plugins)
        made = Specimen.of(job)
        common = _cost(job, made) | {"embed_seconds": round(made.seconds, 3)}
    except Exception as error:
        return failed(job, f"marking: {_reason(job, error)}")
    rows, pictures = list[Row](), list[Picture]()
    for _, readings in groupby(
        job.readings, lambda reading: (reading.case.attacks and reading.case, _unmarked(reading))
    ):
        for reading, result in _read_all(job, made, list(readings), pictures):
            rows.append(_row(job, reading, common | result))
    return Outcome(tuple(rows), tuple(pictures))


def failed(job: Job, reason: str) -> Outcome:
    """What a job leaves of which nothing could be measured."""
    return Outcome(tuple(_row(job, reading, {"failure": reason}) for reading in job.readings))


def _read_all(
    job: Job, made: Specimen, readings: list[Reading], pictures: list[Picture]
) -> Iterator[tuple[Reading, dict[str, Any]]]:
    """The readings that are all of one mesh, each with its result; what is drawn is added to ``pictures``."""
    try:
        mesh = made.attacked(readings[0].case, unmarked=_unmarked(readings[0]))
    except Exception as error:  # of an attack, ours or a library's: the campaign goes on
        yield from ((reading, {"failure": f"attack: {_reason(job, error)}"}) for reading in readings)
        return
    observed = None
    for reading in readings:
        started = time.perf_counter()
        try:
            observed = made.watermark.method.observe(mesh) if observed is None else observed
            result = _read(made, job, observed, key_of(reading.key) if reading.key else made.key, started)
        except Exception as error:  # likewise
            result = {"failure": f"reading: {_reason(job, error)}"}
        yield reading, result | ({} if reading.control else _seen(job, made, reading.case, mesh, pictures))


def _unmarked(reading: Reading) -> bool:
    return reading.control == UNMARKED


def _read(made: Specimen, job: Job, observed: Any, key: Key, started: float) -> dict[str, Any]:
    """What a key reads from a mesh, beside what it should."""
    watermark, expected = made.watermark, made.expected(key)
    reference = made.cover if job.informed or watermark.method.informed else None
    read = watermark.extract_bits(observed, key, reference=reference)
    seconds = time.perf_counter() - started
    errors = bit_errors(expected, read.bits)
    result = {
        "bit_errors": errors.errors,
        "ber": _rounded(errors.rate),
        "corr": _corr(expected, read.bits),
        "log10_p": _rounded(detect(read.soft, expected, hypotheses=read.hypotheses, shown=read.log10_p).log10_p),
        "log10_p_best": _rounded(read.detect(expected).log10_p),
        "log10_p_uncharged": _rounded(detect(read.soft, expected).log10_p),
        "hypotheses": read.hypotheses,
        "seconds": round(seconds, 3),
    }
    return result | _told(read) | _decoded(made, read, key)


def _told(read: Extraction) -> dict[str, Any]:
    """Which reading it was."""
    return {name: _rounded(value) if isinstance(value, float) else value for name, value in read.which().items()}


def _decoded(made: Specimen, read: Extraction, key: Key) -> dict[str, Any]:
    if made.message is None:
        return {}
    decoded = made.watermark.decode(read, key).decoded
    return {
        "message_ok": decoded.message == made.message,
        "message_read": decoded.found,
        "log10_p_message": _rounded(decoded.log10_p),
    }


def _corr(expected: NDArray[np.uint8], bits: NDArray[np.uint8]) -> float | None:
    """The paper's equation, where it has a value."""
    return _rounded(correlation(expected, bits)) if np.ptp(expected) and np.ptp(bits) else None


def _cost(job: Job, made: Specimen) -> dict[str, Any]:
    """The metrics between cover and marked mesh; one that cannot be had is null, and says why."""
    costs: dict[str, float | None] = {}
    reason = None
    for metric in map(METRICS.make, job.metrics):
        try:
            value = float(metric(made.cover, made.marked))
            costs[metric.name] = _rounded(value)
            reason = reason if math.isfinite(value) else f"{metric.name}: {value} is no number that can be kept"
        except Exception as error:
            costs[metric.name], reason = None, f"{metric.name}: {_reason(job, error)}"
    return {"metrics": costs, "vertices": len(made.cover.vertices), "cost_failure": reason}


def _seen(job: Job, made: Specimen, case: Case, mesh: Any, pictures: list[Picture]) -> dict[str, Any]:
    """Whether saliency keeps its order, and pictures, where they are wanted."""
    in_gallery = job.gallery is not None and (case.group == UNTOUCHED or case.name in job.gallery)
    if not (job.saliency_rank or in_gallery):
        return {}
    try:
        saliency = Saliency()(mesh)
        rank = rank_correlation(made.cover, made.saliency, mesh, saliency)
        if in_gallery:
            pictures.extend(pictures_of(job, made, case, mesh, saliency))
        return {"saliency_rank": None if rank is None else _rounded(rank)}
    except Exception as error:
        return {"saliency_failure": _reason(job, error)}


def _row(job: Job, reading: Reading, result: dict[str, Any]) -> Row:
    case = reading.case
    return Row(
        job=job.id,
        mesh=job.mesh.name,
        source=job.mesh.public,
        label=job.label,
        method=job.method,
        group=case.group,
        condition=case.condition,
        attack=" ".join(case.attacks) or "identity",
        control=reading.control,
        seed=job.seed,
        n_bits=job.n_bits,
        version=__version__,
        **{"metrics": dict.fromkeys(spec.partition(":")[0] for spec in job.metrics)} | result,
    )


def _rounded(value: float) -> float | None:
    """Six digits: the rest depends on the order in which threads add. None for what JSON has no number for."""
    return float(f"{value:.6g}") if math.isfinite(value) else None


def _reason(job: Job, error: BaseException) -> str:
    """The error in one line, without folders of the machine."""
    text = str(error).replace(job.mesh.source, job.mesh.public) if job.mesh.digest else str(error)
    return f"{type(error).__name__}: {text}"
