"""Tracing: whose copy is a file? Every view of it is read with the keys of all assets, and laid on all codewords.

An innocent's codeword is fair coins to whatever was read (see `coding.identities`), so the p-value of the best
candidate, charged for every candidate, reading, view and pass, is the probability that some innocent would be named.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import groupby
from typing import Any, TypeAlias

import numpy as np

from o3dmark.arrays import Bits
from o3dmark.coding.identities import Candidate, codewords, nearest
from o3dmark.coding.keys import Key
from o3dmark.copies.chain import Copy
from o3dmark.copies.issuing import asset_digest, asset_key, copies_watermark
from o3dmark.errors import LedgerError, MeshError
from o3dmark.files import Asset
from o3dmark.marking import View, mesh_of, views
from o3dmark.mesh.patch import Patch
from o3dmark.methods import NO_DEEPER, Depth, Extraction, Method, Progress, silent
from o3dmark.profiles import DEFAULT_PROFILE
from o3dmark.watermark import Watermark

_PASSES = 3  # the quick look, which reads most, the search, and the look for a mixture
_MOST_MIXED = 10_000  # copies of an asset that are made again to look for mixtures, in up to a second each
_MOST_COVERS = 4  # parts of a reference that are laid beside each view, the largest


@dataclass(frozen=True)
class Named:
    """A copy as a candidate: log10 of the p-value, all charged, and which of its bits agree (1) or not (0)."""

    copy: Copy
    log10_p: float
    agreement: str

    @property
    def matches(self) -> int:
        """How many bits agree."""
        return self.agreement.count("1")

    @property
    def p_value(self) -> float:
        """The probability that some innocent's copy would agree as well with what was read."""
        return float(10.0**self.log10_p)


@dataclass(frozen=True)
class Trace:
    """Whose copy it is, if it is one's.

    best, runner_up: the candidates that agree best; None where there are none. part: what of the file spoke, and
    how it was read (``view``). patches: those of the surface that spoke, in the file's unit and coordinates; none where
    it spoke as a whole. candidates: how many copies could have been named. mixed: of a mixture of copies those who took
    part, as far as that is sure.
    """

    best: Named | None
    runner_up: Named | None
    candidates: int
    false_positive_rate: float
    part: str = ""
    view: str = ""
    informed: bool = False
    mixed: tuple[Named, ...] = ()
    patches: tuple[Patch, ...] = ()

    @property
    def found(self) -> bool:
        """Whether the best candidate is named: with a p-value within the rate asked for."""
        return self.best is not None and self.best.log10_p <= math.log10(self.false_positive_rate)

    @property
    def named(self) -> tuple[Named, ...]:
        """Those who are named: one, or those who took part in a mixture."""
        return (self.mixed or (self.best,)) if self.found and self.best is not None else ()


@dataclass(frozen=True, eq=False)
class Batch:
    """The copies of one asset that were made with one key, and what reads them."""

    key: Key
    copies: tuple[Copy, ...]
    remade: dict[int, Any] = field(default_factory=dict)  # by cover, what mixtures are compared with

    @property
    def asset(self) -> str:
        return self.copies[0].asset

    @cached_property
    def watermark(self) -> Watermark:
        return copies_watermark(self.copies[0].profile, self.copies[0].n_bits)

    @cached_property
    def words(self) -> Bits:
        """The codewords (N, n_bits) of the copies."""
        return codewords(self.key, [copy.name for copy in self.copies], self.watermark.n_bits)


_Seen: TypeAlias = tuple[Batch, View, Extraction | MeshError, bool]
"""A batch, a view of the file, what it shows under the batch's key, and whether beside the reference."""


