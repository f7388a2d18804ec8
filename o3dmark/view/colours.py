"""Numbers as colours: which range of them is shown, and the colour of each."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import open3d as o3d
from numpy.typing import ArrayLike

from o3dmark.arrays import Floats
from o3dmark.errors import MeshError, SpecError
from o3dmark.mesh.patch import Patch
from o3dmark.mesh.surface import PointCloud, TriangleMesh

PERCENTILES = (2.0, 98.0)  # saliency has long tails: a few extreme vertices would leave one colour for the rest
SALIENCY = "mesh saliency, no unit"  # what a colour bar says
PATCH, RIM = np.array([0.84, 0.36, 0.22]), np.array([0.55, 0.16, 0.10])  # sRGB: what a patch holds, and where it ends
RIM_WIDTH = 0.05  # of the radius
WALL = 0.3  # cosine of the angle to the axis, below which a surface is a wall


def checked_scalars(scalars: ArrayLike, n_vertices: int) -> Floats:
    """Scalars as (n,) float64; MeshError unless there is one finite number for each vertex."""
    values = np.array(scalars, np.float64)
    if values.shape != (n_vertices,):
        raise MeshError(f"scalars of shape {values.shape} do not give one number to each of {n_vertices} vertices")
    bad = ~np.isfinite(values)
    if bad.any():
        raise MeshError(f"{bad.sum()} scalars are not finite; the first is at vertex {bad.argmax()}")
    return values


def colour_limits(scalars: ArrayLike) -> tuple[float, float]:
    """The range of scalars that colours tell apart: the 2nd to the 98th percentile.

    Where those are equal the whole range is taken, and for a constant a range around it.
    """
    values = np.asarray(scalars, np.float64)
    low, high = (float(limit) for limit in np.percentile(values, PERCENTILES))
    if not low < high:
        low, high = float(values.min()), float(values.max())
    if not low < high:
        low, high = low - (abs(low) / 2 or 0.5), high + (abs(high) / 2 or 0.5)
    return low, high


def beyond(scalars: Floats, limits: tuple[float, float]) -> Literal["neither", "min", "max", "both"]:
    """The ends of the colour range that some scalars lie beyond, in matplotlib's words."""
    low, high = bool(scalars.min() < limits[0]), bool(scalars.max() > limits[1])
    return "both" if low and high else "min" if low else "max" if high else "neither"


def colours(scalars: Floats, limits: tuple[float, float], colormap: str) -> Floats:
    """sRGB colours (n, 3) in 0..1 of scalars (n,) on a matplotlib colormap; SpecError names an unknown one."""
    import matplotlib  # here, not above: half a second that a picture without scalars need not wait

    if colormap not in matplotlib.colormaps:
        raise SpecError(f"matplotlib has no colormap {colormap!r}; viridis, plasma and cividis are even to the eye")
    low, high = limits
    if not (np.isfinite([low, high]).all() and low < high):
        raise ValueError(f"colour limits should be finite and rise, not {limits}")
    table = matplotlib.colormaps[colormap](np.linspace(0.0, 1.0, 256))[:, :3]
    return np.asarray(table[np.round(np.clip((scalars - low) / (high - low), 0.0, 1.0) * 255).astype(int)])


def painted(points: Floats, normals: Floats, patches: Sequence[Patch], material: Floats) -> Floats:
    """sRGB colours (k, 3) of points (k, 3) on a surface of a ``material`` (3,) whose patches are coloured.

    They have rims, but for walls along the cylinder, which would be all rim. ``normals`` (k, 3) of either sign.
    """
    rgb = np.tile(material, (len(points), 1))
    for patch in patches:
        inner = patch._replace(radius=(1.0 - RIM_WIDTH) * patch.radius)
        inside = patch.holds(points)
        rgb[inside] = PATCH
        rgb[inside & ~inner.holds(points) & (np.abs(normals @ patch.axis) > WALL)] = RIM
    return rgb


def coloured(mesh: Any, scalars: ArrayLike, colormap: str = "viridis") -> TriangleMesh | PointCloud:
    """A copy of an Open3D triangle mesh or point cloud whose vertex colours show scalars (n,) over `colour_limits`."""
    cloud = isinstance(mesh, o3d.geometry.PointCloud)
    if not cloud and not isinstance(mesh, o3d.geometry.TriangleMesh):
        raise MeshError(f"an Open3D TriangleMesh or PointCloud is wanted, not {type(mesh).__name__}")
    values = checked_scalars(scalars, len(mesh.points if cloud else mesh.vertices))
    rgb = o3d.utility.Vector3dVector(colours(values, colour_limits(values), colormap))
    copy = PointCloud(mesh) if cloud else TriangleMesh(mesh)
    if cloud:
        copy.colors = rgb
    else:
        copy.vertex_colors = rgb
    return copy
