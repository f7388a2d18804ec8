"""Scenes of trimesh as files: GLB through trimesh's own exporter, OBJ and PLY with all digits of their positions."""

import io
import re
from collections.abc import Container, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from PIL import Image
from trimesh.exchange.gltf import export_glb

from o3dmark.arrays import AnyArray, Bits, Floats, Ints
from o3dmark.files.conversion.repack import packed
from o3dmark.files.conversion.scene import Dressed, Placed
from o3dmark.files.references import Source
from o3dmark.mesh import geometry

_CHANNELS = ("red", "green", "blue", "alpha")
_TYPES = {"<f8": "double", "<f4": "float", "|u1": "uchar"}
_FAR = 1e-7  # of the diagonal: where float32 is coarser than this, the mesh moves to the origin, and its node back


def files(dressed: Dressed, suffix: str, stem: str) -> dict[str, bytes]:
    """A scene as a file of that ending, and those beside it."""
    if suffix == ".obj":
        return obj(dressed, stem)
    if suffix == ".ply":
        return {f"{stem}.ply": ply(dressed)}
    content = glb(dressed)
    name = f"{stem}.glb"
    return {name: content} if suffix == ".glb" else packed(Source(Path(name), {name: content})).gltf(stem)


def glb(dressed: Dressed) -> bytes:
    """A GLB: positions near the origin, so that float32 holds them, and one mesh for what was one."""
    for name in dressed.meshes():
        _split_face_colours(dressed, name)
    _bring_near(dressed)
    for name, normals in dressed.normals.items():
        dressed.scene.geometry[name].vertex_normals = normals

    def finish(tree: dict[str, Any]) -> None:
        if dressed.one_mesh:
            _join(tree)
        if not dressed.named:
            for item in (*tree.get("meshes", []), *tree.get("nodes", [])):
                item.pop("name", None)
        for mesh in tree.get("meshes", []):
            if not mesh.get("extras", True):
                del mesh["extras"]

    def put_pictures(buffers: dict[Any, bytes], tree: dict[str, Any]) -> None:
        keys = list(buffers)
        for image in tree["images"]:
            picture = dressed.picture(Image.open(io.BytesIO(buffers[keys[image["bufferView"]]])))
            buffers[keys[image["bufferView"]]] = picture.content + bytes(-len(picture.content) % 4)
            image["mimeType"] = picture.kind

    return export_glb(dressed.scene, tree_postprocessor=finish, buffer_postprocessor=put_pictures)


def obj(dressed: Dressed, stem: str) -> dict[str, bytes]:
    """An OBJ file, its material library and its pictures."""
    beside: dict[str, bytes] = {}
    library: dict[str, str] = {}  # by the names of materials
    lines, names, before = [], dict[int, str](), np.zeros(3, np.int64)
    for mesh in dressed.placed():
        lines += [f"o {_word(mesh.name)}\n"] if dressed.named else []
        material = getattr(mesh.visual, "material", None) if dressed.materials else None
        if material is not None:
            name = names.setdefault(id(material), _unique(_word(material.name or "material"), library))
            library.setdefault(name, _mtl(dressed, material, name, stem, beside))
            lines += [f"usemtl {name}\n"]
        lines += _rows_of_obj(mesh, before)
    if library:
        lines.insert(0, f"mtllib {stem}.mtl\n")
        beside[f"{stem}.mtl"] = "\n".join(library.values()).encode()
    return {f"{stem}.obj": "".join(lines).encode(), **beside}


def ply(dressed: Dressed) -> bytes:
    """A binary PLY: one mesh, positions in double precision; normals and colours where all of its meshes have them."""
    meshes = list(dressed.placed())
    tables = [_columns_of_ply(mesh) for mesh in meshes]
    names = [name for name in tables[0] if all(name in table for table in tables)]
    vertices = np.empty(sum(len(mesh.vertices) for mesh in meshes), [(name, tables[0][name].dtype) for name in names])
    for name in names:
        vertices[name] = np.concatenate([table[name] for table in tables])
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    triangles = np.concatenate([mesh.triangles + start for mesh, start in zip(meshes, starts, strict=False)])
    kept, position = geometry.weld(np.column_stack([vertices[name].astype(np.float64) for name in names]))
    colours = [mesh.visual.face_colors for mesh in meshes if mesh.visual.kind == "face"]
    channels = _CHANNELS if len(colours) == len(meshes) else ()
    faces = np.empty(len(triangles), [("count", "u1"), ("corners", "<i4", 3), *((name, "u1") for name in channels)])
    faces["count"], faces["corners"] = 3, position[triangles]
    for channel, name in enumerate(channels):
        faces[name] = np.concatenate(colours)[:, channel]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(kept)}"]
    header += [f"property {_TYPES[vertices[name].dtype.str]} {name}" for name in names]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    header += [f"property uchar {name}" for name in channels]
    return "\n".join([*header, "end_header\n"]).encode() + vertices[kept].tobytes() + faces.tobytes()


def _columns_of_ply(mesh: Placed) -> dict[str, AnyArray]:
    columns: dict[str, AnyArray] = dict(zip("xyz", mesh.vertices.astype("<f8").T, strict=True))
    if mesh.normals is not None:
        columns.update(zip(("nx", "ny", "nz"), mesh.normals.astype("<f4").T, strict=True))
    colours = _colours(mesh.visual, len(mesh.vertices))
    if colours is not None:
        columns.update(zip(_CHANNELS, colours.T, strict=True))
    return columns


