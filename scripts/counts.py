"""Tables that count readings, for `tables`: each is a head and lines of cells, from a campaign's results."""

import csv
import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean

from o3dmark.campaign.keeping import SUMMARY
from o3dmark.campaign.plan import UNTOUCHED
from o3dmark.campaign.row import UNMARKED, WRONG_KEY, Row
from o3dmark.errors import SpecError
from o3dmark.report.content import corr_number, number
from o3dmark.report.cost import cost, measure
from o3dmark.report.data import Results
from o3dmark.report.markdown import inline
from o3dmark.report.summary import corr

Lines = tuple[list[str], list[list[str]]]  # a head, and the lines under it
CROPPING = "cropping"
KNOWN = -6.0  # log10 of the p-value at which a known message is found
RATES = (0.1, 0.01, 0.001)
P_VALUES = {
    "message known": "log10_p_best",
    "message unknown": "log10_p_message",
    "message known, hypotheses not charged": "log10_p_uncharged",
}


def messages(result: Results) -> Lines:
    """How many messages each method reads after attacks other than cropping, and under wrong keys."""
    lines = [
        [
            inline(who.name),
            _share([row for row in result.attacked(who) if row.group != CROPPING], "message_ok"),
            _share(result.controls(who, WRONG_KEY), "message_read"),
        ]
        for who in result.entries
    ]
    return ["method", "messages read after all attacks but cropping", "messages read under wrong keys"], lines


def wrong_keys(all_results: Sequence[Results]) -> Lines:
    """How many p-values under wrong keys, and of unmarked meshes, are as small as each rate; how many may be."""
    lines = []
    for result in all_results:
        for who in result.entries:
            for control in (WRONG_KEY, UNMARKED):
                read = [row for row in result.controls(who, control) if row.failure is None]
                for kind, field in P_VALUES.items():
                    values = [value for row in read if (value := getattr(row, field)) is not None]
                    if values:
                        lines.append([inline(who.name), control, kind, _span(read), str(len(values)), *_small(values)])
    head = ["method", "control", "p-value", "hypotheses a reading", "readings", *(f"p ≤ {rate:g}" for rate in RATES)]
    return head, lines


def any_mesh(result: Results) -> Lines:
    """How many meshes can be marked, and of how many every bit is read in each condition; which are the others."""
    untouched = [row for who in result.entries for row in result.of(who, UNTOUCHED)]
    refused = [row for row in untouched if row.failure and row.failure.startswith("marking:")]
    lines = [["marked", f"{len(untouched) - len(refused)} of {len(untouched)}", ""]]
    kinds = Counter((row.failure or "").split(": ")[1] for row in refused)
    lines += [["refused", str(count), kind] for kind, count in kinds.most_common()]
    for group, condition in [(UNTOUCHED, "-"), *result.conditions]:
        read = [row for who in result.entries for row in result.of(who, group, condition) if row not in refused]
        read = [row for row in read if not (row.failure or "").startswith("marking:")]
        others = ", ".join(inline(row.mesh) for row in read if row.bit_errors != 0)
        name = group if group == UNTOUCHED else condition
        lines.append([inline(name), f"{sum(row.bit_errors == 0 for row in read)} of {len(read)}", others])
    return ["", "every bit read", "not"], lines


def edits(blindly: Sequence[Results], beside: Sequence[Results]) -> Lines:
    """How many messages are read after each edit, blindly and beside the cover, and how many marks are found by who
    knows them; on which meshes not."""
    lines = []
    for result in blindly:
        for group, condition in [(UNTOUCHED, "-"), *result.conditions]:
            if group == UNTOUCHED and result is not blindly[0]:
                continue
            read = _read(result, group, condition)
            known = sum(row.log10_p_best is not None and row.log10_p_best <= KNOWN for row in read)
            missed = Counter(inline(row.mesh) for row in read if not row.message_ok)
            others = ", ".join(f"{mesh} {count}" for mesh, count in missed.items())
            near = [row for each in beside for row in _read(each, group, condition)]
            name = inline(group if group == UNTOUCHED else condition)
            lines.append(
                [
                    name,
                    _share(read, "message_ok"),
                    f"{known} of {len(read)}",
                    others,
                    _share(near, "message_ok") if near else "–",
                ]
            )
    return ["edit", "message read", "mark found", "not read on", "read beside the cover"], lines


