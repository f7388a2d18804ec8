"""The record of one reading, and the files that hold such records.

    Row              one reading            -> JSON object, CSV line
    read_rows        a folder               -> rows, from rows.jsonl or, where that is absent, rows.csv

A report knows nothing else of a reading. rows.jsonl is what a running campaign appends to; rows.csv is the compact form
of a finished one: columns that are the same in every row stand in campaign.json under "constant".
"""

import csv
import dataclasses
import json
import re
import types
import typing
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from o3dmark.errors import SpecError

PLAN, LINES, TABLE = "campaign.json", "rows.jsonl", "rows.csv"
WRONG_KEY, UNMARKED = "wrong key", "unmarked"
COSTS = ("mrms", "hausdorff", "msdm")  # the metrics that every JSON object has, measured or not
_REFUSAL = re.compile(r"(\w+: )?(MeshError|CapacityError|BackendError): ")


def _column(doc: str, default: Any = dataclasses.MISSING) -> Any:
    return dataclasses.field(default=default, metadata={"doc": doc})


@dataclass(frozen=True)
class Row:
    """How one reading went. What could not be had is None, and ``failure`` says why."""

    job: str = _column("id of the job: 16 hexadecimal digits")
    mesh: str = _column("name of the mesh in the campaign")
    source: str = _column("shape that it was made from, or name of its file")
    label: str = _column("name of the method in the campaign")
    method: str = _column("spec of the method")
    group: str = _column('table of attacks; "no attack", "wrong key" or "unmarked" for what the campaign adds itself')
    condition: str = _column("line of that table")
    attack: str = _column('specs of the attacks, one after the other; "identity" where there are none')
    control: str = _column('"": the marked mesh under its key; "wrong key": under another; "unmarked": the cover mesh')
    seed: int = _column("seed of message, key and attacks")
    n_bits: int = _column("number of bits embedded")
    version: str = _column("version of o3dmark that measured")
    failure: str | None = _column('reason why there is no reading, "stage: error: text"; null when there is one', None)
    vertices: int | None = _column("vertices of the cover mesh", None)
    bit_errors: int | None = _column("wrong bits", None)
    ber: float | None = _column("bit error rate: bit_errors over n_bits", None)
    corr: float | None = _column(
        "Corr, Pearson's correlation of sent and read bits; null where either is constant", None
    )
    message_ok: bool | None = _column("whether the message read is the one sent; null where the bits carry none", None)
    message_read: bool | None = _column("whether any message was read; null where the bits carry none", None)
    log10_p: float | None = _column("bits known, the reading that the method chose, all hypotheses charged", None)
    log10_p_best: float | None = _column("bits known, the reading nearest to them, all readings charged", None)
    log10_p_message: float | None = _column("bits unknown: all messages and hypotheses charged; null without one", None)
    log10_p_uncharged: float | None = _column("as log10_p, hypotheses not charged: for calibration", None)
    hypotheses: int | None = _column("readings among which the method chose", None)
    step: float | None = _column("quantisation step of the reading chosen", None)
    part: str | None = _column("what of the mesh was seen in it; null for all of it", None)
    view: str | None = _column("how that was seen", None)
    smoothing: str | None = _column("filter that was undone for it; null where none was", None)
    passes: int | None = _column("passes of that filter", None)
    fitted: bool | None = _column("whether the frame was fitted in it", None)
    coherence: float | None = _column("how near its values lie to codewords: 1 on them, 0 at random", None)
    seconds: float | None = _column(
        "time of the reading; a mesh read under several keys is looked at in the first", None
    )
    embed_seconds: float | None = _column("time of the embedding", None)
    cost_failure: str | None = _column("reason why a metric is null", None)
    saliency_rank: float | None = _column("Spearman's rho of the mesh's saliency with the cover's, if asked for", None)
    saliency_failure: str | None = _column("reason why that, or a picture, is missing although it was asked for", None)
    metrics: Mapping[str, float | None] = dataclasses.field(
        default_factory=dict, metadata={"doc": "metrics between cover and marked mesh, each a column of its name"}
    )

    def __post_init__(self) -> None:
        object.__setattr__(self, "metrics", dict.fromkeys(COSTS) | dict(self.metrics))
        for name in _NULLABLE_TEXTS:  # a table has one way to say nothing
            object.__setattr__(self, name, getattr(self, name) or None)

    @property
    def p_value(self) -> float | None:
        """10 to the power of log10_p."""
        return None if self.log10_p is None else float(10.0**self.log10_p)

    @property
    def outcome(self) -> Literal["ok", "refused", "failed"]:
        """``refused``: o3dmark or a library said why it cannot be done; ``failed``: anything else went wrong."""
        if self.failure is None:
            return "ok"
        return "refused" if _REFUSAL.match(self.failure) else "failed"

    def to_dict(self) -> dict[str, Any]:
        """One JSON object: every field, the p-value, and the metrics under their own names."""
        fields = {name: getattr(self, name) for name in FIELDS}
        return fields | {"p_value": self.p_value} | dict(self.metrics)

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> "Row":
        """What `to_dict` wrote. Errors: SpecError for what is no row of this version."""
        if not isinstance(content, dict):
            raise SpecError(f"a JSON object is wanted, not {content!r}")
        known = {name: content[name] for name in FIELDS if name in content}
        metrics = {name: value for name, value in content.items() if name not in FIELDS and name != "p_value"}
        missing = [name for name in _REQUIRED if name not in known]
        if missing or not all(value is None or isinstance(value, int | float) for value in metrics.values()):
            raise SpecError(f"of another version of o3dmark; see {', '.join(missing or metrics)}")
        return cls(**known, metrics=metrics)


