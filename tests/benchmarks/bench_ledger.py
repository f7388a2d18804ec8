"""Speed of the ledger of copies: `pytest tests/benchmarks/bench_ledger.py --benchmark-only`."""

import pytest

from fixtures.ledger_writer import entry
from o3dmark.copies import Ledger, verify

COPIES = 10_000


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("ledger") / "copies.db"
    with Ledger(path, writable=True) as ledger:
        ledger.add(entry(f"buyer {number}") for number in range(COPIES))
    return path


@pytest.mark.benchmark(group="10 000 copies")
def test_bench_opening_and_reading(benchmark, path):
    """What a trace does: the chain is walked, and each row read."""

    def read():
        with Ledger(path) as ledger:
            return ledger.copies()

    assert len(benchmark(read)) == COPIES


@pytest.mark.benchmark(group="10 000 copies")
def test_bench_verifying(benchmark, path):
    def read():
        with Ledger(path) as ledger:
            return verify(ledger)

    assert benchmark(read).fits


@pytest.mark.benchmark(group="entering")
def test_bench_one_more_copy(benchmark, path):
    """Among 10 000, on the disk when it returns."""
    with Ledger(path, writable=True) as ledger:
        numbers = iter(range(COPIES, 10 * COPIES))
        benchmark.pedantic(lambda: ledger.add([entry(f"buyer {next(numbers)}")]), rounds=50)