@dataclass
class Tracer:
    """Copies and keys, ready for any number of suspects.

    ``reference``, the unmarked asset, lets fragments be read; it serves the copies that were made of it. ``progress``
    is told how many copies have been made again, to look for a mixture. ``depth``: what else is looked for, where the
    copies' method can.
    """

    batches: tuple[Batch, ...]
    reference: Asset | None = None
    false_positive_rate: float = 1e-6
    depth: Depth = NO_DEEPER
    progress: Progress = silent
    candidates: int = field(init=False)

    def __post_init__(self) -> None:
        self.candidates = sum(len(batch.copies) for batch in self.batches)

    @classmethod
    def of(cls, copies: Iterable[Copy], keys: Sequence[Key], **options: Any) -> "Tracer":
        """For those of the copies, of any ledgers, that were made with one of an owner's keys.

        Errors: LedgerError when there are copies, but none of these; SpecError for a profile that is not known.
        """

        def kind(copy: Copy) -> tuple[str, str, str, int]:
            return copy.asset, copy.key, copy.profile, copy.n_bits

        groups = [tuple(group) for _, group in groupby(sorted(copies, key=kind), kind)]
        pairs = [(asset_key(key, group[0].asset), group) for group in groups for key in keys]
        batches = tuple(Batch(key, group) for key, group in pairs if key.fingerprint == group[0].key)
        if groups and not batches:
            raise LedgerError("no copy in the ledger was made with a key that was given")
        return cls(batches, **options)

    def trace(self, received: Any) -> Trace:
        """Whose copy an asset, mesh or point cloud is. Errors: MeshError when nothing of it can be read."""
        looked_at, covers = views(received, self._method), self._covers
        readings = _PASSES * len(looked_at) * (1 + len(covers))
        found = Trace(None, None, self.candidates, self.false_positive_rate)
        error: MeshError | None = None
        read = False
        for batch, view, extraction, informed in self._extractions(looked_at, covers):
            if isinstance(extraction, MeshError):
                error = error or extraction
                continue
            read = True
            found = self._better(found, batch, view, extraction, readings, informed)
            if found.found:
                break
        if not read:
            raise error or MeshError("there is nothing to read")
        return found if found.found else self._unmixed(found, looked_at, covers)

    def _unmixed(self, found: Trace, looked_at: Sequence[View], covers: Sequence[Any]) -> Trace:
        """Who took part, if the first view is a mixture of copies; or else what was found."""
        served = [batch for batch in self.batches if self._serves(batch) and len(batch.copies) <= _MOST_MIXED]
        tried = [(batch, cover) for batch in served for cover in covers]
        for batch, cover in tried:
            method = batch.watermark.method
            try:
                if id(cover) not in batch.remade:
                    batch.remade[id(cover)] = method.remade(cover, batch.words, batch.key)
                mixture = method.mixture(looked_at[0].shape, batch.remade[id(cover)], self.progress)
            except MeshError:
                continue
            log10_p = np.minimum(mixture.log10_p(len(batch.copies)) + math.log10(_PASSES * len(tried)), 0.0)
            named = [Named(copy, float(p), "") for copy, p in zip(batch.copies, log10_p, strict=True)]
            sure = [each for each in named if each.log10_p <= math.log10(self.false_positive_rate)]
            if sure:
                sure.sort(key=lambda each: each.log10_p)
                others = sorted((each for each in named if each not in sure), key=lambda each: each.log10_p)
                runner_up = others[0] if others else None
                part = looked_at[0].part
                found = replace(found, part=part, informed=True, patches=())
                return replace(found, best=sure[0], runner_up=runner_up, mixed=tuple(sure))
        return found

    def _better(
        self, found: Trace, batch: Batch, view: View, extraction: Extraction, readings: int, informed: bool
    ) -> Trace:
        """The more telling of what was found and what an extraction shows."""
        surest: dict[int, Candidate] = {}
        for soft, charge in extraction.times(readings * self.candidates).charged:
            for each in nearest(soft, batch.words, charge):
                if each.index not in surest or each.log10_p < surest[each.index].log10_p:
                    surest[each.index] = each
        best, *others = (_named(batch, each) for each in sorted(surest.values(), key=lambda each: each.log10_p))
        if found.best is not None and found.best.log10_p <= best.log10_p:
            return found
        runner_up = others[0] if others else None
        return replace(
            found,
            best=best,
            runner_up=runner_up,
            part=view.part,
            view=extraction.note,
            informed=informed,
            patches=view.patches(extraction),
        )

    def _extractions(self, looked_at: Sequence[View], covers: Sequence[Any]) -> Iterator[_Seen]:
        """What each view shows under each batch's key: at first sight, beside the reference, after a search."""
        yield from self._blindly(looked_at, quick=True)
        for view in looked_at:
            for batch in filter(self._serves, self.batches):
                for cover in covers:
                    yield batch, view, _extracted(batch.watermark.method, view.shape, batch, {}, cover), True
        yield from self._blindly(looked_at, quick=False)

    def _blindly(self, looked_at: Sequence[View], *, quick: bool) -> Iterator[_Seen]:
        for view in looked_at:
            seen: dict[Method, Any] = {}
            for batch in self.batches:
                method = batch.watermark.method.searching(self.depth)
                method = method.quick if quick else method
                yield batch, view, _extracted(method, view.shape, batch, seen), False

    @property
    def _method(self) -> Method:
        """What decides on views: of all batches the first, or the default where there is none."""
        return (self.batches[0].watermark if self.batches else copies_watermark(DEFAULT_PROFILE)).method

    @cached_property
    def _covers(self) -> list[Any]:
        if self.reference is None:
            return []
        parts = sorted(self.reference.parts, key=lambda part: -len(part.vertices))
        return [mesh_of(part) for part in parts[:_MOST_COVERS]]

    def _serves(self, batch: Batch) -> bool:
        """Whether the reference is what the copies of a batch were made of, or, if of none, may be of any."""
        digest = asset_digest(self.reference) if self.reference is not None else ""
        return batch.asset == digest or all(each.asset != digest for each in self.batches)


def _named(batch: Batch, candidate: Candidate) -> Named:
    return Named(batch.copies[candidate.index], candidate.log10_p, candidate.agreement)


def _extracted(
    method: Method, shape: Any, batch: Batch, seen: dict[Method, Any], cover: Any = None
) -> Extraction | MeshError:
    """What a shape shows under a key; ``seen`` keeps what it shows whatever the key."""
    try:
        if method.sight not in seen:
            seen[method.sight] = method.sight.observe(shape)
        return method.extract(seen[method.sight], batch.watermark.n_bits, batch.key, reference=cover)
    except MeshError as error:
        return error
