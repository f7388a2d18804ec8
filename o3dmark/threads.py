"""How many threads, said in one place: one for linear algebra, all cores for compiled loops over many items.

The products are small, and a library's threads wait for each other in a loop: what they save alone is little, what they
cost beside another process is much (docs/speed.md has the figures).
"""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

_BLAS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
VARIABLES = ("OMP_NUM_THREADS", *_BLAS, "NUMBA_NUM_THREADS")
"""What libraries read when they are loaded, and hold to from then on."""


def load_with_one_thread() -> None:
    """Let the linear algebra of this process, and of those it starts, have one thread, unless somebody chose otherwise.

    For the owner of a process, before numpy is imported: the threads are then not even made, which is 0.1 s sooner.
    """
    for name in _BLAS:
        os.environ.setdefault(name, "1")


@contextmanager
def one_thread() -> Iterator[None]:
    """Hold the BLAS and OpenMP that are loaded to one thread; also a decorator."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1):
        yield


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_parts(count: int, work: Callable[[int, int], None], least: int = 64) -> None:
    """Do ``work(start, stop)`` for runs that make up 0 .. count; side by side, where there are ``least`` items or more.

    The work is to let go of Python's lock, as numba's kernels do when told to. Numba's own threads are not asked: which
    of its three kinds works hangs on what is installed, and on what else forks or starts threads.
    """
    n_cores = cores()
    if count < least or n_cores == 1:
        work(0, count)
        return
    ends = [count * part // (4 * n_cores) for part in range(4 * n_cores + 1)]
    with ThreadPoolExecutor(n_cores) as pool:
        list(pool.map(work, ends[:-1], ends[1:]))