def _read(result: Results, group: str, condition: str) -> list[Row]:
    """The readings of a condition that came about."""
    return [row for who in result.entries for row in result.of(who, group, condition) if row.failure is None]


def motions(result: Results, *, before: str, after: str) -> Lines:
    """What shows of marks that move the surface in two ways, mean over keys, and how many readings had every bit."""
    kinds = {
        "MSDM": ("msdm", 1.0, 3),
        "planes tilt, degrees": ("planes", 1.0, 2),
        "bending": ("bending", 1.0, 2),
        "rays turn, degrees": ("reflection", 1.0, 1),
        "farthest · 10³": ("max_displacement", 1e3, 1),
        "MRMS · 10³": ("mrms", 1e3, 2),
        "step · 10³": ("step", 1e3, 1),
    }
    entries = [next(who for who in result.entries if who.name == name) for name in (before, after)]
    lines = []
    for mesh in result.meshes:
        both = [[row for row in result.of(who, UNTOUCHED) if row.mesh == mesh] for who in entries]
        if not all(both):
            continue
        cells = []
        for name, scale, digits in kinds.values():
            values = ([_figure(row, name) for row in rows] for rows in both)
            cells.append(" → ".join(f"{scale * fmean(each):.{digits}f}" for each in values))
        read = [[row for row in result.attacked(who) if row.mesh == mesh and row.failure is None] for who in entries]
        exact = (str(sum(row.bit_errors == 0 for row in rows)) for rows in read)
        lines.append([inline(mesh), *cells, f"{' → '.join(exact)} of {len(read[0])}"])
    return ["mesh", *kinds, "every bit read after attacks"], lines


def comparison(result: Results) -> Lines:
    """What each method costs, and of each table of attacks its mean Corr and how many messages are read."""
    measures = [measure(metric) for metric in result.metrics]
    lines = []
    for who in result.entries:
        costs = [cost(result, who, metric) for metric in result.metrics]
        line = [inline(who.name), *(number(value, 2) for value in costs)]
        for group in result.groups:
            rows = result.of(who, group)
            line.append(f"{corr_number(corr(rows))}, {_share(rows, 'message_ok')}")
        lines.append([*line, _share(result.controls(who, WRONG_KEY), "message_read")])
    head = ["", *(each.title for each in measures), *result.groups, "wrong keys"]
    return head, lines


def held_back(result: Results) -> Lines:
    """What is seen of marks and how strong they are, method by method, and how many readings had every bit; "refused"
    where the mesh held no mark."""
    lines = []
    for mesh in result.meshes:
        cells = []
        for who in result.entries:
            rows = [row for row in result.of(who, UNTOUCHED) if row.mesh == mesh and row.failure is None]
            read = [row for row in result.attacked(who) if row.mesh == mesh and row.failure is None]
            costs = [fmean(_figure(row, name) for row in rows) for name in ("jnd", "mrms")] if rows else []
            exact = f"{sum(row.bit_errors == 0 for row in read)} of {len(read)}"
            cells += [f"{costs[0]:.2f}", f"{1e3 * costs[1]:.2f}", exact] if costs else ["refused", "–", "–"]
        lines.append([inline(mesh), *cells])
    heads = ([f"{inline(who.name)}: jnd", "MRMS · 10³", "every bit read"] for who in result.entries)
    return ["mesh", *(head for each in heads for head in each)], lines


def _figure(row: Row, name: str) -> float:
    value = row.step if name == "step" else row.metrics[name]
    assert value is not None
    return value


