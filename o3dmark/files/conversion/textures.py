"""Which textures materials use, and for what: counted, so that a conversion cannot lose one of several in silence."""

import re
from collections.abc import Iterator
from typing import TypeAlias

from o3dmark.errors import MeshError
from o3dmark.files.asset import Asset
from o3dmark.files.conversion import repack

COLOUR = "colour"

Use: TypeAlias = tuple[str, str]
"""What a texture is for, and the picture: its name, or its number."""

_MTL = re.compile(
    rb"^[ \t]*(newmtl|map_\w+|bump|disp|decal|refl|norm)[ \t]+(\S.*?)[ \t\r]*$", re.MULTILINE | re.IGNORECASE
)
_USED = re.compile(rb"^[ \t]*usemtl[ \t]+(\S.*?)[ \t\r]*$", re.MULTILINE)
_TEXTURE_FILE = re.compile(rb"^comment TextureFile[ \t]+(\S.*?)[ \t\r]*$", re.MULTILINE | re.IGNORECASE)
_HEADER = 65_536  # bytes of a PLY file that its header is in
_SAME = {  # what OBJ and glTF call alike
    "map_kd": COLOUR,
    "basecolortexture": COLOUR,
    "map_ke": "glow",
    "emissivetexture": "glow",
    "norm": "normals",
    "normaltexture": "normals",
}


def texture_uses(asset: Asset) -> dict[str, set[str]]:
    """For each purpose that textures have, by the word of the format, the pictures; none where nothing says how they
    lie on the mesh."""
    if "texture coordinates" not in asset.contents:
        return {}
    readers = {".obj": _of_obj, ".ply": _of_ply, ".glb": _of_gltf, ".gltf": _of_gltf}
    found: dict[str, set[str]] = {}
    for purpose, picture in readers.get(asset.path.suffix.lower(), _of_none)(asset):
        found.setdefault(purpose, set()).add(picture)
    return found


def purpose(word: str) -> str:
    """What the word of a format for a texture is for; the word itself where only one format has it."""
    return _SAME.get(word.lower(), word)


def _of_none(_asset: Asset) -> Iterator[Use]:
    return iter(())


def _of_obj(asset: Asset) -> Iterator[Use]:
    used = set(_USED.findall(asset.source.read()))
    for name in asset.references:
        if not name.lower().endswith(".mtl"):
            continue
        try:
            library = asset.source.beside(name)
        except MeshError:
            continue
        material = b""
        for word, rest in _MTL.findall(library):
            if word.lower() == b"newmtl":
                material = rest
            elif material in used:
                yield word.decode(), rest.decode("utf-8", "replace")


def _of_ply(asset: Asset) -> Iterator[Use]:
    header = asset.source.read()[:_HEADER].partition(b"end_header")[0]
    for name in _TEXTURE_FILE.findall(header):
        yield "map_Kd", name.decode("utf-8", "replace")


def _of_gltf(asset: Asset) -> Iterator[Use]:
    tree = repack.packed(asset.source).tree
    for material in tree.get("materials", []):
        for word, texture in {**material, **material.get("pbrMetallicRoughness", {})}.items():
            if word.endswith("Texture") and isinstance(texture, dict):
                yield word, str(_image(tree["textures"][texture["index"]]))


def _image(texture: dict[str, object]) -> object:
    """The number of the image of a texture, which some extensions keep in their own words."""
    extensions = texture.get("extensions")
    others = [each.get("source") for each in extensions.values()] if isinstance(extensions, dict) else []
    return next((number for number in [*others, texture.get("source")] if number is not None), None)
