"""Write the tables of README.md and docs/: methods, attacks, metrics and commands from the code, results from rows.

    python scripts/tables.py [--check]

Between `<!-- table: attacks -->` and `<!-- end -->` stands what this script writes; --check only says whether it is so.
A table of results is made from the rows of a campaign in results/, and followed by a line that says who computed them.
"""

import argparse
import inspect
import os
import re
import sys
import tomllib
from collections.abc import Callable, Iterable, Sequence
from functools import cache, partial
from pathlib import Path
from statistics import median

import counts

from o3dmark import ATTACKS, CODES, METHODS, METRICS, SHAPES
from o3dmark.campaign import load
from o3dmark.campaign.keeping import SUMMARY
from o3dmark.campaign.plan import UNTOUCHED
from o3dmark.campaign.row import LINES, TABLE, UNMARKED, WRONG_KEY, Row, describe_fields
from o3dmark.campaign.spec_file import SPECS
from o3dmark.cli import commands
from o3dmark.errors import SpecError
from o3dmark.registry import Registry, describe
from o3dmark.report.content import corr_number, number
from o3dmark.report.cost import TABLE as COST
from o3dmark.report.cost import cost, measure
from o3dmark.report.data import Entry, Results
from o3dmark.report.markdown import inline, table_lines
from o3dmark.report.published import COMPARISON
from o3dmark.report.summary import corr, mean
from o3dmark.report.tables import published_conditions

ROOT = Path(__file__).parent.parent
RESULTS = ROOT / "results"
BLOCK = re.compile(r"(<!-- table: ([\w -]+) -->\n).*?(<!-- end -->)", re.DOTALL)
SPECTRUM = ("shape_spectrum", "shape_spectrum_small")
CONTROL_FOLDERS = ("false_positives", "wrong_keys", "false_positives_single")
COMPARISONS = ("comparison", "comparison_published", "comparison_semi_regular")
EDITS = ("edits", "edits_of_parts", "edits_beside")  # the last beside the cover
PROFILES = {  # tables of the same kind
    "64 bits in small meshes": ("shape_spectrum_64",),
    "slender results": ("slender", "slender_small"),
    "invisible results": ("invisible", "invisible_small"),
}
Column = tuple[Results, Entry, str]  # a mesh under one method and number of bits


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 when a table is stale")
    options = parser.parse_args(arguments)
    stale, missing = 0, dict[str, None]()
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        text = path.read_text(encoding="utf-8")
        fresh = rewritten(text, path, missing)
        if fresh != text:
            print(f"{path.relative_to(ROOT)}: {'stale' if options.check else 'written'}")
            stale += 1
            if not options.check:
                path.write_text(fresh, encoding="utf-8")
    for reason in missing:
        print(f"left as it is: {reason}", file=sys.stderr)
    return int(bool(missing) or (options.check and stale > 0))


def rewritten(text: str, path: Path, missing: dict[str, None]) -> str:
    """A text with its tables made anew; to ``missing`` go the reasons why some are left as they are.

    Errors: SystemExit for a table that nothing here makes.
    """

    def made(found: re.Match[str]) -> str:
        try:
            return found[1] + table_of(found[2], path) + found[3]
        except SpecError as error:  # a campaign whose results are not kept
            missing[f"{found[2]}: {error}"] = None
            return found[0]

    return BLOCK.sub(made, text)


def table_of(name: str, path: Path) -> str:
    """A table, for the file ``path``; one of results with the lines that say who computed its rows."""
    if name in OF_CODE:
        return OF_CODE[name]()
    if name in OF_RESULTS:
        table, folders = OF_RESULTS[name]
        return f"{table()}\n{''.join(made_by(folder, path) for folder in folders)}"
    raise SystemExit(f"{path.name}: no table is called {name!r}; there is {', '.join([*OF_CODE, *OF_RESULTS])}")


# Tables of the code


def registry_table(registry: "Registry[object]") -> str:
    """A row for each registered name: what it is, and every option with its default and meaning."""
    rows = ["| name | what it is | options: default, meaning |", "|---|---|---|"]
    for name in registry:
        options = "<br>".join(
            f"`{option}`: {shown(default)}, {doc}" for option, _, default, doc in describe(registry[name])
        )
        rows.append(f"| `{name}` | {flowing(inspect.getdoc(registry[name]) or '')} | {cell(options) or '-'} |")
    return "\n".join(rows) + "\n"


def commands_table() -> str:
    """A row for each command: its arguments, its options and what it does."""
    rows = ["| command | what it does | options |", "|---|---|---|"]
    for name, command in commands().items():
        arguments = [p.metavar or p.name.upper() for p in command.params if p.param_type_name == "argument"]
        options = [
            f"`{max(p.opts, key=len)}`: {p.help or ''}"
            for p in command.params
            if p.param_type_name == "option" and p.name not in ("json", "help")
        ]
        usage = " ".join([name, *map(str, arguments)])
        rows.append(f"| `{cell(usage)}` | {cell(flowing(command.help or ''))} | {cell('<br>'.join(options)) or '-'} |")
    return "\n".join(rows) + "\n"


