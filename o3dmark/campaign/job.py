"""One job: a mesh marked once, attacked by everything, read each time. A failure is a row like any other."""

import hashlib
import math
import time
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o3dmark._version import __version__
from o3dmark.attacks import attack_all
from o3dmark.campaign.plan import STRANGER, Case, Job, Source
from o3dmark.coding.detection import detect
from o3dmark.coding.keys import Key
from o3dmark.coding.payload import CODES
from o3dmark.errors import MeshError, SpecError
from o3dmark.files import read_mesh
from o3dmark.methods import METHODS
from o3dmark.metrics import METRICS
from o3dmark.metrics.correlation import bit_errors, correlation
from o3dmark.synthetic import make
from o3dmark.watermark import Watermark

Row = dict[str, Any]
_NOTHING: Row = dict.fromkeys(
    [
        *("vertices", "bit_errors", "corr", "message_ok", "message_read", "p_value", "p_uncharged"),
        *("message_p_value", "mrms", "hausdorff", "msdm", "hypotheses", "note", "seconds", "embed_seconds"),
    ]
)


@dataclass(frozen=True, eq=False)
class Trial:
    """A cover mesh and its marked copy, with all that was used to mark it. ``message`` is None where bits are raw."""

    watermark: Watermark
    key: Key
    message: str | None
    cover: Any
    marked: Any
    seconds: float

    def expected(self, key: Key, seed: int) -> NDArray[np.uint8]:
        """The bits (n_bits,) that stand for the message under ``key``, or the raw ones."""
        return _bits(self.watermark, self.message, key, seed)


def trial(job: Job) -> Trial:
    """Mark the job's mesh. Errors: as in `Watermark.embed`, and MeshError when the mesh cannot be had."""
    watermark = Watermark(METHODS.make(job.method), CODES.make(job.code), job.n_bits)
    message, key = _message(watermark, job.seed), key_of(f"seed {job.seed}")
    cover = cover_of(job.mesh)
    started = time.perf_counter()
    marked = watermark.embed_bits(cover, _bits(watermark, message, key, job.seed), key)
    return Trial(watermark, key, message, cover, marked, time.perf_counter() - started)


def attacked(trial: Trial, case: Case, seed: int) -> Any:
    """The marked mesh after a case; the randomness depends on the seed and on the case's names."""
    digest = hashlib.sha256(f"{seed}/{case.group}/{case.condition}".encode()).digest()
    return attack_all(trial.marked, case.attacks, int.from_bytes(digest[:8], "big"))


def run_job(job: Job) -> list[Row]:
    """The rows of a job, one for each of its readings in their order, whatever fails."""
    try:
        marked = trial(job)
        common = _cost(job, marked) | {"embed_seconds": round(marked.seconds, 3)}
    except Exception as error:
        return failed_rows(job, error)
    return [_row(job, case, common | _result(job, case, marked)) for case in job.readings]


def failed_rows(job: Job, error: BaseException) -> list[Row]:
    """What a job leaves that could not even mark its mesh."""
    cost: Row = dict.fromkeys(METRICS.make(spec).name for spec in job.metrics)
    return [_row(job, case, cost | {"failure": f"marking: {_reason(error)}"}) for case in job.readings]


def key_of(label: str) -> Key:
    """A key that anyone can make again: campaigns are public."""
    return Key(hashlib.sha256(f"o3dmark campaign: {label}".encode()).digest())


def _row(job: Job, case: Case, result: Row) -> Row:
    names: Row = {
        "job": job.id,
        "mesh": job.mesh.name,
        "source": job.mesh.public,
        "label": job.label,
        "method": job.method,
        "group": case.group,
        "condition": case.condition,
        "attack": " ".join(case.attacks) or "identity",
        "seed": job.seed,
        "n_bits": job.n_bits,
    }
    return names | _NOTHING | {"failure": None, "version": __version__} | result


def _result(job: Job, case: Case, marked: Trial) -> Row:
    key = key_of(f"stranger {case.condition} of seed {job.seed}") if case.group == STRANGER else marked.key
    try:
        return _reading(marked, attacked(marked, case, job.seed), key, job.seed)
    except Exception as error:  # of an attack or a reader, ours or a library's: the campaign goes on
        return {"failure": _reason(error)}


def _reading(marked: Trial, mesh: Any, key: Key, seed: int) -> Row:
    watermark, expected = marked.watermark, marked.expected(key, seed)
    started = time.perf_counter()
    read = watermark.extract_bits(mesh, key, reference=marked.cover if watermark.method.informed else None)
    seconds = time.perf_counter() - started
    known = detect(read.soft, expected, hypotheses=read.hypotheses)
    row: Row = {
        "bit_errors": bit_errors(expected, read.bits).errors,
        "corr": _rounded(correlation(expected, read.bits)),
        "p_value": _rounded(known.p_value),
        "p_uncharged": _rounded(detect(read.soft, expected).p_value),
        "hypotheses": read.hypotheses,
        "note": read.note,
        "seconds": round(seconds, 3),
    }
    if marked.message is not None:
        decoded = watermark.code.decode(read.soft, key, hypotheses=read.hypotheses)
        row["message_ok"], row["message_read"] = decoded.message == marked.message, decoded.found
        row["message_p_value"] = _rounded(decoded.p_value)
    return row


def _cost(job: Job, marked: Trial) -> Row:
    """The metrics between cover and marked mesh; one that cannot be had is null, and says why."""
    costs: Row = {"vertices": len(marked.cover.vertices)}
    for metric in map(METRICS.make, job.metrics):
        try:
            value = float(metric(marked.cover, marked.marked))
            costs[metric.name] = _rounded(value) if math.isfinite(value) else None
        except Exception as error:
            costs[metric.name] = None
            costs["cost_failure"] = f"{metric.name}: {_reason(error)}"
    return costs


@lru_cache(maxsize=2)
def cover_of(source: Source) -> Any:
    """The mesh of a source; the last two are kept. Errors: MeshError when a file is gone or is another one now."""
    if not source.digest:
        return make(source.source)
    mesh = read_mesh(source.source)
    if hashlib.sha256(Path(source.source).read_bytes()).hexdigest() != source.digest:
        raise MeshError(f"{source.public} is not the file that the campaign was planned with")
    return mesh


def _message(watermark: Watermark, seed: int) -> str | None:
    """A message as long as the code has room for; None when the bits are too few for any."""
    try:
        size = watermark.code.frame_bytes(watermark.n_bits)
    except SpecError:
        return None
    return "hex:" + hashlib.sha256(f"message {seed}".encode()).digest()[:size].hex()


def _bits(watermark: Watermark, message: str | None, key: Key, seed: int) -> NDArray[np.uint8]:
    if message is None:
        return key_of(f"bits of seed {seed}").stream("campaign/bits").bits(watermark.n_bits)
    return watermark.code.encode(message, watermark.n_bits, key)


def _rounded(value: float) -> float:
    """Six digits: the rest depends on the order in which threads add."""
    return float(f"{value:.6g}")


def _reason(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}"
