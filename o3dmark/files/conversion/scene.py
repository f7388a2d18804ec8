"""Assets as scenes of trimesh, which carries colours, normals, materials and textures from one format to another.

What trimesh reads badly is put right here: materials of OBJ files keep their names and do not become metal, pictures
keep their bytes, names of files cannot leave the folder.
"""

import io
import posixpath
import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import trimesh
from PIL import Image
from trimesh.resolvers import Resolver
from trimesh.visual.material import PBRMaterial, SimpleMaterial

from o3dmark.arrays import Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.files.asset import Asset
from o3dmark.files.conversion import gltf_floats, repack
from o3dmark.files.references import Source
from o3dmark.mesh import geometry

LOADED = (".obj", ".ply", ".glb", ".gltf")  # of these trimesh reads more than the shape
_SLOTS = ("baseColorTexture", "normalTexture", "occlusionTexture", "emissiveTexture", "metallicRoughnessTexture")
_LOOKS = [
    "name",
    "emissiveFactor",
    "baseColorFactor",
    "metallicFactor",
    "roughnessFactor",
    "doubleSided",
    "alphaMode",
    "alphaCutoff",
]
_KEPT_AS_THEY_ARE = {"PNG": "image/png", "JPEG": "image/jpeg"}
_OPTIONS = re.compile(r"(?:-[a-z]+\s+(?:(?:[\d.+-][\d.eE+-]*|on|off)\s+)*)+", re.IGNORECASE)
_FACE = re.compile(rb"^[ \t]*f[ \t].*$", re.MULTILINE)
_BARE_FACE = re.compile(rb"^[ \t]*f[ \t]+[+-]?\d+(?:[ \t]|//)", re.MULTILINE)
_COUNTS_BACK = re.compile(rb"^[ \t]*f[ \t].*[ /]-\d", re.MULTILINE)  # from the last vt, which would be another
_BARE_CORNER = re.compile(rb"(?<=[ \t])([+-]?\d+)(?:/(/[+-]?\d+)|/{0,2})(?=\s|$)")


@dataclass(frozen=True)
class Picture:
    """An image file as it was."""

    content: bytes
    kind: str

    @property
    def suffix(self) -> str:
        return ".jpg" if self.kind == "image/jpeg" else ".png"


@dataclass(frozen=True)
class Placed:
    """A mesh of a scene where it stands; normals (n, 3), if it has any, and what it wears."""

    name: str
    vertices: Floats
    triangles: Ints
    normals: Floats | None
    visual: Any


@dataclass
class Dressed:
    """A scene, the normals of its meshes, and the pictures of its materials.

    In place of pictures the materials have tokens, which `picture` tells. ``one_mesh``: its meshes are parts of one,
    which differ in material; ``named``: the names in it are those of the asset; ``materials``: so are the materials.
    """

    scene: trimesh.Scene
    one_mesh: bool = False
    named: bool = False
    materials: bool = False
    normals: dict[str, Floats] = field(default_factory=dict)
    pictures: list[Picture] = field(default_factory=list)

    def picture(self, token: Image.Image) -> Picture:
        red, green, blue = token.convert("RGB").getpixel((0, 0))
        return self.pictures[(red << 16) + (green << 8) + blue]

    def meshes(self) -> dict[str, trimesh.Trimesh]:
        return {name: mesh for name, mesh in self.scene.geometry.items() if isinstance(mesh, trimesh.Trimesh)}

    def placed(self) -> Iterator[Placed]:
        """All meshes, each at all its places."""
        meshes = self.meshes()
        for node in self.scene.graph.nodes_geometry:
            place, name = self.scene.graph[node]
            if name not in meshes:
                continue
            vertices, triangles, normals = meshes[name].vertices, meshes[name].faces, self.normals.get(name)
            if (place != np.eye(4)).any():
                linear = place[:3, :3]
                vertices = vertices @ linear.T + place[:3, 3]
                cofactors = np.cross(linear[[1, 2, 0]], linear[[2, 0, 1]])  # what turns normals, mirrored or not
                sign = -1.0 if np.linalg.det(linear) < 0.0 else 1.0
                triangles = triangles[:, :: int(sign)]
                normals = None if normals is None else geometry.unit(sign * normals @ cofactors.T)
            yield Placed(name, vertices, triangles, normals, meshes[name].visual)


def plain(asset: Asset) -> Dressed:
    """The shape alone, coincident vertices as one."""
    scene = trimesh.Scene()
    for part in asset.parts:
        kept, position = geometry.weld(part.vertices)
        mesh = trimesh.Trimesh(part.vertices[kept], position[part.triangles], process=False)
        name = scene.add_geometry(mesh, geom_name=part.name, node_name=part.name, transform=part.placements[0])
        for place in part.placements[1:]:
            scene.graph.update(f"{name} {len(scene.graph.nodes)}", matrix=place, geometry=scene.graph[name][1])
    return Dressed(scene, named="names" in asset.contents)


