"""Pictures of meshes and point clouds, made without a display and without OpenGL.

Open3D's ray caster finds what each pixel sees; numpy shades it. The hidden window of Open3D's visualiser is not used:
it needs an EGL context, which Open3D makes from 0.20 on and on Linux alone, it writes to stderr whatever the log level,
and it lights vertices, not pixels. The ray caster gives the same picture on every machine. It computes in float32, so
meshes are moved to the origin and scaled to size one first; nothing is measured here.
"""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
import open3d as o3d
from numpy.typing import ArrayLike, NDArray

from o3dmark.errors import BackendError, MeshError
from o3dmark.files import replacing
from o3dmark.mesh import geometry
from o3dmark.mesh.patch import Patch
from o3dmark.mesh.rays import scene_of
from o3dmark.mesh.surface import Surface
from o3dmark.view.camera import THREE_QUARTER, Camera
from o3dmark.view.colours import checked_scalars, colour_limits, colours, painted
from o3dmark.view.model import Model, n_vertices, positions, shape_of
from o3dmark.view.shading import Hits, open_sky, shade, zebra
from o3dmark.view.texture import Texture
from o3dmark.view.worn import worn

Image = NDArray[np.uint8]
Look: TypeAlias = Literal["clay", "worn", "gloss", "zebra", "texture"]

SAMPLES = 2  # rays a pixel along each side, so that edges are smooth
MATERIAL = np.array([0.80, 0.765, 0.72])  # sRGB: a warm grey, like clay
GAMMA = 2.2  # of sRGB, nearly


def render(
    mesh: Any,
    scalars: ArrayLike | None = None,
    *,
    camera: Camera = THREE_QUARTER,
    size: tuple[int, int] = (640, 480),
    limits: tuple[float, float] | None = None,
    colormap: str = "viridis",
    frame: Any = None,
    look: Look = "clay",
    patches: Sequence[Patch] = (),
) -> Image:
    """Picture (h, w, 3) of an Open3D triangle mesh or point cloud on white; ``size`` is (w, h) in pixels.

    scalars: one number a vertex (or point), shown as colours of a matplotlib ``colormap`` that spans ``limits``, by
    default the 2nd to the 98th percentile. frame: the mesh that the camera is fitted to, so that several are drawn
    alike; by default this one. look: clay; worn, in the mesh's own texture, else its vertices' colours, else clay;
    texture, which it must have; gloss, clay that is varnished; zebra, a mirror under light tubes, whose stripes show
    what clay hides. Only clay has scalars, or in their place patches, whose surface is coloured. The same call gives
    the same picture.
    Errors: MeshError when there is nothing to draw, no texture, or the scalars do not fit; SpecError for an unknown
    colormap.
    """
    width, height = size
    if width < 1 or height < 1:
        raise ValueError(f"a picture of {width} x {height} pixels has no pixel")
    if look != "clay" and scalars is not None:
        raise ValueError(f"a {look} view has no scalars")
    if patches and (look != "clay" or scalars is not None):
        raise ValueError("patches are drawn on clay, without scalars")
    shape = shape_of(mesh)
    fit = positions(shape if frame is None else shape_of(frame))
    centre, to_camera = geometry.box_centre(fit), camera.axes.T / (geometry.diagonal(fit) or 1.0)
    values = None if scalars is None else checked_scalars(scalars, n_vertices(shape))
    model = Model.of(shape, values, centre, to_camera)
    scene = scene_of(model.points, model.triangles)
    hits = Hits.of(model, scene, camera.rays((fit - centre) @ to_camera, SAMPLES * width, SAMPLES * height))
    material = MATERIAL
    if values is not None and hits.scalars is not None:
        material = colours(hits.scalars, limits or colour_limits(values), colormap)
    if patches:
        to_model = np.eye(4)
        to_model[:3] = to_camera.T @ np.column_stack([np.eye(3), -centre])
        points, normals = hits.points.astype(np.float64), hits.normals.astype(np.float64)
        material = painted(points, normals, [patch.placed(to_model) for patch in patches], MATERIAL)
    if look == "texture":
        if not isinstance(shape, Surface):
            raise MeshError("a point cloud has no texture to draw")
        material = Texture.of(mesh, shape).at(hits.triangle, hits.weights)
    if look == "worn" and (dress := worn(mesh, shape)) is not None:
        material = dress.at(hits.triangle, hits.weights)
    if look == "zebra":
        light = zebra(hits)
    else:
        light = shade(hits, open_sky(scene, hits), material**GAMMA, varnished=look == "gloss")
    picture = np.ones((SAMPLES * height, SAMPLES * width, 3), np.float32)
    picture[hits.row, hits.column] = light.clip(0, 1) ** (1 / GAMMA)
    pixels = picture.reshape(height, SAMPLES, width, SAMPLES, 3).mean(axis=(1, 3))
    return np.round(255 * pixels).astype(np.uint8)


def save_png(path: str | Path, image: Image) -> None:
    """Write a picture (h, w, 3) uint8 as PNG; the file is there complete or not at all.

    Errors: MeshError when the folder is missing; BackendError when Open3D cannot write it.
    """
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
        raise ValueError(f"a picture is (h, w, 3) uint8, not {image.shape} {image.dtype}")
    pixels = np.ascontiguousarray(image)
    with replacing(path) as draft, o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        if not o3d.io.write_image(str(draft), o3d.geometry.Image(pixels)):
            raise BackendError(f"Open3D could not write {Path(path).name}: does its name end in .png?")


def jpeg(image: Image, quality: int = 86) -> bytes:
    """A picture (h, w, 3) uint8 as the bytes of a JPEG file; ``quality`` is 1 to 95."""
    from matplotlib.image import imsave

    file = io.BytesIO()
    imsave(file, np.ascontiguousarray(image), format="jpeg", pil_kwargs={"quality": quality})
    return file.getvalue()
