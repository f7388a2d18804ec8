"""The main job, from beginning to end: mark a mesh, let the world have it, read the mark back, look at everything.

    scripts/demo [MESH] [--out FOLDER] [--message TEXT]

Without MESH it takes a synthetic bust. Exit code 0 when the message is read back blindly after similarity,
simplification by half and 0.1 % noise together.
"""

import argparse
import sys
import time
from pathlib import Path

from rich.console import Console
from rich.table import Table

from o3dmark import METRICS, SHAPES, Key, O3dmarkError, Saliency, Watermark, attack_all, read_mesh, write_mesh
from o3dmark.metrics.distance import surface_distance
from o3dmark.view import comparison_sheet, render_scalars, save_png

JOURNEYS = {  # what happens to copies of the marked mesh; the last is the one that must be read
    "nothing": [],
    "0.3 % noise": ["noise:amplitude=0.003"],
    "10-bit quantisation": ["quantise:bits=10"],
    "30 steps of smoothing": ["smooth:iterations=30"],
    "Loop subdivision": ["subdivide"],
    "isotropic remeshing": ["remesh"],
    "similarity, half the triangles, 0.1 % noise": ["similarity", "simplify", "noise:amplitude=0.001"],
}


def main() -> int:
    parser = argparse.ArgumentParser(prog="scripts/demo", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("mesh", nargs="?", type=Path, help="a mesh file; a synthetic bust by default")
    parser.add_argument("--out", type=Path, default=Path("demo_output"), help="folder for meshes and pictures")
    parser.add_argument("--message", default="mine", help="up to 4 bytes")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    started = time.perf_counter()

    cover = read_mesh(options.mesh) if options.mesh else SHAPES.make("bimba").build()
    key, watermark = Key.generate(), Watermark()
    marked = watermark.embed(cover, options.message, key)
    write_mesh(options.out / "marked.ply", marked)

    console = Console()
    table = Table("what happened to it", "message", "corrected", "p-value", "seconds", box=None)
    for journey, attacks in JOURNEYS.items():
        attacked = attack_all(marked, attacks, 1)
        begun = time.perf_counter()
        reading = watermark.extract(attacked, key)
        taken = f"{time.perf_counter() - begun:.1f}"
        corrected = "-" if reading.decoded.corrected_bits is None else f"{reading.decoded.corrected_bits} of 64"
        table.add_row(journey, reading.message or "[red]not found[/]", corrected, f"{reading.p_value:.1e}", taken)
    other = watermark.extract(marked, Key.generate())
    table.add_row("nothing, but another key", other.message or "none, as it should be", "-", f"{other.p_value:.1e}")
    console.print(table)

    distance = surface_distance(cover, marked)
    msdm = METRICS.make("msdm2")(cover, marked)
    cost = f"MRMS {distance.mrms:.2e}, Hausdorff {distance.hausdorff:.2e} of the diagonal, MSDM2 {msdm:.2f}"
    console.print(f"\nwhat the mark cost: {cost}")

    write_mesh(options.out / "attacked.ply", attacked)
    saliency = Saliency()(cover)
    sheet = comparison_sheet(
        cover,
        marked,
        attacked,
        saliency=saliency,
        title="o3dmark",
        attack=journey,
        notes=[f"read back: {reading.message}", f"p-value {reading.p_value:.1e}", cost],
    )
    save_png(options.out / "comparison.png", sheet)
    save_png(options.out / "saliency.png", render_scalars(cover, saliency, "saliency"))
    console.print(f"pictures: {options.out / 'comparison.png'}, {options.out / 'saliency.png'}")
    console.print(f"meshes:   {options.out / 'marked.ply'}, {options.out / 'attacked.ply'}")
    console.print(f"all of it took {time.perf_counter() - started:.0f} s")
    return 0 if reading.message == options.message else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except O3dmarkError as error:
        print(error, file=sys.stderr)
        sys.exit(error.exit_code)
