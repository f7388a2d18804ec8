"""Write the README's tables of methods, attacks, metrics, codes, shapes and commands from the code.

    python scripts/readme_tables.py [--check]

Between `<!-- table: attacks -->` and `<!-- end -->` stands what this script writes; --check only says whether it is so.
"""

import argparse
import inspect
import sys
from pathlib import Path

import typer.main

from o3dmark import ATTACKS, CODES, METHODS, METRICS, SHAPES
from o3dmark.cli import app
from o3dmark.registry import Registry, describe

README = Path(__file__).parent.parent / "README.md"


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
    tables = {name: registry_table(each) for name, each in registries().items()} | {"commands": commands_table()}
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


def flowing(doc: str) -> str:
    """A docstring as one table cell: paragraphs become lines."""
    paragraphs = [" ".join(part.split()) for part in doc.split("\n\n")]
    return cell("<br>".join(paragraphs))


def cell(text: str) -> str:
    return text.replace("|", "\\|")


def shown(default: object) -> str:
    return "none" if default is None else str(default).lower() if isinstance(default, bool) else f"{default}"


if __name__ == "__main__":
    sys.exit(main())
