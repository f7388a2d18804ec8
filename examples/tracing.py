"""A copy for each buyer, a leak, and whose copy it was: what `o3dmark issue` and `trace` do, from Python.

python examples/tracing.py [ASSET] [--out OUT]
"""

import argparse
from pathlib import Path

import o3dmark
from o3dmark.copies import Ledger, Tracer, issue

BUYERS = ["studio north", "studio south", "freelancer"]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("asset", type=Path, nargs="?")
    parser.add_argument("--out", type=Path, default=Path())
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    asset = options.asset or synthetic(options.out)
    key = o3dmark.Key.generate()
    key.save(options.out / "owner.key")

    with Ledger(options.out / "copies.db", writable=True) as ledger:
        for step in issue(asset, BUYERS, key, ledger, options.out / "copies"):
            print(f"{step.done} of {step.total} copies")
        copies = ledger.copies()

    leaked = o3dmark.read_mesh(options.out / "copies" / copies[1].file)
    leaked = o3dmark.attack_all(leaked, ["crop:share=0.3", "noise:amplitude=0.0005"], 1)
    found = Tracer.of(copies, [key]).trace(leaked)
    print("leaked by:", ", ".join(named.copy.name for named in found.named) or "nobody that we know")


def synthetic(folder: Path) -> Path:
    o3dmark.write_mesh(folder / "bust.ply", o3dmark.SHAPES.make("bimba").build())
    return folder / "bust.ply"


if __name__ == "__main__":
    main()
