"""Where a glTF's nodes place its meshes: matrices in double precision, down through the hierarchy.

Sources: glTF 2.0 specification, 3.5 (scenes); EXT_mesh_gpu_instancing.
"""

from collections import defaultdict

import numpy as np

from o3dmark.arrays import Floats
from o3dmark.errors import MeshError
from o3dmark.files._budget import Budget
from o3dmark.files._gltf_accessors import Accessors
from o3dmark.files._json_fields import Fields

_MOST_NODES = 100_000
_INSTANCING = "EXT_mesh_gpu_instancing"
_MATRIX_BYTES = 128


def placements(root: Fields, accessors: Accessors, budget: Budget) -> dict[int, list[Floats]]:
    """For each mesh that the default scene uses (all scenes if none is) its matrices, stacked (k, 4, 4) each.

    Errors: MeshError for nodes that are their own ancestors or have two parents, wrong numbers, or too many nodes.
    """
    nodes, n_meshes = root.parts("nodes", "node"), len(root.parts("meshes", "mesh"))
    if len(nodes) > _MOST_NODES:
        raise MeshError(f"{root.where} has {len(nodes)} nodes; up to {_MOST_NODES} are read")
    found: dict[int, list[Floats]] = defaultdict(list)
    seen: set[int] = set()
    waiting = [(number, np.eye(4)) for number in reversed(_roots(root, nodes))]
    while waiting:
        number, parent = waiting.pop()
        node = nodes[number]
        if number in seen:
            raise MeshError(f"{node.where} is its own ancestor, or has two parents")
        seen.add(number)
        world = _product(node, parent, _local(node))
        if "mesh" in node:
            mesh = node.number_of("mesh", n_meshes)
            found[mesh].append(_instances(node, world, accessors, budget))
        waiting += [(child, world) for child in reversed(node.numbers_of("children", len(nodes)))]
    return found


def _roots(root: Fields, nodes: list[Fields]) -> list[int]:
    """The nodes that the default scene begins with, those of all scenes, or those without a parent."""
    scenes = root.parts("scenes", "scene")
    if "scene" in root:
        scenes = [scenes[root.number_of("scene", len(scenes))]]
    if scenes:
        return list(dict.fromkeys(number for scene in scenes for number in scene.numbers_of("nodes", len(nodes))))
    children = {child for node in nodes for child in node.numbers_of("children", len(nodes))}
    return [number for number in range(len(nodes)) if number not in children]


def _local(node: Fields) -> Floats:
    """A node's own matrix (4, 4)."""
    if "matrix" in node:
        return np.array(node.floats("matrix", np.eye(4).ravel().tolist())).reshape(4, 4).T
    translation = np.array([node.floats("translation", (0, 0, 0))])
    rotation = np.array([node.floats("rotation", (0, 0, 0, 1))])
    scale = np.array([node.floats("scale", (1, 1, 1))])
    return matrices(translation, rotation, scale)[0]


def matrices(translations: Floats, rotations: Floats, scales: Floats) -> Floats:
    """Matrices (k, 4, 4) from translations (k, 3), quaternions x, y, z, w (k, 4) and scales (k, 3)."""
    with np.errstate(all="ignore"):
        lengths = np.linalg.norm(rotations, axis=1, keepdims=True)
        units = np.divide(rotations, lengths, out=np.tile([0.0, 0, 0, 1], (len(rotations), 1)), where=lengths > 0)
        return _composed(translations, units, scales)


def _composed(translations: Floats, rotations: Floats, scales: Floats) -> Floats:
    x, y, z, w = rotations.T
    matrix = np.zeros((len(translations), 4, 4))
    matrix[:, 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], axis=1)
    matrix[:, 1, :3] = np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], axis=1)
    matrix[:, 2, :3] = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=1)
    matrix[:, :3, :3] *= scales[:, None, :]
    matrix[:, :3, 3] = translations
    matrix[:, 3, 3] = 1.0
    return matrix


def _instances(node: Fields, world: Floats, accessors: Accessors, budget: Budget) -> Floats:
    """The node's matrix, or one for each of its instances (k, 4, 4)."""
    extensions = node.part("extensions")
    if _INSTANCING not in extensions:
        budget.take(_MATRIX_BYTES)
        return world[None]
    attributes = extensions.part(_INSTANCING).part("attributes")
    given = {
        name: accessors[attributes.number_of(name, len(accessors))]
        for name in ("TRANSLATION", "ROTATION", "SCALE")
        if name in attributes
    }
    count = max((accessor.count for accessor in given.values()), default=1)
    budget.take(_MATRIX_BYTES * count)
    columns = []
    for name, default in (("TRANSLATION", (0.0, 0, 0)), ("ROTATION", (0.0, 0, 0, 1)), ("SCALE", (1.0, 1, 1))):
        accessor = given.get(name)
        if accessor and (accessor.width != len(default) or accessor.count != count):
            raise attributes.wrong(name, f"{count} rows of {len(default)} numbers")
        columns.append(accessor.floats() if accessor else np.tile(default, (count, 1)))
    return _product(node, world, matrices(*columns))


def _product(node: Fields, parent: Floats, local: Floats) -> Floats:
    """Errors: MeshError where the numbers grow beyond all bounds."""
    with np.errstate(all="ignore"):
        product = parent @ local
    if not np.isfinite(product).all():
        raise MeshError(f"{node.where} is placed where no number reaches")
    return product
