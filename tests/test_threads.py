"""One thread for linear algebra, whoever starts it, unless somebody chose otherwise; all cores for our own loops."""

import os
import subprocess
import sys

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from o3dmark import threads
from o3dmark.threads import VARIABLES, in_parts, one_thread

_BLAS = """
import o3dmark.threads, sys
o3dmark.threads.load_with_one_thread()
assert "numpy" not in sys.modules
import numpy, threadpoolctl
print(*{each["num_threads"] for each in threadpoolctl.threadpool_info() if each["user_api"] == "blas"})
"""


@pytest.mark.parametrize(("chosen", "found"), [({}, "1"), ({"OPENBLAS_NUM_THREADS": "2", "MKL_NUM_THREADS": "2"}, "2")])
def test_linear_algebra_is_loaded_with_one_thread_or_as_chosen(chosen: dict[str, str], found: str) -> None:
    if found == "2" and threads.cores() < 2:
        pytest.skip("one core")
    environment = {name: value for name, value in os.environ.items() if name not in VARIABLES} | chosen
    done = subprocess.run([sys.executable, "-c", _BLAS], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [found]


def test_one_thread_while_it_lasts() -> None:
    np.ones((2, 2)) @ np.ones((2, 2))
    before = [each["num_threads"] for each in threadpool_info()]
    with one_thread():
        assert {each["num_threads"] for each in threadpool_info()} == {1}
    assert [each["num_threads"] for each in threadpool_info()] == before


@pytest.mark.parametrize("cores", [1, 3])
@pytest.mark.parametrize("count", [0, 1, 63, 64, 65, 1000])
def test_parts_cover_every_item_once(count: int, cores: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threads.os, "sched_getaffinity", lambda _: set(range(cores)), raising=False)
    done, parts = np.zeros(count, int), []

    def work(start: int, stop: int) -> None:
        done[start:stop] += 1
        parts.append((start, stop))

    in_parts(count, work)
    assert np.array_equal(done, np.ones(count, int))
    assert len(parts) == (1 if count < 64 or cores == 1 else 4 * cores)


def test_what_goes_wrong_in_a_part_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threads.os, "sched_getaffinity", lambda _: {0, 1}, raising=False)

    def work(start: int, stop: int) -> None:
        if start:
            raise ValueError("of a later part")

    with pytest.raises(ValueError, match="of a later part"):
        in_parts(100, work)
