"""Executors: processes on this machine, or the workers of a Dask cluster."""

import os
import signal
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, get_context
from typing import Any

from o3dmark.errors import BackendError

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


@contextmanager
def process_pool(workers: int) -> Iterator[Executor]:
    """``workers`` processes with one thread each: more would wait for each other.

    The libraries read the number of threads from the environment when they are loaded, so it is set while processes
    are started, which are started anew rather than forked for the same reason.
    """
    before, others = {name: os.environ.get(name) for name in _THREADS}, set(active_children())
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    pool = ProcessPoolExecutor(workers, get_context("spawn"), initializer=_leave_interrupts_to_the_parent)
    try:
        yield pool
    except BaseException:  # an interrupt: what is at work would be waited for, and its rows then be dropped
        for process in set(active_children()) - others:
            process.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        for name, value in before.items():
            os.environ.pop(name, None) if value is None else os.environ.update({name: value})


def _leave_interrupts_to_the_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def dask_cluster(address: str) -> Iterator[tuple[Executor, int]]:
    """The workers of the Dask scheduler at ``address``, and how many threads they have. Needs the extra "dask".

    The workers need o3dmark too, and mesh files under the same paths; shapes they make themselves.
    """
    try:
        from distributed import Client
    except ImportError:
        raise BackendError("Dask is not installed: pip install 'o3dmark[dask]'") from None
    try:
        client: Any = Client(address, timeout="20s")  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise BackendError(f"no Dask scheduler answers at {address}: {error}") from None
    with client:
        yield client.get_executor(pure=False), max(1, sum(client.nthreads().values()))
