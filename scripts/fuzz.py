"""Damaged files without end, each a change that reaches new code of a parser: none may do more than be refused.

    pip install --target FOLDER atheris
    PYTHONPATH=FOLDER python scripts/fuzz.py FORMAT... [--minutes M]

What is parsed is moved, written and parsed again. It may end well, or with an error of o3dmark; whatever else happens
is a finding: another exception, a warning, more than 5 s, more memory than ten times the file and 256 MiB, a file that
does not hold what was written into it. Findings and the inputs that led to them are kept in build/fuzz/FORMAT, the
counts are added to results/fuzz/counts.csv. Exit code 1 when there was a finding.
"""

import argparse
import csv
import datetime
import json
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path

import fuzz_targets

ROOT = Path(__file__).parent.parent
COUNTS = ROOT / "results" / "fuzz" / "counts.csv"
FINDINGS = ROOT / "build" / "fuzz"
MIB = 1 << 20
LARGEST = 64_000  # bytes of an input
SLOWEST = 5.0  # seconds of the processor
MEMORY = 256 * MIB  # beside ten times the input
MOST_MEMORY = (
    4096 * MIB
)  # beyond what the libraries take: more is refused by the system; libFuzzer itself grows with its corpus
HANGS = 60  # seconds after which an input is given up
COMPILED = ["o3dmark.files.ply.ragged"]  # by numba, which does not know what instruments add
LAST = "last"  # the name of the file that has the input being parsed
RESTARTS = 20  # a parser that ends the process so often has been heard


def main() -> int:
    options = _options()
    if options.inside:
        return inside(options.formats[0], options.inside, options.minutes * 60)
    findings = [fuzzed(name, options.minutes * 60) for name in options.formats]
    return int(any(findings))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "formats", nargs="+", choices=fuzz_targets.TARGETS, metavar="FORMAT", help="; ".join(fuzz_targets.TARGETS)
    )
    parser.add_argument("--minutes", type=float, default=10.0, metavar="M", help="for each format; 10 by default")
    parser.add_argument("--inside", type=Path, help=argparse.SUPPRESS)  # the process that parses
    return parser.parse_args()


def fuzzed(name: str, seconds: float) -> int:
    """Fuzz one format, in processes that may die; returns how many different findings there are."""
    findings = FINDINGS / name
    shutil.rmtree(findings, ignore_errors=True)
    findings.mkdir(parents=True)
    end, inputs, started = time.monotonic() + seconds, 0, time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        corpus = Path(folder) / "corpus"
        corpus.mkdir()
        for number, seed in enumerate(fuzz_targets.TARGETS[name].seeds()):
            if len(seed) <= LARGEST:
                (corpus / f"seed{number}").write_bytes(seed)
        for _ in range(RESTARTS):
            if (left := end - time.monotonic()) < 1.0:
                break
            words = [
                sys.executable,
                str(Path(__file__).resolve()),
                name,
                "--minutes",
                str(left / 60),
                "--inside",
                folder,
            ]
            ended = subprocess.run(words, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, check=False)
            state = Path(folder) / "state.json"
            if not state.exists():
                sys.exit(ended.stderr.decode(errors="replace"))
            inputs += json.loads(state.read_text())["inputs"]
            state.unlink()
            if ended.returncode:
                _keep_death(findings, Path(folder), ended.stderr.decode(errors="replace"))
    found = len(list(findings.glob("*.txt")))
    _count(name, inputs, round(time.monotonic() - started), found)
    return found


def _keep_death(findings: Path, folder: Path, said: str) -> None:
    """Keep what a process said that ended by itself, its last input, and the one that libFuzzer blames."""
    number = len(list(findings.glob("death*.txt")))
    (findings / f"death{number}.txt").write_text(said[-5000:])
    shutil.copy(folder / LAST, findings / f"death{number}.input")
    for blamed in [path for path in folder.iterdir() if re.match("crash-|timeout-|oom-|slow-unit-|leak-", path.name)]:
        shutil.move(blamed, findings / f"death{number}-{blamed.name}")


def _count(name: str, inputs: int, seconds: int, findings: int) -> None:
    """Put a row into the counts, in place of an older one of the format."""
    row = {"format": name, "inputs": str(inputs), "seconds": str(seconds), "findings": str(findings)}
    row |= {"commit": _commit(), "date": datetime.date.today().isoformat()}
    COUNTS.parent.mkdir(parents=True, exist_ok=True)
    rows = {name: row}
    if COUNTS.exists():
        with COUNTS.open(newline="") as file:
            rows = {each["format"]: each for each in csv.DictReader(file)} | rows
    with COUNTS.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(row), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows[each] for each in sorted(rows))
    print(", ".join(f"{key} {value}" for key, value in row.items()))