FIELDS = tuple(field.name for field in dataclasses.fields(Row) if field.name != "metrics")
_REQUIRED = tuple(field.name for field in dataclasses.fields(Row) if field.default is dataclasses.MISSING)[:-1]
_HINTS = typing.get_type_hints(Row)
_NULLABLE_TEXTS = tuple(name for name, hint in _HINTS.items() if hint == str | None)


def describe_fields() -> dict[str, str]:
    """What each field of a row means."""
    return {field.name: field.metadata["doc"] for field in dataclasses.fields(Row)}


def read_rows(directory: str | Path) -> Iterator[Row]:
    """The rows of a folder; a last line that was never finished is left out, no file means no row.

    Errors: SpecError for a line that is no row.
    """
    lines, table = Path(directory) / LINES, Path(directory) / TABLE
    if lines.exists():
        yield from _lines(lines)
    elif table.exists():
        yield from read_table(table)


def _lines(path: Path) -> Iterator[Row]:
    with path.open(encoding="utf-8") as lines:
        for number, line in enumerate(lines, start=1):
            try:
                row = Row.from_dict(json.loads(line))
            except (ValueError, SpecError) as error:
                if line.endswith("\n"):
                    raise SpecError(f"{path}, line {number}: not a row: {error}") from None
                return
            if line.endswith("\n"):
                yield row


def read_table(path: Path) -> Iterator[Row]:
    """The rows of a rows.csv, with what campaign.json beside it says of all of them. Errors as in `read_rows`."""
    constant = json.loads((path.parent / PLAN).read_text(encoding="utf-8")).get("constant", {})
    with path.open(encoding="utf-8", newline="") as file:
        for number, texts in enumerate(csv.DictReader(file), start=2):
            try:
                yield Row.from_dict(constant | {name: value_of(name, text) for name, text in texts.items()})
            except (ValueError, KeyError, SpecError) as error:
                raise SpecError(f"{path}, line {number}: not a row: {error}") from None


def text_of(value: Any) -> str:
    """A value as it stands in a CSV cell: nothing for None, every digit of a number."""
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)


def value_of(name: str, text: str) -> Any:
    """The value of a column from its cell, by the type of the field; other columns are metrics."""
    kinds: Iterable[Any] = typing.get_args(hint) if isinstance(hint := _HINTS.get(name), types.UnionType) else (hint,)
    if hint is None:
        kinds = (float, type(None))
    if text == "" and type(None) in kinds:
        return None
    kind = next(each for each in kinds if each is not type(None))
    return {"true": True, "false": False}[text] if kind is bool else kind(text)
