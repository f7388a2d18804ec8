"""PLY, read by Open3D under the counts of its own header: Open3D returns the first part of a truncated file."""

from pathlib import Path

from o3dmark.errors import MeshError
from o3dmark.files import _open3d
from o3dmark.files._parsing import check_size, fewer
from o3dmark.mesh.surface import TriangleMesh

_HEADER_BYTES = 65536  # in which a header must end
_SIZES = {
    **dict.fromkeys(("char", "uchar", "int8", "uint8"), 1),
    **dict.fromkeys(("short", "ushort", "int16", "uint16"), 2),
    **dict.fromkeys(("int", "uint", "float", "int32", "uint32", "float32"), 4),
    **dict.fromkeys(("double", "float64"), 8),
}


def read(path: Path) -> TriangleMesh:
    """The mesh in a PLY file, in double precision where the file has it. Errors: MeshError for a damaged file."""
    vertices, faces = counts(path)
    mesh = _open3d.read(path)
    if len(mesh.vertices) < vertices or len(mesh.triangles) < faces:  # more triangles than faces: polygons
        raise fewer(path, (vertices, faces), (len(mesh.vertices), len(mesh.triangles)))
    return mesh


def counts(path: Path) -> tuple[int, int]:
    """(vertices, faces) as the header says. Errors: MeshError for another kind of file, or one too small for them."""
    with path.open("rb") as file:
        start = file.read(_HEADER_BYTES)
    head, found, _ = start.partition(b"end_header")
    if not start.startswith(b"ply") or not found:
        raise MeshError(f"{path.name} does not begin like a PLY file")
    announced, least, element = {"vertex": 0, "face": 0}, len(head) + len(b"end_header"), ""
    sizes = _SIZES if b"format ascii" not in head else dict.fromkeys(_SIZES, 2)  # a digit and a space
    for line in head.decode("ascii", "replace").splitlines():
        match line.split():
            case ["element", element, count]:
                announced[element] = int(count) if count.isdigit() else 0
            case ["property", "list", count_type, item_type, name]:
                corners = 3 if name.startswith("vertex_ind") else 0  # other lists may be empty
                least += announced[element] * (sizes.get(count_type, 1) + corners * sizes.get(item_type, 1))
            case ["property", kind, _]:
                least += announced[element] * sizes.get(kind, 1)
    check_size(path, least)
    return announced["vertex"], announced["face"]
