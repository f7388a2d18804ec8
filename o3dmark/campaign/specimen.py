"""A mesh and its marked copy, as a job has them made: the same again wherever and whenever that is done."""

import hashlib
import time
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o3dmark.arrays import Floats
from o3dmark.campaign.checks import checked_attacks
from o3dmark.campaign.plan import Case, Job, Source
from o3dmark.coding.keys import Key
from o3dmark.coding.payload import CODES
from o3dmark.errors import MeshError, SpecError
from o3dmark.files import read_mesh
from o3dmark.mesh.saliency import Saliency
from o3dmark.methods import METHODS
from o3dmark.synthetic import make
from o3dmark.watermark import Watermark


@dataclass(frozen=True, eq=False)
class Specimen:
    """A cover mesh and its marked copy, with all that was used to mark it. ``message`` is None where bits are raw."""

    watermark: Watermark
    seed: int
    message: str | None
    cover: Any
    marked: Any
    seconds: float

    @classmethod
    def of(cls, job: Job) -> "Specimen":
        """Mark the job's mesh. Errors: as in `Watermark.embed`, and MeshError when the mesh cannot be had."""
        watermark = Watermark(METHODS.make(job.method), CODES.make(job.code), job.n_bits)
        message, key, cover = _message(watermark, job.seed), key_of(f"seed {job.seed}"), cover_of(job.mesh)
        bits = _bits(watermark, message, key, job.seed)
        started = time.perf_counter()
        marked = watermark.embed_bits(cover, bits, key)
        return cls(watermark, job.seed, message, cover, marked, time.perf_counter() - started)

    @property
    def key(self) -> Key:
        """The owner's key."""
        return key_of(f"seed {self.seed}")

    def expected(self, key: Key) -> NDArray[np.uint8]:
        """The bits (n_bits,) that stand for the message under ``key``, or the raw ones."""
        return _bits(self.watermark, self.message, key, self.seed)

    def attacked(self, case: Case, *, unmarked: bool = False) -> Any:
        """The marked mesh, or the cover, after a case; the randomness depends on the seed and on the case's names."""
        digest = hashlib.sha256(f"{self.seed}/{case.name}".encode()).digest()
        return checked_attacks(self.cover if unmarked else self.marked, case.attacks, int.from_bytes(digest[:8], "big"))

    @cached_property
    def saliency(self) -> Floats:
        """Saliency of the cover's vertices (n,)."""
        return Saliency()(self.cover)


def key_of(label: str) -> Key:
    """A key that anyone can make again: campaigns are public."""
    return Key(hashlib.sha256(f"o3dmark campaign: {label}".encode()).digest())


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
