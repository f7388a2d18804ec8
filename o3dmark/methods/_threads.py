"""How many threads a method uses: one for linear algebra, all cores for its own compiled loops over many items."""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


@contextmanager
def one_thread() -> Iterator[None]:
    """Hold BLAS and OpenMP to one thread; also a decorator.

    The products are small, and threads that wait for each other beside another process cost more than they save.
    """
    with threadpool_limits(limits=1):
        yield


def in_parts(count: int, work: Callable[[int, int], None], least: int = 64) -> None:
    """Do ``work(start, stop)`` for runs that make up 0 .. count; side by side, where there are ``least`` items or more.

    The work is to let go of Python's lock, as numba's kernels do when told to. Numba's own threads are not asked: which
    of its three kinds works hangs on what is installed, and on what else forks or starts threads.
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if count < least or cores == 1:
        work(0, count)
        return
    ends = [count * part // (4 * cores) for part in range(4 * cores + 1)]
    with ThreadPoolExecutor(cores) as pool:
        list(pool.map(work, ends[:-1], ends[1:]))