def loaded(asset: Asset, textures: bool) -> Dressed:
    """All that trimesh reads.

    Errors: of trimesh, any; with ``textures``, MeshError for a file that is missing or outside of the folder.
    """
    suffix = asset.path.suffix.lower()
    content, resolver = asset.source.read(), _Beside(asset.source)
    if suffix in (".glb", ".gltf"):
        packed = repack.packed(asset.source)
        gltf_floats.write_out(packed)
        content, suffix = packed.glb(), ".glb"
    elif suffix == ".obj":
        content = _textured_throughout(content)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of libraries among themselves
        scene = trimesh.load_scene(io.BytesIO(content), suffix[1:], resolver=resolver, process=False)
    if textures and resolver.failure is not None:
        raise resolver.failure
    scene.metadata.clear()
    for mesh in scene.geometry.values():
        mesh.metadata.clear()
    graph, contents = suffix == ".glb", asset.contents
    materials = bool(contents & {"materials", "textures"})
    dressed = Dressed(scene, one_mesh=not graph, named=graph and "names" in contents, materials=materials)
    for name, mesh in dressed.meshes().items():
        if "vertex_normals" in mesh._cache.cache:  # given, not computed; trimesh forgets them on the next occasion
            dressed.normals[name] = np.array(mesh.vertex_normals)
    _take_pictures(dressed)
    return dressed


def _textured_throughout(content: bytes) -> bytes:
    """An OBJ file that is textured in part, with texture coordinates at all corners of its faces.

    trimesh leaves them all out where one is missing. Those added are 0 0, which is what programs draw there.
    """
    count = len(re.findall(rb"^vt[ \t]", content, re.MULTILINE))
    if not count or not _BARE_FACE.search(content) or _COUNTS_BACK.search(content):
        return content

    def complete(line: re.Match[bytes]) -> bytes:
        return _BARE_CORNER.sub(rb"\1/%d\2" % (count + 1), line[0])

    return _FACE.sub(complete, content) + b"\nvt 0 0\n"


class _Beside(Resolver):  # type: ignore[misc]
    """Gives trimesh the files beside an asset, and remembers why it could not: trimesh goes on without."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.failure: MeshError | None = None
        self._folder = ""

    def get(self, name: str) -> bytes:
        name = _OPTIONS.sub("", name.strip(), count=1).replace("\\", "/") if name.startswith("-") else name
        places = dict.fromkeys((name, posixpath.normpath(posixpath.join(self._folder, name))))
        for place in places:
            try:
                content = self.source.beside(place)
                self._folder = posixpath.dirname(place) if place.lower().endswith(".mtl") else self._folder
                return content
            except MeshError as error:
                failure = error
        self.failure = self.failure or failure
        raise FileNotFoundError(name)

    def keys(self) -> list[str]:
        return []

    def write(self, name: str, data: bytes) -> None:
        raise NotImplementedError

    def namespaced(self, namespace: str) -> Resolver:
        raise NotImplementedError


def _take_pictures(dressed: Dressed) -> None:
    """Make all materials physically based, with tokens for pictures, or without where nothing says how they lie."""
    tokens: dict[int, Image.Image] = {}
    materials: dict[tuple[int, bool], PBRMaterial] = {}
    olds = [getattr(mesh.visual, "material", None) for mesh in dressed.meshes().values()]
    for mesh, old in zip(dressed.meshes().values(), olds, strict=True):
        if old is None:
            continue
        laid = mesh.visual.uv is not None and len(mesh.visual.uv) == len(mesh.vertices)
        if (id(old), laid) not in materials:
            materials[id(old), laid] = new = _physical(old) if isinstance(old, SimpleMaterial) else _copied(old)
            for slot in _SLOTS:
                image = getattr(new, slot)
                if image is None:
                    continue
                if not laid or image.format is None:  # made by trimesh where there is none
                    setattr(new, slot, None)
                    continue
                if id(image) not in tokens:
                    tokens[id(image)] = _token(len(dressed.pictures))
                    dressed.pictures.append(_picture(image))
                setattr(new, slot, tokens[id(image)])
        mesh.visual.material = materials[id(old), laid]


def _token(number: int) -> Image.Image:
    return Image.new("RGB", (1, 1), (number >> 16, number >> 8 & 255, number & 255))


def _picture(image: Image.Image) -> Picture:
    """The bytes that an image was read from; as PNG where glTF and the web know no such format."""
    stream = getattr(image, "fp", None)
    if image.format in _KEPT_AS_THEY_ARE and stream is not None:
        stream.seek(0)
        return Picture(stream.read(), _KEPT_AS_THEY_ARE[image.format])
    out = io.BytesIO()
    image.save(out, "PNG")
    return Picture(out.getvalue(), "image/png")


def _copied(old: PBRMaterial) -> PBRMaterial:
    """A material with the same images; trimesh's own copy forgets what files they are."""
    return PBRMaterial(**{name: getattr(old, name) for name in (*_LOOKS, *_SLOTS)})


def _physical(old: SimpleMaterial) -> PBRMaterial:
    """An OBJ material in the terms of glTF: not metal, as rough as its exponent says, white unless it has a colour."""
    colour = np.ones(4)
    if "kd" in old.kwargs:
        colour[:3] = np.atleast_1d(old.kwargs["kd"])[:3]
    opacity = next((float(old.kwargs[key][0]) for key in ("d",) if key in old.kwargs), 1.0)
    opacity = 1.0 - float(old.kwargs["tr"][0]) if "tr" in old.kwargs and "d" not in old.kwargs else opacity
    colour[3] = opacity
    return PBRMaterial(
        name=old.name,
        baseColorFactor=np.clip(colour, 0.0, 1.0),
        baseColorTexture=old.image,
        metallicFactor=0.0,
        roughnessFactor=float((2.0 / (old.glossiness + 2.0)) ** 0.25),
        alphaMode="BLEND" if opacity < 1.0 else None,
    )
