"""What each ray sees of a model, and in which light. All vectors are in the camera's axes: right, up, to the eye."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import open3d as o3d
from scipy.ndimage import uniform_filter

from o3dmark.arrays import Floats, Ints
from o3dmark.view.model import Float32s, Model

SKY_RAYS = 3  # rays to the sky from each hit, which see how much of it is open
BLOCK = 4  # side of the block of rays that share what they see: 48 directions for the price of 3
SKY_REACH = 0.25  # what is farther away hides no sky; the bounding-box diagonal is 1
BIAS = 2e-4  # height above the surface at which rays to the sky begin: in float32 it would hide itself

# A studio, by eye: a warm lamp from the upper left, a weak cold one from the right, sky above and ground below.
KEY, KEY_COLOUR = (-0.455, 0.655, 0.603), 0.80 * np.array([1.0, 0.985, 0.96], np.float32)
FILL, FILL_COLOUR = (0.863, 0.05, 0.503), 0.16 * np.array([0.93, 0.97, 1.0], np.float32)
SKY_COLOUR = 0.46 * np.array([0.98, 0.99, 1.0], np.float32)
GROUND_COLOUR = 0.26 * np.array([1.0, 0.97, 0.93], np.float32)
GLOSS, GLOSS_EXPONENT = 0.05, 30.0  # of clay
VARNISH, VARNISH_EXPONENT = 0.6, 90.0  # of what is glossy
STRIPES = 14  # light tubes from the ground to the zenith, that a zebra view reflects
EDGE = 0.12  # of a stripe's width, over which it goes from dark to light
DARK, LIGHT = 0.02, 0.9


@dataclass(frozen=True, eq=False)
class Hits:
    """What k of a picture's rays see.

    row, column (k,): which rays. points (k, 3): where they meet the model; there, normals (k, 3), smooth, of length one
    and turned to the eye, to_eye (k, 3), the way back, and scalars (k,) or None; the triangle (k,) that each is in, and
    the weights of its corners there (k, 3).
    """

    row: Ints
    column: Ints
    points: Float32s
    normals: Float32s
    to_eye: Float32s
    scalars: Floats | None
    triangle: Ints
    weights: Floats

    @classmethod
    def of(cls, model: Model, scene: o3d.t.geometry.RaycastingScene, rays: Float32s) -> "Hits":
        """Cast ``rays`` (h, w, 6), origins and unit directions, into the scene of the model."""
        cast = {name: values.numpy() for name, values in scene.cast_rays(o3d.core.Tensor(rays)).items()}
        row, column = np.nonzero(np.isfinite(cast["t_hit"]))
        distance, triangle, uv, flat = (
            cast[name][row, column] for name in ("t_hit", "primitive_ids", "primitive_uvs", "primitive_normals")
        )
        origin, direction = np.split(rays[row, column], 2, axis=1)
        weights = np.column_stack([1 - uv.sum(axis=1), uv])
        normals = _unit((weights[:, None] @ model.normals[triangle])[:, 0])
        normals[_dot(flat, direction) > 0] *= -1  # the inside of an open mesh is drawn like its outside
        scalars = None if model.scalars is None else _dot(weights, model.scalars[model.triangles[triangle]])
        return cls(row, column, origin + distance[:, None] * direction, normals, -direction, scalars, triangle, weights)


def open_sky(scene: o3d.t.geometry.RaycastingScene, hits: Hits) -> Float32s:
    """The part (k,) of the sky's light that nothing near hides from each hit: 1 in the open, near 0 in a hole.

    Each hit sends a few rays, in directions that depend on its place in a block of rays; the mean over the block around
    it then counts BLOCK^2 times as many, without noise.
    """
    directions = _sky_directions(BLOCK**2 * SKY_RAYS).reshape(SKY_RAYS, BLOCK, BLOCK, 3)
    directions = directions[:, hits.row % BLOCK, hits.column % BLOCK]
    x, y, z = np.split(hits.normals, 3, axis=1)
    side = _unit(np.where(np.abs(x) > 0.7, np.hstack([z, 0 * x, -x]), np.hstack([0 * x, -z, y])))
    towards = directions[..., :1] * side + directions[..., 1:2] * np.cross(hits.normals, side)
    towards += directions[..., 2:] * hits.normals
    start = np.broadcast_to(hits.points + BIAS * (hits.normals + hits.to_eye), towards.shape)
    rays = o3d.core.Tensor(np.concatenate([start, towards], axis=2, dtype=np.float32))
    free = ~scene.test_occlusions(rays, 0.0, SKY_REACH).numpy()
    grid = np.zeros((2, hits.row.max(initial=0) + 1, hits.column.max(initial=0) + 1), np.float32)
    grid[:, hits.row, hits.column] = free.mean(axis=0), np.ones(len(hits.row))
    total, count = uniform_filter(grid, (0, BLOCK, BLOCK), mode="constant")[:, hits.row, hits.column]
    return np.asarray(total / count)


def shade(hits: Hits, sky: Float32s, material: Floats, *, varnished: bool = False) -> Float32s:
    """Linear light (k, 3) that reaches the eye from a ``material`` (3,) or (k, 3), linear too, under an `open_sky`."""
    amount, exponent = (VARNISH, VARNISH_EXPONENT) if varnished else (GLOSS, GLOSS_EXPONENT)
    key, fill = ((hits.normals @ np.array(lamp, np.float32)).clip(0)[:, None] for lamp in (KEY, FILL))
    upward = 0.5 + 0.5 * hits.normals[:, 1:2]
    ambient = GROUND_COLOUR + (SKY_COLOUR - GROUND_COLOUR) * upward
    near = 0.45 + 0.55 * sky[:, None]  # what hides the sky hides the lamps in part, which are not points
    gloss = amount * _dot(hits.normals, _unit(hits.to_eye + np.array(KEY, np.float32))).clip(0) ** exponent
    light = near * (key * KEY_COLOUR + fill * FILL_COLOUR) + sky[:, None] * ambient
    return np.asarray(light * material.astype(np.float32) + near * gloss[:, None])


def zebra(hits: Hits) -> Float32s:
    """Linear light (k, 3) of a mirror under level light tubes: stripes, whose kinks are creases and whose waves bumps.

    Source: Klass 1980, Correction of local surface irregularities using reflection lines.
    """
    reflected = 2.0 * _dot(hits.normals, hits.to_eye)[:, None] * hits.normals - hits.to_eye
    height = np.arcsin(reflected[:, 1].clip(-1.0, 1.0)) / np.pi + 0.5
    wave = np.sin(2.0 * np.pi * STRIPES * height)
    light = DARK + (LIGHT - DARK) * (0.5 + 0.5 * wave / np.maximum(np.abs(wave), np.sin(np.pi * EDGE)))
    return np.asarray(np.repeat(light[:, None], 3, axis=1), np.float32)


def _sky_directions(n: int) -> Float32s:
    """Directions (n, 3) over the hemisphere around z, as dense as the light that they bring (cosine), on a spiral."""
    i = np.arange(n)
    radius, angle = np.sqrt((i + 0.5) / n), i * np.pi * (3 - np.sqrt(5))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1 - radius**2)], axis=1, dtype=np.float32)


def _dot(a: Any, b: Any) -> Any:
    return np.einsum("kj,kj->k", a, b)


def _unit(vectors: Float32s) -> Float32s:
    return np.asarray(vectors / np.sqrt(_dot(vectors, vectors)).clip(1e-20)[:, None])