def _commit() -> str:
    """The commit of the tree; dirty where more than the counts has changed."""
    git = ["git", "-C", str(ROOT)]
    head = subprocess.run([*git, "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False)
    other = [".", f":(exclude){COUNTS.relative_to(ROOT).as_posix()}"]
    clean = subprocess.run([*git, "diff", "--quiet", "HEAD", "--", *other], check=False).returncode == 0
    return head.stdout.strip() + ("" if clean else "-dirty")


def inside(name: str, folder: Path, seconds: float) -> int:
    """Parse inputs of a format until the time is over; never returns, for libFuzzer ends the process."""
    import atheris

    with atheris.instrument_imports(include=["o3dmark.files"], exclude=COMPILED):
        watch = Watch(name, folder, FINDINGS / name)
        for seed in sorted((folder / "corpus").glob("seed*")):
            watch(seed.read_bytes())  # so that all that is imported later is there before the limit
    (folder / "words").write_text("".join(f'"{word}"\n' for word in sorted(_words(folder / "corpus"))))
    size = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    resource.setrlimit(resource.RLIMIT_AS, (size + MOST_MEMORY, size + MOST_MEMORY))
    limits = [
        f"-max_total_time={max(1, round(seconds))}",
        f"-max_len={LARGEST}",
        f"-timeout={HANGS}",
        "-rss_limit_mb=0",
    ]
    files = [f"-dict={folder / 'words'}", f"-artifact_prefix={folder}/", str(folder / "corpus")]
    atheris.Setup([sys.argv[0], *limits, "-verbosity=0", *files], watch)
    atheris.Fuzz()
    return 0


def _words(corpus: Path) -> set[str]:
    """Words of the seeds, for libFuzzer to put in."""
    return {
        word.decode()
        for seed in corpus.glob("seed*")
        for word in re.findall(rb"[A-Za-z_:]{3,30}", seed.read_bytes())
        if word.lower() == word or word.upper() == word or b"_" in word or len(word) > 5
    }


class Watch:
    """Parses one input after the other, and keeps what must not happen, once for each place in the code."""

    def __init__(self, name: str, folder: Path, findings: Path) -> None:
        import o3dmark.files  # noqa: F401 - whatever is imported at first use
        from o3dmark.errors import O3dmarkError

        self.allowed = O3dmarkError
        self.target, self.state, self.findings = fuzz_targets.TARGETS[name], folder / "state.json", findings
        self.last = folder / LAST
        self.inputs, self.told, self.peak = 0, 0.0, 0
        warnings.simplefilter("error")

    def __call__(self, data: bytes) -> None:
        self.inputs += 1
        if time.monotonic() - self.told > 0.5:
            self.told = time.monotonic()
            self.state.write_text(json.dumps({"inputs": self.inputs}))
        self.last.write_bytes(data)  # for a parser that ends the process
        before, started = _resident(), time.process_time()
        try:
            self.target.journey(data)
        except self.allowed:
            pass
        except Exception as error:
            self.keep(_place(error), traceback.format_exc(), data)
        self.watch_costs(data, before, started)

    def watch_costs(self, data: bytes, before: int, started: float) -> None:
        """Keep what took too long, or more memory than any input before and than this one may."""
        if (taken := time.process_time() - started) > SLOWEST:
            self.keep("slow", f"{taken:.1f} s", data)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        if peak > self.peak and peak - before > 10 * len(data) + MEMORY:
            self.keep("memory", f"{(peak - before) / MIB:.0f} MiB for {len(data)} bytes", data)
        self.peak = peak

    def keep(self, place: str, what: str, data: bytes) -> None:
        """Keep a finding, unless one of the same place is there already."""
        words = self.findings / f"{place}.txt"
        if not words.exists():
            words.write_text(what)
            words.with_suffix(".input").write_bytes(data)


def _resident() -> int:
    """Bytes of memory that the process has now."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def _place(error: BaseException) -> str:
    """A name for where an error came from: its type and the last line of o3dmark that it passed, or else its words."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "o3dmark" in frame.filename]
    where = f"{Path(frames[-1].filename).stem}-{frames[-1].lineno}" if frames else str(error)[:30].replace(" ", "-")
    return f"{type(error).__name__}-{where}"


if __name__ == "__main__":
    sys.exit(main())
