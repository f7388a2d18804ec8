"""GLB files such as people have, made from the synthetic bust: all hold a mark, each has one speciality."""

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
from glb import INDICES, VERTICES, Glb, single

from o3dmark.arrays import AnyArray, Floats, Ints
from o3dmark.files import read_mesh
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import mesh_arrays

BODY = Path(__file__).parents[2] / "data_synthetic" / "bimba.ply"
QUANTISED = "KHR_mesh_quantization"
NECK = 0.45  # of the height: above it the second joint turns
STEPS = 2**14 - 1  # of positions in KHR_mesh_quantization, as gltfpack has them


def body() -> tuple[Floats, Ints, Floats]:
    """The bust: vertices (n, 3), triangles (m, 3), unit normals (n, 3)."""
    vertices, triangles = mesh_arrays(read_mesh(BODY))
    return vertices, triangles, geometry.unit(geometry.vertex_area_vectors(vertices, triangles))


def plain() -> bytes:
    """Positions, normals, triangles."""
    glb = Glb(nodes=[{"mesh": 0}])
    glb.document["meshes"] = [{"primitives": [glb.primitive(*_narrow(*body()))]}]
    return glb.bytes()


def two_primitives() -> bytes:
    """One mesh of two materials, each with vertices of its own, which coincide where they meet."""
    materials = [{"name": name, "pbrMetallicRoughness": {"roughnessFactor": 0.6}} for name in ("skin", "cloth")]
    glb = Glb(nodes=[{"mesh": 0, "name": "bust"}], materials=materials)
    vertices, triangles, normals = body()
    upper = _height(vertices)[triangles].mean(axis=1) > NECK
    primitives = []
    for number, faces in enumerate((triangles[upper], triangles[~upper])):
        used, corners = np.unique(faces, return_inverse=True)
        here = glb.primitive(single(vertices[used]), corners.reshape(-1, 3), normals[used])
        primitives.append(here | {"material": number})
    glb.document["meshes"] = [{"primitives": primitives}]
    return glb.bytes()


def quantised() -> bytes:
    """Positions of 14 bits in two bytes, as gltfpack writes them; the node scales them back."""
    vertices, triangles, normals = body()
    low, scale = vertices.min(axis=0), float(np.ptp(vertices, axis=0).max()) / STEPS
    node = {"mesh": 0, "translation": low.tolist(), "scale": [scale] * 3}
    glb = Glb(nodes=[node], extensionsUsed=[QUANTISED], extensionsRequired=[QUANTISED])
    attributes = {
        "POSITION": glb.positions(np.rint((vertices - low) / scale).astype(np.uint16)),
        "NORMAL": glb.accessor(np.rint(127 * normals).astype(np.int8), VERTICES, normalized=True),
    }
    indices = glb.accessor(triangles.ravel().astype(np.uint32), INDICES)
    glb.document["meshes"] = [{"primitives": [{"attributes": attributes, "indices": indices}]}]
    return glb.bytes()


def morph() -> bytes:
    """Two named targets of positions, one of them on show."""
    glb = Glb(nodes=[{"mesh": 0}])
    vertices, triangles, normals = body()
    primitive = glb.primitive(*_narrow(vertices, triangles, normals))
    bulge = 0.05 * normals * (_height(vertices)[:, None] > NECK)
    primitive["targets"] = [{"POSITION": glb.positions(single(shift))} for shift in (bulge, -0.5 * bulge)]
    names = {"targetNames": ["full", "thin"]}
    glb.document["meshes"] = [{"primitives": [primitive], "weights": [0.3, 0.0], "extras": names}]
    return glb.bytes()


def instances() -> bytes:
    """One mesh at four nodes: far away, turned, mirrored, in a hierarchy."""
    nodes: list[dict[str, Any]] = [
        {"name": "all", "children": [1, 2, 3, 4]},
        {"mesh": 0},
        {"mesh": 0, "translation": [3, 0, 0], "rotation": [0, 0.6, 0, 0.8]},
        {"mesh": 0, "translation": [-3, 0, 0], "scale": [-1, 1, 1]},
        {"mesh": 0, "translation": [0, 0, 3], "scale": [0.5, 0.5, 0.5]},
    ]
    glb = Glb(nodes=nodes)
    glb.document["meshes"] = [{"primitives": [glb.primitive(*_narrow(*body()))]}]
    return glb.bytes()


