"""What a command costs from the first to the last: `pytest tests/benchmarks/bench_start.py --benchmark-only`.

Each round is a process of its own, files in memory and kernels compiled, measured by the clock; ``extra_info`` has the
processor's seconds, which other jobs disturb less. Beside them is the limit: Python, numpy and what of scipy is used.
"""

import resource
import subprocess
import sys

import pytest

from o3dmark import SHAPES
from o3dmark.files import write_mesh

LIMIT = "import numpy, scipy.sparse.csgraph, scipy.special, finufft"
ROUNDS = 5


@pytest.fixture(scope="module")
def home(tmp_path_factory, key):
    """A folder with a key, a bust of 8 857 vertices, and the same marked."""
    folder = tmp_path_factory.mktemp("start")
    key.save(folder / "owner.key")
    write_mesh(folder / "bust.ply", SHAPES.make("bimba").build())
    run(folder, "-m", "o3dmark", "embed", "bust.ply", "marked.ply", "--key", "owner.key", "--message", "mine")
    return folder


def run(folder, *words):
    subprocess.run([sys.executable, *words], cwd=folder, check=True, capture_output=True)


def measured(benchmark, folder, *words):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    benchmark.pedantic(run, (folder, *words), rounds=ROUNDS, warmup_rounds=1)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    benchmark.extra_info["processor"] = seconds / (ROUNDS + 1)


@pytest.mark.benchmark(group="a command, 8 857 vertices")
@pytest.mark.parametrize(
    "words",
    [
        ("--help",),
        ("extract", "marked.ply", "--key", "owner.key"),
        ("detect", "marked.ply", "--key", "owner.key", "--message", "mine"),
        ("embed", "bust.ply", "out.ply", "--overwrite", "--key", "owner.key", "--message", "mine"),
    ],
    ids=lambda words: words[0],
)
def test_bench_command(benchmark, home, words):
    measured(benchmark, home, "-m", "o3dmark", *words)


@pytest.mark.benchmark(group="a command, 8 857 vertices")
@pytest.mark.parametrize("code", [LIMIT, "import open3d"])
def test_bench_imports(benchmark, home, code):
    measured(benchmark, home, "-c", code)
