"""Two mesh files as trimesh and assimp read them: a program of its own, for it may crash.

    python readers.py READER BEFORE AFTER

One JSON object on stdout: ``before`` and ``after``, [vertices, faces] of each mesh; ``materials``, how many each has;
``motion``, by how much a coordinate differs at most, or null when the counts do; ``largest`` coordinate.
Or only ``refusals``, the reader's words, where it does not read one of them, or both.
"""

import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent / "python_modules"))


def by_trimesh(path: str) -> tuple[list[Any], int]:
    """Meshes as (vertices (n, 3), number of faces), and how many materials there are."""
    import trimesh

    scene = trimesh.load_scene(path, process=False)
    meshes = [mesh for mesh in scene.geometry.values() if isinstance(mesh, trimesh.Trimesh)]
    materials = {id(mesh.visual.material) for mesh in meshes if hasattr(mesh.visual, "material")}
    return [(np.asarray(mesh.vertices), len(mesh.faces)) for mesh in meshes], len(materials)


def by_assimp(path: str) -> tuple[list[Any], int]:
    """As `by_trimesh`."""
    import assimp_py

    scene = assimp_py.import_file(path, assimp_py.Process_Triangulate)
    meshes = [(np.array(mesh.vertices, np.float64).reshape(-1, 3), mesh.num_faces) for mesh in scene.meshes]
    return meshes, scene.num_materials


READERS = {"trimesh": by_trimesh, "assimp_py": by_assimp}


def main(reader: str, before: str, after: str) -> None:
    refusals, read = [], []
    for path in (before, after):
        try:
            read.append(READERS[reader](path))
        except Exception as error:  # whatever stops a reader
            refusals.append(f"{type(error).__name__}: {error}".splitlines()[0].replace(path, Path(path).name))
    if refusals:
        print(json.dumps({"refusals": refusals}))
        return
    (was, materials), (now, others) = read
    counts = [[[len(vertices), faces] for vertices, faces in meshes] for meshes in (was, now)]
    motion = None
    if counts[0] == counts[1]:
        motion = _largest(a - b for (a, _), (b, _) in zip(was, now, strict=True))
    largest = _largest(vertices for vertices, _ in was)
    seen = {"before": counts[0], "after": counts[1], "materials": [materials, others]}
    print(json.dumps(seen | {"motion": motion, "largest": largest}))


def _largest(arrays: Iterable[Any]) -> float:
    return max((float(np.abs(array).max()) for array in arrays if len(array)), default=0.0)


if __name__ == "__main__":
    main(*sys.argv[1:])
