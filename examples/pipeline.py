"""An Open3D pipeline that marks what it ships: read, clean, mark, simplify, read back; for every mesh of a folder.

    python examples/pipeline.py [FOLDER] [--out OUT]

Without FOLDER three synthetic meshes are made. Each level of detail goes to OUT as a PLY, beside the key that reads it.
"""

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path

import open3d as o3d
from rich.progress import track

import o3dmark

FACES = 6000  # of the level of detail


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--out", type=Path, default=Path("marked"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    key, mark = o3dmark.Key.generate(), o3dmark.Watermark()
    key.save(options.out / "owner.key")
    meshes = list(meshes_in(options.folder or synthetic()))
    for path in track(meshes, description="marking"):
        mesh = cleaned(o3dmark.read_mesh(path))
        try:
            marked = mark.embed(mesh, "mine", key)
        except o3dmark.MeshError as error:  # too small, too thin: the reason says so
            print(f"{path.name}: left as it is: {error}")
            continue
        shipped = marked.simplify_quadric_decimation(FACES)
        o3dmark.write_mesh(options.out / f"{path.stem}.ply", shipped)
        print(path.name, mark.extract(shipped, key))


def cleaned(mesh: o3d.geometry.TriangleMesh) -> o3d.geometry.TriangleMesh:
    """What a pipeline does before: here, Open3D's own filters."""
    mesh.remove_degenerate_triangles()
    mesh.remove_unreferenced_vertices()
    mesh.compute_vertex_normals()
    return mesh


def meshes_in(folder: Path) -> Iterator[Path]:
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() in (".ply", ".obj", ".off", ".stl", ".glb", ".gltf"):
            yield path


def synthetic() -> Path:
    """A folder of three test shapes."""
    folder = Path(tempfile.mkdtemp())
    for name in ("bimba", "cup", "cat"):
        o3dmark.write_mesh(folder / f"{name}.ply", o3dmark.SHAPES.make(name).build())
    return folder


if __name__ == "__main__":
    main()
