"""From what is the mark of a point cloud read? results/clouds/rows.csv, a row for each mesh, key and condition.

    python scripts/clouds.py --meshes FOLDER [MESH...]     what is not there yet

Of each mesh 200 000 points are sampled, with their triangles' normals, and marked. The mark is read from the points,
from half of them, with noise of 0.1 % of the diagonal, without normals, and from the Poisson surface of the points.
Interrupted, it can be run again.
"""

import argparse
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import open3d as o3d
from kept_rows import about, append, rows

from o3dmark.coding.keys import Key
from o3dmark.errors import MeshError
from o3dmark.files import read_mesh
from o3dmark.mesh import geometry
from o3dmark.mesh.reconstruction import poisson
from o3dmark.mesh.surface import PointCloud, point_cloud
from o3dmark.profiles import DEFAULT_PROFILE, PROFILES

ROWS = Path(__file__).parent.parent / "results" / "clouds" / "rows.csv"
MESHES = {
    "bimba": "paper/bimba.ply",
    "bunny": "paper/bunny.ply",
    "camel_9770": "extra/camel_9770.ply",
    "nefertiti_35002": "extra/nefertiti_35002.ply",
    "hand_53054": "extra/hand_53054.ply",
}
POINTS, NOISE, SEEDS = 200_000, 1e-3, (0, 1, 2)
FIELDS = ("mesh", "seed", "condition", "read", "log10_p", "seconds", "embed_seconds", "rms", "commit", "date")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("meshes", nargs="*", metavar="MESH", help=", ".join(MESHES))
    parser.add_argument("--meshes", dest="folder", type=Path, required=True, help="the folder of real meshes")
    options = parser.parse_args()
    done = {(row["mesh"], row["seed"]) for row in rows(ROWS)}
    for name in options.meshes or MESHES:
        for seed in SEEDS:
            if (name, str(seed)) not in done:
                for values in list(measured(name, options.folder, seed)):
                    append(ROWS, FIELDS, values)


def measured(name: str, folder: Path, seed: int) -> Iterator[tuple[object, ...]]:
    """The rows of a mesh and a seed; seconds are the processor's."""
    mark, key = PROFILES[DEFAULT_PROFILE], Key(bytes([seed] * 32))
    o3d.utility.random.seed(seed)
    cloud = read_mesh(folder / MESHES[name]).sample_points_uniformly(POINTS, use_triangle_normal=True)
    begun = time.process_time()
    try:
        marked = mark.embed(cloud, "mine", key)
    except MeshError as error:
        yield name, seed, f"refused: {error}", 0, "", "", "", "", *about().values()
        return
    spent, points = time.process_time() - begun, np.asarray(marked.points)
    rms = np.sqrt(((points - np.asarray(cloud.points)) ** 2).sum(axis=1).mean()) / geometry.diagonal(points)
    for condition, received in conditions(marked, np.random.default_rng(seed)):
        begun = time.process_time()
        read = mark.extract(received, key)
        seconds = time.process_time() - begun
        known = mark.test(read.extraction, key, "mine").log10_p
        figures = f"{known:.1f}", f"{seconds:.1f}", f"{spent:.1f}", f"{rms:.2e}"
        yield name, seed, condition, int(read.message == "mine"), *figures, *about().values()


def conditions(marked: PointCloud, rng: np.random.Generator) -> Iterator[tuple[str, object]]:
    """What is received, by its name."""
    points, normals = np.asarray(marked.points), np.asarray(marked.normals)
    half = rng.permutation(len(points))[: len(points) // 2]
    noise = rng.normal(0.0, NOISE * geometry.diagonal(points) / np.sqrt(3.0), points.shape)
    yield "as marked", marked
    yield "half of the points", marked.select_by_index(half.tolist())
    yield "noise of 0.1 %", point_cloud(points + noise, normals)
    yield "without normals", point_cloud(points)
    yield "Poisson surface", poisson(marked, 8)


if __name__ == "__main__":
    main()
