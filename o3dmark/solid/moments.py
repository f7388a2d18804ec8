"""Moments of a solid or of its surface, from the triangles, and how they change as a vertex moves.

``volume`` moments integrate over the solid (divergence theorem), ``area`` moments over its surface. Polynomials up to
the third degree are integrated exactly: for a linear form that is a, b, c at the corners (and 0 at the origin),

    integral of l^n over the tetrahedron = 6 V n! / (n + 3)! h_n(a, b, c),    over the triangle = 2 A n! / (n + 2)! h_n

with h_n the complete homogeneous symmetric polynomial. Complex moments, of higher degree, are integrated by quadrature.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, TypeAlias

import numpy as np

from o3dmark.arrays import AnyArray, Complexes, Floats, Ints
from o3dmark.mesh import geometry
from o3dmark.solid.solid import Solid

Measure: TypeAlias = Literal["volume", "area"]
# Part of the format: triangles from which on complex moments take one point in each. At 30 000 (botijo) that turns the
# frame by 2e-5 radians, a twentieth of what the reader allows for.
_MANY = 40_000
_LEAST_SPREAD = 1e-30  # of a solid whose trace of the second moment over the mass is one
_CHUNK = 1 << 12  # triangles whose corners stay in a processor's cache: half the time of all at once
_STEP = 1e-4  # of central differences, in units of the frame: an error of 1e-8


@dataclass(frozen=True)
class ComplexMoment:
    """The integral of w^order |w|^(2 radial) z^axial; its angle says how far a solid is turned about axis ``axis``.

    z is the coordinate along the axis, w = x + i y those across it, in cyclic order.
    """

    axis: int
    order: int
    radial: int = 0
    axial: int = 0

    @property
    def degree(self) -> int:
        """Degree of the polynomial, which is homogeneous."""
        return self.order + 2 * self.radial + self.axial

    def function(self, points: Floats) -> Complexes:
        """What is integrated: its values (...,) at points (..., 3)."""
        z = points[..., self.axis]
        w = points[..., (self.axis + 1) % 3] + 1j * points[..., (self.axis + 2) % 3]
        return np.asarray(w**self.order * np.abs(w) ** (2 * self.radial) * z**self.axial)

    def of(self, seen: Solid, measure: Measure) -> complex:
        """The moment of a solid as seen in its frame, by nine points a triangle, or one where triangles are many."""
        weights, barycentric = _gauss(3 if len(seen.triangles) < _MANY else 1)
        points = np.einsum("gc,mcd->gmd", barycentric, seen.vertices[seen.triangles])
        if measure == "area":
            return complex(weights @ self.function(points) @ seen.areas)
        # div(f x) = (degree + 3) f, and x . a is the same all over a triangle
        size = np.einsum("md,md->m", seen.area_vectors, seen.vertices[seen.triangles[:, 0]])
        return complex(weights @ self.function(points) @ size / (self.degree + 3))


def moments(solid: Solid, measure: Measure, origin: Floats | float = 0.0) -> tuple[float, Floats, Floats]:
    """Mass, first moment (3,) and second moment (3, 3) about ``origin`` (3,)."""
    bulk = measure == "volume"
    vertices = solid.vertices - origin
    mass, first, second = _sums(vertices, solid.triangles, solid.area_vectors if bulk else solid.areas[:, None])
    if bulk:
        mass, first, second = mass / 3.0, first / 3.0, second / 3.0
    return mass, first / (4.0 if bulk else 3.0), np.asarray(second / (20.0 if bulk else 12.0))


def _sums(vertices: Floats, triangles: Ints, sizes: Floats) -> tuple[float, Floats, Floats]:
    """Sums of size, size (a + b + c) and size (s s' + a a' + b b' + c c'), s = a + b + c, over the triangles.

    sizes (m, 3): area vectors, whose product with a corner is the size; or (m, 1): the size itself.
    """
    mass, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    coordinates = np.ascontiguousarray(vertices.T)
    for start in range(0, len(triangles), _CHUNK):
        chunk = slice(start, start + _CHUNK)
        corners = np.take(coordinates, np.ascontiguousarray(triangles[chunk].T), axis=1)
        whole = corners.sum(axis=1)
        size = np.einsum("xm,mx->m", corners[:, 0], sizes[chunk]) if sizes.shape[1] == 3 else sizes[chunk, 0]
        mass += float(size.sum())
        first += whole @ size
        second += (whole * size) @ whole.T + (corners * size).reshape(3, -1) @ corners.reshape(3, -1).T
    return mass, first, second


def third_moments(seen: Solid, measure: Measure) -> Floats:
    """Skewness (3,) along each coordinate axis: mean of x^3 over that of x^2 to the power 3/2, ``seen`` centred."""
    a, b, c = seen.vertices[seen.triangles.T]
    size, p1 = _sizes(seen, measure, a), a + b + c
    p2, p3 = a * a + b * b + c * c, a * a * a + b * b * b + c * c * c
    cube = size @ (p1 * p1 * p1 + 3.0 * p1 * p2 + 2.0 * p3) / 6.0 / (20.0 if measure == "volume" else 10.0)
    mass, _, second = moments(seen, measure)
    spread = np.maximum(np.diag(second) / mass, _LEAST_SPREAD)  # far triangles may leave less than nothing, by rounding
    return np.asarray(cube / mass / spread**1.5)


def response(seen: Solid, normals: Floats, measure: Measure, function: Callable[[Floats], AnyArray]) -> AnyArray:
    """The change (n_mesh, d) of the integral of ``function`` (..., 3) -> (..., d) as a vertex moves along its normal.

    Lumped at the vertices: exact in the limit of small triangles.
    """
    n = len(seen.movable)
    x = seen.vertices[:n]
    if measure == "volume":
        return np.asarray(function(x) * np.einsum("vd,vd->v", seen.vertex_area_vectors, normals)[:, None])
    slope = (function(x + _STEP * normals) - function(x - _STEP * normals)) / (2.0 * _STEP)
    total: Any = slope * seen.vertex_areas[:, None]
    face = geometry.unit(seen.area_vectors)
    middle = function(seen.vertices[seen.triangles].mean(axis=1))
    for corner in range(3):  # the gradient of a triangle's area at a corner is half the opposite edge, turned inward
        v, a, b = (seen.triangles[:, (corner + i) % 3] for i in range(3))
        mine = v < n
        gradient = 0.5 * np.cross(face[mine], (seen.vertices[b] - seen.vertices[a])[mine])
        grow = np.einsum("md,md->m", gradient, normals[v[mine]])
        np.add.at(total, v[mine], grow[:, None] * middle[mine])
    return np.asarray(total)


def _sizes(solid: Solid, measure: Measure, corner: Floats) -> Floats:
    """Areas (m,), or the signed volumes of the tetrahedra of triangles and origin; ``corner`` (m, 3) from there."""
    if measure == "area":
        return solid.areas
    return np.einsum("md,md->m", solid.area_vectors, corner) / 3.0


@cache
def _gauss(order: int) -> tuple[Floats, Floats]:
    """Weights (order^2,) of sum one and barycentric coordinates (order^2, 3): Gauss' rule on the square, collapsed."""
    if order == 1:
        return np.ones(1), np.full((1, 3), 1.0 / 3.0)
    x, w = np.polynomial.legendre.leggauss(order)
    u, v = np.meshgrid(0.5 * (x + 1.0), 0.5 * (x + 1.0), indexing="ij")
    weights = np.outer(w, w) / 2.0 * (1.0 - u)
    return weights.ravel(), np.stack([u, (1.0 - u) * v, (1.0 - u) * (1.0 - v)], axis=-1).reshape(-1, 3)
