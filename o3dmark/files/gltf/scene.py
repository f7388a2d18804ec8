"""Where a glTF's nodes place its meshes: matrices in double precision, down through the hierarchy.

Sources: glTF 2.0 specification, 3.5 (scenes); EXT_mesh_gpu_instancing.
"""

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from o3dmark.arrays import Floats
from o3dmark.errors import MeshError
from o3dmark.files.asset import STAYS
from o3dmark.files.gltf.accessors import Accessor, Accessors
from o3dmark.files.gltf.budget import Budget
from o3dmark.files.gltf.json_fields import Fields

_MOST_NODES = 100_000
_INSTANCING = "EXT_mesh_gpu_instancing"
_MATRIX_BYTES = 128
_TRANSFORM = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}


def placements(root: Fields, accessors: Accessors, budget: Budget) -> dict[int, list[Floats]]:
    """For each mesh that the default scene uses (all scenes if none is) its matrices, stacked (k, 4, 4) each.

    Errors: MeshError for nodes that are their own ancestors or have two parents, wrong numbers, or too many nodes.
    """
    nodes, n_meshes = root.parts("nodes", "node"), len(root.parts("meshes", "mesh"))
    if len(nodes) > _MOST_NODES:
        raise MeshError(f"{root.where} has {len(nodes)} nodes; up to {_MOST_NODES} are read")
    found: dict[int, list[Floats]] = defaultdict(list)
    world, instances = _locals(nodes), _Instances(accessors, budget)
    with np.errstate(all="ignore"):
        for number, parent in _walk(nodes, _roots(root, nodes)):
            if parent >= 0:
                world[number] = world[parent] @ world[number]
            node = nodes[number]
            if "mesh" in node:
                stack = world[number] @ instances.of(node)
                if not np.isfinite(stack).all():
                    raise MeshError(f"{node.where} is placed where no number reaches")
                found[node.number_of("mesh", n_meshes)].append(stack)
    return found


def _walk(nodes: list[Fields], roots: list[int]) -> Iterator[tuple[int, int]]:
    """Nodes and their parents, or -1, from the roots down, each after its parent.

    Errors: MeshError where a node is met twice.
    """
    seen: set[int] = set()
    waiting = [(number, -1) for number in reversed(roots)]
    while waiting:
        number, parent = waiting.pop()
        if number in seen:
            raise MeshError(f"{nodes[number].where} is its own ancestor, or has two parents")
        seen.add(number)
        yield number, parent
        waiting += [(child, number) for child in reversed(nodes[number].numbers_of("children", len(nodes)))]


def _roots(root: Fields, nodes: list[Fields]) -> list[int]:
    """The nodes that the default scene begins with, those of all scenes, or those without a parent."""
    scenes = root.parts("scenes", "scene")
    if "scene" in root:
        scenes = [scenes[root.number_of("scene", len(scenes))]]
    if scenes:
        return list(dict.fromkeys(number for scene in scenes for number in scene.numbers_of("nodes", len(nodes))))
    children = {child for node in nodes for child in node.numbers_of("children", len(nodes))}
    return [number for number in range(len(nodes)) if number not in children]


def _locals(nodes: list[Fields]) -> Floats:
    """The nodes' own matrices (k, 4, 4)."""
    columns = [
        np.array([node.floats(name, default) if name in node else default for node in nodes]).reshape(-1, len(default))
        for name, default in _TRANSFORM.items()
    ]
    local = matrices(*columns)
    for number, node in enumerate(nodes):
        if "matrix" in node:
            local[number] = np.reshape(node.floats("matrix", [0.0] * 16), (4, 4)).T
    return local


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


class _Instances:
    """Where the instances of a node stand in its own frame; many nodes may name the same numbers."""

    def __init__(self, accessors: Accessors, budget: Budget) -> None:
        self._accessors, self._budget = accessors, budget
        self._known: dict[tuple[Accessor | None, ...], Floats] = {}

    def of(self, node: Fields) -> Floats:
        """Matrices (k, 4, 4), or the one that changes nothing for a node that is alone."""
        extensions = node.part("extensions")
        if _INSTANCING not in extensions:
            self._budget.take(_MATRIX_BYTES)
            return STAYS
        attributes = extensions.part(_INSTANCING).part("attributes")
        names = [name.upper() for name in _TRANSFORM]
        given = tuple(
            self._accessors[attributes.number_of(name, len(self._accessors))] if name in attributes else None
            for name in names
        )
        count = max((accessor.count for accessor in given if accessor), default=1)
        self._budget.take(_MATRIX_BYTES * count)
        if given not in self._known:
            for name, accessor, default in zip(names, given, _TRANSFORM.values(), strict=True):
                if accessor and (accessor.width, accessor.count) != (len(default), count):
                    raise attributes.wrong(name, f"{count} rows of {len(default)} numbers")
            self._known[given] = matrices(
                *(
                    accessor.floats() if accessor else np.tile(default, (count, 1))
                    for accessor, default in zip(given, _TRANSFORM.values(), strict=True)
                )
            )
        return self._known[given]
