"""The independent programs: where they are, their versions, and runs of them that always end."""

import json
import os
import shutil
import signal
import subprocess
from collections.abc import Mapping
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
LONGEST = 300  # seconds, for one run
_CHROMIUM = ("chromium", "chromium-browser", "google-chrome")
_INSTALL = {
    "node_modules": "npm ci",
    "python_modules": "pip install --no-deps --target python_modules -r requirements.txt",
}


class MissingError(Exception):
    """A program that is not here; the words say how to get it."""


class FailedError(Exception):
    """A program that ended with an error, or not at all; the words are its last ones."""


def run(*command: object, variables: Mapping[str, str] | None = None, may_end_with: tuple[int, ...] = (0,)) -> str:
    """What a program says on stdout. Errors: FailedError, also when it takes too long; nothing of it is left."""
    words = [str(word) for word in command]
    environment = {**os.environ, **(variables or {})}
    pipe = subprocess.PIPE
    with subprocess.Popen(
        words, stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe, text=True, env=environment, start_new_session=True
    ) as program:
        try:
            said, complaint = program.communicate(timeout=LONGEST)
        except subprocess.TimeoutExpired:
            raise FailedError(f"{Path(words[0]).name} took longer than {LONGEST} s") from None
        finally:
            if program.poll() is None:
                os.killpg(program.pid, signal.SIGKILL)
    if program.returncode not in may_end_with:
        last = [line for line in (complaint or said).splitlines() if line.strip()][-3:]
        raise FailedError(f"{Path(words[0]).name} ended with {program.returncode}: {' / '.join(last)}")
    return said


def node(package: str) -> str:
    """The version of an npm package. Errors: MissingError without it, or without node."""
    if shutil.which("node") is None:
        raise MissingError("node is not here; on Debian: apt-get install nodejs npm")
    return str(json.loads(_installed("node_modules", package, "package.json").read_text())["version"])


def script(package: str, command: str) -> Path:
    """The path of a command of an npm package. Errors: as `node`."""
    node(package)
    return HERE / "node_modules" / ".bin" / command


def python(package: str) -> str:
    """The version of a reader's Python package. Errors: MissingError without it."""
    _installed("python_modules", package)
    return next((HERE / "python_modules").glob(f"{package}-*.dist-info")).stem.partition("-")[2]


def chromium() -> str:
    """The path of a Chromium. Errors: MissingError without one."""
    found = next(filter(None, map(shutil.which, _CHROMIUM)), None)
    if found is None:
        raise MissingError("no Chromium is here; on Debian: apt-get install chromium")
    return found


def _installed(folder: str, *parts: str) -> Path:
    path = HERE.joinpath(folder, *parts)
    if not path.exists():
        raise MissingError(f"{parts[0]} is not here; in {HERE.relative_to(ROOT)}: {_INSTALL[folder]}")
    return path
