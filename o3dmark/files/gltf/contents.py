"""What is in a glTF beside positions and triangles, in the words of `asset.KINDS`; and which extensions are known."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from o3dmark.errors import MeshError
from o3dmark.files.gltf.json_fields import Fields

# Extensions that change nothing about where vertices stand, or that are understood here.
_STORAGE = {
    "KHR_mesh_quantization",
    "KHR_draco_mesh_compression",
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
}
_HARMLESS = {
    "EXT_mesh_gpu_instancing",
    "EXT_mesh_features",
    "EXT_instance_features",
    "EXT_structural_metadata",
    "EXT_lights_ies",
    "EXT_lights_image_based",
    "KHR_animation_pointer",
    "KHR_lights_punctual",
    "KHR_node_visibility",
    "KHR_node_selectability",
    "KHR_node_hoverability",
    "KHR_techniques_webgl",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "MSFT_lod",
    "MSFT_texture_dds",
    "FB_ngon_encoding",
    "CESIUM_RTC",
    "CESIUM_primitive_outline",
    "AGI_articulations",
    "AGI_stk_metadata",
    "VRM",
    "VRMC_vrm",
    "VRMC_springBone",
    "VRMC_node_constraint",
}
_HARMLESS_FAMILIES = ("KHR_materials_", "KHR_texture_", "EXT_materials_", "EXT_texture_", "VRMC_materials_")
_IN_OTHER_WORDS = _STORAGE | {"EXT_mesh_gpu_instancing", "KHR_lights_punctual"}  # nodes and lights

_ATTRIBUTES = {"NORMAL": "normals", "TANGENT": "tangents", "TEXCOORD_0": "texture coordinates", "POSITION": ""}
_FAMILIES = {
    "TEXCOORD": "second texture coordinates",
    "COLOR": "vertex colours",
    "JOINTS": "skins",
    "WEIGHTS": "skins",
}
_LISTS = ("materials", "skins", "animations", "cameras")
_MODES = {0: "points", 1: "lines", 2: "lines", 3: "lines"}


def check_extensions(root: Fields) -> None:
    """Errors: MeshError for a required extension that nobody here knows."""
    for name in root.texts("extensionsRequired"):
        if name not in _STORAGE | _HARMLESS and not name.startswith(_HARMLESS_FAMILIES):
            raise MeshError(
                f"{root.where} cannot be read without its extension {name!r}, which is not known here;"
                " export it again without that extension"
            )


def contents(root: Fields, value: dict[str, Any]) -> frozenset[str]:
    """The words for a file whose JSON is ``value``, or ``root``."""
    words = {name for name in _LISTS if value.get(name)}
    meshes, nodes = root.parts("meshes", "mesh"), root.parts("nodes", "node")
    words |= {word for mesh in meshes for word in _of_mesh(mesh)}
    words |= {"textures"} if value.get("textures") or value.get("images") else set()
    words |= {"names"} if any("name" in each for each in (*meshes, *nodes)) else set()
    words |= {"several meshes"} if len(meshes) > 1 else set()
    words |= {"nodes"} if any(map(_is_moved, nodes)) else set()
    asset = root.part("asset")
    words |= {"metadata"} if any(name not in ("version", "minVersion", "generator") for name in asset) else set()
    keys = set(_keys(value))
    words |= {"metadata"} if ("extras", None) in keys else set()
    extensions = {inner for outer, inner in keys if outer == "extensions" and inner} | set(root.texts("extensionsUsed"))
    words |= {f"extension {name}" for name in extensions - _IN_OTHER_WORDS}
    words |= {"lights"} if "KHR_lights_punctual" in extensions else set()
    words |= {"nodes"} if "EXT_mesh_gpu_instancing" in extensions else set()
    return frozenset(words)


def _of_mesh(mesh: Fields) -> Iterator[str]:
    for primitive in mesh.parts("primitives", "primitive"):
        for name in primitive.part("attributes"):
            word = _ATTRIBUTES.get(name, _FAMILIES.get(name.partition("_")[0], f"attribute {name}"))
            if word:
                yield word
        if primitive.parts("targets", "target"):
            yield "morph targets"
        if word := _MODES.get(primitive.whole("mode", 4), ""):
            yield word


def _is_moved(node: Fields) -> bool:
    """Whether a node has children, or a transform other than none."""
    identity = np.eye(4).ravel().tolist()
    return (
        "children" in node
        or node.floats("matrix", identity) != identity
        or node.floats("translation", (0, 0, 0)) != [0, 0, 0]
        or node.floats("rotation", (0, 0, 0, 1)) != [0, 0, 0, 1]
        or node.floats("scale", (1, 1, 1)) != [1, 1, 1]
    )


def _keys(value: Any) -> Iterator[tuple[str, str | None]]:
    """Every key of a JSON value with None, and with each of the keys that the object under it has."""
    waiting = [value]
    while waiting:
        here = waiting.pop()
        if isinstance(here, list):
            waiting += here
        elif isinstance(here, dict):
            for key, inner in here.items():
                yield key, None
                if key == "extensions" and isinstance(inner, dict):
                    yield from ((key, name) for name in inner)
                if isinstance(inner, dict | list):
                    waiting.append(inner)
