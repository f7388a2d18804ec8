"""What a campaign's folder says of itself: DIR/campaign.json, the plan and the runs that computed its rows."""

import datetime
import inspect
import json
import os
import platform
import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from o3dmark._version import __version__
from o3dmark.campaign.plan import Campaign
from o3dmark.campaign.row import PLAN
from o3dmark.errors import SpecError
from o3dmark.files import replacing
from o3dmark.methods import METHODS, Method
from o3dmark.registry import describe

_PACKAGE = Path(__file__).parent.parent


@dataclass(frozen=True)
class Run:
    """One invocation that computed rows. ``commit`` is None where the package lies in no git checkout.

    ``seconds`` until its last row was kept; None where that was not noted.
    """

    command: str
    started: str
    version: str
    commit: str | None
    machine: str
    python: str
    seconds: float | None = None

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


@dataclass(frozen=True)
class Kept:
    """A folder's plan, the runs that computed its rows, and what each method is: spec, says, needs, options."""

    campaign: Campaign
    runs: tuple[Run, ...]
    methods: Mapping[str, Mapping[str, str]]


def load(directory: str | Path) -> Kept:
    """What a folder says of itself. Errors: SpecError when it holds no campaign."""
    path = Path(directory) / PLAN
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        runs = tuple(Run(**run) for run in content["runs"])
        return Kept(Campaign.from_dict(content["campaign"]), runs, content["methods"])
    except OSError:
        raise SpecError(f"{directory} holds no campaign; `o3dmark bench NAME --out {directory}` makes one") from None
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise SpecError(f"{path} is damaged, or of another version of o3dmark: {error!r}") from None


def save(directory: str | Path, kept: Kept, **more: Mapping[str, Any]) -> None:
    """Write campaign.json; ``more``: what else stands in it."""
    content = {
        "campaign": kept.campaign.to_dict(),
        "runs": [asdict(run) for run in kept.runs],
        "methods": {label: dict(told) for label, told in kept.methods.items()},
    }
    with replacing(Path(directory) / PLAN) as draft:
        draft.write_text(json.dumps(content | more, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def told_of_methods(campaign: Campaign) -> dict[str, dict[str, str]]:
    """Of each method of a campaign: its spec, what its class says, what its reader needs, options off their default."""
    return {label: _told(spec, label in campaign.informed) for label, spec in campaign.methods.items()}


def _told(spec: str, informed: bool) -> dict[str, str]:
    method = METHODS.make(spec)
    return {
        "spec": spec,
        "says": (inspect.getdoc(type(method)) or "").partition("\n")[0],
        "needs": "key and cover mesh" if informed or method.informed else "key alone (blind)",
        "options": ", ".join(_options(method)) or "none",
    }


def _options(method: Method) -> Iterator[str]:
    for name, _, default, doc in describe(type(method)):
        if (value := getattr(method, name)) != default:
            text = format(value, "g") if isinstance(value, (int, float)) else str(value).lower()
            yield f"{name} = {text} ({doc.partition(';')[0]})"


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