def row_table() -> str:
    """A line for each column of a campaign's rows."""
    rows = [f"| `{name}` | {cell(doc)} |" for name, doc in describe_fields().items()]
    return "\n".join(["| column | what it says |", "|---|---|", *rows]) + "\n"


def campaigns_table() -> str:
    """A row for each campaign of the package: the comment on top of its file, and whether it needs real meshes."""
    rows = ["| campaign | what it measures | meshes |", "|---|---|---|"]
    for path in sorted(SPECS.glob("*.toml")):
        text = path.read_text(encoding="utf-8")
        comment = " ".join(line.lstrip("# ") for line in text.partition("\n#\n")[0].splitlines())
        plan = tomllib.loads(text)
        own, real = plan.get("meshes", {}), plan.get("real", {})
        needed = "files" in plan or not real.keys() <= own.keys()
        rows.append(f"| `{path.stem}` | {cell(comment)} | {'real' if needed else 'either' if real else 'synthetic'} |")
    return "\n".join(rows) + "\n"


def flowing(doc: str) -> str:
    """A docstring as one table cell: paragraphs become lines, and so does each "name   meaning" of a list."""
    paragraphs = [" ".join(part.split()) for part in re.split(r"\n\n|\n(?=[\w-]+(?:, [\w-]+)* {2,}\S)", doc)]
    return cell("<br>".join(paragraphs))


def cell(text: str) -> str:
    return text.replace("|", "\\|")


def shown(default: object) -> str:
    return "none" if default is None else str(default).lower() if isinstance(default, bool) else f"{default}"


# Tables of results


@cache
def results(folder: str) -> Results:
    """A campaign's results. Errors: SpecError where they are not kept."""
    return Results.load(RESULTS / folder)


def made_by(folder: str, path: Path) -> str:
    """The line that says who computed a campaign's rows, and where they are."""
    runs = load(RESULTS / folder).runs
    called = ", ".join(f"`{text}`" for text in distinct(run.command for run in runs))
    dates = sorted(run.started[:10] for run in runs)
    versions = "; ".join(distinct(f"o3dmark {run.version}, commit {run.commit or 'not known'}" for run in runs))
    machines = "; ".join(distinct(f"{run.machine}, Python {run.python}" for run in runs))
    link = os.path.relpath(RESULTS / folder, path.parent)
    there = next(name for name in (TABLE, SUMMARY, LINES) if (RESULTS / folder / name).exists())
    when = " to ".join(distinct([dates[0], dates[-1]]))
    return f"Measured by {called} on {when} ({versions}; {machines}): [rows]({link}/{there}).\n"