def _rows_of_obj(mesh: Placed, before: Ints) -> Iterator[str]:
    """The lines of a mesh; ``before``: how many v, vt and vn there are already, which is brought up to date."""
    vertices, triangles, normals, visual = mesh.vertices, mesh.triangles, mesh.normals, mesh.visual
    uv = getattr(visual, "uv", None)
    colours = _colours(visual, len(vertices))
    if visual.kind == "face":  # corners of its own for each face, in its colour
        colours = np.repeat(visual.face_colors, 3, axis=0)
        vertices, normals = vertices[triangles].reshape(-1, 3), None
        triangles = np.arange(triangles.size).reshape(-1, 3)
    yield _lines("v", vertices if colours is None else np.column_stack([vertices, colours[:, :3] / 255.0]))
    used = [True, uv is not None and len(uv) == len(vertices), normals is not None]
    if uv is not None and used[1]:
        yield _lines("vt", uv[:, :2])
    if normals is not None:
        yield _lines("vn", normals)
    form = ("%d", "%d//%d", "%d/%d", "%d/%d/%d")[2 * used[1] + used[2]]
    corners = np.repeat((triangles + 1).reshape(-1, 1), 3, axis=1) + before
    before += np.where(used, len(vertices), 0)
    yield ("f " + " ".join([form] * 3) + "\n") * len(triangles) % tuple(corners[:, used].ravel().tolist())


def _lines(word: str, rows: Floats) -> str:
    """Rows of numbers (n, d), each with as many digits as tell it from all others."""
    return (word + " %r" * rows.shape[1] + "\n") * len(rows) % tuple(np.asarray(rows, np.float64).ravel().tolist())


def _mtl(dressed: Dressed, material: Any, name: str, stem: str, beside: dict[str, bytes]) -> str:
    """A material of an MTL library; its pictures go beside it."""
    colour = np.ones(4) if material.baseColorFactor is None else np.asarray(material.baseColorFactor) / 255.0
    lines = [f"newmtl {name}", "Kd {:.6g} {:.6g} {:.6g}".format(*colour[:3]), f"d {colour[3]:.6g}"]
    for keyword, slot in (("map_Kd", "baseColorTexture"), ("map_Ke", "emissiveTexture"), ("norm", "normalTexture")):
        token = getattr(material, slot, None)
        if token is not None:
            picture = dressed.picture(token)
            number = dressed.pictures.index(picture)
            file = f"{stem}{number or ''}{picture.suffix}"
            beside[file] = picture.content
            lines.append(f"{keyword} {file}")
    return "\n".join([*lines, ""])


def _colours(visual: Any, count: int) -> Bits | None:
    """Colours of the vertices (n, 4), if they have any of their own."""
    colours = visual.vertex_colors if visual.kind == "vertex" else None
    if colours is None and hasattr(visual, "vertex_attributes"):
        colours = visual.vertex_attributes.get("color")
    return None if colours is None or len(colours) != count else trimesh.visual.color.to_rgba(colours)


def _split_face_colours(dressed: Dressed, name: str) -> None:
    """Give each face corners of its own in its colour, where colours are those of faces."""
    mesh = dressed.scene.geometry[name]
    if mesh.visual.kind == "face":
        corners = mesh.vertices[mesh.faces].reshape(-1, 3)
        colours = np.repeat(mesh.visual.face_colors, 3, axis=0)
        triangles = np.arange(len(corners)).reshape(-1, 3)
        dressed.scene.geometry[name] = trimesh.Trimesh(corners, triangles, vertex_colors=colours, process=False)
        dressed.normals.pop(name, None)


def _bring_near(dressed: Dressed) -> None:
    """Move meshes whose positions float32 would blur to the origin, and their nodes back: nodes have double precision.

    What is one mesh moves as one. Nodes stand in no other.
    """
    scene, nodes = dressed.scene, dressed.scene.graph.nodes_geometry
    whole = np.concatenate([mesh.bounds for mesh in dressed.meshes().values() if len(mesh.vertices)])
    moves = {}
    for name, mesh in dressed.meshes().items():
        bounds = whole if dressed.one_mesh else mesh.bounds
        if bounds is None:
            continue
        step = np.spacing(np.abs(bounds).max().astype(np.float32))
        if step > _FAR * np.linalg.norm(np.ptp(bounds, axis=0)):
            moves[name] = np.round(bounds.mean(axis=0))
    for node in nodes:
        place, name = scene.graph[node]
        if name in moves:
            back = np.eye(4)
            back[:3, 3] = moves[name]
            scene.graph.update(node, matrix=place @ back, geometry=name)
    for name, move in moves.items():
        scene.geometry[name].vertices = scene.geometry[name].vertices - move


def _join(tree: dict[str, Any]) -> None:
    """All meshes as primitives of one, where they all stand at the same place."""
    nodes = [node for node in tree.get("nodes", []) if "mesh" in node]
    if nodes:
        primitives = [primitive for mesh in tree["meshes"] for primitive in mesh["primitives"]]
        tree["meshes"] = [{"primitives": primitives}]
        tree["nodes"] = [{key: value for key, value in nodes[0].items() if key in ("matrix", "translation")}]
        tree["nodes"][0]["mesh"] = 0
        tree["scenes"] = [{"nodes": [0]}]


def _word(name: str) -> str:
    """A name that ends with its line."""
    return re.sub(r"[\s\x00-\x1f]+", " ", str(name)).strip() or "unnamed"


def _unique(name: str, taken: Container[str]) -> str:
    number, found = 1, name
    while found in taken:
        number += 1
        found = f"{name} {number}"
    return found
