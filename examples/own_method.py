"""A robustness check of one's own method under one's own attack, beside the default, with a report.

    python examples/own_method.py [--out OUT]

OUT/report.html has tables and curves; rows are kept, and a second run measures only what is missing.
"""

import argparse
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("own"))
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    for name in ("own.toml", "own_plugin.py"):
        shutil.copyfile(HERE / name, out / name)
    o3dmark = [sys.executable, "-m", "o3dmark"]
    subprocess.run([*o3dmark, "bench", "own.toml", "--out", "rows"], cwd=out, check=True)
    subprocess.run([*o3dmark, "report", "rows"], cwd=out, check=True)


if __name__ == "__main__":
    main()
