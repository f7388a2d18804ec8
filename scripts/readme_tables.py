"""Write the README's tables of methods, attacks, metrics, codes, shapes and commands from the code.

    python scripts/readme_tables.py [--check]

Between `<!-- table: attacks -->` and `<!-- end -->` stands what this script writes; --check only says whether it is so.
"""

import argparse
import csv
import inspect
import re
import sys
from pathlib import Path
from statistics import mean

import typer.main

from o3dmark import ATTACKS, CODES, METHODS, METRICS, SHAPES
from o3dmark.cli import app
from o3dmark.registry import Registry, describe

ROOT = Path(__file__).parent.parent
README, RESULTS = ROOT / "README.md", ROOT / "results"
PAPER = ROOT / "o3dmark" / "report" / "paper_tables.csv"
CONDITIONS = {  # of the table of shape-spectrum, by the paper's table and line
    "reorder": ("reordering", "1"),
    "similarity": ("similarity", "1"),
    **{f"noise {p} %": ("noise", f"{p}0%") for p in ("0.1", "0.3", "0.5")},
    "noise 0.05 %": ("noise", "0.05%"),
    **{f"umbrella 0.1 x {n}": ("smoothing", f"{n} it") for n in (5, 10, 30, 50)},
    **{f"{b} bit": ("quantization", f"{b} bit") for b in (11, 10, 9, 8, 7)},
    **{scheme: ("subdivision", scheme) for scheme in ("loop", "midpoint", "sqrt3")},
}


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args()
    text = README.read_text()
    fresh = rewritten(text)
    if not options.check:
        README.write_text(fresh)
    return int(options.check and fresh != text)


def rewritten(text: str) -> str:
    """The README with its tables made anew."""
    tables = {name: registry_table(each) for name, each in registries().items()}
    tables |= {"commands": commands_table(), "saliency-scs results": results_table()}
    tables |= {"shape-spectrum results": spectrum_table(), "known message results": known_table()}
    tables |= {"informed results": informed_table(), "campaign results": campaign_table()}
    for name, table in tables.items():
        begin, end = f"<!-- table: {name} -->\n", "<!-- end -->"
        if begin in text:
            head, rest = text.split(begin, 1)
            text = head + begin + table + end + rest.split(end, 1)[1]
    return text


def registries() -> dict[str, "Registry[object]"]:
    return {"methods": METHODS, "attacks": ATTACKS, "metrics": METRICS, "codes": CODES, "shapes": SHAPES}


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
    for name, command in typer.main.get_command(app).commands.items():  # type: ignore[attr-defined]
        arguments = [p.metavar or p.name.upper() for p in command.params if p.param_type_name == "argument"]
        options = [
            f"`{max(p.opts, key=len)}`: {p.help or ''}"
            for p in command.params
            if p.param_type_name == "option" and p.name not in ("json", "help")
        ]
        usage = " ".join([name, *map(str, arguments)])
        rows.append(f"| `{usage}` | {cell(flowing(command.help or ''))} | {cell('<br>'.join(options)) or '-'} |")
    return "\n".join(rows) + "\n"


