"""The curved surface that a coarse mesh approximates: PN triangles."""

import numpy as np

from o3dmark.arrays import Floats
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import Surface


def pn_triangles(surface: Surface) -> Surface:
    """Each triangle cut into four, with the edges' midpoints moved out to where curved edges would pass.

    The edges are cubics through their end vertices, at right angles to the vertex normals, as in PN triangles
    (Vlachos, Peters, Boyd, Mitchell 2001); so flat parts stay as they are.
    """
    v, t, normal = surface.vertices, surface.triangles, surface.normals
    edges, side = geometry.numbered_edges(t)
    a, b = edges.T
    middle = 0.5 * (v[a] + v[b]) + 0.125 * (_rise(v[b] - v[a], normal[a]) + _rise(v[a] - v[b], normal[b]))
    (i, j, k), (ij, jk, ki) = t.T, len(v) + side.T
    parts = ((i, ij, ki), (ij, j, jk), (ki, jk, k), (ij, jk, ki))
    return Surface.from_arrays(np.concatenate([v, middle]), np.concatenate([np.stack(p, axis=1) for p in parts]))


def _rise(edge: Floats, normal: Floats) -> Floats:
    """How far (e, 3) a curve that leaves at right angles to ``normal`` rises above a straight ``edge``, times eight."""
    return np.asarray(-np.einsum("ed,ed->e", edge, normal)[:, None] * normal)
