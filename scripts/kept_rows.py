"""Rows of a measurement that goes on where it stands: a CSV file in results/, to which lines are appended."""

import csv
import datetime
import subprocess
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parent.parent


def rows(path: Path) -> list[dict[str, str]]:
    """The rows that are there; none, where there is no file."""
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def append(path: Path, fields: Sequence[str], values: Sequence[object]) -> None:
    """One more row, under a head of ``fields`` where the file is new."""
    path.parent.mkdir(parents=True, exist_ok=True)
    new = not path.exists()
    with path.open("a", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        if new:
            table.writerow(fields)
        table.writerow(values)


def about() -> dict[str, str]:
    """Commit and date of a row that is made now."""
    git = ["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"]
    commit = subprocess.run(git, capture_output=True, text=True, check=False).stdout.strip()
    return {"commit": commit, "date": datetime.date.today().isoformat()}
