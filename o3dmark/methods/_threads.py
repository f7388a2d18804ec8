"""How many threads the linear algebra of a method uses: one."""

from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


@contextmanager
def one_thread() -> Iterator[None]:
    """Hold BLAS and OpenMP to one thread; also a decorator.

    The products are small, and threads that wait for each other beside another process cost more than they save.
    """
    with threadpool_limits(limits=1):
        yield
