"""A campaign that is over in a second: a toy method on a rough torus, both made here."""

import dataclasses
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from o3dmark.campaign import Campaign, Row, read_campaign
from o3dmark.files import write_mesh
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays, triangle_mesh

TOY = '''
"""A method that any noise destroys: the parity of the first vertices' x coordinates in steps of 0.001."""
from dataclasses import dataclass
import numpy as np
from o3dmark.attacks import ATTACKS, Attack
from o3dmark.mesh.surface import mesh_arrays, triangle_mesh
from o3dmark.methods import METHODS, Extraction, Method

STEP = 1e-3
LOOKED_AT, GIVEN = [], []

@METHODS.register("toy")
@dataclass(frozen=True)
class Toy(Method):
    """The parity of the first vertices' x coordinates."""
    needs: bool = False

    @property
    def takes_reference(self):
        return True

    def embed(self, mesh, bits, key):
        vertices, triangles = mesh_arrays(mesh)
        parity = np.asarray(bits) ^ key.stream("toy").bits(len(bits))
        x = vertices[: len(bits), 0] / STEP
        vertices[: len(bits), 0] = STEP * (2 * np.round((x - parity) / 2) + parity)
        return triangle_mesh(vertices, triangles)

    def observe(self, mesh):
        LOOKED_AT.append(mesh)
        return np.round(mesh_arrays(mesh)[0][:, 0] / STEP).astype(int) % 2

    def extract(self, mesh, n_bits, key, *, reference=None):
        GIVEN.append(reference)
        parity = mesh if isinstance(mesh, np.ndarray) else self.observe(mesh)
        return Extraction(2.0 * (parity[:n_bits] ^ key.stream("toy").bits(n_bits)) - 1.0)

    def capacity(self, mesh):
        return len(mesh.vertices)
'''
TOML = """
title = "small"
bits = 64
seeds = [0, 5]
wrong_keys = 1
metrics = ["mrms:samples=2000"]
plugins = ["toy.py"]
[meshes]
Ring = "ring.ply"
[methods]
one = "toy"
two = "toy:needs=true"
[attacks.noise]
"0.05%" = "noise:amplitude=0.0005"
[attacks.cropping]
"10%, shuffled" = ["crop:share=0.1", "reorder"]
"""
TIMES = ("seconds", "embed_seconds")


def ring(across: int = 45) -> TriangleMesh:
    """A rough torus of 20 vertices around, 900 by default."""
    torus = TriangleMesh.create_torus(1.0, 0.4, across, 20)
    vertices, triangles = mesh_arrays(torus)
    rough = np.random.default_rng(1).uniform(-0.03, 0.03, vertices.shape)
    return triangle_mesh(vertices * [1.0, 0.8, 1.3] + rough, triangles)


def campaign(folder: Path, text: str = TOML, **options: Any) -> Campaign:
    """The campaign of a TOML text, with ring.ply and the toy beside it."""
    (folder / "campaign.toml").write_text(text)
    (folder / "toy.py").write_text(TOY)
    write_mesh(folder / "ring.ply", ring())
    return read_campaign(folder / "campaign.toml", **options)


def comparable(rows: Iterable[Row]) -> list[str]:
    """Rows without their timing, in an order that depends on nothing else."""
    untimed = (dataclasses.replace(row, **dict.fromkeys(TIMES)) for row in rows)
    return sorted(json.dumps(row.to_dict()) for row in untimed)