def grid(head: Sequence[str], rows: Iterable[Sequence[str]], left: int = 1) -> str:
    """A Markdown table whose first ``left`` columns are words, the others figures."""
    lines = [head, ["---"] * left + ["--:"] * (len(head) - left), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def own(result: Results) -> list[Entry]:
    """The campaign's own method, with each number of bits, the fewest first."""
    return sorted((who for who in result.entries if who.label == result.campaign.main), key=lambda who: who.n_bits)


def lines_of(folders: Sequence[str]) -> list[tuple[str, str]]:
    """(table, condition) of each line of a table: without an attack first, then as the campaigns have them."""
    return list(dict.fromkeys([(UNTOUCHED, "-"), *(each for folder in folders for each in results(folder).conditions)]))


def line_name(group: str, condition: str) -> str:
    return inline(group if group == UNTOUCHED else f"{group} {condition}")


def saliency_scs_table() -> str:
    """Mean Corr of the most bits on each mesh, and the least Corr of the fewest bits on all of them."""
    result = results("saliency_scs")
    few, many = own(result)[0], own(result)[-1]
    head = ["mean Corr", *(f"{inline(mesh)}, {many.n_bits} bits" for mesh in result.meshes)]
    rows = [
        [
            line_name(*each),
            *(corr_number(corr(result.of(many, *each, mesh))) for mesh in result.meshes),
            corr_number(least(result.of(few, *each))),
        ]
        for each in lines_of(["saliency_scs"])
    ]
    return grid([*head, f"least of all, {few.n_bits} bits"], rows)


def spectrum_columns(folders: Sequence[str] = SPECTRUM) -> list[Column]:
    return [
        (result, who, mesh)
        for result in map(results, folders)
        for who in own(result)
        for mesh in result.meshes
        if result.of(who, UNTOUCHED, mesh=mesh)
    ]


def spectrum_table(folders: Sequence[str] = SPECTRUM) -> str:
    """Mean Corr on each mesh over its keys; the mean of the figures published for these meshes, where there are any."""
    columns = spectrum_columns(folders)
    lines = lines_of(folders)
    known = {each: published(columns, *each) for each in lines}
    metrics = distinct(metric for result in map(results, folders) for metric in result.metrics)
    rows = [
        ["keys", *(str(len({row.seed for row in r.of(who, UNTOUCHED, mesh=mesh)})) for r, who, mesh in columns)],
        ["bits", *(str(who.n_bits) for _, who, _ in columns)],
        *([measure(metric).title, *(number(cost(*c[:2], metric, c[2]), 3) for c in columns)] for metric in metrics),
        *(
            [line_name(*each), *(corr_number(corr(r.of(who, *each, mesh))) for r, who, mesh in columns)]
            for each in lines
        ),
    ]
    head = ["mean Corr", *(inline(mesh) for _, _, mesh in columns)]
    if any(value is not None for value in known.values()):
        head.append("published")
        last = [""] * (len(rows) - len(lines)) + [number(known[each]) for each in lines]
        rows = [[*row, text] for row, text in zip(rows, last, strict=True)]
    return grid(head, rows)


def published(columns: Sequence[Column], group: str, condition: str) -> float | None:
    """The mean of the figures published for the meshes of a table; each mesh counts once."""
    told = ((mesh, result.published.value(group, condition, mesh)) for result, _, mesh in columns)
    return mean({mesh: value for mesh, value in told if value is not None}.values())


def known_message_table() -> str:
    """Where not every bit is read: how sure one is who knows them, over the keys."""
    rows = []
    for result, who, mesh in spectrum_columns():
        for each in lines_of(SPECTRUM):
            read = [row for row in result.of(who, *each, mesh) if row.log10_p_best is not None]
            if any(row.bit_errors for row in read):
                rows.append(
                    [f"{inline(mesh)}, {who.n_bits}", line_name(*each), corr_number(corr(read)), *sureness(read)]
                )
    head = [
        "mesh, bits",
        "attack",
        "mean Corr of what is read",
        "keys with p <= 1e-4",
        "and <= 1e-6",
        "log10 p, middle",
    ]
    return grid(head, rows, left=2)


def sureness(read: Sequence[Row]) -> list[str]:
    """How many p-values of the known bits are below 1e-4 and 1e-6, and the middle one."""
    log10_p = [row.log10_p_best for row in read if row.log10_p_best is not None]
    counts = [f"{sum(value <= limit for value in log10_p)} of {len(log10_p)}" for limit in (-4, -6)]
    return [*counts, number(median(log10_p), 1)]


def informed_table() -> str:
    """Least Corr over all meshes and keys, beside the two controls: their mean Corr, and their least p-value."""
    result = results("informed_crop")
    (who,) = own(result)
    rows = []
    for each in result.conditions:
        read = result.of(who, *each)
        wrong, unmarked = (result.of(who, *each, control=control) for control in (WRONG_KEY, UNMARKED))
        logs = [row.log10_p for row in (*wrong, *unmarked) if row.log10_p is not None]
        whole = sum(row.bit_errors == 0 for row in read)
        means = (number(corr(wrong)), number(corr(unmarked)), f"{10 ** min(logs):.2g}")
        rows.append([line_name(*each), str(len(read)), str(whole), corr_number(least(read)), *means])
    head = ["fragment", f"readings on {len(result.meshes)} meshes", "all right", "least Corr"]
    return grid([*head, "mean Corr, wrong key", "mean Corr, unmarked", "least p of these"], rows)


def campaign_table() -> str:
    """What all methods read in the published conditions."""
    return "\n".join(table_lines(published_conditions(results("paper")))) + "\n"


def summary_table() -> str:
    """The last, strongest condition of each published table: two methods, and what was published."""
    result = results("paper")
    table = published_conditions(result)
    last = {group: number for number, (group, _) in enumerate(result.compared, start=1)}
    shown = [n for n, who in enumerate(result.entries, start=2) if who.label in ("saliency-scs", result.campaign.main)]
    cells = [[table.rows[n][column].text for column in (0, 1, *shown)] for n in (0, *last.values())]
    return grid([table.head[column] for column in (0, 1, *shown)], cells)


def rivals_table() -> str:
    """Corr of each method that has published figures, as published and as measured here, condition by condition."""
    result = results("rivals")
    methods = rivals(result, [group + COMPARISON for group in result.groups])
    rows = [
        [
            f"{inline(mesh)}, {line_name(group, condition)}",
            *(
                text
                for method, ours in methods.items()
                for text in (
                    corr_number(result.published.value(group + COMPARISON, condition, mesh, method=method)),
                    *(corr_number(corr(result.of(who, group, condition, mesh))) for who in ours),
                )
            ),
        ]
        for mesh in result.meshes
        for group, condition in result.conditions
        if result.published.value(group + COMPARISON, condition, mesh) is not None
    ]
    return grid(["mean Corr", *rivals_head(result, methods)], rows)


def rivals_cost_table() -> str:
    """What marks of these methods cost, as published and as measured here."""
    result, table = results("rivals"), COST + COMPARISON
    methods = rivals(result, [table])
    rows = [
        [
            f"{inline(mesh)}, {measure(metric).title}",
            *(
                text
                for method, ours in methods.items()
                for text in (
                    number(result.published.value(table, "", mesh, measure(metric).published, method), 3),
                    *(number(cost(result, who, metric, mesh), 3) for who in ours),
                )
            ),
        ]
        for mesh in result.meshes
        if mesh in result.published.models(table)
        for metric in ("mrms", "msdm")
    ]
    return grid(["", *rivals_head(result, methods)], rows)


def rivals(result: Results, groups: Sequence[str]) -> dict[str, list[Entry]]:
    """The methods of published tables, but for the main one, and the entries that are named after each."""
    told = distinct(method for group in groups for method in result.published.methods(group))
    return {
        method: [who for who in result.entries if who.label.startswith(method)]
        for method in told
        if method != result.published.method
    }


def rivals_head(result: Results, methods: dict[str, list[Entry]]) -> list[str]:
    return [
        text
        for method, ours in methods.items()
        for text in (f"{result.published.name(method)}, published", *(inline(who.label) for who in ours))
    ]


def comparison_table(folder: str) -> str:
    return grid(*counts.comparison(results(folder)))


def fragments_table(folder: str) -> str:
    return grid(*counts.edits([results(folder)], []), left=4)


def edits_table() -> str:
    blindly, beside = map(results, EDITS[:2]), map(results, EDITS[2:])
    return grid(*counts.edits([*blindly], [*beside]), left=4)


def attack_sweep_table() -> str:
    return grid(*counts.attack_sweep(RESULTS / "attack_sweep"))


def least(rows: Iterable[Row]) -> float | None:
    return min((row.corr for row in rows if row.corr is not None), default=None)


def distinct(texts: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(texts))


REGISTRIES = {"methods": METHODS, "attacks": ATTACKS, "metrics": METRICS, "codes": CODES, "shapes": SHAPES}
OF_CODE: dict[str, Callable[[], str]] = {
    **{name: partial(registry_table, registry) for name, registry in REGISTRIES.items()},
    "commands": commands_table,
    "rows": row_table,
    "campaigns": campaigns_table,
    "collusion": lambda: grid(*counts.collusion(RESULTS / "collusion" / "rows.csv")),  # by scripts/collusion.py
    "clouds": lambda: grid(*counts.clouds(RESULTS / "clouds" / "rows.csv")),  # by scripts/clouds.py
    "marked twice": lambda: grid(
        *counts.marked_twice(RESULTS / "marked_twice" / "rows.csv")
    ),  # by scripts/marked_twice.py
}
OF_RESULTS: dict[str, tuple[Callable[[], str], tuple[str, ...]]] = {  # and the folders that they are made of
    "saliency-scs results": (saliency_scs_table, ("saliency_scs",)),
    "shape-spectrum results": (spectrum_table, SPECTRUM),
    "known message results": (known_message_table, SPECTRUM),
    "informed results": (informed_table, ("informed_crop",)),
    "campaign results": (campaign_table, ("paper",)),
    "summary results": (summary_table, ("paper",)),
    "messages": (lambda: grid(*counts.messages(results("paper"))), ("paper",)),
    "wrong keys": (lambda: grid(*counts.wrong_keys([*map(results, CONTROL_FOLDERS)]), left=4), CONTROL_FOLDERS),
    "any mesh results": (lambda: grid(*counts.any_mesh(results("any_mesh")), left=3), ("any_mesh",)),
    "edits": (edits_table, EDITS),
    **{name: (partial(fragments_table, name), (name,)) for name in ("fragments", "fragments_any_scale")},
    "motion": (lambda: grid(*counts.motions(results("motion"), before="least", after="unseen")), ("motion",)),
    "cap and eye": (lambda: grid(*counts.held_back(results("seen"))), ("seen",)),
    "rivals": (rivals_table, ("rivals",)),
    **{name: (partial(comparison_table, name), (name,)) for name in COMPARISONS},
    "rivals cost": (rivals_cost_table, ("rivals",)),
    "attack sweep": (attack_sweep_table, ("attack_sweep",)),
    **{name: (partial(spectrum_table, folders), folders) for name, folders in PROFILES.items()},
}


if __name__ == "__main__":
    sys.exit(main())
