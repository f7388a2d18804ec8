"""Makes the synthetic test meshes, or checks that the ones here are what the generator makes.

    python scripts/make_synthetic.py                all of them, the large ones into data_synthetic/large
    python scripts/make_synthetic.py cat horse      only these
    python scripts/make_synthetic.py --check        make them again and compare; exit code 1 when one differs

manifest.json holds, for each file, the spec that makes it, its counts, and a digest of its geometry.
"""

import argparse
import hashlib
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import open3d as o3d

from o3dmark.files import read_mesh, write_mesh
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays
from o3dmark.registry import spec_of
from o3dmark.synthetic import SHAPES

SMALL = ("ant", "bimba", "cat", "cup", "flower", "vase")  # kept in the repository
LARGE = ("bunny", "horse", "venus")  # made on demand
FOLDER = Path(__file__).parent.parent / "data_synthetic"
TOLERANCE = 1e-9


def digest(mesh: TriangleMesh) -> str:
    """SHA-256 of the vertices, rounded to the tolerance, and of the triangles."""
    vertices, triangles = mesh_arrays(mesh)
    steps = np.rint(vertices / TOLERANCE).astype("<i8")
    return hashlib.sha256(steps.tobytes() + triangles.astype("<i4").tobytes()).hexdigest()


def entry(spec: str, mesh: TriangleMesh) -> dict[str, Any]:
    """What the manifest says of one mesh."""
    shape = SHAPES.make(spec)
    return {
        "spec": spec_of(shape),
        "seed": shape.seed,
        "vertices": len(mesh.vertices),
        "triangles": len(mesh.triangles),
        "sha256": digest(mesh),
        "open3d": o3d.__version__,
        "numpy": np.__version__,
    }


def differs(mesh: TriangleMesh, path: Path, expected: dict[str, Any]) -> str:
    """In what a new mesh is not the one in the file (without a file: in the manifest); empty if in nothing."""
    if not path.exists():
        return "" if digest(mesh) == expected["sha256"] else "its digest"
    made, kept = mesh_arrays(mesh), mesh_arrays(read_mesh(path))
    if len(made[0]) != len(kept[0]) or not np.array_equal(made[1], kept[1]):
        return "its triangles"
    return "" if np.abs(made[0] - kept[0]).max() <= TOLERANCE else "its vertices"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(SMALL + LARGE)}; all by default")
    parser.add_argument("--check", action="store_true", help="compare instead of writing")
    options = parser.parse_args()
    if unknown := set(options.names) - set(SMALL + LARGE):
        parser.error(f"no mesh is called {', '.join(sorted(unknown))}")
    manifest_path = FOLDER / "manifest.json"
    manifest = json.loads(manifest_path.read_text()) if manifest_path.exists() else {}
    failures = 0
    for name in options.names or SMALL + LARGE:
        file = f"{name}.ply" if name in SMALL else f"large/{name}.ply"
        mesh = SHAPES.make(name).build()
        verdict = f"{len(mesh.vertices)} vertices, {len(mesh.triangles)} triangles"
        if options.check:
            problem = (
                differs(mesh, FOLDER / file, manifest[file]) if file in manifest else "everything: not in the manifest"
            )
            verdict = f"differs in {problem}" if problem else "the same"
            failures += bool(problem)
        else:
            (FOLDER / file).parent.mkdir(exist_ok=True)
            write_mesh(FOLDER / file, mesh)
            manifest[file] = entry(name, mesh)
            manifest_path.write_text(json.dumps(manifest, indent=2, sort_keys=True) + "\n")
        print(f"{file}: {verdict}", flush=True)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
