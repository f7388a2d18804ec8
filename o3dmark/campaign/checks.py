"""Attacks under supervision: what comes out has to be a mesh, and what went in has to stay as it was."""

from collections.abc import Iterable
from copy import deepcopy
from typing import Any

import numpy as np

from o3dmark.attacks import ATTACKS
from o3dmark.mesh.surface import mesh_arrays


class BadResultError(Exception):
    """An attack did not give a mesh, or changed the one that it was given."""


def checked_attacks(mesh: Any, attacks: Iterable[str], seed: int) -> Any:
    """What `attack_all` gives. Errors: BadResultError names the first attack of which it is untrue."""
    generator = np.random.default_rng(seed)
    for spec in attacks:
        given = deepcopy(mesh)  # one that is changed all the same must not spoil the readings that follow
        result = ATTACKS.make(spec)(given, generator)
        if found := flaws(result, changed=not all(map(np.array_equal, _content(mesh), _content(given)))):
            raise BadResultError(f"{spec}: {', '.join(found)}")
        mesh = result
    return mesh


def flaws(mesh: Any, *, changed: bool = False) -> list[str]:
    """What is wrong with a mesh, in words; ``changed``: so was the one that it was made from."""
    vertices, triangles = mesh_arrays(mesh)
    return [
        text
        for text, is_so in {
            "the input was changed": changed,
            "no triangle": not len(triangles),
            "a vertex is not finite": not np.isfinite(vertices).all(),
            "an index is out of range": len(triangles) and not 0 <= triangles.min() <= triangles.max() < len(vertices),
        }.items()
        if is_so
    ]


def _content(mesh: Any) -> tuple[Any, ...]:
    return *mesh_arrays(mesh), np.array(mesh.vertex_colors), np.array(mesh.triangle_uvs)
