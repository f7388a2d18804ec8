"""Point clouds: a scan is marked, read from half of its points, and coloured by its saliency.

    python examples/point_cloud.py [--out OUT]

Writes scan.ply, points with normals, coloured by how salient they are, and a picture of it, scan.png.
"""

import argparse
from pathlib import Path

import open3d as o3d

import o3dmark
from o3dmark import view

POINTS = 100_000


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path())
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    key, mark = o3dmark.Key.generate(), o3dmark.Watermark()

    o3d.utility.random.seed(1)
    bust = o3dmark.SHAPES.make("bimba").build()
    scan = mark.embed(bust.sample_points_uniformly(POINTS, use_triangle_normal=True), "mine", key)
    print(mark.extract(scan.uniform_down_sample(2), key))

    saliency = o3dmark.Saliency()(scan)
    o3d.io.write_point_cloud(str(options.out / "scan.ply"), view.coloured(scan, saliency))
    view.save_png(options.out / "scan.png", view.render(scan, saliency))


if __name__ == "__main__":
    main()
