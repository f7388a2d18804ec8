"""What a campaign's folder says of itself: DIR/campaign.json, the plan and the runs that computed its rows."""

import datetime
import json
import os
import platform
import subprocess
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from o3dmark._version import __version__
from o3dmark.campaign.plan import Campaign
from o3dmark.campaign.row import PLAN
from o3dmark.errors import SpecError
from o3dmark.files import replacing

_PACKAGE = Path(__file__).parent.parent


@dataclass(frozen=True)
class Run:
    """One invocation that computed rows. ``commit`` is None where the package lies in no git checkout."""

    command: str
    started: str
    version: str
    commit: str | None
    machine: str
    python: str

    @classmethod
    def now(cls, command: str) -> "Run":
        """A run that starts now, by this version on this machine."""
        return cls(
            command=command,
            started=datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC"),
            version=__version__,
            commit=commit(),
            machine=f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores",
            python=platform.python_version(),
        )


def load(directory: str | Path) -> tuple[Campaign, list[Run]]:
    """The campaign that a folder holds the rows of, and the runs that made them. Errors: SpecError when none is."""
    path = Path(directory) / PLAN
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return Campaign.from_dict(content["campaign"]), [Run(**run) for run in content["runs"]]
    except OSError:
        raise SpecError(f"{directory} holds no campaign; `o3dmark bench NAME --out {directory}` makes one") from None
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise SpecError(f"{path} is damaged, or of another version of o3dmark: {error!r}") from None


def save(directory: str | Path, campaign: Campaign, runs: Iterable[Run], **more: Mapping[str, Any]) -> None:
    """Write campaign.json; ``more``: what else stands in it."""
    content = {"campaign": campaign.to_dict(), "runs": [asdict(run) for run in runs]} | more
    with replacing(Path(directory) / PLAN) as draft:
        draft.write_text(json.dumps(content, indent=1, ensure_ascii=False), encoding="utf-8")


def commit() -> str | None:
    """The commit that the package is of, "+changes" where it was changed since; None when no git checkout has it."""
    if _git("ls-files", "--error-unmatch", "_version.py") is None:
        return None
    name, changes = _git("rev-parse", "--short", "HEAD"), _git("status", "--porcelain", "--", ".")
    return name and name.strip() + ("+changes" if changes else "")


def _git(*words: str) -> str | None:
    """What git says in the package's folder; None when it fails, or is not there."""
    try:
        done = subprocess.run(["git", *words], cwd=_PACKAGE, capture_output=True, text=True, check=False, timeout=60)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout if done.returncode == 0 else None