def attack_sweep(directory: Path) -> Lines:
    """How many attacks gave a valid mesh, from a folder's summary; each that sometimes did not. Errors: SpecError."""
    try:
        with (directory / SUMMARY).open(encoding="utf-8", newline="") as file:
            found = [line for line in csv.DictReader(file) if line["group"] != UNTOUCHED]
    except OSError:
        raise SpecError(f"{directory} has no {SUMMARY}; `o3dmark bench NAME --summary` writes it") from None
    outcomes = ("ok", "refused", "failed")
    total = [str(sum(int(line[outcome]) for line in found)) for outcome in outcomes]
    lines = [[f"all {len(found)}", *total]]
    lines += [
        [inline(line["attack"]), *(line[outcome] for outcome in outcomes)]
        for line in found
        if line["refused"] != "0" or line["failed"] != "0"
    ]
    return ["attack", "a valid mesh, the input as it was", "refused, with a reason", "failed"], lines


def clouds(path: Path) -> Lines:
    """From which points messages are read, and what that takes; from the rows of clouds.py."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if not row["condition"].startswith("refused")]
    names, lines = list(dict.fromkeys(row["condition"] for row in rows)), []
    for mesh in dict.fromkeys(row["mesh"] for row in rows):
        mine = [row for row in rows if row["mesh"] == mesh]
        here = [[row for row in mine if row["condition"] == name] for name in names]
        seconds = [fmean(float(row["seconds"]) for row in each) for each in here]
        counts = [f"{sum(int(row['read']) for row in each)} of {len(each)}" for each in here]
        cells = [f"{count}, {took:.0f} s" for count, took in zip(counts, seconds, strict=True)]
        rms, spent = (fmean(float(row[name]) for row in mine) for name in ("rms", "embed_seconds"))
        lines.append([inline(mesh), f"{1e3 * rms:.2f}", f"{spent:.0f} s", *cells])
    return ["", "RMS motion · 10³", "marked in", *names], lines


def marked_twice(path: Path) -> Lines:
    """How often the first of two marks is read, and found by who knows it; from the rows of marked_twice.py."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    meshes, lines = list(dict.fromkeys(row["mesh"] for row in rows)), []
    for profile in dict.fromkeys(row["profile"] for row in rows):
        mine = [row for row in rows if row["profile"] == profile]
        cells = []
        for mesh in meshes:
            here = [row for row in mine if row["mesh"] == mesh]
            found = sum(float(row["log10_p"]) <= KNOWN for row in here)
            cells.append(f"{sum(int(row['read']) for row in here)}, {found} of {len(here)}" if here else "–")
        msdm = [float(row["msdm"]) for row in mine]
        lines.append([f"`{profile}`", *cells, f"{min(msdm):.2f} to {max(msdm):.2f}"])
    return ["profile", *map(inline, meshes), "MSDM of one mark"], lines


def collusion(path: Path) -> Lines:
    """In how many mixtures somebody who took part is named, by what was mixed how; from the rows of collusion.py."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    sizes = sorted({int(row["colluders"]) for row in rows})
    kinds = dict.fromkeys((row["how"], row["after"]) for row in rows)
    lines = []
    for how, after in kinds:
        mine = [row for row in rows if (row["how"], row["after"]) == (how, after)]
        found = {size: [int(row["named"]) > 0 for row in mine if int(row["colluders"]) == size] for size in sizes}
        lines.append(
            [how, after, *(f"{sum(found[size])} of {len(found[size])}" if found[size] else "" for size in sizes)]
        )
    innocents = sum(int(row["innocents"]) for row in rows)
    lines.append(["innocents named", f"in {len(rows)} mixtures", str(innocents), *[""] * (len(sizes) - 1)])
    return ["mixed by", "and then", *(f"{size} copies" for size in sizes)], lines


def _share(rows: Sequence[Row], field: str) -> str:
    values = [value for row in rows if (value := getattr(row, field)) is not None]
    return f"{sum(values)} of {len(values)}"


def _span(rows: Sequence[Row]) -> str:
    counts = sorted(row.hypotheses for row in rows if row.hypotheses is not None)
    return f"{counts[0]} to {counts[-1]}" if counts[0] < counts[-1] else str(counts[0])


def _small(log10_p: Sequence[float]) -> list[str]:
    """The number of p-values at or below each rate, and how many may be."""
    return [
        f"{sum(value <= math.log10(rate) for value in log10_p)} ({rate * len(log10_p):.3g} allowed)" for rate in RATES
    ]
