"""Compare o3dmark's metrics with the values of independent programs: a CSV table on stdout.

    python scripts/oracle_table.py ORACLE_FOLDER [PAIR_PREFIX ...]

ORACLE_FOLDER holds pairs.csv (pair, original, distorted), pairs/*.ply, and metrics.csv (pair, metric, value, tool),
computed on 2026-11-22. results/oracle/rows.csv is its output for all pairs; tests/golden/metrics_spot.csv is that
for the pairs whose meshes lie beside it:

    python scripts/oracle_table.py ORACLE_FOLDER spot_gauss0.1 spot_unif0.5 spot_lap10 spot_quant8

Lengths are in the units of the vertices. RMS and max are over libigl's and our own random points: one way, the maximum
may lie at a point that the other did not draw; MRMS and HD are the larger of both ways.
"""

import csv
import sys
from pathlib import Path
from typing import Any, Literal

from o3dmark.files import read_mesh
from o3dmark.metrics.displacement import MaxDisplacement, RmsDisplacement
from o3dmark.metrics.distance import surface_distance
from o3dmark.metrics.msdm import MSDM, MSDM2

DATE = "2026-11-22"
DIRECTIONS: tuple[Literal["forward", "backward"], ...] = ("forward", "backward")
LIBIGL = ("RMS", "max", "MRMS", "HD")
TOOLS = {"MSDM": "MEPP1", "MSDM2": "MEPP2", "vertex": "numpy"} | dict.fromkeys(LIBIGL, "libigl")


def main(folder: Path, prefixes: list[str]) -> None:
    with open(folder / "pairs.csv") as file:
        pairs = {row["pair"]: row for row in csv.DictReader(file)}
    table = csv.writer(sys.stdout, lineterminator="\n")
    table.writerow(["pair", "metric", "oracle", "ours", "deviation", "program", "date"])
    for pair, known in oracle_values(folder).items():
        if prefixes and not pair.startswith(tuple(prefixes)):
            continue
        meshes = (read_mesh(folder / "pairs" / f"{pairs[pair][side]}.ply") for side in ("original", "distorted"))
        for metric, value in our_values(*meshes, one_to_one="MSDM" in known).items():
            oracle, program = known[metric]
            table.writerow([pair, metric, oracle, f"{value:.9g}", f"{value / oracle - 1:+.1e}", program, DATE])


def oracle_values(folder: Path) -> dict[str, dict[str, tuple[float, str]]]:
    """For each pair its metrics' (value, program), by the programs that define them."""
    known: dict[str, dict[str, tuple[float, str]]] = {}
    with open(folder / "metrics.csv") as file:
        for row in csv.DictReader(file):
            if row["tool"].startswith(TOOLS.get(row["metric"].split("_")[0], "none")):
                known.setdefault(row["pair"], {})[row["metric"]] = float(row["value"]), row["tool"]
    return known


def our_values(reference: Any, distorted: Any, *, one_to_one: bool) -> dict[str, float]:
    """The same metrics, under the same names and in the same units, by o3dmark."""
    distance = surface_distance(reference, distorted)
    directed = [MSDM2(direction=way)(reference, distorted) for way in DIRECTIONS]
    values = {
        "RMS_fwd": distance.rms_forward * distance.diagonal,
        "RMS_bwd": distance.rms_backward * distance.diagonal,
        "max_fwd": distance.max_forward * distance.diagonal,
        "max_bwd": distance.max_backward * distance.diagonal,
        "MRMS": distance.mrms * distance.diagonal,
        "HD": distance.hausdorff * distance.diagonal,
        "MSDM2_fwd": directed[0],
        "MSDM2_bwd": directed[1],
        "MSDM2_sym": sum(directed) / 2,
    }
    if one_to_one:
        values |= {
            "MSDM": MSDM()(reference, distorted),
            "MSDM_swapped": MSDM()(distorted, reference),
            "vertex_RMSE_index_corr": RmsDisplacement()(reference, distorted) * distance.diagonal,
            "vertex_max_index_corr": MaxDisplacement()(reference, distorted) * distance.diagonal,
        }
    return values


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), sys.argv[2:])
