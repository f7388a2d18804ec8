"""What a copy costs after the first: `pytest tests/benchmarks/bench_copies.py --benchmark-only`.

The synthetic bust at 100 000 vertices, as binary PLY, issued in this process; reading back included. And a trace of one
of its copies beside ten thousand in the ledger, against the extraction alone.
"""

import time

import numpy as np
import pytest

from o3dmark import SHAPES
from o3dmark.coding.keys import Key
from o3dmark.copies import Copy, Ledger, Tracer, issue
from o3dmark.copies.issuing import asset_key, copies_watermark
from o3dmark.files import read_mesh, write_mesh

COPIES, CROWD = 20, 10_000
KEY = Key(bytes(range(32)))


@pytest.fixture(scope="module")
def asset(tmp_path_factory):
    path = tmp_path_factory.mktemp("asset") / "bust.ply"
    write_mesh(path, SHAPES.make("bimba:vertices=100000").build())
    return path


@pytest.mark.benchmark(group="copies", timer=time.process_time)
def test_bench_copies(benchmark, asset, tmp_path):
    moments = [time.process_time()]

    def all_copies():
        with Ledger(tmp_path / "copies.db", writable=True) as ledger:
            names = [f"buyer {number}" for number in range(COPIES)]
            steps = issue(asset, names, KEY, ledger, tmp_path / "out", profile="robust-2026")
            moments.extend(time.process_time() for _ in steps)

    benchmark.pedantic(all_copies, rounds=1)
    first, *others = np.diff(moments)[1:]
    seconds = {"first": first, "further, median": float(np.median(others)), "further, most": max(others)}
    benchmark.extra_info |= seconds
    print(seconds)


@pytest.mark.benchmark(group="trace")
def test_bench_a_trace_beside_ten_thousand_copies(benchmark, asset, tmp_path):
    with Ledger(tmp_path / "copies.db", writable=True) as ledger:
        list(issue(asset, ["b3"], KEY, ledger, tmp_path / "out", profile="robust-2026"))
        (copy,) = ledger.copies()
    mesh = read_mesh(tmp_path / "out" / copy.file)
    crowd = [Copy(**vars(copy) | {"name": f"buyer {number}"}) for number in range(CROWD)]
    started = time.perf_counter()
    mark = copies_watermark(copy.profile)
    mark.extract_bits(mesh, asset_key(KEY, copy.asset))
    alone = time.perf_counter() - started
    found = benchmark.pedantic(lambda: Tracer.of([copy, *crowd], [KEY]).trace(mesh), rounds=3)
    assert found.best.copy.name == "b3"
    benchmark.extra_info |= {"the extraction alone": alone}
    print("the extraction alone", alone, "median of the trace", benchmark.stats.stats.median)
