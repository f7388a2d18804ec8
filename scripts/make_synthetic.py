"""Make the synthetic stand-ins for the paper's models, and the manifest that says what they are.

    python scripts/make_synthetic.py [NAME...] [--large] [--check]

The small ones go to data_synthetic/ and are kept in the repository; --large also makes bunny, horse and venus, in
data_synthetic/large/, which is not. --check builds the kept ones anew and compares them with the files: the same
triangles, the same vertices to 1e-9 (bit for bit only under the same versions of the libraries).
"""

import argparse
import hashlib
import json
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np

from o3dmark.files import read_mesh, write_mesh
from o3dmark.mesh import mesh_arrays
from o3dmark.registry import to_dict
from o3dmark.synthetic import SHAPES

FOLDER = Path(__file__).parent.parent / "data_synthetic"
SMALL = ("flower", "vase", "cup", "ant", "cat", "bimba")
LARGE = ("bunny", "horse", "venus")


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="only these")
    parser.add_argument("--large", action="store_true", help="bunny, horse and venus too")
    parser.add_argument("--check", action="store_true", help="compare, write nothing")
    options = parser.parse_args()
    names = options.names or (SMALL + LARGE if options.large else SMALL)
    if options.check:
        wrong = [name for name in names if not is_as_built(name)]
        print(f"differs: {', '.join(wrong)}" if wrong else "as built")
        return int(bool(wrong))
    entries = {name: made(name) for name in names}
    manifest = FOLDER / "manifest.json"
    kept = json.loads(manifest.read_text()) if manifest.exists() else {}
    kept |= {name: entry for name, entry in entries.items() if name in SMALL}
    manifest.write_text(json.dumps(kept, indent=2, sort_keys=True) + "\n")
    return 0


def path_of(name: str) -> Path:
    return (FOLDER if name in SMALL else FOLDER / "large") / f"{name}.ply"


def made(name: str) -> dict[str, object]:
    """Build a shape, write it, and say what it is."""
    shape, path = SHAPES.make(name), path_of(name)
    mesh = shape.build()
    path.parent.mkdir(exist_ok=True)
    write_mesh(path, mesh)
    print(f"{path.name}: {len(mesh.vertices)} vertices, {len(mesh.triangles)} triangles")
    return {
        "generator": to_dict(shape),
        "vertices": len(mesh.vertices),
        "triangles": len(mesh.triangles),
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "open3d": version("open3d"),
        "numpy": version("numpy"),
    }


def is_as_built(name: str) -> bool:
    vertices, triangles = mesh_arrays(read_mesh(path_of(name)))
    fresh, fresh_triangles = mesh_arrays(SHAPES.make(name).build())
    return np.array_equal(triangles, fresh_triangles) and bool(np.abs(vertices - fresh).max() < 1e-9)


if __name__ == "__main__":
    sys.exit(main())
