"""Point clouds: saliency of a scan as its colours, and a mark that is read from points sampled on a marked mesh.

    python examples/point_cloud.py [--out OUT]

Writes scan.ply, points with normals, coloured by how salient they are, and a picture of it, scan.png.
"""

import argparse
from pathlib import Path

import open3d as o3d

import o3dmark
from o3dmark import view

POINTS = 60_000


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path())
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    key, mark = o3dmark.Key.generate(), o3dmark.Watermark()
    marked = mark.embed(o3dmark.SHAPES.make("bimba").build(), "mine", key)

    o3d.utility.random.seed(1)
    scan = marked.sample_points_uniformly(POINTS, use_triangle_normal=True)
    salient = view.coloured(scan, o3dmark.Saliency()(scan))
    o3d.io.write_point_cloud(str(options.out / "scan.ply"), salient)
    view.save_png(options.out / "scan.png", view.render(salient))
    print(mark.extract(scan, key))


if __name__ == "__main__":
    main()