def results_table() -> str:
    """Mean Corr of 64 bits on each mesh, and the least of 16 bits on all of them, from results/saliency_scs.csv."""
    rows = rows_of("saliency_scs.csv")
    meshes, attacks = (list(dict.fromkeys(row[name] for row in rows)) for name in ("mesh", "attack"))

    def corr(attack: str, n_bits: str, mesh: str | None = None) -> list[float]:
        wanted = [row for row in rows if (row["attack"], row["n_bits"]) == (attack, n_bits)]
        return [float(row["corr"]) for row in wanted if mesh in (None, row["mesh"])]

    lines = [
        f"| attack | {' | '.join(f'{mesh}, 64 bits' for mesh in meshes)} | least of all, 16 bits |",
        "|---|" + "--:|" * (len(meshes) + 1),
    ]
    for attack in attacks:
        cells = [f"{mean(corr(attack, '64', mesh)):.2f}" for mesh in meshes] + [f"{min(corr(attack, '16')):.2f}"]
        lines.append(f"| `{attack}` | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def spectrum_table() -> str:
    """Mean Corr on each mesh over its keys, from results/shape_spectrum.csv, and the paper's mean over its meshes."""
    rows = rows_of("shape_spectrum.csv")
    meshes, attacks = (list(dict.fromkeys(row[name] for row in rows)) for name in ("mesh", "attack"))

    def of(mesh: str, name: str, attack: str = "none") -> list[float]:
        return [float(row[name]) for row in rows if (row["mesh"], row["attack"]) == (mesh, attack)]

    lines = [f"| | {' | '.join(map(short, meshes))} | paper |", "|---|" + "--:|" * (len(meshes) + 1)]
    for name, title, form in (
        ("seed", "keys", "{}"),
        ("bits", "bits", "{:.0f}"),
        ("mrms", "MRMS, 1e-4 of the diagonal", "{:.2f}"),
        ("msdm", "MSDM", "{:.3f}"),
    ):
        factor = 1e4 if name == "mrms" else 1.0
        cells = [form.format(len(of(m, name)) if name == "seed" else factor * mean(of(m, name))) for m in meshes]
        lines.append(f"| {title} | {' | '.join(cells)} | |")
    for attack in attacks:
        found = [of(mesh, "corr", attack) for mesh in meshes]
        cells = [two_digits(mean(values)) if values else "" for values in found]
        lines.append(f"| {attack} | {' | '.join(cells)} | {published(attack)} |")
    return "\n".join(lines) + "\n"


def known_table() -> str:
    """Where not every bit is read: how sure one is who knows them, over the keys, from results/shape_spectrum.csv."""
    rows = [row for row in rows_of("shape_spectrum.csv") if row["log10_p"]]
    lines = [
        "| mesh, bits | attack | mean Corr of what is read | keys with p <= 1e-4 | and <= 1e-6 | log10 p, middle |",
        "|---|---|--:|--:|--:|--:|",
    ]
    for mesh, attack in dict.fromkeys((row["mesh"], row["attack"]) for row in rows):
        mine = [row for row in rows if (row["mesh"], row["attack"]) == (mesh, attack)]
        if all(row["errors"] == "0" for row in mine):
            continue
        p = sorted(float(row["log10_p"]) for row in mine)
        cells = [
            f"{short(mesh)}, {mine[0]['bits']}",
            attack,
            two_digits(mean(float(row["corr"]) for row in mine)),
            *(f"{sum(value <= limit for value in p)} of {len(p)}" for limit in (-4, -6)),
            f"{p[len(p) // 2]:.1f}".replace("-0.0", "0.0"),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def informed_table() -> str:
    """Least and mean Corr over all meshes and keys, from results/informed_crop.csv, beside its two controls."""
    rows = rows_of("informed_crop.csv")
    meshes = len({row["mesh"] for row in rows})
    lines = [
        f"| fragment | readings on {meshes} meshes | all right | least Corr | mean Corr, wrong key | and unmarked |",
        "|---|--:|--:|--:|--:|--:|",
    ]
    for attack in dict.fromkeys(row["attack"] for row in rows):
        mine = [row for row in rows if row["attack"] == attack]
        exact = sum(row["errors"] == "0" for row in mine)
        least = min(float(row["corr"]) for row in mine)
        controls = [two_digits(mean(float(row[name]) for row in mine)) for name in ("wrong_key_corr", "unmarked_corr")]
        lines.append(f"| {attack} | {len(mine)} | {exact} | {two_digits(least)} | {' | '.join(controls)} |")
    return "\n".join(lines) + "\n"


def campaign_table() -> str:
    """What all methods read in the paper's conditions: that table of results/paper_real/report.md."""
    report = (RESULTS / "paper_real" / "report.md").read_text()
    return report.split("### All methods in the paper's conditions\n\n")[1].split("\n\n")[0] + "\n"


def published(attack: str) -> str:
    """The paper's mean over its meshes for an attack; nothing where it has none."""
    if attack not in CONDITIONS:
        return ""
    with PAPER.open(newline="") as file:
        wanted = (*CONDITIONS[attack], "hamidi", "corr")
        rows = [
            row
            for row in csv.DictReader(file)
            if wanted == tuple(row[k] for k in ("table", "condition", "method", "metric"))
        ]
    return two_digits(mean(float(row["value"]) for row in rows))


def rows_of(name: str) -> list[dict[str, str]]:
    with (RESULTS / name).open(newline="") as file:
        return list(csv.DictReader(file))


def short(mesh: str) -> str:
    """bimba of bimba, vase of vase_psb539, but octa_flower of octa_flower_7919."""
    return re.sub(r"(_(psb)?\d+)(_derived)?$", "", mesh)


def two_digits(value: float) -> str:
    """Never 1.00 for anything less."""
    return f"{min(value, 0.99) if value < 1 else value:.2f}"


def flowing(doc: str) -> str:
    """A docstring as one table cell: paragraphs become lines, and so does each "name   meaning" of a list."""
    paragraphs = [" ".join(part.split()) for part in re.split(r"\n\n|\n(?=[\w-]+(?:, [\w-]+)* {2,}\S)", doc)]
    return cell("<br>".join(paragraphs))


def cell(text: str) -> str:
    return text.replace("|", "\\|")


def shown(default: object) -> str:
    return "none" if default is None else str(default).lower() if isinstance(default, bool) else f"{default}"


if __name__ == "__main__":
    sys.exit(main())
