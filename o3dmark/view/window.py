"""The interactive window: Open3D's own viewer, where there is a screen."""

import ctypes
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import open3d as o3d
from numpy.typing import ArrayLike

from o3dmark.errors import BackendError
from o3dmark.mesh.surface import PointCloud, TriangleMesh, is_cloud, legacy_mesh, mesh_arrays, triangle_mesh
from o3dmark.view.colours import coloured
from o3dmark.view.model import shape_of
from o3dmark.view.render import MATERIAL
from o3dmark.view.worn import has_texture, vertex_colours

GAP = 0.1  # between neighbours, over the diagonal of the one on the left


def show(meshes: Sequence[Any], scalars: Sequence[ArrayLike | None] | None = None, colormap: str = "viridis") -> None:
    """Open a window with the meshes (or point clouds) in a row along x, and wait until it is closed.

    scalars: for each mesh one number a vertex, shown as colours as `render` does, or None for its own colours
    or textures, if it has any.
    Errors: BackendError without a display; MeshError as in `render`.
    """
    scalars = [None] * len(meshes) if scalars is None else scalars
    if len(scalars) != len(meshes):
        raise ValueError(f"scalars for {len(scalars)} meshes, but there are {len(meshes)} meshes")
    shown, left = [], 0.0
    for mesh, values in zip(meshes, scalars, strict=True):
        copy = _to_show(mesh, values, colormap)
        low, high = copy.get_min_bound(), copy.get_max_bound()
        copy.translate([left - low[0], -(low[1] + high[1]) / 2, -(low[2] + high[2]) / 2])
        left += high[0] - low[0] + GAP * float(np.linalg.norm(high - low))
        shown.append(copy)
    if not has_display():
        raise BackendError("there is no display to open a window on; --png FILE draws a picture without one")
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        o3d.visualization.draw_geometries(shown, "o3dmark", 1280, 800, mesh_show_back_face=True)


def has_display() -> bool:
    """Whether a window can be opened. Open3D cannot tell: without a display its viewer never returns."""
    if not sys.platform.startswith("linux"):
        return True
    wayland, runtime = os.environ.get("WAYLAND_DISPLAY"), os.environ.get("XDG_RUNTIME_DIR", "")
    if wayland and (Path(runtime) / wayland).exists():
        return True
    if not os.environ.get("DISPLAY"):
        return False
    try:
        x11 = ctypes.CDLL("libX11.so.6")
    except OSError:
        return False
    x11.XOpenDisplay.restype = ctypes.c_void_p
    display = x11.XOpenDisplay(None)
    if display:
        x11.XCloseDisplay(ctypes.c_void_p(display))
    return bool(display)


def _to_show(mesh: Any, scalars: ArrayLike | None, colormap: str) -> TriangleMesh | PointCloud:
    """A copy to be lit and moved about: coloured by scalars, else in its own colours or textures, else grey."""
    shape = shape_of(mesh)
    cloud = is_cloud(shape)
    copy = PointCloud(shape) if cloud else triangle_mesh(*mesh_arrays(mesh)).compute_vertex_normals()
    if scalars is not None:
        return coloured(copy, scalars, colormap)
    own = vertex_colours(mesh)
    if has_texture(mesh):
        return TriangleMesh(legacy_mesh(mesh)).compute_vertex_normals()
    if own is None:
        return copy.paint_uniform_color(MATERIAL)
    if cloud:
        copy.colors = o3d.utility.Vector3dVector(own)
    else:
        copy.vertex_colors = o3d.utility.Vector3dVector(own)
    return copy