def rigged() -> bytes:
    """Two joints, weights, an animation of the upper one, and a picture on a surface with a seam."""
    vertices, triangles, uv = _unrolled(*body()[:2])
    normals = _smooth_normals(vertices, triangles)
    height = _height(vertices)
    share = np.clip((height - NECK + 0.1) / 0.2, 0.0, 1.0)
    neck = float(vertices[:, 1].min() + NECK * np.ptp(vertices[:, 1]))
    nodes = [
        {"name": "bust", "mesh": 0, "skin": 0},
        {"name": "shoulders", "children": [2]},
        {"name": "head", "translation": [0, neck, 0]},
    ]
    glb = Glb(nodes=nodes, scenes=[{"nodes": [0, 1]}])
    weights = np.zeros((len(vertices), 4))
    weights[:, 0], weights[:, 1] = 1.0 - share, share
    primitive = glb.primitive(
        *_narrow(vertices, triangles, normals),
        TEXCOORD_0=glb.accessor(single(uv), VERTICES),
        JOINTS_0=glb.accessor(np.array([0, 1, 0, 0], np.uint8) * (weights > 0), VERTICES),
        WEIGHTS_0=glb.accessor(single(weights), VERTICES),
    )
    glb.document["meshes"] = [{"name": "bust", "primitives": [primitive | {"material": 0}]}]
    _texture(glb)
    inverse = np.tile(np.eye(4), (2, 1, 1))
    inverse[1, 3, 1] = -neck  # column-major: the translation stands in the last row
    glb.document["skins"] = [{"joints": [1, 2], "inverseBindMatrices": glb.accessor(single(inverse))}]
    _animation(glb)
    return glb.bytes()


def _texture(glb: Glb) -> None:
    """A chequered picture as a PNG, and the material that wears it."""
    v, u = np.meshgrid(*[np.arange(256) / 256] * 2, indexing="ij")
    checks = (np.floor(16 * u) + np.floor(16 * v)) % 2
    colours = np.where(checks[..., None], (0.92, 0.88, 0.80), (0.35 + 0.3 * v)[..., None] + (0.0, 0.12, 0.25))
    png = io.BytesIO()
    matplotlib.image.imsave(png, colours.clip(0, 1), format="png", metadata={"Software": None})
    glb.document["images"] = [{"mimeType": "image/png", "bufferView": glb.view(png.getvalue())}]
    glb.document["textures"] = [{"source": 0}]
    surface = {"baseColorTexture": {"index": 0}, "metallicFactor": 0.0, "roughnessFactor": 0.5}
    glb.document["materials"] = [{"name": "painted", "pbrMetallicRoughness": surface}]


def _animation(glb: Glb) -> None:
    """The head turns aside within a second, and back in another."""
    angles = np.array([0.0, 0.9, 0.0])
    turns = np.stack([0.1 * np.sin(angles / 2), np.sin(angles / 2), 0 * angles, np.cos(angles / 2)], axis=1)
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    seconds = glb.accessor(single(np.arange(3.0)), min=[0.0], max=[2.0])
    sampler = {"input": seconds, "output": glb.accessor(single(turns)), "interpolation": "LINEAR"}
    channel = {"sampler": 0, "target": {"node": 2, "path": "rotation"}}
    glb.document["animations"] = [{"name": "look aside", "samplers": [sampler], "channels": [channel]}]


def _unrolled(vertices: Floats, triangles: Ints) -> tuple[Floats, Ints, Floats]:
    """Vertices, triangles and (n, 2) texture coordinates around the axis; those at the seam stand twice."""
    around = np.arctan2(vertices[:, 0], -vertices[:, 2]) / (2 * np.pi) + 0.5  # the seam is at the back
    crossing = np.ptp(around[triangles], axis=1) > 0.5
    late = crossing[:, None] & (around[triangles] < 0.5)
    again, twins = np.unique(triangles[late], return_inverse=True)
    triangles = triangles.copy()
    triangles[late] = len(vertices) + twins
    uv = np.stack([around, 1.0 - _height(vertices)], axis=1)
    uv = np.concatenate([uv, uv[again] + (1.0, 0.0)])
    return np.concatenate([vertices, vertices[again]]), triangles, uv


def _smooth_normals(vertices: Floats, triangles: Ints) -> Floats:
    """Normals that are equal on both sides of a seam."""
    places, place = geometry.weld(vertices)
    return geometry.unit(geometry.vertex_area_vectors(vertices[places], place[triangles]))[place]


def _height(vertices: Floats) -> Floats:
    """From 0 at the lowest vertex to 1 at the highest (n,)."""
    y = vertices[:, 1]
    return (y - y.min()) / np.ptp(y)


def _narrow(vertices: Floats, triangles: Ints, normals: Floats) -> tuple[AnyArray, Ints, Floats]:
    return single(vertices), triangles, normals


MODELS: dict[str, Callable[[], bytes]] = {
    make.__name__: make for make in (plain, two_primitives, quantised, morph, instances, rigged)
}
