"""Executors: processes on this machine, or the workers of a Dask cluster."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, get_context
from typing import Any

from o3dmark.errors import BackendError
from o3dmark.threads import VARIABLES


class ProcessPool(Executor):
    """``workers`` processes with one thread each: more would wait for each other. Make one with `process_pool`.

    The libraries read the number of threads from the environment when they are loaded, so it is set while processes
    are started, which are started anew rather than forked for the same reason.
    """

    def __init__(self, workers: int) -> None:
        self._workers, self._others = workers, set(active_children())
        self._pool, self._processes = self._started(), set[Any]()

    def submit(self, call: Callable[..., Any], /, *arguments: Any, **options: Any) -> Future[Any]:
        """As `Executor.submit`. Errors: BrokenProcessPool once a process has died, until `renew`."""
        future = self._pool.submit(call, *arguments, **options)
        self._processes |= set(active_children()) - self._others
        return future

    def renew(self) -> None:
        """Start again with new processes; what was submitted before is lost."""
        self._pool.shutdown(cancel_futures=True)
        self._pool, self._processes = self._started(), set()

    def _started(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self._workers, get_context("spawn"), initializer=_leave_interrupts_to_the_parent)

    def endings(self) -> list[int]:
        """The exit codes of the processes that ended with another than 0, negative for a signal."""
        patience = time.monotonic() + 10.0
        for process in self._processes:
            process.join(timeout=10)
            while process.exitcode is None and time.monotonic() < patience:
                time.sleep(0.01)  # the pool's own thread was told first, and is about to write it down
        return [process.exitcode for process in self._processes if process.exitcode]

    def terminate(self) -> None:
        """End the processes at once: what is at work would be waited for."""
        for process in set(active_children()) - self._others:
            process.terminate()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """As `Executor.shutdown`."""
        self._pool.shutdown(wait, cancel_futures=cancel_futures)


@contextmanager
def process_pool(workers: int) -> Iterator[ProcessPool]:
    """A pool of processes, ended at the end of the block; at once where that ends with an error or an interrupt."""
    before = {name: os.environ.get(name) for name in VARIABLES}
    os.environ.update(dict.fromkeys(VARIABLES, "1"))
    pool = ProcessPool(workers)
    try:
        yield pool
    except BaseException:
        pool.terminate()
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

    The workers need o3dmark too, and files of meshes and plug-ins under the same paths; shapes they make themselves.
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
